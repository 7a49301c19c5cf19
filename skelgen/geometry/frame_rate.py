"""Whole takes and projects at another frame rate, to be written: other programs play at 24, 30 or 60 frames per second.

Between two frames positions go straight and rotations turn evenly (slerp); of a skeleton the root's position and every
limb's turn against its parent, so that joints neither open nor leave their axes. What was not seen in one of the two
frames is not seen between them. A change of the rate smooths nothing; `smoothed` does: a low-pass filter of the paths
of markers, which leaves their phase as it is.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from skelgen.errors import InputError
from skelgen.geometry.rotations import matrix_from_vector, transform_from, vector_from_matrix
from skelgen.model import Motion, PointCloud, Project, Skeleton, Take, Trajectories
from skelgen.model.arrays import Floats, Ints
from skelgen.model.filled import Filled, PositionSource
from skelgen.model.joint_spans import JointSpan
from skelgen.model.labelling import seen_runs

AS_RECORDED_RATE = 0.0
"""The rate that leaves frames as they are."""

MOST_FRAMES = 2_000_000
"""Frames that a higher rate may make of a take: some hours at what programs play; more is a slip of the keyboard."""

_ON_A_FRAME = 1e-6  # of a frame: nearer than this the frame itself is taken, to its last digit


class _Between(NamedTuple):
    """For each new frame: the old ones around it, shape (n,), equal where it falls on one; the part of the way."""

    before: Ints
    after: Ints
    part: Floats


def n_frames_at(n_frames: int, recorded: float, rate: float) -> int:
    """Return how many frames at another rate lie within a take.

    Parameters
    ----------
    n_frames : int
        Frames of the take.
    recorded : float, Hz
        Its rate.
    rate : float, Hz
        The rate asked for; `AS_RECORDED_RATE` for that of the take.
    """
    if rate == AS_RECORDED_RATE or n_frames == 0:
        return n_frames
    return int((n_frames - 1) * rate / recorded + _ON_A_FRAME) + 1


def with_rate(value: Project | Take | Filled, rate: float) -> Project | Take | Filled:
    """Return a take or a project at another frame rate; the first frame stays the first.

    Parameters
    ----------
    value : Project, PointCloud, Trajectories, Poses or Filled
        Points without labels stay as they are, since nothing connects them; a project loses how sure its labels are,
        which a notice says of the recorded frames.
    rate : float, Hz
        The rate asked for; `AS_RECORDED_RATE` returns the value as it is.

    Raises
    ------
    InputError
        If the rate is negative or not finite, or makes more frames than `MOST_FRAMES`.
    """
    if not (np.isfinite(rate) and rate >= 0):
        raise InputError(f"a frame rate of {rate:g} Hz; it must be above 0, or 0 for that of the recording")
    if rate == AS_RECORDED_RATE:
        return value
    if isinstance(value, Project):
        return _project(value, rate)
    if isinstance(value, Filled):
        return _filled(value, rate)
    return _take(value, rate)


def transforms_at_rate(transforms: Floats, recorded: float, rate: float) -> Floats:
    """Return transforms at another frame rate; the first frame stays the first.

    Parameters
    ----------
    transforms : ndarray, shape (n_frames, ..., 4, 4), mm
        One set per frame.
    recorded : float, Hz
        Their rate.
    rate : float, Hz
        The rate asked for.

    Raises
    ------
    InputError
        If the rate makes more frames than `MOST_FRAMES`.
    """
    return _rigid(transforms, _between(len(transforms), recorded, rate))


def vectors_at_rate(vectors: Floats, recorded: float, rate: float) -> Floats:
    """Return vectors at another frame rate; see `transforms_at_rate`.

    Parameters
    ----------
    vectors : ndarray, shape (n_frames, ...)
        One set per frame, in any unit.
    recorded : float, Hz
        Their rate.
    rate : float, Hz
        The rate asked for.
    """
    return _line(vectors, _between(len(vectors), recorded, rate))


def _project(project: Project, rate: float) -> Project:
    take = _take(project.take, rate)
    changes: dict[str, Any] = {"take": take, "_labelling": None}
    if project.has("labels"):
        is_take = project.trajectories is project.take
        changes["_trajectories"] = take if is_take else _markers(project.trajectories, rate)
    if project.has("joints"):
        topology = project.topology
        at = _between(len(topology.raw_joint_positions), project.trajectories.rate, rate)
        raw, factor = _line(topology.raw_joint_positions, at), rate / project.trajectories.rate
        spans = tuple(_span_at(span, factor, len(raw) - 1) for span in topology.spans)
        changes["_topology"] = replace(topology, raw_joint_positions=raw, spans=spans)
    if project.has("skeleton"):
        changes["_motion"] = _motion(project.motion, project.skeleton, changes["_trajectories"], rate)
    return replace(project, **changes)


def _span_at(span: JointSpan, factor: float, last: int) -> JointSpan:
    first_frame, last_frame = (min(round(factor * frame), last) for frame in (span.first_frame, span.last_frame))
    return replace(span, first_frame=first_frame, last_frame=last_frame)


def _take(take: Take, rate: float) -> Take:
    if isinstance(take, PointCloud):
        return take
    if isinstance(take, Trajectories):
        return _markers(take, rate)
    at = _between(take.n_frames, take.rate, rate)
    return replace(take, world_from_body=_rigid(take.world_from_body, at), rate=rate)


def _markers(markers: Trajectories, rate: float) -> Trajectories:
    at = _between(markers.n_frames, markers.rate, rate)
    return replace(markers, positions=_line(markers.positions, at), rate=rate)


def _filled(filled: Filled, rate: float) -> Filled:
    """Positions between a measured and a filled one are filled; their deviations go straight, too, which is no less."""
    at = _between(filled.measured.n_frames, filled.measured.rate, rate)
    source = np.maximum(filled.source[at.before], filled.source[at.after])
    positions = np.where((source == PositionSource.NONE)[..., np.newaxis], np.nan, _line(filled.positions, at))
    return Filled(_markers(filled.measured, rate), positions, source, _line(filled.std, at))


def _motion(motion: Motion, skeleton: Skeleton, measured: Trajectories, rate: float) -> Motion:
    at = _between(motion.n_frames, motion.rate, rate)
    poses = np.empty((len(at.part), *motion.world_from_limb.shape[1:]))
    for limb in skeleton.outward.tolist():
        parent = int(skeleton.parents[limb])
        if parent < 0:
            poses[:, limb] = _rigid(motion.world_from_limb[:, limb], at)
        else:
            turn = _rigid(_inverse(motion.world_from_limb[:, parent]) @ motion.world_from_limb[:, limb], at)
            poses[:, limb] = poses[:, parent] @ turn
    parents = np.array([joint.parent for joint in skeleton.joints], dtype=np.intp)
    markers = _carried(motion, motion.marker_positions, skeleton.limb_of_marker, poses, at)
    joints = _carried(motion, motion.joint_positions, parents, poses, at)
    residuals = np.linalg.norm(measured.positions - markers, axis=2)
    seen = motion.limb_seen[at.before] & motion.limb_seen[at.after]
    std = None if motion.joint_std is None else _line(motion.joint_std, at)
    return Motion(poses, joints, markers, residuals, seen, rate, std)


def _carried(motion: Motion, places: Floats, limbs: Ints, poses: Floats, at: _Between) -> Floats:
    """Places [mm], shape (n_frames, n, 3), that limbs carry along, between frames; a limb of -1 has none."""
    old = motion.world_from_limb[:, limbs]
    on_limb = (old[..., :3, :3].swapaxes(-1, -2) @ (places - old[..., :3, 3])[..., np.newaxis])[..., 0]
    new = poses[:, limbs]
    carried = (new[..., :3, :3] @ _line(on_limb, at)[..., np.newaxis])[..., 0] + new[..., :3, 3]
    return np.asarray(np.where((limbs >= 0)[:, np.newaxis], carried, np.nan))


def _between(n_frames: int, recorded: float, rate: float) -> _Between:
    wanted = n_frames_at(n_frames, recorded, rate)
    if wanted > max(MOST_FRAMES, n_frames):
        raise InputError(f"{rate:g} Hz make {wanted} frames of {n_frames}; more than {MOST_FRAMES} are not written")
    place = np.arange(wanted) * recorded / rate
    near = np.rint(place)
    place = np.where(np.abs(place - near) < _ON_A_FRAME, near, place)
    before = np.floor(place).astype(np.intp)
    return _Between(before, np.ceil(place).astype(np.intp), place - before)


def _line(values: Floats, at: _Between) -> Floats:
    part = at.part.reshape(-1, *([1] * (values.ndim - 1)))
    return np.asarray((1 - part) * values[at.before] + part * values[at.after])


def _rigid(transforms: Floats, at: _Between) -> Floats:
    """Transforms, shape (n_frames, ..., 4, 4), between frames: translations go straight, rotations by slerp."""
    first, second = transforms[at.before, ..., :3, :3], transforms[at.after, ..., :3, :3]
    part = at.part.reshape(-1, *([1] * (transforms.ndim - 2)))
    turned = first @ matrix_from_vector(vector_from_matrix(first.swapaxes(-1, -2) @ second) * part)
    rotations = np.where(part[..., np.newaxis] > 0, turned, first)
    return transform_from(rotations, _line(transforms[..., :3, 3], at))


def _inverse(transforms: Floats) -> Floats:
    back = transforms[..., :3, :3].swapaxes(-1, -2)
    return transform_from(back, -(back @ transforms[..., :3, 3, np.newaxis])[..., 0])


_ORDER = 2  # of the filter, which runs forward and back: fourth order in all


def smoothed(positions: Floats, rate: float, cutoff: float) -> Floats:
    """Filter a path by a Butterworth low-pass of fourth order, forward and back, each stretch between gaps by itself.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, 3), mm
        The path; NaN where unseen, which stays. Stretches too short for the filter stay as they are.
    rate : float, Hz
        Frames per second.
    cutoff : float, Hz
        Frequency at which half of the power passes; below half of the rate.

    References
    ----------
    Winter, Biomechanics and Motor Control of Human Movement, 4th edition 2009, section 2.2.4.
    """
    if not 0 < cutoff < rate / 2:
        raise InputError(f"smoothing at {cutoff:g} Hz; take more than 0 and less than half of the take's {rate:g} Hz")
    from scipy.signal import butter, filtfilt  # noqa: PLC0415 - heavy

    single = cutoff / (2**0.5 - 1) ** (1 / (2 * _ORDER))  # each of both passes lets more through
    if single >= rate / 2:
        raise InputError(f"smoothing at {cutoff:g} Hz needs more than the {rate:g} Hz of the take; choose a lower one")
    numerator, denominator = butter(_ORDER, single, fs=rate)
    pad = 3 * max(len(numerator), len(denominator))
    found = np.array(positions)
    _, starts, ends = seen_runs(~np.isnan(found[:, :1]))
    for first, last in zip(starts.tolist(), ends.tolist(), strict=True):
        if last - first + 1 > pad:
            found[first : last + 1] = filtfilt(numerator, denominator, found[first : last + 1], axis=0, padlen=pad)
    return found
