"""Poses of a chain in all frames: without positions that cannot be right, and the likelier of two in ambiguous frames.

A limb whose parents are placed can reach only a sphere around its joint: a position that is much nearer to the joint or
farther from it than the marker's place on the limb is an error, whatever its size. What is left is compared with the
fitted limb, and at last with the fit of the whole chain.

Least squares in a frame end in the minimum next to the start, and where markers are unseen the closed form may start
beside the wrong one: an arm that shows one marker too few may bend to either side. Such frames are posed again from a
start interpolated between the determined frames around them, limb by limb against the parent. The likelier pose is
kept; where both are about as likely, the one that follows in time.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from skelgen.geometry.rotations import fill_rotations
from skelgen.geometry.statistics import SIGMA_OF_MEDIAN, lengths_of, median_of_known
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses, observed, residuals, seen_weights
from skelgen.kinematics.inverse.loop_closure import KinematicLoops, fit_closed_poses
from skelgen.kinematics.inverse.poses import fit_poses
from skelgen.kinematics.inverse.root_outward import KnownJoints, pose_outward
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.skeleton.assembly import BodyOfTake
from skelgen.stages.skeleton.parameters import SkeletonParameters

LEAST_PART = 0.02
"""Of the markers' typical distance from the joint: less than this is no gross error, however exact the take."""

SQUARE_OF_MEDIAN = 2.366
"""Median of the squared length of a normal vector of deviation 1 along three axes."""

GENTLE = 2.0
"""Deviations at which Cauchy's weights are a half: noise keeps most of its weight."""

LEAST_TYPICAL = 1e-60
"""mm; least typical deviation of a marker: of one that fits exactly in half of the frames it would be 0."""

REWEIGHTINGS = 6
STEPS_BETWEEN = 2
"""Steps of the poses after each new weights: enough to follow."""

LARGE_ROTATION = 0.1
"""rad: a limb that is nearer to its interpolated rotation is not ambiguous."""

ABOUT_AS_LIKELY = 9.21
"""Twice the logarithm of the ratio of two likelihoods, 100 to 1, from which on the frame's own markers decide."""


@dataclass(frozen=True, eq=False)
class ConstrainedChain:
    """A chain with what holds its limbs together.

    Attributes
    ----------
    chain : Chain
        The limbs.
    articulation : Articulation
        What the joints allow.
    loops : KinematicLoops, optional
        Joints that close loops.
    """

    chain: Chain
    articulation: Articulation
    loops: KinematicLoops | None = None

    def projected(self, poses: ChainPoses) -> ChainPoses:
        """Return poses that the joints allow, near to given ones."""
        return ChainPoses(poses.root, self.articulation.projected(self.chain.parents, poses.rotations))

    def fit(self, start: ChainPoses, positions: Floats) -> ChainPoses:
        """Fit poses to markers in all frames, loops closed.

        Parameters
        ----------
        start : ChainPoses
            Where to begin.
        positions : ndarray, shape (n_frames, n_markers, 3), mm
            Measured markers, NaN where unseen.
        """
        if self.loops is None or not self.loops.n_loops:
            return fit_poses(self.chain, start, positions, self.articulation)
        return fit_closed_poses(observed(self.chain, self.articulation, start, positions), self.loops)

    def fit_in_time(self, start: ChainPoses, positions: Floats, fixed: Bools) -> ChainPoses:
        """Fit poses to markers in successive frames, and ambiguous frames twice.

        Parameters
        ----------
        start : ChainPoses
            Where to begin.
        positions : ndarray, shape (n_frames, n_markers, 3), mm
            Measured markers, NaN where unseen.
        fixed : ndarray of bool, shape (n_frames, n_limbs)
            Whether points of the frame fix each rotation of the start.
        """
        poses = self.fit(start, positions)
        interpolated, frames = _ambiguous(self.chain, poses, fixed)
        if not len(frames):
            return poses
        again = self.fit(self.projected(ChainPoses(poses.root[frames], interpolated)), positions[frames])
        before, after = (_squares(self.chain, one, positions[frames]) for one in (poses[frames], again))
        # Mean square of a coordinate's residual [mm^2] in frames that fix all limbs
        whole: Bools = np.asarray(fixed.all(axis=1))
        if not whole.any():
            whole = np.ones(len(fixed), dtype=np.bool_)
        count = 3 * int((~np.isnan(positions[whole, :, 0])).sum())
        variance = float(_squares(self.chain, poses[whole], positions[whole]).sum()) / max(count, 1)
        better = after <= before + ABOUT_AS_LIKELY * variance
        poses.root[frames[better]], poses.rotations[frames[better]] = again.root[better], again.rotations[better]
        return poses


