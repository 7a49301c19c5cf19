"""Place the joints of the tree in all frames, those of long takes block by block.

Which limbs are joined is told by part of a long take; of the frames between, no more than a block is looked at at once.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from skelgen.kinematics.bodies.shape import LimbShape
from skelgen.model import Limbs
from skelgen.model.arrays import Floats, Ints
from skelgen.model.topology import outward_order
from skelgen.progress import SILENT, Monitor
from skelgen.stages.joints.pairs import JointGuess, guess_joint
from skelgen.stages.joints.parameters import JointParameters
from skelgen.stages.joints.segments import ENOUGH_FRAMES, Segment, make_segment, typical_variance

POSE_POINTS = 3
"""Points that fix a pose, where a limb has as many."""

BLOCK_FRAMES = 16_384
"""Frames that are looked at at once: the poses of all limbs take 2 KB each. Takes up to this length are one block."""

THIN_FRAMES = 6_000
"""Frames of longer takes that tell the tree, beside those that show limbs which these hardly show."""


def tracks_of_limbs(positions: Floats, limbs: Limbs, parameters: JointParameters) -> list[Floats]:
    """Return each limb's markers in the frames that tell the tree: all, or of a long take some that are spread."""
    markers = [limbs.markers_of(limb) for limb in range(limbs.n_limbs)]
    if len(positions) <= BLOCK_FRAMES:
        return [positions[:, own] for own in markers]
    seen = ~np.isnan(positions[:, :, 0])
    chosen = [np.linspace(0, len(positions) - 1, THIN_FRAMES).astype(np.intp)]
    for own in markers:
        shows = np.flatnonzero(seen[:, own].sum(axis=1) >= min(len(own), POSE_POINTS))
        chosen.append(spread(shows, int(parameters.samples)))
    frames = np.unique(np.concatenate(chosen))
    return [positions[np.ix_(frames, own)] for own in markers]


def sample_frames(n_frames: int, parameters: JointParameters) -> Ints:
    """Return frames at which all pairs of limbs are tried, rising."""
    step = parameters.sampling or max(1.0, n_frames / parameters.samples)
    return np.unique(np.arange(0, n_frames, step).astype(np.intp).clip(max=n_frames - 1))  # rounding may reach the end


def telling_frames(track: Floats, frames: Ints) -> Ints:
    """Return sampled frames, or, where they hardly show a limb, as many of all frames that do."""
    enough = min(track.shape[1], POSE_POINTS)
    shows = (~np.isnan(track[:, :, 0])).sum(axis=1) >= enough
    if shows[frames].sum() >= min(ENOUGH_FRAMES, shows.sum()):
        return frames
    return spread(np.flatnonzero(shows), len(frames))


def spread(frames: Ints, most: int) -> Ints:
    """Return at most so many of the frames, evenly."""
    return frames[np.unique(np.linspace(0, len(frames) - 1, most).astype(np.intp))] if len(frames) > most else frames


def place_in_blocks(
    positions: Floats, limbs: Limbs, parents: Ints, parameters: JointParameters, seed: int, monitor: Monitor
) -> Floats:
    """Place the joints of a tree in all frames of a long take, shape (n_frames, n_joints, 3), mm.

    Each block tells its own shapes and joints. Parameters are those of `place_joints` and the take's positions.
    """
    n_frames = len(positions)
    children = outward_order(parents)[(parents < 0).sum() :]
    raw = np.empty((n_frames, len(children), 3))
    ends = np.linspace(0, n_frames, -(-n_frames // BLOCK_FRAMES) + 1).astype(np.intp)
    for first, last in pairwise(ends.tolist()):
        block = positions[first:last]
        frames = sample_frames(len(block), parameters)
        tracks = [block[:, limbs.markers_of(limb)] for limb in range(limbs.n_limbs)]
        segments = [make_segment(track, telling_frames(track, frames)) for track in tracks]
        kept, _ = place_joints(segments, frames, parents, parameters, seed, SILENT)
        raw[first:last] = stacked([kept[int(child)] for child in children], len(block))
        monitor.advance(last, n_frames)
    raw.flags.writeable = False
    return raw


def place_joints(
    segments: list[Segment], frames: Ints, parents: Ints, parameters: JointParameters, seed: int, monitor: Monitor
) -> tuple[dict[int, JointGuess], list[Segment]]:
    """Place the joints of the tree in all frames of some segments, those between limbs with poses first.

    Points that hardly turn about a joint lie on a sphere of any size. A joint that comes out farther from its markers
    than all markers are from each other is placed anew by the joint cost, which pulls it towards them.

    Parameters
    ----------
    segments : list of Segment
        Of all limbs.
    frames : ndarray of intp
        Those that tell the shapes of limbs which gain a joint.
    parents : ndarray of intp, shape (n_limbs,)
        The tree, -1 for roots.
    parameters : JointParameters
        How.
    seed : int
        Seed of the annealing jitter.
    monitor : Monitor
        Told of progress.

    Returns
    -------
    tuple of dict of int to JointGuess and list of Segment
        Joints by child limb, and all limbs with the joints that give them poses.
    """
    segments = list(segments)
    typical = typical_variance(segment.noise for segment in segments)
    reach, pulled = _extent(segments, frames), replace(parameters, solver="conjugate-gradient")
    waiting = [int(child) for child in np.flatnonzero(parents >= 0)]
    n_joints = len(waiting)
    kept: dict[int, JointGuess] = {}
    while waiting:
        waiting.sort(key=lambda child: -_known(segments[child].shape) - _known(segments[parents[child]].shape))
        child = waiting.pop(0)
        pair = (int(parents[child]), child)
        first, second = segments[pair[0]], segments[pair[1]]
        kept[child] = guess_joint(first, second, typical, parameters.alpha_final, parameters, seed)
        if kept[child].distance > reach:
            kept[child] = guess_joint(first, second, typical, parameters.alpha, pulled, seed)
        for limb in pair:
            if segments[limb].lacks_poses:
                segments[limb] = segments[limb].with_joint(kept[child].positions, frames)
        monitor.advance(len(kept), n_joints)
    return kept, segments


def _extent(segments: list[Segment], frames: Ints) -> float:
    """Usual diagonal of the box around all markers [mm]."""
    markers = np.concatenate([segment.markers[frames] for segment in segments], axis=1)
    seen = ~np.isnan(markers[:, :, :1])
    shown = seen.any(axis=(1, 2))
    if not shown.any():
        return np.inf
    highest = np.where(seen, markers, -np.inf)[shown].max(axis=1)
    lowest = np.where(seen, markers, np.inf)[shown].min(axis=1)
    return float(np.median(np.linalg.norm(highest - lowest, axis=1)))


def _known(shape: LimbShape) -> int:
    return int(shape.posed.sum() >= ENOUGH_FRAMES) + int(shape.has_pose)


def stacked(guesses: list[JointGuess], n_frames: int) -> Floats:
    """Return the positions of joints side by side, shape (n_frames, n_joints, 3), mm."""
    return np.stack([one.positions for one in guesses], axis=1) if guesses else np.zeros((n_frames, 0, 3))
