"""The structures that can be simulated, found by name: rods, humans, a quadruped, random trees."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from skelgen.errors import ParameterError
from skelgen.model.arrays import Floats
from skelgen.simulation.articulated import DEGREES_OF_FREEDOM, LimbModel, Structure
from skelgen.simulation.bodies import human, quadruped, seed_human
from skelgen.simulation.limbs import markers_around, unit

ROD_LENGTH = 350.0
"""Length [mm] of each rod of the seed's construction (seed, 5.1)."""

_ROD_HEIGHT = 1200.0  # mm: carried by hand
_ROD_RADIUS = 8.0  # mm
_STICK = 60.0  # mm: the carbon fibre sticks that hold the markers off the rods

_TREE_PREFIX = "tree:"
_TREE_LIMBS = (2, 40)  # fewest and most limbs of a random tree
_TREE_LENGTHS = (200.0, 400.0)  # mm
_TREE_STICKS = (40.0, 90.0)  # mm: markers' distance from a limb's axis
_TREE_MARKERS = (3, 5)
_TREE_AMPLITUDES = (35.0, 50.0)  # deg
_TREE_ROOM = (1.0, 0.65, 0.3)  # fractions of a limb's axis where its children sit: as many as a limb may have
_TREE_ASIDE = 70.0  # mm off the axis: siblings that shared a joint could not be told from parent and child
_TREE_HEIGHT = 1200.0  # mm
_SMALLEST_SINE = 0.6  # between a hinge's axis and its limb: a limb that spins about itself moves no marker far


def rods_chain() -> Structure:
    """Return the seed's chain: three rods of 350 mm, ball joints between them, three markers on sticks on each."""
    half = ROD_LENGTH / 2
    tilt, waving = (150.0, 40.0, 40.0), (40.0, 40.0, 40.0)
    return Structure(
        "rods",
        (
            _rod("middle rod", "", "free", (0.0, 0.0, _ROD_HEIGHT), span=(-half, half), amplitudes=tilt, phase=0.3),
            _rod(
                "rear rod",
                "middle rod",
                "ball",
                (-half, 0.0, 0.0),
                span=(-ROD_LENGTH, 0.0),
                amplitudes=waving,
                phase=1.1,
            ),
            _rod(
                "front rod",
                "middle rod",
                "ball",
                (half, 0.0, 0.0),
                span=(0.0, ROD_LENGTH),
                amplitudes=waving,
                phase=2.3,
            ),
        ),
    )


def _rod(
    name: str,
    parent: str,
    kind: str,
    joint: tuple[float, float, float],
    *,
    span: tuple[float, float],
    amplitudes: tuple[float, float, float],
    phase: float,
) -> LimbModel:
    segment = np.array([[span[0], 0.0, 0.0], [span[1], 0.0, 0.0]])
    axes = np.eye(3)[::-1] if kind == "free" else np.eye(3)
    markers = markers_around(segment, _STICK, 3, phase)
    angles = np.array(amplitudes)
    return LimbModel(name, parent, kind, np.array(joint), segment, _ROD_RADIUS, markers, axes, angles, np.zeros(3))


def random_tree(n_limbs: int, seed: int = 0) -> Structure:
    """Return a random tree with joints of all kinds and 3 to 5 markers, no three in line, on each limb.

    Parameters
    ----------
    n_limbs : int
        Number of limbs, 2 to 40.
    seed : int
        Seed of the random choices.
    """
    low, high = _TREE_LIMBS
    if not low <= n_limbs <= high:
        raise ParameterError(f"a random tree of {n_limbs} limbs; it must have {low} to {high}")
    rng = np.random.default_rng(seed)
    limbs = [_random_limb(rng, "limb 1", "", "free", np.array([0.0, 0.0, _TREE_HEIGHT]))]
    n_children = [0]
    for index in range(1, n_limbs):
        parent = int(rng.choice([i for i, count in enumerate(n_children) if count < len(_TREE_ROOM)]))
        joint = _attachment(rng, limbs[parent], n_children[parent])
        kind = str(rng.choice(["ball", "universal", "hinge"]))
        limbs.append(_random_limb(rng, f"limb {index + 1}", limbs[parent].name, kind, joint))
        n_children[parent] += 1
        n_children.append(0)
    return Structure(f"{_TREE_PREFIX}{n_limbs}", tuple(limbs))


def _attachment(rng: np.random.Generator, parent: LimbModel, n_children: int) -> Floats:
    start, tip = parent.segment
    aside = unit(np.cross(tip - start, _direction(rng)))
    return np.asarray(start + _TREE_ROOM[n_children] * (tip - start) + _TREE_ASIDE * aside)


def _random_limb(rng: np.random.Generator, name: str, parent: str, kind: str, joint: Floats) -> LimbModel:
    segment = np.stack([np.zeros(3), rng.uniform(*_TREE_LENGTHS) * _direction(rng)])
    n_markers = int(rng.integers(_TREE_MARKERS[0], _TREE_MARKERS[1] + 1))
    markers = markers_around(segment, rng.uniform(*_TREE_STICKS), n_markers, rng.uniform(0, 2 * np.pi))
    amplitudes = rng.uniform(*_TREE_AMPLITUDES, size=DEGREES_OF_FREEDOM[kind])
    axes = _random_axes(rng, kind, unit(segment[1]))
    offsets = np.zeros(len(amplitudes))
    return LimbModel(name, parent, kind, joint, segment, _ROD_RADIUS, markers, axes, amplitudes, offsets)


def _random_axes(rng: np.random.Generator, kind: str, along: Floats) -> Floats:
    first = _direction(rng)
    while np.linalg.norm(np.cross(first, along)) < _SMALLEST_SINE:
        first = _direction(rng)
    second = unit(np.cross(first, _direction(rng)))
    return np.stack([first, second, np.cross(first, second)])[: DEGREES_OF_FREEDOM[kind]]


def _direction(rng: np.random.Generator) -> Floats:
    return unit(rng.normal(size=3))


_BUILDERS: dict[str, Callable[[], Structure]] = {
    "rods": rods_chain,
    "human": human,
    "seed-human": seed_human,
    "quadruped": quadruped,
}

STRUCTURE_NAMES = (*_BUILDERS, f"{_TREE_PREFIX}8")
"""Names that `find_structure` knows; any number of limbs may follow ``tree:``."""


def find_structure(name: str, seed: int = 0) -> Structure:
    """Return the structure called `name`, e.g. ``human`` or ``tree:8``.

    Parameters
    ----------
    name : str
        One of ``rods``, ``human``, ``human:4`` (markers per limb), ``seed-human``, ``quadruped``, ``tree:8`` (limbs).
    seed : int
        Seed of a random tree.

    Raises
    ------
    ParameterError
        If there is no such structure.
    """
    kind, _, count = name.partition(":")
    if name in _BUILDERS:
        return _BUILDERS[name]()
    if kind == "human" and count in {"3", "4", "5"}:
        return human(int(count))
    if kind == "tree" and count.isascii() and count.isdigit():
        return random_tree(int(count), seed)
    raise ParameterError(f"there is no structure {name!r}; there are {', '.join(STRUCTURE_NAMES)} and human:4")


__all__ = [
    "ROD_LENGTH",
    "STRUCTURE_NAMES",
    "LimbModel",
    "Structure",
    "find_structure",
    "human",
    "quadruped",
    "random_tree",
    "rods_chain",
    "seed_human",
]
