"""Long takes: limbs, joints and axes from frames that are spread over the take, then poses of all frames by block.

Time is linear in frames. Memory holds what is measured, what is found, and one block.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from skelgen.geometry.rotations import (
    matrix_from_quaternion,
    matrix_from_vector,
    quaternion_from_matrix,
    vector_from_matrix,
)
from skelgen.kinematics.chain.chain import ChainPoses
from skelgen.kinematics.inverse.motion import PosedMotion
from skelgen.model import Skeleton
from skelgen.model.arrays import Bools, Floats, Ints, evenly_spread, read_only, runs_of
from skelgen.progress import Monitor
from skelgen.stages.skeleton.assembly import BodyOfTake, StructuredTake
from skelgen.stages.skeleton.fitting import FittedBody
from skelgen.stages.skeleton.parameters import SkeletonParameters
from skelgen.stages.skeleton.posing import without_outliers

LONGEST_AT_ONCE = 16_384
"""Frames; a take of forty markers needs some 10 KB for each while it is fitted."""

THIN_FRAMES = 6_000
"""Frames of a longer take that are fitted; frames of limbs that these hardly show are added."""

FRAMES_OF_LIMB = 300
"""Of the fitted frames, at least so many show most of each limb, if the take has as many."""

BLOCK_FRAMES = 8_192
MARGIN = 400
"""Frames on both sides of a block that are posed with it: what is not seen at its ends is interpolated as elsewhere."""


TISSUE_ROUNDS = 2
"""Rounds in which slides of markers are taken off and limbs are posed again: each depends on the other."""


@dataclass(frozen=True, eq=False)
class Playback:
    """A skeleton in all frames of a long take.

    Attributes
    ----------
    motion : PosedMotion
        Its poses.
    n_outliers : ndarray of intp, shape (n_markers,)
        Number of positions of each marker that were left out.
    """

    motion: PosedMotion
    n_outliers: Ints


def fitted_frames(take: StructuredTake) -> Ints:
    """Return the frames to which limbs and joints are fitted: all, or of a long take some that are spread over it."""
    n_frames = take.trajectories.n_frames
    if n_frames <= LONGEST_AT_ONCE:
        return np.arange(n_frames)
    chosen = [np.linspace(0, n_frames - 1, THIN_FRAMES).astype(np.intp)]
    seen = take.trajectories.seen
    for limb in range(take.limbs.n_limbs):
        own = take.limbs.markers_of(limb)
        chosen.append(evenly_spread(np.flatnonzero(seen[:, own].sum(axis=1) >= len(own) - 1), FRAMES_OF_LIMB))
    return np.unique(np.concatenate(chosen))


class _Found:
    """What is filled block by block."""

    def __init__(self, n_frames: int, n_limbs: int, n_markers: int) -> None:
        self.orientations = np.empty((n_frames, n_limbs, 4))
        self.origins = np.empty((n_frames, n_limbs, 3))
        self.seen = np.zeros((n_frames, n_limbs), dtype=bool)
        self.n_outliers = np.zeros(n_markers, dtype=np.intp)


def play_back(
    fitted: list[FittedBody],
    skeleton: Skeleton,
    take: StructuredTake,
    frames: Ints,
    parameters: SkeletonParameters,
    monitor: Monitor,
) -> Playback:
    """Pose a skeleton in all frames of a long take.

    Parameters
    ----------
    fitted : list of FittedBody
        Its trees.
    skeleton : Skeleton
        Made of them.
    take : StructuredTake
        The whole take.
    frames : ndarray of intp
        Frames to which the trees were fitted: the deviations of others are those of the nearest.
    parameters : SkeletonParameters
        How.
    monitor : Monitor
        Receives progress.
    """
    trajectories = take.trajectories
    n_frames = trajectories.n_frames
    found = _Found(n_frames, skeleton.n_limbs, trajectories.n_markers)
    for wide, inner, part in _blocks(n_frames):
        for one, body in zip(fitted, take.at(wide).bodies(), strict=True):
            _pose_block(one, body, parameters, found, inner, part)
        monitor.advance(part.stop, n_frames)
    for one in fitted:
        present = ~np.isnan(trajectories.positions[:, one.body.markers, 0]).all(axis=1)
        _fill_absence(one, np.asarray(present), found)
    deviations = read_only(_deviations(fitted, skeleton, frames, n_frames))
    orientations, origins = read_only(found.orientations), read_only(found.origins)
    motion = PosedMotion(skeleton, orientations, origins, trajectories, found.seen, deviations)
    return Playback(motion, found.n_outliers)


def _blocks(n_frames: int) -> Iterator[tuple[slice, slice, slice]]:
    """Frames with margin, which of these are the block's, and the block's frames in the take."""
    ends = np.linspace(0, n_frames, -(-n_frames // BLOCK_FRAMES) + 1).astype(np.intp)
    for first, last in pairwise(ends.tolist()):
        start = max(first - MARGIN, 0)
        yield slice(start, min(last + MARGIN, n_frames)), slice(first - start, last - start), slice(first, last)


def _pose_block(
    one: FittedBody, body: BodyOfTake, parameters: SkeletonParameters, found: _Found, inner: slice, part: slice
) -> None:
    """Pose one tree in a block, and keep what is found in the frames of the block without its margins."""
    inliers, poses, fixed = without_outliers(body, one.chain, parameters)
    if parameters.fit == "whole-chain":
        held = one.constrained
        poses = held.fit_in_time(held.projected(poses), inliers, fixed)
        if one.tissue is not None:
            for _ in range(TISSUE_ROUNDS):
                poses = held.fit(poses, inliers - one.tissue.displacements(held.chain, poses))
    poses = poses[inner]
    found.orientations[part, body.limbs] = quaternion_from_matrix(poses.rotations)
    found.origins[part, body.limbs] = poses.origins(one.chain)
    found.seen[part, body.limbs] = fixed[inner]
    left_out = np.isnan(inliers[inner, :, 0]) & ~np.isnan(body.positions[inner, :, 0])
    found.n_outliers[body.markers] += left_out.sum(axis=0)


def _fill_absence(one: FittedBody, present: Bools, found: _Found) -> None:
    """Interpolate a body where none of its markers is seen for longer than a margin, from the ends of the absence."""
    limbs = one.body.limbs
    for first, last in runs_of(~present):
        if last - first <= MARGIN:
            continue
        before, after = max(first - 1, 0), min(last, len(present) - 1)
        ends = np.array([before if first > 0 else after, after if last < len(present) else before])
        at_ends = matrix_from_quaternion(found.orientations[np.ix_(ends, limbs)])
        between = vector_from_matrix(at_ends[0].swapaxes(1, 2) @ at_ends[1])
        for start in range(first, last, BLOCK_FRAMES):
            part = slice(start, min(start + BLOCK_FRAMES, last))
            share = (np.arange(part.start, part.stop) - before) / max(after - before, 1)
            rotations = at_ends[0] @ matrix_from_vector(share[:, np.newaxis, np.newaxis] * between)
            root = (1 - share[:, np.newaxis]) * found.origins[ends[0], limbs[0]]
            root += share[:, np.newaxis] * found.origins[ends[1], limbs[0]]
            found.orientations[part, limbs] = quaternion_from_matrix(rotations)
            found.origins[part, limbs] = ChainPoses(root, rotations).origins(one.chain)


def _deviations(fitted: list[FittedBody], skeleton: Skeleton, frames: Ints, n_frames: int) -> Floats:
    """Standard deviations of the joints; frames between those that were fitted have those of the nearest."""
    nearest = np.searchsorted((frames[1:] + frames[:-1]) / 2, np.arange(n_frames))
    by_limb = np.zeros((len(frames), skeleton.n_limbs, 3))
    for one in fitted:
        by_limb[:, one.body.limbs] = one.deviations
    return np.asarray(by_limb[:, [joint.child for joint in skeleton.joints]][nearest])
