r"""Bodies whose halves mirror each other: bones are as long on both sides, and a person's joints lie inward of markers.

A limb's twin is the limb on the other side. With joints a and b of a limb and a', b' of its twin, or of one limb
between both halves, :math:`|a - b|` and :math:`|a' - b'|` differ by chance only. Markers on people are stuck to the
outer side of arms and legs: joints lie from there towards the other side.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from skelgen.geometry.rotations import unit_vectors
from skelgen.kinematics.calibration.joint_places import TOWARDS_CHILD, JointPlace
from skelgen.kinematics.chain.chain import Chain, ObservedChain
from skelgen.model.arrays import Floats, Ints

ALIKE = 1.25
"""Largest ratio of D between the joints of two limbs that mirror each other."""

UNEQUAL = 0.02
"""Of the length: standard deviation of the difference between bones of both halves."""

LEAST_LENGTH = 1.0
"""mm; joints that are nearer to each other are as good as one."""

INWARD = {
    "thigh": (0.08, 0.05),
    "shank": (0.14, 0.04),
    "foot": (0.17, 0.08),
    "upper arm": (-0.03, 0.08),
    "forearm": (0.12, 0.05),
}
"""Of D: how far inward of where joints of any body are expected those of people lie, and its standard deviation, by the
segment below; from ``python tests/benchmarks/learn_joints.py``."""

STEADY = 0.4
"""Length of the mean of the directions to the other side, as a limb sees them, from which on there is an inner side."""


@dataclass(frozen=True, eq=False)
class InwardPlace:
    """How far inward a joint of a person is expected.

    Attributes
    ----------
    place : JointPlace
        The joint.
    segment : str
        What the limb below is.
    size : float, mm
        Mean D of it and its twin.
    in_parent, in_child : ndarray, shape (3,)
        Unit vector to the other side in the frames of its limbs.
    """

    place: JointPlace
    segment: str
    size: float
    in_parent: Floats
    in_child: Floats


def twins(chain: Chain, known: Sequence[JointPlace]) -> Ints:
    """Return the limb on the other side for each limb of two that mirror each other, else -1, shape (n_limbs,).

    Parameters
    ----------
    chain : Chain
        The limbs.
    known : sequence of JointPlace
        Their joints.
    """
    size, parents = {one.limb: one.distance for one in known}, chain.parents
    n_children = np.bincount(parents[1:], minlength=chain.n_limbs)
    twin = np.full(chain.n_limbs, -1)
    for limb in range(1, chain.n_limbs):
        parent = int(parents[limb])
        is_first = twin[parent] < 0  # of an arm or a leg: another of as many limbs hangs on the same parent
        above = parent if is_first else twin[parent]
        alike = [
            other
            for other in np.flatnonzero(parents == above).tolist()
            if other != limb
            and {limb, other} <= size.keys()
            and 1 / ALIKE < size[other] / size[limb] < ALIKE
            and (not is_first or n_children[other] == n_children[limb] > 0)
        ]
        if len(alike) == 1:
            twin[limb] = alike[0]
    is_mutual = (twin >= 0) & (twin[twin] == np.arange(chain.n_limbs))
    return np.asarray(np.where(is_mutual, twin, -1))


def inward_places(
    fit: ObservedChain, known: Sequence[JointPlace], twin: Ints, segments: Mapping[int, str]
) -> list[InwardPlace]:
    """Return how far inward the joints of a person are expected.

    Parameters
    ----------
    fit : ObservedChain
        The person.
    known : sequence of JointPlace
        Joints of any body.
    twin : ndarray of intp, shape (n_limbs,)
        From `twins`.
    segments : mapping of int to str
        Segments of limbs.
    """
    markers, rotations, found = fit.poses.markers(fit.chain), fit.poses.rotations, []
    by_limb = {one.limb: one for one in known}
    for limb, place in by_limb.items():
        other = by_limb.get(int(twin[limb]))
        if other is None or segments.get(limb) != segments.get(other.limb) or segments.get(limb) not in INWARD:
            continue
        own, there = (
            markers[:, one.nearest[0]] + TOWARDS_CHILD * (markers[:, one.nearest[1]] - markers[:, one.nearest[0]])
            for one in (place, other)
        )
        way = unit_vectors(there - own)
        ends = rotations[:, fit.chain.parents[limb]], rotations[:, limb]
        in_parent, in_child = (np.einsum("fji,fj->i", one, way) / len(way) for one in ends)
        if min(np.linalg.norm(in_parent), np.linalg.norm(in_child)) < STEADY:
            continue
        size = (place.distance + other.distance) / 2
        found.append(InwardPlace(place, segments[limb], size, unit_vectors(in_parent), unit_vectors(in_child)))
    return found


def inward_residuals(chain: Chain, known: Sequence[InwardPlace]) -> tuple[Floats, Floats]:
    """Return derivatives by `places` of how far inward joints lie, and the residuals, in standard deviations.

    Parameters
    ----------
    chain : Chain
        The limbs.
    known : sequence of InwardPlace
        What is expected.

    Returns
    -------
    tuple of ndarray, shapes (n_residuals, 3 (n_markers + n_limbs - 1)) and (n_residuals,)
    """
    n_places = chain.n_markers + chain.n_limbs - 1
    rows, expected = np.zeros((len(known), n_places, 3)), np.zeros(len(known))
    for index, one in enumerate(known):
        above, below = one.place.nearest
        inward, deviation = INWARD[one.segment]
        rows[index, chain.n_markers + one.place.limb - 1] = (1 - TOWARDS_CHILD) * one.in_parent
        rows[index, above] -= (1 - TOWARDS_CHILD) * one.in_parent
        rows[index, below] -= TOWARDS_CHILD * one.in_child
        rows[index] /= deviation * one.size
        expected[index] = inward / deviation
    flat = rows.reshape(len(known), 3 * n_places)
    return flat, flat @ np.concatenate([chain.offsets, chain.joints[1:]]).ravel() - expected


def twin_residuals(chain: Chain, twin: Ints) -> tuple[Floats, Floats]:
    """Return derivatives by `places` of differences between bones of both halves, and these, in standard deviations.

    Parameters
    ----------
    chain : Chain
        The limbs.
    twin : ndarray of intp, shape (n_limbs,)
        From `twins`.

    Returns
    -------
    tuple of ndarray, shapes (n_residuals, 3 (n_markers + n_limbs - 1)) and (n_residuals,)
    """
    rows, offs = [np.zeros((0, 3 * (chain.n_markers + chain.n_limbs - 1)))], [np.zeros(0)]
    for limb in range(chain.n_limbs):
        mirror = int(twin[limb]) if twin[limb] >= 0 else limb
        joints = chain.joints_of(limb)
        image = {one: mirror if one == limb else int(twin[one]) for one in joints}
        if mirror == limb:  # between both halves: joints without a twin are their own images
            image = {one: one if other < 0 else other for one, other in image.items()}
        for pair in combinations([one for one in joints if image[one] >= 0], 2):
            other = tuple(image[one] for one in pair)
            if mirror < limb or (mirror == limb and tuple(sorted(other)) <= pair):
                continue  # seen from the other side, or its own image
            (row, length), (image_row, image_length) = (
                _log_length(chain, one, ends) for one, ends in ((limb, pair), (mirror, other))
            )
            rows.append((row - image_row)[np.newaxis] / UNEQUAL)
            offs.append(np.array([(length - image_length) / UNEQUAL]))
    return np.concatenate(rows), np.concatenate(offs)


def _log_length(chain: Chain, limb: int, ends: tuple[int, ...]) -> tuple[Floats, float]:
    """Derivatives by `places` of the logarithm of the distance [mm] between two joints of a limb, and its value."""
    first, second = (np.zeros(3) if one == limb else chain.joints[one] for one in ends)
    length = max(float(np.linalg.norm(second - first)), LEAST_LENGTH)
    row = np.zeros((chain.n_markers + chain.n_limbs - 1, 3))
    for end, sign in zip(ends, (-1.0, 1.0), strict=True):
        if end != limb:
            row[chain.n_markers + end - 1] += sign * (second - first) / length**2
    return row.ravel(), float(np.log(length))
