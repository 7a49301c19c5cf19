"""Long takes: limbs, joints and axes from frames that are spread over the take, then poses of all frames by block.

Time is linear in frames, and beside what is measured and what is found no more than a block is held.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from skelgen.geometry.orientation import ROTATORS
from skelgen.geometry.rotations import (
    matrix_from_quaternion,
    matrix_from_vector,
    quaternion_from_matrix,
    vector_from_matrix,
)
from skelgen.kinematics.chain.chain import ChainPoses
from skelgen.kinematics.inverse.posed_motion import PosedMotion
from skelgen.model import Limbs, Skeleton, Topology, Trajectories
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.progress import Monitor
from skelgen.stages.skeleton.assembly import Body, cut_out
from skelgen.stages.skeleton.fitting import FittedBody
from skelgen.stages.skeleton.loops import all_poses
from skelgen.stages.skeleton.parameters import SkeletonParameters
from skelgen.stages.skeleton.posing import posed_with_care, without_outliers

LONGEST_AT_ONCE = 16_384
"""Frames; a take of forty markers needs some 10 KB for each while it is fitted."""

TELLING_FRAMES = 6_000
"""Frames of longer takes that tell limbs and joints, beside those that show limbs which these hardly show."""

FRAMES_OF_LIMB = 300
"""Frames that show most of each limb are among them, if there are as many."""

BLOCK_FRAMES = 8_192
MARGIN = 400
"""Frames on both sides of a block that are posed with it: what is not seen at its ends is interpolated as elsewhere."""


def telling_frames(trajectories: Trajectories, limbs: Limbs) -> Ints:
    """Return the frames from which limbs and joints are told: all, or of a long take some that are spread."""
    n_frames = trajectories.n_frames
    if n_frames <= LONGEST_AT_ONCE:
        return np.arange(n_frames)
    chosen = [np.linspace(0, n_frames - 1, TELLING_FRAMES).astype(np.intp)]
    seen = ~np.isnan(trajectories.positions[:, :, 0])
    for limb in range(limbs.n_limbs):
        own = limbs.markers_of(limb)
        shows = np.flatnonzero(seen[:, own].sum(axis=1) >= len(own) - 1)
        chosen.append(shows[np.unique(np.linspace(0, max(len(shows) - 1, 0), FRAMES_OF_LIMB).astype(np.intp))])
    return np.unique(np.concatenate(chosen))


def at_frames(trajectories: Trajectories, topology: Topology, frames: Ints | slice) -> tuple[Trajectories, Topology]:
    """Return markers and raw joints in some frames."""
    if not isinstance(frames, slice) and len(frames) == trajectories.n_frames:
        return trajectories, topology
    some = replace(trajectories, positions=trajectories.positions[frames])
    return some, replace(topology, raw_joint_positions=topology.raw_joint_positions[frames])


SETTLING = 2
"""Times that slides of markers are taken off and limbs posed: slides follow the poses, and poses the slides."""


@dataclass(frozen=True, eq=False)
class Playback:
    """A skeleton in all frames of a long take.

    Attributes
    ----------
    motion : PosedMotion
        Its poses.
    n_outliers : ndarray of intp, shape (n_markers,)
        Positions of each marker that were left out.
    """

    motion: PosedMotion
    n_outliers: Ints


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
    trajectories: Trajectories,
    limbs: Limbs,
    topology: Topology,
    parameters: SkeletonParameters,
    telling: Ints,
    monitor: Monitor,
) -> Playback:
    """Pose a skeleton in all frames of a long take.

    Parameters
    ----------
    fitted : list of FittedBody
        Its trees, as the telling frames tell them.
    skeleton : Skeleton
        Made of them.
    trajectories, limbs, topology
        The whole take.
    parameters : SkeletonParameters
        How.
    telling : ndarray of intp
        The telling frames: the deviations of others are those of the nearest.
    monitor : Monitor
        Told of progress.
    """
    n_frames = trajectories.n_frames
    found = _Found(n_frames, skeleton.n_limbs, trajectories.n_markers)
    for wide, inner, part in _blocks(n_frames):
        some, there = at_frames(trajectories, topology, wide)
        for one, root in zip(fitted, topology.roots.tolist(), strict=True):
            _pose_block(one, cut_out(some, limbs, there, root), parameters, found, inner, part)
        monitor.advance(part.stop, n_frames)
    for one in fitted:
        present = ~np.isnan(trajectories.positions[:, one.body.markers, 0]).all(axis=1)
        _fill_absence(one, np.asarray(present), found)
    motion = PosedMotion(
        skeleton,
        _frozen(found.orientations),
        _frozen(found.origins),
        trajectories.positions,
        found.seen,
        trajectories.rate,
        _frozen(_deviations(fitted, skeleton, telling, n_frames)),
    )
    return Playback(motion, found.n_outliers)


def _blocks(n_frames: int) -> Iterator[tuple[slice, slice, slice]]:
    """Frames with margin, which of these are the block's, and the block's frames in the take."""
    ends = np.linspace(0, n_frames, -(-n_frames // BLOCK_FRAMES) + 1).astype(np.intp)
    for first, last in pairwise(ends.tolist()):
        start = max(first - MARGIN, 0)
        yield slice(start, min(last + MARGIN, n_frames)), slice(first - start, last - start), slice(first, last)


def _pose_block(
    one: FittedBody, body: Body, parameters: SkeletonParameters, found: _Found, inner: slice, part: slice
) -> None:
    """Pose one tree in a block, and note what is found in the frames of the block without its margins."""
    chain = one.chain
    trusted, poses, posed = without_outliers(body, chain, parameters, ROTATORS[parameters.rotation])
    if parameters.fit == "whole-chain":
        articulation = one.errors.articulation.turned(chain.parents, one.turn)
        start = ChainPoses(poses.root, articulation.projected(chain.parents, poses.rotations))
        poses = posed_with_care(chain, one.rings, start, trusted, articulation, posed)
        if one.skin is not None:
            for _ in range(SETTLING):
                still = trusted - one.skin.displacements(chain, poses)
                poses = all_poses(chain, one.rings, poses, still, articulation)
    poses = poses[inner]
    found.orientations[part, body.limbs] = quaternion_from_matrix(poses.rotations)
    found.origins[part, body.limbs] = poses.origins(chain)
    found.seen[part, body.limbs] = posed[inner]
    left_out = np.isnan(trusted[inner, :, 0]) & ~np.isnan(body.positions[inner, :, 0])
    found.n_outliers[body.markers] += left_out.sum(axis=0)


def _fill_absence(one: FittedBody, present: Bools, found: _Found) -> None:
    """Interpolate a body where none of its markers is seen for longer than a margin, from the ends of the absence."""
    edges = np.flatnonzero(np.diff(np.concatenate([[True], present, [True]]).astype(np.int8)))
    limbs = one.body.limbs
    for first, last in edges.reshape(-1, 2).tolist():
        if last - first <= MARGIN:
            continue
        before, after = max(first - 1, 0), min(last, len(present) - 1)
        ends = np.array([before if first > 0 else after, after if last < len(present) else before])
        turns = matrix_from_quaternion(found.orientations[np.ix_(ends, limbs)])
        way = vector_from_matrix(turns[0].swapaxes(1, 2) @ turns[1])
        for start in range(first, last, BLOCK_FRAMES):
            part = slice(start, min(start + BLOCK_FRAMES, last))
            share = (np.arange(part.start, part.stop) - before) / max(after - before, 1)
            rotations = turns[0] @ matrix_from_vector(share[:, np.newaxis, np.newaxis] * way)
            root = (1 - share[:, np.newaxis]) * found.origins[ends[0], limbs[0]]
            root += share[:, np.newaxis] * found.origins[ends[1], limbs[0]]
            found.orientations[part, limbs] = quaternion_from_matrix(rotations)
            found.origins[part, limbs] = ChainPoses(root, rotations).origins(one.chain)


def _deviations(fitted: list[FittedBody], skeleton: Skeleton, telling: Ints, n_frames: int) -> Floats:
    """Standard deviations of the joints, of frames between telling ones those of the nearest."""
    nearest = np.searchsorted((telling[1:] + telling[:-1]) / 2, np.arange(n_frames))
    by_limb = np.zeros((len(telling), skeleton.n_limbs, 3))
    for one in fitted:
        by_limb[:, one.body.limbs] = one.deviations
    return np.asarray(by_limb[:, [joint.child for joint in skeleton.joints]][nearest])


def _frozen(array: Floats) -> Floats:
    array.flags.writeable = False
    return array
