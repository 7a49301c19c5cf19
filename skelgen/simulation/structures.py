"""Structures that can be simulated, found by name: rods, a hand, random trees, bodies of a table; all lengths in mm."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from skelgen.errors import ParameterError
from skelgen.geometry.rotations import unit_vectors
from skelgen.marker_sets import read_table
from skelgen.model.arrays import Floats
from skelgen.simulation.articulated import (
    DEGREES_OF_FREEDOM,
    Attachment,
    Capsule,
    LimbModel,
    Structure,
    Swing,
    limb,
    markers_around,
)

_TABLES = Path(__file__).parent / "tables"
_BACK_OF_HAND = ((15, 22, 22), (12, -18, 22), (84, 32, 16), (90, 6, 22), (76, -30, 12))  # mm in the palm's frame

ROD_LENGTH = 350.0
"""Length [mm] of each rod (Schönauer 2007, 5.1)."""

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


def _structure_of_table(name: str, n_markers: int | None = None) -> Structure:
    """Return a structure of ``tables/structures.toml``, with as many markers on each limb if a number is given."""
    rows = read_table("structures", _TABLES)[name]
    limbs = []
    for row in (*rows, *(_on_the_right(row) for row in rows if row["name"].startswith("left "))):
        swing = Swing(row["amplitudes"], row.get("offsets"), row.get("axes")) if "amplitudes" in row else None
        joint = Attachment(row["parent"], row["kind"], row["joint"], swing)
        capsule = Capsule(row["tip"], row["radius"], row.get("start", np.zeros(3)))
        limbs.append(limb(row["name"], joint, capsule, n_markers or row.get("n_markers", 3)))
    return Structure(name, tuple(limbs))


def _on_the_right(row: dict[str, Any]) -> dict[str, Any]:
    """Return the row of the limb of the right that one of the left stands for."""
    name, parent = (row[which].replace("left ", "right ") for which in ("name", "parent"))
    x, y, z = row["joint"]
    differing: dict[str, Any] = row.get("right", {})
    return row | {"name": name, "parent": parent, "joint": (x, -y, z)} | differing


def hand() -> Structure:
    """Return a right hand of 16 limbs, fingers along x, the palm down: five markers on its back, three on a phalanx."""
    palm = limb("palm", Attachment("", "free", (0, 0, 1000)), Capsule((70, 0, 0), 15, start=(10, 0, 0)), 3)
    limbs = [replace(palm, markers=np.array(_BACK_OF_HAND, dtype=np.float64))]
    lengths = {"thumb": (46, 34, 26), "index": (44, 26, 20), "middle": (48, 30, 21), "ring": (44, 28, 21)}
    bases = {"thumb": (25, 32, -12), "index": (92, 28, -2), "middle": (98, 8, 6), "ring": (88, -12, 2)}
    lengths["little"], bases["little"] = (34, 20, 19), (74, -30, -9)
    knuckle, bend = Swing((35, 16), (40, 0), [(0, 1, 0), (0, 0, 1)]), Swing((30,), (35,), [(0, 1, 0)])
    opposing = Swing((20, 20), (15, 0), [(0, 0.8, 0.6), (0, -0.6, 0.8)])
    for finger, phalanges in lengths.items():
        first = opposing if finger == "thumb" else knuckle
        joint = Attachment("palm", "universal", bases[finger], first)
        for part, length in zip(("proximal", "middle", "distal"), phalanges, strict=True):
            tip = (0.8 * length, 0.6 * length, 0.0) if finger == "thumb" else (length, 0.0, 0.0)
            limbs.append(limb(f"{finger} {part}", joint, Capsule(tip, 3), 3))
            joint = Attachment(f"{finger} {part}", "hinge", tip, bend)
    return Structure("hand", tuple(limbs))


def rods_chain() -> Structure:
    """Return three rods of 350 mm with ball joints between them and three markers on sticks on each."""
    half = ROD_LENGTH / 2
    tilt, waving = (150.0, 40.0, 40.0), (40.0, 40.0, 40.0)
    rods = (
        _rod("middle rod", Attachment("", "free", (0.0, 0.0, _ROD_HEIGHT), Swing(tilt)), (-half, half), phase=0.3),
        _rod("rear rod", Attachment("middle rod", "ball", (-half, 0, 0), Swing(waving)), (-ROD_LENGTH, 0.0), phase=1.1),
        _rod("front rod", Attachment("middle rod", "ball", (half, 0, 0), Swing(waving)), (0.0, ROD_LENGTH), phase=2.3),
    )
    return Structure("rods", rods)


def _rod(name: str, attachment: Attachment, span: tuple[float, float], phase: float) -> LimbModel:
    """Build a rod along x, from one coordinate [mm] to another, whose markers start at an angle [rad]."""
    parent, kind, joint, swing = attachment
    segment = np.array([[span[0], 0.0, 0.0], [span[1], 0.0, 0.0]])
    axes = np.eye(3)[::-1] if kind == "free" else np.eye(3)
    markers = markers_around(segment, _STICK, 3, phase)
    angles = np.array(swing.amplitudes if swing else 0.0)
    return LimbModel(name, parent, kind, np.array(joint), segment, _ROD_RADIUS, markers, axes, angles, np.zeros(3))


def random_tree(n_limbs: int, seed: int = 0) -> Structure:
    """Return a random tree with joints of all types and 3 to 5 markers, no three in line, on each limb.

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
        start, tip = limbs[parent].segment
        aside = unit_vectors(np.cross(tip - start, _direction(rng)))
        joint = start + _TREE_ROOM[n_children[parent]] * (tip - start) + _TREE_ASIDE * aside
        kind = str(rng.choice(["ball", "universal", "hinge"]))
        limbs.append(_random_limb(rng, f"limb {index + 1}", limbs[parent].name, kind, joint))
        n_children[parent] += 1
        n_children.append(0)
    return Structure(f"{_TREE_PREFIX}{n_limbs}", tuple(limbs))


