"""The bodies of a human, of the seed's human and of a quadruped, in mm, with plausible proportions and ranges."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from skelgen.errors import InputError
from skelgen.model.arrays import Floats
from skelgen.simulation.articulated import DEGREES_OF_FREEDOM, LimbModel, Structure

MARKER_STANDOFF = 10.0
"""Distance [mm] of a marker's centre from the skin: a sphere of 14 mm on a base plate."""

_TURN_BETWEEN_MARKERS = np.deg2rad(137.5)  # the golden angle: no two markers of a limb come to lie behind each other
_FIRST_FRACTION, _LAST_FRACTION = 0.2, 0.85  # of the limb's axis: clear of the neighbouring limbs
_MIN_MARKERS, _MAX_MARKERS = 2, 5

_X, _Y, _Z = np.eye(3)
_ROOT_AXES = np.array([_Z, _Y, _X])
_ROOT_AMPLITUDES = (150.0, 12.0, 12.0)  # deg: heading, pitch, roll
_SIDES = {"left": 1.0, "right": -1.0}


def limb(
    name: str,
    parent: str,
    kind: str,
    joint: ArrayLike,
    tip: ArrayLike,
    *,
    radius: float,
    n: int,
    axes: ArrayLike | None = None,
    amplitudes: ArrayLike | None = None,
    offsets: ArrayLike | None = None,
    start: ArrayLike = (0.0, 0.0, 0.0),
) -> LimbModel:
    """Build a limb whose markers wind around its axis.

    Parameters
    ----------
    name, parent, kind, joint, radius, axes, amplitudes, offsets
        As in `LimbModel`; by default the axes are those of the world, amplitudes 35 deg and offsets 0.
    tip, start : array_like, shape (3,), mm
        Ends of the limb's axis in its own frame.
    n : int
        Number of markers.
    """
    n_angles = DEGREES_OF_FREEDOM[kind]
    default_axes = _ROOT_AXES if kind == "free" else np.eye(3)[:n_angles]
    default_amplitudes = _ROOT_AMPLITUDES if kind == "free" else np.full(n_angles, 35.0)
    segment = np.stack([_floats(start), _floats(tip)])
    return LimbModel(
        name=name,
        parent=parent,
        kind=kind,
        joint=_floats(joint),
        segment=segment,
        radius=radius,
        markers=markers_around(segment, radius + MARKER_STANDOFF, n, phase=float(len(name) + len(parent))),
        axes=unit(default_axes if axes is None else axes),
        amplitudes=_floats(default_amplitudes if amplitudes is None else amplitudes),
        offsets=np.zeros(n_angles) if offsets is None else _floats(offsets),
    )


def markers_around(segment: Floats, distance: float, n_markers: int, phase: float) -> Floats:
    """Place markers on a helix around an axis, so that no three of them lie on one line.

    Parameters
    ----------
    segment : ndarray, shape (2, 3), mm
        Ends of the axis.
    distance : float, mm
        Distance of the markers from the axis.
    n_markers : int
        How many, 2 to 5.
    phase : float, rad
        Where the helix starts.

    Returns
    -------
    ndarray, shape (n_markers, 3), mm
    """
    if not _MIN_MARKERS <= n_markers <= _MAX_MARKERS:
        raise InputError(f"{n_markers} markers per limb; it must be {_MIN_MARKERS} to {_MAX_MARKERS}")
    fractions = np.linspace(_FIRST_FRACTION, _LAST_FRACTION, n_markers)[:, np.newaxis]
    angles = (phase + _TURN_BETWEEN_MARKERS * np.arange(n_markers))[:, np.newaxis]
    direction = unit(segment[1] - segment[0])
    first = unit(np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))]))
    second = np.cross(direction, first)
    on_axis = segment[0] + fractions * (segment[1] - segment[0])
    return np.asarray(on_axis + distance * (np.cos(angles) * first + np.sin(angles) * second))


def _floats(values: ArrayLike) -> Floats:
    return np.asarray(values, dtype=np.float64)


