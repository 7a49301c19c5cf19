"""A project in one frame, as arrays to draw.

Rows are taken when a frame is shown: opening a project costs nothing.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from skelgen.app.drawing.poses import Bones, MarkerState, find_bones, find_views, middle_of, place_markers
from skelgen.kinematics.inverse.inverse_kinematics import posture_of
from skelgen.model import PointCloud, Poses, Project, Trajectories
from skelgen.model.arrays import Bools, Floats, Ints, spread_frames
from skelgen_gui.model.view_state import MAGNIFICATIONS
from skelgen_gui.model.viewpoint import level_axes

_SAMPLES = 300  # frames that determine where a take lies and how large it is

_TRAIL_SAMPLES = 90  # points of a trail at most: more would lie within the same pixels

_OUTLIERS = 1.0  # percent of positions on each side that may lie outside the box: ghost points lie anywhere
_PAD = 0.05  # of the box, so that all others are inside

_UNCERTAIN_SAMPLES = 20
_ELLIPSOID = 0.04  # of the size of what is seen: half an axis of a typical ellipsoid
_NO_POINTS = np.zeros((0, 3))
_NO_BODIES = np.zeros((0, 4, 4))
_NO_INTS = np.zeros(0, dtype=np.intp)

_BLOCK = 64  # frames whose covariances are derived at once: takes hardly longer than one, some ms

_MOST_BLOCKS = 4  # that are kept: what is shown, and what is played into


State = MarkerState


@dataclass(frozen=True, eq=False)
class Snapshot:
    """One frame. Lengths in mm; NaN where something is unknown.

    Attributes
    ----------
    frame : int
        Its number.
    markers : ndarray, shape (n_markers, 3)
        Measured positions, or those on the skeleton.
    state : ndarray of intp, shape (n_markers,)
        A `State` for each.
    unlabelled : ndarray, shape (n_points, 3)
        All points of an unlabelled take, those of markers included; bodies before the first stage.
    joints : ndarray, shape (n_joints, 3)
        Joints.
    covariances : ndarray, shape (n_joints, 3, 3), mm^2
        Of the joints' places along the world's axes.
    bones : ndarray, shape (n_bones, 2, 3)
        Both ends of each bone.
    axes : ndarray, shape (n_axes, 2, 3)
        Joint and unit direction of each axis of hinges and universal joints.
    bodies : ndarray, shape (n_bodies, 4, 4)
        Poses of a take of bodies.
    """

    frame: int
    markers: Floats
    state: Ints
    unlabelled: Floats
    joints: Floats
    covariances: Floats
    bones: Floats
    axes: Floats
    bodies: Floats


class Scene:
    """A project, frame by frame.

    Parameters
    ----------
    project : Project
        Whatever stages have run.
    """

    def __init__(self, project: Project) -> None:
        self.project = project
        labelled = project.trajectories if project.has("labels") else project.take
        self.trajectories = labelled if isinstance(labelled, Trajectories) else None
        self.n_frames = project.take.n_frames
        self.names = self.trajectories.names if self.trajectories is not None else ()
        self.n_markers = len(self.names)
        self._block = lru_cache(_MOST_BLOCKS)(self._covariances_of_block)

    @cached_property
    def limb_of_marker(self) -> Ints:
        """Limb of each marker, -1 where it has none, or none yet; shape (n_markers,)."""
        if not self.project.has("limbs"):
            return np.full(self.n_markers, -1, dtype=np.intp)
        return np.asarray(self.project.limbs.limb_of_marker)

    @cached_property
    def bones(self) -> Bones:
        """Lines that make the bones; before the joints stage each limb is a star about its middle."""
        edges = self.project.topology.edges if self.project.has("joints") else np.zeros((0, 2), dtype=np.intp)
        return find_bones(edges, self.limb_of_marker)

    @cached_property
    def open_joints(self) -> frozenset[int]:
        """Joints whose place the motion does not determine, hinges along their axes among them."""
        joints = self.project.skeleton.joints if self.project.has("skeleton") else ()
        return frozenset(index for index, joint in enumerate(joints) if not joint.is_fully_determined)

    @cached_property
    def sample(self) -> Floats:
        """Positions in some frames spread over the take, shape (n_samples, n, 3); NaN where there are none."""
        frames = spread_frames(self.n_frames, _SAMPLES)
        take = self.project.take
        if isinstance(take, Trajectories):
            return np.asarray(take.positions[frames])
        rows = [self._points(int(frame)) for frame in frames]
        sample = np.full((len(rows), max((len(row) for row in rows), default=0), 3), np.nan)
        for index, row in enumerate(rows):
            sample[index, : len(row)] = row
        return sample

    @cached_property
    def inliers(self) -> Floats:
        """Positions of the sample without outliers, shape (n, 3)."""
        points = self.sample.reshape(-1, 3)
        points = points[~np.isnan(points[:, 0])]
        if not len(points):
            return points
        low, high = np.percentile(points, [_OUTLIERS, 100 - _OUTLIERS], axis=0)
        pad = _PAD * (high - low)
        return np.asarray(points[((points >= low - pad) & (points <= high + pad)).all(axis=1)])

    @cached_property
    def skeleton_sample(self) -> Floats:
        """Joints in some frames of the take, shape (n, 3), but none farther from all markers than the body is large."""
        if not self.project.has("skeleton") or not len(self.inliers):
            return _NO_POINTS
        frames = spread_frames(self.n_frames, _SAMPLES)
        points = np.asarray(self.project.motion.joint_positions[frames]).reshape(-1, 3)
        low, high = self.inliers.min(axis=0) - self.size, self.inliers.max(axis=0) + self.size
        return np.asarray(points[((points >= low) & (points <= high)).all(axis=1)])

    def nearest_place(self, marker: int, frame: int) -> Floats:
        """Return where a marker is in a frame [mm], or where it is seen next in time; NaN if it never is.

        Parameters
        ----------
        marker, frame : int
            Their indices.
        """
        place = np.asarray(self._markers(frame)[0][marker])
        if self.trajectories is None or not np.isnan(place[0]):
            return place
        seen = np.flatnonzero(self.trajectories.seen[:, marker])
        nearest = seen[np.abs(seen - frame).argmin()] if len(seen) else frame
        return np.asarray(self.trajectories.positions[nearest, marker])

    @cached_property
    def spans(self) -> Floats:
        """Extent along each axis [mm] of what is seen in a typical frame, shape (3,)."""
        known = self.sample[(~np.isnan(self.sample[..., 0])).any(axis=1)]
        if not len(known):
            return np.zeros(3)
        spans = np.fmax.reduce(known, axis=1) - np.fmin.reduce(known, axis=1)
        return np.asarray(np.median(spans, axis=0))

    @property
    def size(self) -> float:
        """Diagonal [mm] of what is seen in a typical frame."""
        return float(np.linalg.norm(self.spans))

    @cached_property
    def up(self) -> int:
        """The axis that points up: what is lowest moves least along it; 2 if nothing is seen."""
        points = self.sample.reshape(-1, 3)
        points = points[~np.isnan(points[:, 0])][: self.sample.shape[1]]
        return int(np.argmax(find_views(points, self.sample)[0].up)) if len(points) else 2

    def front(self, up: int) -> float:
        """Azimuth [rad] of a viewer before the wider side, along an axis, where an axis points up."""
        first, second = level_axes(up)
        return -math.pi / 2 if self.spans[first] > self.spans[second] else 0.0

    @cached_property
    def magnification(self) -> int:
        """Half axes of ellipsoids in standard deviations, so that most of them have a good size."""
        frames = spread_frames(self.n_frames, _UNCERTAIN_SAMPLES)
        variances = np.linalg.eigvalsh(joint_covariances(self.project, frames))[..., -1].ravel()
        if not len(variances):
            return MAGNIFICATIONS[0]
        most = _ELLIPSOID * self.size / max(float(np.sqrt(np.median(variances))), 1e-9)
        return max((step for step in MAGNIFICATIONS if step <= most), default=MAGNIFICATIONS[0])

    def at(self, frame: int) -> Snapshot:
        """Return what is there in a frame.

        Parameters
        ----------
        frame : int
            From 0, within the take.
        """
        markers, state = self._markers(frame)
        joints = self._joints(frame)
        take = self.project.take
        is_labelled = self.trajectories is not None and not isinstance(take, PointCloud)
        return Snapshot(
            frame,
            markers,
            state,
            _NO_POINTS if is_labelled else self._points(frame),
            joints,
            self._block(frame // _BLOCK)[frame % _BLOCK],
            self.bones.place(joints, markers),
            self._axes(frame),
            take.world_from_body[frame] if isinstance(take, Poses) else _NO_BODIES,
        )

    def is_hidden(self, hidden: frozenset[str]) -> tuple[Bools, Bools]:
        """Return which markers are hidden, and which limbs, because all of their markers are.

        Parameters
        ----------
        hidden : frozenset of str
            Names of markers.

        Returns
        -------
        markers, limbs : ndarray of bool, shapes (n_markers,) and (n_limbs,)
        """
        markers = np.array([name in hidden for name in self.names], dtype=np.bool_)
        shown = np.bincount(self.limb_of_marker[~markers & (self.limb_of_marker >= 0)])
        limbs = np.ones(int(self.limb_of_marker.max(initial=-1)) + 1, dtype=np.bool_)
        limbs[np.flatnonzero(shown)] = False
        return markers, limbs

    def without(self, snapshot: Snapshot, hidden: frozenset[str]) -> Snapshot:
        """Return a frame without hidden markers, and without limbs whose markers are all hidden.

        Parameters
        ----------
        snapshot : Snapshot
            The frame.
        hidden : frozenset of str
            Names of markers.
        """
        if not hidden:
            return snapshot
        gone, limbs = self.is_hidden(hidden)
        edges = self.project.topology.edges if len(snapshot.joints) else np.zeros((0, 2), dtype=np.intp)
        joints: Bools = np.all(limbs[edges], axis=1)
        return replace(
            snapshot,
            markers=_without(snapshot.markers, gone),
            joints=_without(snapshot.joints, joints),
            bones=_without(snapshot.bones, limbs[self.bones.limb]),
            axes=_without(snapshot.axes, joints[self.axis_joints]) if len(snapshot.axes) else snapshot.axes,
        )

    def middle(self, frame: int) -> Floats:
        """Return the middle of a frame: of its joints, or else of what is seen; NaN if that is nothing.

        Parameters
        ----------
        frame : int
            From 0, within the take.
        """
        joints = self._joints(frame) if self.project.has("skeleton") else _NO_POINTS
        return middle_of(joints if len(joints) else self._points(frame))

    def trail(self, frame: int, seconds: float) -> Floats:
        """Return where the markers were until a frame, at frames that stay the same while it moves on.

        Parameters
        ----------
        frame : int
            From 0.
        seconds : float, s
            Length of the trail.

        Returns
        -------
        ndarray, shape (n_steps, n_markers, 3), mm
            The frame itself last; NaN where unseen.
        """
        if self.trajectories is None:
            return np.zeros((0, self.n_markers, 3))
        return np.asarray(self.trajectories.positions[[*self._frames_before(frame, seconds), frame]])

    def past_points(self, frame: int, seconds: float) -> Floats:
        """Return all points of a take that has no markers yet, from some time [s] before a frame on, shape (n, 3).

        Parameters
        ----------
        frame : int
            From 0.
        seconds : float, s
            How far back.
        """
        if self.trajectories is not None:
            return _NO_POINTS
        return np.concatenate([_NO_POINTS, *(self._points(earlier) for earlier in self._frames_before(frame, seconds))])

    def _frames_before(self, frame: int, seconds: float) -> range:
        """Frames before one, at most `_TRAIL_SAMPLES`, that stay the same while it moves on."""
        length = max(round(seconds * self.project.take.rate), 1)
        stride = -(-length // _TRAIL_SAMPLES)
        first = max(frame - length, 0)
        return range(-(-first // stride) * stride, frame, stride)

    def _points(self, frame: int) -> Floats:
        take = self.project.take
        if isinstance(take, PointCloud):
            return take.frame(frame)
        return take.world_from_body[frame, :, :3, 3] if isinstance(take, Poses) else take.positions[frame]

    def _markers(self, frame: int) -> tuple[Floats, Ints]:
        """Measured markers, where unseen those on the skeleton, and the state of each."""
        if self.trajectories is None:
            return _NO_POINTS, _NO_INTS
        markers, state = place_markers(self.project, self.trajectories, slice(frame, frame + 1))
        return markers[0], state[0]

    def _covariances_of_block(self, number: int) -> Floats:
        frames = np.arange(number * _BLOCK, min((number + 1) * _BLOCK, self.n_frames))
        return joint_covariances(self.project, frames)

    def _joints(self, frame: int) -> Floats:
        if self.project.has("skeleton"):
            return np.asarray(self.project.motion.joint_positions[frame])
        if self.project.has("joints"):
            return np.asarray(self.project.topology.raw_joint_positions[frame])
        return _NO_POINTS

    @cached_property
    def axis_joints(self) -> Ints:
        """The joint of each axis of `Snapshot.axes`."""
        return np.array([joint for joint, _, _ in self._limb_axes], dtype=np.intp)

    @cached_property
    def _limb_axes(self) -> list[tuple[int, int, Floats]]:
        """Joint, limb, and direction in the limb's frame, of each axis."""
        joints = self.project.skeleton.joints if self.project.has("skeleton") else ()
        held = [(index, joint.parent, joint.axis) for index, joint in enumerate(joints)]
        held += [(index, joint.child, joint.second_axis) for index, joint in enumerate(joints)]
        return [(index, limb, axis) for index, limb, axis in held if axis is not None]

    def _axes(self, frame: int) -> Floats:
        if not self._limb_axes:
            return np.zeros((0, 2, 3))
        motion = self.project.motion
        directions = [motion.world_from_limb[frame, limb, :3, :3] @ axis for _, limb, axis in self._limb_axes]
        return np.stack([motion.joint_positions[frame, self.axis_joints], directions], axis=1)


