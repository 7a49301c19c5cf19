"""A skeleton fitted to remembered poses, in a thread beside the running tracker.

The fit takes about a second. Its result is used a fixed number of frames later, so that the same frames give the same
labels, however fast the machine is.
"""

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from skelgen.errors import InputError
from skelgen.geometry.orientation import fit_transform
from skelgen.model import Skeleton, Trajectories
from skelgen.model.arrays import Floats, Ints
from skelgen.stages.joints import JointParameters, find_joints
from skelgen.stages.labels.online.pose_filter import PoseFilter, PosePrediction
from skelgen.stages.limbs import find_limbs
from skelgen.stages.skeleton import SkeletonParameters, fit_skeleton

FIRST_SECONDS, LAG_SECONDS = 3.0, 1.0
"""s until the first fit, when all joints have moved a little; and s from the begin of a fit to its use."""

GROWTH = 2.0
"""Each fit begins when the session is so many times as long as at the one before: fits become rare."""

LEAST_POSES = 20
"""Poses that a fit needs, and a marker in it."""

JOINT_SAMPLES = 60
"""Poses at which pairs of limbs are tried: so many that poses alone tell a joint, without spheres about each limb."""

UNKNOWN_STEPS = 10
"""Frames of motion that may lie between a pose composed limb by limb and the fitted one."""


class Learner:
    """Fits skeletons when it is time, and keeps the last one."""

    def __init__(self) -> None:
        self._next = FIRST_SECONDS
        self._due = np.inf
        self._future: Future[Skeleton | None] | None = None
        self._labels: Ints = np.empty(0, dtype=np.intp)

    def begin(self, poses: Floats, labels: Ints, now: float) -> None:
        """Begin a fit if it is time.

        Parameters
        ----------
        poses : ndarray, shape (n_poses, n_markers, 3), mm
            Markers in some frames, NaN where unseen.
        labels : ndarray of intp, shape (n_markers,)
            Their labels.
        now : float, s
            Time since the tracker began.
        """
        if now < self._next or self._future is not None:
            return
        self._next = GROWTH * now
        often = (~np.isnan(poses[:, :, 0])).sum(axis=0) >= LEAST_POSES
        if len(poses) < LEAST_POSES or not often.any():
            return
        pool = ThreadPoolExecutor(max_workers=1, thread_name_prefix="skelgen-tracker")
        self._future = pool.submit(_fit_skeleton_to, poses[:, often].copy())
        pool.shutdown(wait=False)
        self._labels, self._due = labels[often], now + LAG_SECONDS

    def result(self, now: float) -> tuple[Skeleton, Ints] | None:
        """The skeleton and the labels of its markers once, when the fit is due; None otherwise or without a limb."""
        if self._future is None or now < self._due:
            return None
        skeleton, self._future = self._future.result(), None
        return None if skeleton is None else (skeleton, self._labels)


def _fit_skeleton_to(poses: Floats) -> Skeleton | None:
    """Fit a skeleton to poses, shape (n_poses, n_markers, 3) [mm]; None if they show no limb."""
    names = tuple(str(index) for index in range(poses.shape[1]))
    try:
        markers = Trajectories(poses, names, 1.0)
        limbs = find_limbs(markers)
        topology = find_joints(markers, limbs, JointParameters(samples=JOINT_SAMPLES))
        skeleton, _ = fit_skeleton(markers, limbs, topology, SkeletonParameters(fit="root-outward"))
    except (InputError, np.linalg.LinAlgError):  # poses too poor for a skeleton; the tracker goes on without
        return None
    return skeleton


@dataclass(frozen=True, eq=False)
class LearnedPose:
    """The pose of a learned skeleton, followed frame by frame.

    Attributes
    ----------
    pose : PoseFilter
        The pose.
    labels : ndarray of intp, shape (n_markers,)
        Label of each of its markers.
    """

    pose: PoseFilter
    labels: Ints

    def start(self, points: Floats, labels: Ints) -> bool:
        """Start at the pose of labelled points; False if they do not show any limb.

        Parameters
        ----------
        points : ndarray, shape (n, 3), mm
            The frame.
        labels : ndarray of intp, shape (n,)
            Label of each point, -1 for none.
        """
        rotations = np.full((self.pose.n_limbs, 3, 3), np.nan)
        origins = np.full((self.pose.n_limbs, 3), np.nan)
        markers = self.markers_of(labels)
        limb_of_point = np.where(markers >= 0, self.pose.limb[markers], -1)
        for limb in range(self.pose.n_limbs):
            own = limb_of_point == limb
            if own.sum() >= 3:
                seen = np.ones(int(own.sum()), dtype=np.bool_)
                limb_pose = fit_transform(self.pose.offsets[markers[own]], points[own], seen)
                rotations[limb], origins[limb] = limb_pose[:3, :3], limb_pose[:3, 3]
        if np.isnan(origins).all():
            return False
        self.pose.set_pose(rotations, origins)
        self.follow(points, labels, UNKNOWN_STEPS)
        return True

    def follow(self, points: Floats, labels: Ints, n_steps: int) -> PosePrediction:
        """Follow the pose into a frame, and predict all markers.

        Parameters
        ----------
        points : ndarray, shape (n, 3), mm
            The frame.
        labels : ndarray of intp, shape (n,)
            Label of each point, -1 for none.
        n_steps : int
            Frame periods since the frame before.
        """
        markers = self.markers_of(labels)
        is_known = markers >= 0
        before = self.pose.rotations, self.pose.origins
        self.pose.advance(n_steps)
        prediction = self.pose.fit(points[is_known], markers[is_known])
        self.pose.learn_motion(*before, n_steps)
        return prediction

    def markers_of(self, labels: Ints) -> Ints:
        """Marker that a limb carries for each label, -1 for none; `labels` has shape (n,)."""
        is_marker = (labels[:, np.newaxis] == self.labels) & self.pose.carried
        return np.where(is_marker.any(axis=1), is_marker.argmax(axis=1), -1)
