r"""What changed between two takes of one subject: places of markers on their limbs, and freedoms of joints.

Places are compared marker by marker, in the frames of the limbs.

Each take is cut into spans of equal length. A marker's usual place in each span, its median, varies with noise, skin
and posture; two takes differ where the means of these differ by more than they vary. With the covariances :math:`S_i`
of the spans' places and their numbers :math:`n_i`,

.. math::
    T^2 = d^T \left( S_1 / n_1 + S_2 / n_2 + E \right)^{-1} d, \qquad
    F = \frac{\nu - 2}{3 \nu} T^2 \sim F(3, \nu - 2),

Hotelling's test for unequal covariances, the degrees of freedom :math:`\nu` after Nel and van der Merwe (1986,
*Communications in Statistics* 15, 3719). E is what the calibration leaves open of the marker's place and of the joints
of its limb: a joint that is off pushes all markers of the limb aside, as the pose has it. The level is shared by all
markers (Bonferroni).

A joint has more freedoms than before where the new take shows rotations that its type does not allow: a neck that only
nodded is no hinge here. Both takes are posed with all joints free. How far a joint then leaves the rotations that its
type allows is noise and skin in the calibrated take; in the new one it may be more. The root mean squares of this angle
in equal spans of both takes are compared by Welch's test, on their logarithms, one-sided, at the same shared level.

A body of another size has all its limbs larger, or all smaller: a sign test over the limbs finds what is too little of
each marker.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import binomtest, ttest_ind
from scipy.stats import f as f_distribution

from skelgen.geometry.rotations import vector_from_matrix
from skelgen.geometry.statistics import median_of_known, pair_lengths
from skelgen.kinematics.chain.articulation import FREEDOMS
from skelgen.kinematics.inverse.skeleton_tree import SkeletonTree
from skelgen.model import Motion, Skeleton
from skelgen.model.arrays import Bools, Floats
from skelgen.stages.labels import SkeletonPoses, with_free_joints

N_SPANS = 12
"""Spans of a take: long against the time for which skin stays on one side, enough for a covariance of three numbers."""

LEAST_SPANS = 6
"""Spans that must show a marker in both takes; with fewer nothing can be said."""

LEAST_SEEN = 5
"""Frames of a span that must show a marker."""

LEVEL = 0.001
"""Probability of calling any marker of a take moved where none is."""

LEAST_SIZE = 0.03
"""Part by which limbs must be larger or smaller. Skin that is stretched otherwise makes up to 2 % of all limbs, between
the halves of recorded takes."""

_RIDGE = 1e-6  # mm: exact takes have no spread, and differ by rounding


@dataclass(frozen=True, eq=False)
class PlaceTest:
    """What the comparison says of each marker.

    Attributes
    ----------
    shifts : ndarray, shape (n_markers, 3), mm
        Mean place in the new take minus that in the calibrated one, in the limb's frame; NaN where unknown.
    p_values : ndarray, shape (n_markers,)
        Probability of as large a difference by chance; 1 where unknown.
    """

    shifts: Floats
    p_values: Floats

    @property
    def n_tested(self) -> int:
        """Number of markers that could be tested."""
        return int((~np.isnan(self.shifts[:, 0])).sum())

    @property
    def is_moved(self) -> Bools:
        """Whether each marker moved, at the level shared by all."""
        return np.asarray(self.p_values < LEVEL / max(self.n_tested, 1))

    @property
    def distances(self) -> Floats:
        """Lengths of the shifts [mm], 0 where unknown."""
        return np.asarray(np.nan_to_num(np.linalg.norm(self.shifts, axis=1)))


@dataclass(frozen=True)
class SizeTest:
    """How much larger the limbs are than in the calibrated take.

    Attributes
    ----------
    factor : float
        Median of the limbs' factors: of each, the median ratio of the distances between its markers.
    n_alike, n_limbs : int
        Limbs whose factor is on the same side of one, and all that could be compared.
    """

    factor: float
    n_alike: int
    n_limbs: int

    @property
    def is_other_size(self) -> bool:
        """Whether so many limbs are larger, or smaller, that it is no chance (sign test), and by `LEAST_SIZE`."""
        if not self.n_limbs or abs(self.factor - 1.0) < LEAST_SIZE:
            return False
        return bool(binomtest(self.n_alike, self.n_limbs).pvalue < LEVEL)


def compare_sizes(skeleton: Skeleton, positions: Floats) -> SizeTest:
    """Compare the distances between the markers of each limb with those of the skeleton.

    Parameters
    ----------
    skeleton : Skeleton
        Calibrated on another take.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Its markers in this take, NaN where unseen.
    """
    factors = []
    for limb in range(skeleton.n_limbs):
        markers = skeleton.markers_of(limb)
        first, second = (markers[end] for end in np.triu_indices(len(markers), 1))
        known = np.linalg.norm(skeleton.marker_offsets[first] - skeleton.marker_offsets[second], axis=1)
        lengths = pair_lengths(positions, first, second)
        shown = (np.isfinite(lengths).sum(axis=1) >= LEAST_SEEN) & (known > 0.0)
        if shown.any():
            factors.append(float(np.median(median_of_known(lengths[shown].T) / known[shown])))
    factor = float(np.median(factors)) if factors else 1.0
    return SizeTest(factor, sum((one > 1.0) == (factor > 1.0) for one in factors), len(factors))


def span_means(local: Floats) -> Floats:
    """Return usual places in each span [mm], shape (n_spans, n_markers, 3), NaN where too little is seen.

    Parameters
    ----------
    local : ndarray, shape (n_frames, n_markers, 3), mm
        Markers in the frames of their limbs, NaN where unseen.
    """
    means = np.full((N_SPANS, *local.shape[1:]), np.nan)
    for span, part in enumerate(np.array_split(local, N_SPANS)):
        seen = ~np.isnan(part[:, :, 0])
        enough = seen.sum(axis=0) >= LEAST_SEEN
        if enough.any():
            means[span, enough] = np.nanmedian(part[:, enough], axis=0)
    return means


def place_errors(skeleton: Skeleton) -> Floats:
    """Return what a calibration leaves open of markers' places against the joints [mm^2], shape (n_markers, 3, 3).

    The covariances of the place on the limb and of all joints of the limb are added.
    """
    errors = np.zeros((len(skeleton.limb_of_marker), 3, 3))
    if skeleton.offset_std is not None:
        errors += np.nan_to_num(skeleton.offset_std)[:, np.newaxis] ** 2 * np.eye(3)
    for joint in skeleton.joints:
        for limb, covariance in ((joint.parent, joint.covariance), (joint.child, joint.covariance_in_child)):
            if covariance is not None:
                errors[skeleton.limb_of_marker == limb] += covariance
    return errors


def compare_places(before: Floats, after: Floats, errors: Floats) -> PlaceTest:
    """Test whether markers sit at the same places in two takes.

    Parameters
    ----------
    before, after : ndarray, shape (n_spans, n_markers, 3), mm
        From `span_means`.
    errors : ndarray, shape (n_markers, 3, 3), mm^2
        From `place_errors`.
    """
    n_markers = before.shape[1]
    shifts, p_values = np.full((n_markers, 3), np.nan), np.ones(n_markers)
    for marker in range(n_markers):
        samples = [means[:, marker][~np.isnan(means[:, marker, 0])] for means in (before, after)]
        if min(map(len, samples)) >= LEAST_SPANS:
            shifts[marker] = samples[1].mean(axis=0) - samples[0].mean(axis=0)
            parts = [np.cov(sample.T) / len(sample) + _RIDGE**2 * np.eye(3) for sample in samples]
            whole = parts[0] + parts[1]
            square = float(shifts[marker] @ np.linalg.solve(whole + errors[marker], shifts[marker]))
            spread = sum(_size(part) / (len(sample) - 1) for part, sample in zip(parts, samples, strict=True))
            freedom = max(_size(whole) / spread, 3.0)
            p_values[marker] = float(f_distribution.sf(square * (freedom - 2) / (3 * freedom), 3, freedom - 2))
    return PlaceTest(shifts, p_values)


def _size(matrix: Floats) -> float:
    return float(np.trace(matrix @ matrix) + np.trace(matrix) ** 2)


LEAST_VALUE = 1e-6
"""rad or mm: exact takes have none."""

HELD = 1e-3
"""rad; joints that keep so near to their types are held to them: the end of a limb then errs by parts of a mm."""


def with_joints_as_fitted(skeleton: Skeleton, motion: Motion) -> Skeleton:
    """Return a skeleton whose joints are ball joints where its own motion does not keep to their types.

    The fit of a skeleton names the type that is nearest, and holds a joint to it only if noise explains the rest.

    Parameters
    ----------
    skeleton : Skeleton
        With the types of joints.
    motion : Motion
        To which it was fitted.
    """
    off = _angles_off(skeleton, motion.world_from_limb).max(axis=0, initial=0.0)
    loose = [index for index in _bound_joints(skeleton) if off[skeleton.joints[index].child] > HELD]
    return with_free_joints(skeleton, tuple(loose))


def freer_joints(skeleton: Skeleton, before: SkeletonPoses, after: SkeletonPoses) -> tuple[int, ...]:
    """Find joints whose type does not hold in a new take.

    Parameters
    ----------
    skeleton : Skeleton
        With the types of joints.
    before, after : SkeletonPoses
        The calibrated and the new take, posed with all joints free.

    Returns
    -------
    tuple of int
        Indices of joints.
    """
    bound = _bound_joints(skeleton)
    angles = [_angles_off(skeleton, poses.world_from_limb) for poses in (before, after)]
    found = []
    for index in bound:
        child = skeleton.joints[index].child
        samples = [
            log_root_mean_squares(angle[:, child], poses.seen[:, child])
            for angle, poses in zip(angles, (before, after), strict=True)
        ]
        if min(map(len, samples)) >= LEAST_SPANS:
            p_value = float(ttest_ind(samples[1], samples[0], equal_var=False, alternative="greater").pvalue)
            if p_value < LEVEL / len(bound):
                found.append(index)
    return tuple(found)


def _bound_joints(skeleton: Skeleton) -> list[int]:
    """Indices of joints whose types allow fewer turns than a ball joint's."""
    return [index for index, joint in enumerate(skeleton.joints) if FREEDOMS[joint.kind] < FREEDOMS["ball"]]