def _without(values: Floats, gone: Bools) -> Floats:
    return np.where(np.reshape(gone, (-1, *[1] * (values.ndim - 1))), np.nan, values)


def joint_covariances(project: Project, frames: Ints) -> Floats:
    """Return the covariances of the joints' places along the world's axes.

    Parameters
    ----------
    project : Project
        A project with a skeleton, or without: then there are none.
    frames : ndarray of intp, shape (n,)
        From 0.

    Returns
    -------
    ndarray, shape (n, n_joints, 3, 3), mm^2
        With the variances of the motion where it has them, otherwise from the skeleton, turned with the parents.
    """
    if not project.has("skeleton"):
        return np.zeros((len(frames), 0, 3, 3))
    motion = project.motion
    if motion.joint_std is None:
        turns = motion.world_from_limb[frames][:, [joint.parent for joint in project.skeleton.joints], :3, :3]
        own = [joint.place_covariance for joint in project.skeleton.joints]
        return np.asarray(turns @ np.reshape(own, (-1, 3, 3)) @ turns.swapaxes(2, 3))
    posture = posture_of(project.skeleton, motion, project.trajectories.positions, frames)
    std = motion.joint_std[frames] / np.maximum(posture.joint_std, np.finfo(float).tiny)
    return np.asarray(std[..., np.newaxis] * posture.joint_covariances * std[..., np.newaxis, :])