def unit(vectors: ArrayLike) -> Floats:
    """Return vectors divided by their lengths, shape (..., 3)."""
    array = np.asarray(vectors, dtype=np.float64)
    return np.asarray(array / np.linalg.norm(array, axis=-1, keepdims=True))


def human(n_markers_per_limb: int = 3) -> Structure:
    """Return a human of 15 limbs, 1.75 m tall, with hinges in elbows and knees, universal wrists and ankles.

    Parameters
    ----------
    n_markers_per_limb : int
        Markers on every limb.
    """
    n = n_markers_per_limb
    limbs = [
        limb("pelvis", "", "free", (0, 0, 960), (0, 110, 0), radius=95, n=n, start=(0, -110, 0)),
        limb("chest", "pelvis", "ball", (-15, 0, 110), (0, 0, 300), radius=120, n=n, amplitudes=(25, 30, 35)),
        limb("head", "chest", "ball", (10, 0, 370), (15, 0, 190), radius=80, n=n, amplitudes=(30, 35, 50)),
    ]
    for side in _SIDES:
        limbs += _arm(side, n) + _leg(side, n)
    return Structure("human", tuple(limbs))


def _arm(side: str, n: int) -> list[LimbModel]:
    s, upper, fore = _SIDES[side], f"{side} upper arm", f"{side} forearm"
    elbow = [(-0.1 * s, -1, 0.15 * s)]
    wrist = [(0, -1, 0), (1, 0, 0)]
    return [
        limb(
            upper,
            "chest",
            "ball",
            (0, 185 * s, 300),
            (0, 0, -300),
            radius=45,
            n=n,
            amplitudes=(40, 50, 40),
            offsets=(15 * s, -15, 0),
        ),
        limb(
            fore,
            upper,
            "hinge",
            (0, 10 * s, -305),
            (0, 0, -250),
            radius=36,
            n=n,
            axes=elbow,
            amplitudes=(50,),
            offsets=(60,),
        ),
        limb(
            f"{side} hand",
            fore,
            "universal",
            (5, 5 * s, -260),
            (0, 0, -170),
            radius=28,
            n=n,
            axes=wrist,
            amplitudes=(40, 30),
            offsets=(5, 0),
        ),
    ]


def _leg(side: str, n: int) -> list[LimbModel]:
    s, thigh, shank = _SIDES[side], f"{side} thigh", f"{side} shank"
    knee = [(0.05 * s, 1, -0.1 * s)]
    ankle = [(0, 1, 0), (1, 0, 0.3 * s)]
    return [
        limb(
            thigh,
            "pelvis",
            "ball",
            (0, 95 * s, -70),
            (0, 0, -415),
            radius=70,
            n=n,
            amplitudes=(30, 40, 30),
            offsets=(8 * s, -15, 0),
        ),
        limb(
            shank,
            thigh,
            "hinge",
            (0, 5 * s, -420),
            (0, 0, -390),
            radius=50,
            n=n,
            axes=knee,
            amplitudes=(45,),
            offsets=(50,),
        ),
        limb(
            f"{side} foot",
            shank,
            "universal",
            (-10, 0, -405),
            (190, 0, -55),
            radius=34,
            n=n,
            axes=ankle,
            amplitudes=(30, 25),
            offsets=(0, 0),
        ),
    ]