def _random_limb(rng: np.random.Generator, name: str, parent: str, kind: str, joint: Floats) -> LimbModel:
    segment = np.stack([np.zeros(3), rng.uniform(*_TREE_LENGTHS) * _direction(rng)])
    n_markers = int(rng.integers(_TREE_MARKERS[0], _TREE_MARKERS[1] + 1))
    markers = markers_around(segment, rng.uniform(*_TREE_STICKS), n_markers, rng.uniform(0, 2 * np.pi))
    amplitudes = rng.uniform(*_TREE_AMPLITUDES, size=DEGREES_OF_FREEDOM[kind])
    first = _direction(rng)
    while np.linalg.norm(np.cross(first, unit_vectors(segment[1]))) < _SMALLEST_SINE:
        first = _direction(rng)
    second = unit_vectors(np.cross(first, _direction(rng)))
    axes = np.stack([first, second, np.cross(first, second)])[: DEGREES_OF_FREEDOM[kind]]
    offsets = np.zeros(len(amplitudes))
    return LimbModel(name, parent, kind, joint, segment, _ROD_RADIUS, markers, axes, amplitudes, offsets)


def _direction(rng: np.random.Generator) -> Floats:
    return unit_vectors(rng.normal(size=3))


_DESCRIBED = ("human", "classic-human", "quadruped")  # in the table
_FORMER_NAMES = {"seed-human": "classic-human"}  # of version 0.1.0

STRUCTURE_NAMES = ("rods", *_DESCRIBED, "hand", f"{_TREE_PREFIX}8")
"""Names that `find_structure` knows; any number of limbs may follow ``tree:``."""


def find_structure(name: str, seed: int = 0) -> Structure:
    """Return the structure called `name`, e.g. ``human`` or ``tree:8``.

    Parameters
    ----------
    name : str
        ``rods``, ``human``, ``human:4`` (markers per limb), ``classic-human``, ``quadruped``, ``hand`` or ``tree:8``
        (limbs).
    seed : int
        Seed of a random tree.

    Raises
    ------
    ParameterError
        If there is no such structure.
    """
    name = _FORMER_NAMES.get(name, name)
    kind, _, count = name.partition(":")
    if name in {"rods", "hand"}:
        return rods_chain() if name == "rods" else hand()
    if name in _DESCRIBED or (kind == "human" and count in {"3", "4", "5"}):
        return _structure_of_table(kind, int(count) if count else None)
    if kind == "tree" and count.isascii() and count.isdigit():
        return random_tree(int(count), seed)
    raise ParameterError(f"there is no structure {name!r}; there are {', '.join(STRUCTURE_NAMES)} and human:4")
