"""Fill gaps of markers from their limb, from joints, and from the frames around.

The limb's other markers, or its joints where these are too few, tell where the marker would be if the limb were rigid
(`helpers`). Skin moves, so the marker's own way off that place, after the part that the other markers' shape and the
bend of the joints explain, is bridged through the gap from what it was before and after (`bridging`). Where the limb
is not posed at all, the marker itself is bridged, in the frame of its parent limb or in the world.
"""

from __future__ import annotations

import numpy as np

from skelgen.errors import InputError
from skelgen.kinematics.bridging import bridge, fit_memory
from skelgen.kinematics.helpers import Helpers, explained_part, find_helpers, rigid_lead
from skelgen.model import Motion, Skeleton, Trajectories
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.filled import Filled, Source

_FEWEST_TOGETHER = 25  # frames in which a marker and its helpers are seen, to learn from
_FEWEST_KNOWN = 10  # frames in which a marker is seen, to tell how far it strays from them
_WORLD = -1


def fill_gaps(trajectories: Trajectories, skeleton: Skeleton, motion: Motion) -> Filled:
    """Fill the gaps of every marker.

    Parameters
    ----------
    trajectories : Trajectories
        The markers that the skeleton was fitted to.
    skeleton : Skeleton
        Limbs and joints.
    motion : Motion
        Their poses in every frame.

    Returns
    -------
    Filled
        Measured positions as they are, filled ones with source and standard deviation. Wherever three other markers
        pose the limb they are the source; elsewhere it is what has the smallest deviation: the limb with its joints,
        or interpolation. Markers that are never seen stay empty, and those seen in fewer than ten frames where their
        limb is not posed.

    Raises
    ------
    InputError
        If trajectories, skeleton and motion do not belong together.
    """
    if motion.marker_positions.shape != trajectories.positions.shape:
        raise InputError(
            f"the motion has {motion.marker_positions.shape[:2]} frames and markers and the take "
            f"{trajectories.positions.shape[:2]}: give the motion that was fitted to this take"
        )
    work = _Work(trajectories, skeleton, motion)
    for marker in np.flatnonzero(work.with_gaps).tolist():
        _interpolate(work, marker)
    for limb in range(skeleton.n_limbs):
        _fill_limb(work, limb)
    return Filled(trajectories, work.positions, work.source, work.std)


class _Work:
    """The arrays that are being filled; of two values for one place, the better one stays."""

    def __init__(self, trajectories: Trajectories, skeleton: Skeleton, motion: Motion) -> None:
        self.trajectories, self.skeleton, self.motion = trajectories, skeleton, motion
        self.seen = trajectories.seen
        self.with_gaps = np.asarray(self.seen.any(axis=0) & ~self.seen.all(axis=0))
        self.positions = trajectories.positions.copy()
        self.source = np.where(self.seen, Source.MEASURED, Source.NONE).astype(np.intp)
        self.std = np.where(self.seen, 0.0, np.nan)

    def put(self, marker: int, frames: Ints, world: Floats, std: Floats, source: Source) -> None:
        """Store filled values, those from the limb always and others where they are better than what is there."""
        old = self.std[frames, marker]
        better = np.isnan(old) | (std < old) | (source == Source.LIMB)
        frames = frames[better]
        self.positions[frames, marker] = world[better]
        self.std[frames, marker] = std[better]
        self.source[frames, marker] = source

    def put_local(self, marker: int, frames: Ints, limb: int, local: Floats, std: Floats, source: Source) -> None:
        """Store filled values given in a limb's frame [mm], shape (n_frames, 3)."""
        poses = self.motion.world_from_limb[frames, limb]
        world = poses[:, :3, 3] + np.einsum("fij,fj->fi", poses[:, :3, :3], local)
        self.put(marker, frames, world, std, source)


def _interpolate(work: _Work, marker: int) -> None:
    """Bridge a marker itself, in the world and in the frame of the parent limb where that is posed."""
    series, seen = work.trajectories.positions[:, marker], work.seen[:, marker]
    missing = np.flatnonzero(~seen)
    if seen.sum() < _FEWEST_KNOWN:
        return
    work.put(marker, missing, *bridge(series, seen, missing, fit_memory(series, seen)), Source.INTERPOLATED)
    limb = int(work.skeleton.limb_of_marker[marker])
    parent = int(work.skeleton.parents[limb]) if limb >= 0 else _WORLD
    if parent == _WORLD:
        return
    posed = work.motion.limb_seen[:, parent]
    frames = missing[posed[missing]]
    if (seen & posed).sum() < _FEWEST_KNOWN or len(frames) == 0:
        return
    poses = work.motion.world_from_limb[:, parent]
    local = np.einsum("fji,fj->fi", poses[:, :3, :3], series - poses[:, :3, 3])
    values, std = bridge(local, seen & posed, frames, fit_memory(local, seen & posed))
    work.put_local(marker, frames, parent, values, std, Source.INTERPOLATED)


def _fill_limb(work: _Work, limb: int) -> None:
    """Fill the markers of a limb, one set of helpers at a time, in frames in which the limb is posed."""
    markers = work.skeleton.markers_of(limb)
    if not work.with_gaps[markers].any():
        return
    helpers = find_helpers(work.trajectories, work.skeleton, work.motion, limb)
    for index in np.flatnonzero(work.with_gaps[markers]).tolist():
        marker = int(markers[index])
        frames = np.flatnonzero(~work.seen[:, marker] & work.motion.limb_seen[:, limb])
        usable = helpers.usable[frames]
        usable[:, index] = False
        enough = helpers.posed_by(usable)
        usable[enough, helpers.n_markers :] = False
        patterns, which = np.unique(usable, axis=0, return_inverse=True)
        for number, pattern in enumerate(patterns):
            of_pattern = which.ravel() == number
            source = Source.LIMB if enough[of_pattern][0] else Source.JOINT
            _fill_from(work, limb, (marker, index), helpers, pattern, frames[of_pattern], source)


def _fill_from(
    work: _Work,
    limb: int,
    which: tuple[int, int],
    helpers: Helpers,
    pattern: Bools,
    frames: Ints,
    source: Source,
) -> None:
    """Fill one marker, given by its index in the take and on the limb, in frames with the same helpers."""
    marker, index = which
    chosen, place = np.flatnonzero(pattern), helpers.places[index]
    rigid = helpers.errors[:, chosen].reshape(len(work.seen), -1) @ rigid_lead(helpers, place, chosen).T
    together = helpers.usable[:, chosen].all(axis=1) & helpers.usable[:, index]
    if together.sum() < _FEWEST_TOGETHER:  # too few to learn from: the place on the limb, with the marker's deviation
        std = np.full(len(frames), work.skeleton.marker_std[marker])
        work.put_local(marker, frames, limb, place + rigid[frames], std, source)
        return
    series = helpers.errors[:, index] - rigid
    explained, inflation = explained_part(helpers, chosen, series, together)
    rest = series - explained
    values, std = bridge(rest, together, frames, fit_memory(rest, together))
    local = place + (rigid + explained)[frames] + values
    work.put_local(marker, frames, limb, local, inflation * std, source)
