"""The structures that can be simulated, found by name: rods, humans, a quadruped, random trees; all lengths in mm."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from skelgen.errors import ParameterError
from skelgen.geometry.rotations import unit_vectors
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

SIDES = {"left": 1.0, "right": -1.0}
"""Sides of a body, and the sign of y there."""

_TRUNK = Swing((25, 30, 35))
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


def human(n_markers_per_limb: int = 3) -> Structure:
    """Return a human of 15 limbs, 1.75 m tall, with hinges in elbows and knees, universal wrists and ankles.

    Parameters
    ----------
    n_markers_per_limb : int
        Markers on every limb.
    """
    n = n_markers_per_limb
    limbs = [
        limb("pelvis", Attachment("", "free", (0, 0, 960)), Capsule((0, 110, 0), 95, start=(0, -110, 0)), n),
        limb("chest", Attachment("pelvis", "ball", (-15, 0, 110), _TRUNK), Capsule((0, 0, 300), 120), n),
        limb("head", Attachment("chest", "ball", (10, 0, 370), Swing((30, 35, 50))), Capsule((15, 0, 190), 80), n),
    ]
    for side, s in SIDES.items():
        upper, fore, hand = f"{side} upper arm", f"{side} forearm", f"{side} hand"
        elbow = Swing((50,), (60,), [(-0.1 * s, -1, 0.15 * s)])
        wrist = Swing((40, 30), (5, 0), [(0, -1, 0), (1, 0, 0)])
        limbs += [
            limb(upper, Attachment("chest", "ball", (0, 185 * s, 300), _shoulder(s)), Capsule((0, 0, -300), 45), n),
            limb(fore, Attachment(upper, "hinge", (0, 10 * s, -305), elbow), Capsule((0, 0, -250), 36), n),
            limb(hand, Attachment(fore, "universal", (5, 5 * s, -260), wrist), Capsule((0, 0, -170), 28), n),
        ]
        thigh, shank, foot = f"{side} thigh", f"{side} shank", f"{side} foot"
        knee = Swing((45,), (50,), [(0.05 * s, 1, -0.1 * s)])
        ankle = Swing((30, 25), axes=[(0, 1, 0), (1, 0, 0.3 * s)])
        limbs += [
            limb(thigh, Attachment("pelvis", "ball", (0, 95 * s, -70), _hip(s)), Capsule((0, 0, -415), 70), n),
            limb(shank, Attachment(thigh, "hinge", (0, 5 * s, -420), knee), Capsule((0, 0, -390), 50), n),
            limb(foot, Attachment(shank, "universal", (-10, 0, -405), ankle), Capsule((190, 0, -55), 34), n),
        ]
    return Structure("human", tuple(limbs))


def _shoulder(s: float) -> Swing:
    return Swing((40, 50, 40), (15 * s, -15, 0))


def _hip(s: float) -> Swing:
    return Swing((30, 40, 30), (8 * s, -15, 0))


def classic_human() -> Structure:
    """Return a human of 13 bones and 31 markers, most limbs with two, as in (Schönauer 2007, tables 5.2 and 5.3).

    The knees are hinges; all other joints are balls, as the joint errors in table 5.4 show.
    """
    limbs = [
        limb("breast", Attachment("", "free", (0, 0, 1250)), Capsule((0, 0, 250), 120, start=(0, 0, -50)), 3),
        limb("head", Attachment("breast", "ball", (10, 0, 300)), Capsule((15, 0, 190), 80), 2),
        limb("hip", Attachment("breast", "ball", (0, 0, -120), _TRUNK), Capsule((0, 0, -150), 110), 2),
    ]
    for side, s in SIDES.items():
        upper, fore, hand = f"{side} upper arm", f"{side} forearm", f"{side} hand"
        elbow = Swing((25, 45, 35), (0, -55, 0))
        limbs += [
            limb(upper, Attachment("breast", "ball", (0, 185 * s, 220), _shoulder(s)), Capsule((0, 0, -300), 45), 2),
            limb(fore, Attachment(upper, "ball", (0, 10 * s, -305), elbow), Capsule((0, 0, -250), 36), 2),
            limb(hand, Attachment(fore, "ball", (5, 5 * s, -260)), Capsule((0, 0, -170), 28), 2),
        ]
        thigh, shank = f"{side} thigh", f"{side} lower leg"
        knee = Swing((45,), (50,), [(0, 1, 0)])
        limbs += [
            limb(thigh, Attachment("hip", "ball", (0, 95 * s, -220), _hip(s)), Capsule((0, 0, -415), 70), 3),
            limb(shank, Attachment(thigh, "hinge", (0, 5 * s, -420), knee), Capsule((0, 0, -390), 50), 3),
        ]
    return Structure("classic-human", tuple(limbs))


def quadruped() -> Structure:
    """Return a dog-like animal of 17 limbs with three markers each: hinges in elbows, stifles and carpi."""
    limbs = [
        limb("pelvis", Attachment("", "free", (-300, 0, 600)), Capsule((60, 0, 0), 90, start=(-100, 0, 0)), 3),
        limb("trunk", Attachment("pelvis", "ball", (80, 0, 10), Swing((20, 20, 25))), Capsule((440, 0, 0), 110), 3),
        limb("neck", Attachment("trunk", "ball", (480, 0, 40), Swing((20, 35, 35))), Capsule((130, 0, 130), 55), 3),
        limb("head", Attachment("neck", "ball", (150, 0, 150), Swing((30, 30, 35))), Capsule((200, 0, -30), 55), 3),
        limb("tail", Attachment("pelvis", "ball", (-140, 0, 20), Swing((20, 30, 45))), Capsule((-320, 0, 0), 20), 3),
    ]
    for side, s in SIDES.items():
        upper, fore, foot = f"{side} upper foreleg", f"{side} forearm", f"{side} forefoot"
        shoulder = Swing((20, 35, 20))
        elbow, carpus = Swing((40,), (30,), [(0.1 * s, -1, 0)]), Swing((45,), (20,), [(0, 1, 0.2 * s)])
        limbs += [
            limb(upper, Attachment("trunk", "ball", (380, 100 * s, -60), shoulder), Capsule((-40, 0, -190), 40), 3),
            limb(fore, Attachment(upper, "hinge", (-45, 0, -200), elbow), Capsule((20, 0, -190), 30), 3),
            limb(foot, Attachment(fore, "hinge", (20, 0, -200), carpus), Capsule((50, 0, -110), 24), 3),
        ]
        thigh, shank, foot = f"{side} thigh", f"{side} shank", f"{side} hind foot"
        hip = Swing((20, 35, 20))
        stifle, hock = Swing((40,), (30,), [(0.1 * s, 1, 0)]), Swing((35, 20), axes=[(0, 1, 0), (1, 0, 0)])
        limbs += [
            limb(thigh, Attachment("pelvis", "ball", (-40, 80 * s, -50), hip), Capsule((40, 0, -210), 55), 3),
            limb(shank, Attachment(thigh, "hinge", (45, 0, -220), stifle), Capsule((-70, 0, -190), 35), 3),
            limb(foot, Attachment(shank, "universal", (-75, 0, -200), hock), Capsule((60, 0, -130), 24), 3),
        ]
    return Structure("quadruped", tuple(limbs))


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


_BUILDERS: dict[str, Callable[[], Structure]] = {
    "rods": rods_chain,
    "human": human,
    "classic-human": classic_human,
    "quadruped": quadruped,
    "hand": hand,
}

_FORMER_NAMES = {"seed-human": "classic-human"}  # of version 0.1.0

STRUCTURE_NAMES = (*_BUILDERS, f"{_TREE_PREFIX}8")
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
    if name in _BUILDERS:
        return _BUILDERS[name]()
    if kind == "human" and count in {"3", "4", "5"}:
        return human(int(count))
    if kind == "tree" and count.isascii() and count.isdigit():
        return random_tree(int(count), seed)
    raise ParameterError(f"there is no structure {name!r}; there are {', '.join(STRUCTURE_NAMES)} and human:4")
