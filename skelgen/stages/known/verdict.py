"""What is said of a take that a known skeleton was applied to."""

from __future__ import annotations

import numpy as np

from skelgen.model import Skeleton
from skelgen.model.arrays import Floats, Ints
from skelgen.stages.known.labels import KnownLabels
from skelgen.stages.known.moved import LEVEL, PlaceTest

OTHER_BODY = 0.5
"""Part of the markers that sit elsewhere from which on it is not the markers that moved, but the body that differs."""

MANY_LIMBS = 0.25
"""Part of the limbs with moved markers from which on the user is told that the body may be another one."""


def is_other_body(moved: tuple[int, ...], test: PlaceTest) -> bool:
    """Return whether so many markers sit elsewhere that these are not the body and the markers of the skeleton."""
    return bool(moved) and len(moved) >= OTHER_BODY * test.n_tested


def sentences(
    labels: KnownLabels,
    names: tuple[str, ...],
    test: PlaceTest,
    skeleton: Skeleton,
    moved: tuple[int, ...],
    shifts: Floats,
    missing: tuple[int, ...],
    looser: tuple[int, ...],
) -> tuple[str, ...]:
    """Say in whole sentences how a take differs from what its skeleton knows.

    Parameters
    ----------
    labels : KnownLabels
        How points became markers.
    names : tuple of str
        Of the skeleton's markers, then of new ones.
    test : PlaceTest
        Where markers sit.
    skeleton : Skeleton
        With the limbs of all markers.
    moved, missing : tuple of int
        Markers that sit elsewhere, and that no frame shows.
    shifts : ndarray, shape (n_known,), mm
        How far markers are from where they sat.
    looser : tuple of int
        Joints that turn in more ways than before.
    """
    how = "its names and the known skeleton" if labels.by_name else "the known skeleton"
    said = [f"labelled by {how}, which explains {100 * labels.explained:.1f} % of the positions that it could"]
    if is_other_body(moved, test):
        said.append(
            f"{len(moved)} of {test.n_tested} markers sit elsewhere on their limbs than in the calibrated take "
            f"(Hotelling's test, all together at a level of {LEVEL:g}): this is another body, or the markers were put "
            "on anew; calibrate this take by itself"
        )
    elif moved:
        parts = ", ".join(f"{names[m]} by {shifts[m]:.1f} mm" for m in sorted(moved, key=lambda m: -shifts[m]))
        said.append(f"moved on their limbs since the calibrated take, and placed anew: {parts}")
        limbs = skeleton.limb_of_marker
        n_limbs, n_touched = len(np.unique(limbs[limbs >= 0])), len(np.unique(limbs[list(moved)]))
        if n_touched > MANY_LIMBS * n_limbs:
            said.append(
                f"that concerns {n_touched} of {n_limbs} limbs: unless so many markers can have slipped, this is "
                "another body"
            )
    if missing:
        said.append(f"markers of the skeleton that no frame shows: {', '.join(names[m] for m in missing)}")
    if looser:
        joints = [skeleton.joints[index] for index in looser]
        parts = ", ".join(f"limb{joint.parent}-limb{joint.child}" for joint in joints)
        said.append(f"joints that turn in more ways than the calibrated take showed, balls here: {parts}")
    if labels.new:
        parts = ", ".join(
            f"{name} on limb {one.limb}" if one.limb >= 0 else f"{name} on no limb"
            for name, one in zip(names[len(shifts) :], labels.new, strict=True)
        )
        said.append(f"markers that the skeleton does not know: {parts}")
    n_left = int((labels.marker_of_point < 0).sum())
    if n_left:
        said.append(
            f"{n_left} points ({100 * n_left / len(labels.marker_of_point):.1f} %) are no marker's and are left out"
        )
    said += _renamed(labels, names)
    return tuple(said)


def _renamed(labels: KnownLabels, names: tuple[str, ...]) -> list[str]:
    """Which markers of the take have other names in the skeleton."""
    given = labels.points.names
    if not given:
        return []
    owned = labels.marker_of_point >= 0
    counts = np.zeros((len(given), len(names)), dtype=np.intp)
    np.add.at(counts, (labels.points.tracks[owned], labels.marker_of_point[owned]), 1)
    usual: Ints = counts.argmax(axis=1)
    pairs = [
        f"{name} is {names[usual[track]]}"
        for track, name in enumerate(given)
        if counts[track].any() and names[usual[track]] != name
    ]
    return [f"named otherwise than in the skeleton: {', '.join(pairs)}"] if pairs else []