def without_outliers(
    body: BodyOfTake, chain: Chain, parameters: SkeletonParameters, held: Articulation | None = None
) -> tuple[Floats, ChainPoses, Bools]:
    """Pose a body from the root outward, and leave positions out that cannot be right.

    Parameters
    ----------
    body : BodyOfTake
        The measured markers and raw joints.
    chain : Chain
        Its limbs.
    parameters : SkeletonParameters
        Their `outlier_limit`, `rotation` and `flatness`.
    held : Articulation, optional
        What the joints allow: axes of hinges help where a limb's points do not fix its rotation.

    Returns
    -------
    tuple of ndarray, ChainPoses and ndarray of bool, shape (n_frames, n_limbs)
        Positions with NaN for outliers [mm], shape (n_frames, n_markers, 3), poses that rest on them, and whether
        points of the frame fix each rotation.
    """
    inliers, rotator, flatness = body.positions, parameters.rotator, parameters.flatness
    joints = None if held is None else KnownJoints(held)
    pose = partial(pose_outward, chain, joints=joints, rotator=rotator, flatness=flatness)
    poses, fixed = pose(inliers, body.raw_joints)
    for find in (_out_of_reach, _out_of_place):
        outliers = find(chain, poses, fixed, inliers, parameters.outlier_limit)
        if outliers.any():
            inliers = np.where(outliers[..., np.newaxis], np.nan, inliers)
            poses, fixed = pose(inliers, body.raw_joints)
    return inliers, poses, fixed


def out_of_line(held: ConstrainedChain, poses: ChainPoses, positions: Floats, factor: float) -> Bools:
    """Find positions that a fit of the whole chain does not explain.

    One wrong position draws its limb off the others. So frames with large residuals are fitted again with Cauchy's
    weights, which are small for what is far off, before residuals are compared with the limit (Huber and Ronchetti
    2009, *Robust Statistics*, 7).

    Parameters
    ----------
    held : ConstrainedChain
        The fitted limbs; loops may open.
    poses : ChainPoses
        The fitted poses.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        What they were fitted to, NaN where unseen.
    factor : float
        Standard deviations of a coordinate beyond which a position is an outlier.

    Returns
    -------
    ndarray of bool, shape (n_frames, n_markers)
    """
    chain = held.chain
    distance = _distances(chain, poses, positions)
    typical = _typical(np.where(np.isnan(positions[:, :, 0]), np.nan, distance), 1 / np.sqrt(SQUARE_OF_MEDIAN))
    limit = np.maximum(factor * typical, _least_outlier(chain))
    far = distance > limit
    frames = np.flatnonzero(far.any(axis=1))
    if not len(frames):
        return far
    some, measured = poses[frames], positions[frames]
    for _ in range(REWEIGHTINGS):
        ratio = _distances(chain, some, measured) / np.maximum(GENTLE * typical, LEAST_TYPICAL)
        weights = seen_weights(measured, 1 / (1 + ratio**2))
        some = fit_poses(chain, some, measured, held.articulation, weights, STEPS_BETWEEN)
    far[frames] = _distances(chain, some, measured) > limit
    return far


def _distances(chain: Chain, poses: ChainPoses, positions: Floats) -> Floats:
    return lengths_of(residuals(chain, poses, positions))


def _out_of_reach(chain: Chain, poses: ChainPoses, fixed: Bools, positions: Floats, factor: float) -> Bools:
    """Positions that no rotation of their limb explains: `factor` deviations off the sphere around its joint."""
    limb = chain.limb_of_marker
    origins = poses.origins(chain)[:, limb]
    radius = np.linalg.norm(chain.offsets, axis=1)
    off_sphere = np.abs(lengths_of(positions - origins) - radius)
    counts = _parents_fixed(chain, fixed)[:, limb] & (chain.parents[limb] >= 0)
    return _beyond(off_sphere, counts, factor, _least_outlier(chain))