def _angles_off(skeleton: Skeleton, world_from_limb: Floats) -> Floats:
    """Angles [rad] by which rotations of limbs differ from what the joints above allow, shape (n_frames, n_limbs)."""
    angles = np.zeros(world_from_limb.shape[:2])
    for root in skeleton.roots:
        tree = SkeletonTree(skeleton, int(root), None)
        free = world_from_limb[:, tree.limbs][..., :3, :3]
        held = tree.articulation.projected(tree.chain.parents, free)
        above = np.maximum(tree.chain.parents, 0)
        turns = [rotations[:, above].swapaxes(-1, -2) @ rotations for rotations in (held, free)]
        off = np.linalg.norm(vector_from_matrix(turns[0].swapaxes(-1, -2) @ turns[1]), axis=-1)
        angles[:, tree.limbs[1:]] = off[:, 1:]
    return angles


def log_root_mean_squares(values: Floats, seen: Bools) -> Floats:
    """Return logarithms of the root mean square in each span of a take that shows enough.

    Parameters
    ----------
    values : ndarray, shape (n_frames,)
        Angles [rad] or gaps [mm].
    seen : ndarray of bool, shape (n_frames,)
        Frames that count.
    """
    spans = zip(np.array_split(values, N_SPANS), np.array_split(seen, N_SPANS), strict=True)
    shown = [part[known] for part, known in spans if known.sum() >= LEAST_SEEN]
    return np.array([np.log(np.sqrt((part**2).mean()) + LEAST_VALUE) for part in shown])