def seed_human() -> Structure:
    """Return a human of 13 bones and 31 markers, most limbs with two, as in tables 5.2 and 5.3 of the seed.

    The knees are hinges; all other joints are balls, as the joint errors in the seed's table 5.4 tell.
    """
    limbs = [
        limb("breast", "", "free", (0, 0, 1250), (0, 0, 250), radius=120, n=3, start=(0, 0, -50)),
        limb("head", "breast", "ball", (10, 0, 300), (15, 0, 190), radius=80, n=2),
        limb("hip", "breast", "ball", (0, 0, -120), (0, 0, -150), radius=110, n=2, amplitudes=(25, 30, 35)),
    ]
    for side, s in _SIDES.items():
        upper, fore, thigh = f"{side} upper arm", f"{side} forearm", f"{side} thigh"
        limbs += [
            limb(
                upper,
                "breast",
                "ball",
                (0, 185 * s, 220),
                (0, 0, -300),
                radius=45,
                n=2,
                amplitudes=(40, 50, 40),
                offsets=(15 * s, -15, 0),
            ),
            limb(
                fore,
                upper,
                "ball",
                (0, 10 * s, -305),
                (0, 0, -250),
                radius=36,
                n=2,
                amplitudes=(25, 45, 35),
                offsets=(0, -55, 0),
            ),
            limb(f"{side} hand", fore, "ball", (5, 5 * s, -260), (0, 0, -170), radius=28, n=2),
            limb(
                thigh,
                "hip",
                "ball",
                (0, 95 * s, -220),
                (0, 0, -415),
                radius=70,
                n=3,
                amplitudes=(30, 40, 30),
                offsets=(8 * s, -15, 0),
            ),
            limb(
                f"{side} lower leg",
                thigh,
                "hinge",
                (0, 5 * s, -420),
                (0, 0, -390),
                radius=50,
                n=3,
                axes=[_Y],
                amplitudes=(45,),
                offsets=(50,),
            ),
        ]
    return Structure("seed-human", tuple(limbs))


def quadruped() -> Structure:
    """Return a dog-like animal of 17 limbs with three markers each: hinges in elbows, stifles and carpi."""
    limbs = [
        limb("pelvis", "", "free", (-300, 0, 600), (60, 0, 0), radius=90, n=3, start=(-100, 0, 0)),
        limb("trunk", "pelvis", "ball", (80, 0, 10), (440, 0, 0), radius=110, n=3, amplitudes=(20, 20, 25)),
        limb("neck", "trunk", "ball", (480, 0, 40), (130, 0, 130), radius=55, n=3, amplitudes=(20, 35, 35)),
        limb("head", "neck", "ball", (150, 0, 150), (200, 0, -30), radius=55, n=3, amplitudes=(30, 30, 35)),
        limb("tail", "pelvis", "ball", (-140, 0, 20), (-320, 0, 0), radius=20, n=3, amplitudes=(20, 30, 45)),
    ]
    for side in _SIDES:
        limbs += _foreleg(side) + _hindleg(side)
    return Structure("quadruped", tuple(limbs))


def _foreleg(side: str) -> list[LimbModel]:
    s, upper, fore = _SIDES[side], f"{side} upper foreleg", f"{side} forearm"
    elbow, carpus = [(0.1 * s, -1, 0)], [(0, 1, 0.2 * s)]
    return [
        limb(upper, "trunk", "ball", (380, 100 * s, -60), (-40, 0, -190), radius=40, n=3, amplitudes=(20, 35, 20)),
        limb(
            fore,
            upper,
            "hinge",
            (-45, 0, -200),
            (20, 0, -190),
            radius=30,
            n=3,
            axes=elbow,
            amplitudes=(40,),
            offsets=(30,),
        ),
        limb(
            f"{side} forefoot",
            fore,
            "hinge",
            (20, 0, -200),
            (50, 0, -110),
            radius=24,
            n=3,
            axes=carpus,
            amplitudes=(45,),
            offsets=(20,),
        ),
    ]


def _hindleg(side: str) -> list[LimbModel]:
    s, thigh, shank = _SIDES[side], f"{side} thigh", f"{side} shank"
    stifle, hock = [(0.1 * s, 1, 0)], [(0, 1, 0), (1, 0, 0)]
    return [
        limb(thigh, "pelvis", "ball", (-40, 80 * s, -50), (40, 0, -210), radius=55, n=3, amplitudes=(20, 35, 20)),
        limb(
            shank,
            thigh,
            "hinge",
            (45, 0, -220),
            (-70, 0, -190),
            radius=35,
            n=3,
            axes=stifle,
            amplitudes=(40,),
            offsets=(30,),
        ),
        limb(
            f"{side} hind foot",
            shank,
            "universal",
            (-75, 0, -200),
            (60, 0, -130),
            radius=24,
            n=3,
            axes=hock,
            amplitudes=(35, 20),
        ),
    ]