def _out_of_place(chain: Chain, poses: ChainPoses, fixed: Bools, positions: Floats, factor: float) -> Bools:
    """Positions far off their place on a posed limb, only the worst of each limb in each frame.

    One wrong position draws the limb off the others: they are compared when it is gone.
    """
    limb = chain.limb_of_marker
    off_place = lengths_of(positions - poses.markers(chain))
    counts = (_parents_fixed(chain, fixed) & fixed)[:, limb]
    far = _beyond(off_place, counts, factor, _least_outlier(chain))
    known = np.where(np.isnan(off_place), -np.inf, off_place)
    for one in range(chain.n_limbs):
        own = np.flatnonzero(limb == one)
        far[:, own] &= known[:, own] == known[:, own].max(axis=1, keepdims=True)
    return far


def _least_outlier(chain: Chain) -> float:
    """Distance [mm] below which no position is an outlier."""
    return LEAST_PART * float(np.sqrt((chain.offsets**2).sum(axis=1).mean()))


def _parents_fixed(chain: Chain, fixed: Bools) -> Bools:
    """Whether all limbs from the root to a limb's parent are fixed, shape (n_frames, n_limbs)."""
    placed = np.ones_like(fixed)
    for limb in range(1, chain.n_limbs):
        parent = chain.parents[limb]
        placed[:, limb] = placed[:, parent] & fixed[:, parent]
    return placed


def _beyond(deviation: Floats, counts: Bools, factor: float, limit: float) -> Bools:
    """Deviations beyond `factor` typical ones of their marker, or of all markers where those are larger."""
    known = np.where(counts & ~np.isnan(deviation), deviation, np.nan)
    if np.isnan(known).all():
        return np.zeros(deviation.shape, dtype=bool)
    return np.nan_to_num(known) > np.maximum(factor * _typical(known, SIGMA_OF_MEDIAN), limit)


def _typical(values: Floats, scale: float) -> Floats:
    """Median of each marker's values times `scale`, of all markers where that is larger, shape (n_markers,)."""
    seen = ~np.isnan(values).all(axis=0)
    typical = np.zeros(values.shape[1])
    if seen.any():
        typical[seen] = median_of_known(values[:, seen]) * scale
        typical = np.maximum(typical, np.median(typical[seen]))
    return typical


def _ambiguous(chain: Chain, poses: ChainPoses, fixed: Bools) -> tuple[Floats, Ints]:
    """Rotations interpolated in time where a frame does not fix them, and the frames where that makes a difference."""
    certain = _certain(chain, fixed)
    differs = np.zeros(len(fixed), dtype=bool)
    interpolated = poses.rotations.copy()
    for limb in range(chain.n_limbs):
        parent = int(chain.parents[limb])
        above = poses.rotations[:, parent].swapaxes(1, 2) if parent >= 0 else np.eye(3)
        own = above @ poses.rotations[:, limb]
        filled = fill_rotations(own, certain[:, limb]) if certain[:, limb].any() else own
        trace = np.einsum("fij,fij->f", own, filled)  # of the rotation between both
        differs |= trace < 1 + 2 * np.cos(LARGE_ROTATION)
        interpolated[:, limb] = interpolated[:, parent] @ filled if parent >= 0 else filled
    frames = np.flatnonzero(differs)
    return interpolated[frames], frames


def _certain(chain: Chain, fixed: Bools) -> Bools:
    """Limbs that a frame fixes together with their parents and children."""
    certain = fixed.copy()
    for limb in range(1, chain.n_limbs):
        parent = int(chain.parents[limb])
        certain[:, limb] &= fixed[:, parent]
        certain[:, parent] &= fixed[:, limb]
    return certain


def _squares(chain: Chain, poses: ChainPoses, positions: Floats) -> Floats:
    return np.asarray((residuals(chain, poses, positions) ** 2).sum(axis=(1, 2)))
