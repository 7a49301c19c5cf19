"""Limbs built from a few figures: an axis, a radius, a number of markers, and how far the joint swings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from skelgen.errors import InputError
from skelgen.model.arrays import Floats
from skelgen.simulation.articulated import DEGREES_OF_FREEDOM, LimbModel

MARKER_STANDOFF = 10.0
"""Distance [mm] of a marker's centre from the skin: a sphere of 14 mm on a base plate."""

_TURN_BETWEEN_MARKERS = np.deg2rad(137.5)  # the golden angle: no two markers of a limb come to lie behind each other
_FIRST_FRACTION, _LAST_FRACTION = 0.2, 0.85  # of the limb's axis: clear of the neighbouring limbs
_MIN_MARKERS, _MAX_MARKERS = 2, 5

_ROOT_AXES = np.eye(3)[::-1]  # turned one after the other: heading, pitch, roll


class Swing(NamedTuple):
    """How far a joint is moved: every angle stays within offset ± amplitude.

    Attributes
    ----------
    amplitudes : array_like, shape (n_angles,), deg
        Amplitudes.
    offsets : array_like, shape (n_angles,), deg, or None
        Middle positions; None for 0.
    axes : array_like, shape (n_angles, 3), or None
        Axes of any length; None for those of the world.
    """

    amplitudes: ArrayLike
    offsets: ArrayLike | None = None
    axes: ArrayLike | None = None


_ROOT_SWING = Swing((150.0, 12.0, 12.0), axes=_ROOT_AXES)
_BALL_SWING = Swing((35.0, 35.0, 35.0))


def limb(
    name: str,
    parent: str,
    kind: str,
    joint: ArrayLike,
    tip: ArrayLike,
    *,
    radius: float,
    n: int,
    swing: Swing | None = None,
    start: ArrayLike = (0.0, 0.0, 0.0),
) -> LimbModel:
    """Build a limb whose markers wind around its axis.

    Parameters
    ----------
    name, parent, kind, joint, radius
        As in `LimbModel`.
    tip, start : array_like, shape (3,), mm
        Ends of the limb's axis in its own frame.
    n : int
        Number of markers.
    swing : Swing, optional
        How the joint moves; by default 35 deg about each axis of a ball, and what a walker does for a root.
    """
    amplitudes, offsets, axes = swing or (_ROOT_SWING if kind == "free" else _BALL_SWING)
    n_angles = DEGREES_OF_FREEDOM[kind]
    segment = np.stack([_floats(start), _floats(tip)])
    return LimbModel(
        name=name,
        parent=parent,
        kind=kind,
        joint=_floats(joint),
        segment=segment,
        radius=radius,
        markers=markers_around(segment, radius + MARKER_STANDOFF, n, phase=float(len(name) + len(parent))),
        axes=unit(np.eye(3)[:n_angles] if axes is None else axes),
        amplitudes=_floats(amplitudes),
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
