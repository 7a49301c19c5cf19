r"""The pose of a skeleton, followed frame by frame like a Kalman filter.

Limbs are rigid bodies that joints hold together like stiff springs. In each frame the small motions :math:`\delta_l` of
all limbs minimise

.. math::
    \sum_m \frac{|x_m - T_{l(m)} q_m|^2}{\sigma_m^2}
    + \sum_j \frac{|T_{p(j)} a_j - T_{c(j)} b_j|^2}{\sigma_j^2}
    + \sum_j \frac{|\omega_{c(j)} - \omega_{p(j)}|^2}{s_j^2},

the squared residuals of markers, joints and relative rotations, by a few Gauss-Newton steps with robust weights. By the
last sum a limb that shows no marker keeps its angle to the parent; the variance :math:`s_j^2` grows while nothing is
seen. The inverse of the normal matrix gives the covariance of each predicted marker. Joints that close loops are left
out: what remains is a tree, which is solved in a time that grows with the number of limbs.
"""

from dataclasses import dataclass

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels.spring_joints import (
    LimbPoses,
    SeenMarkers,
    SpringBody,
    Springs,
    fit_poses,
    move_limbs,
    predict_markers,
)
from skelgen._kernels.tree_equations import N_FREEDOMS, NormalEquations, Tree
from skelgen.model import Skeleton
from skelgen.model.arrays import Bools, Floats, Ints

ROBUST = 4.0
"""A marker that deviates by so many standard deviations has lost three quarters of its weight."""

LEAST_DEVIATION = 0.005
"""Of the typical distance of markers from the joint: deviations are no smaller, however exact the skeleton is."""

JOINT_SHARE = 0.5
"""Deviation of a joint, in those of a typical marker: joints are fitted to many frames and markers."""

DAMPING = 0.8
"""Part of the last rotation and step that is predicted to continue; with 1, unseen limbs would rotate on and on."""

TURN_NOISE = 0.06
"""rad per frame, standard deviation of the random walk of an unseen angle: 6 rad/s at 100 Hz."""

MOST_SPREAD = 1.0
"""rad; largest standard deviation of an unseen angle, about half of what joints allow."""

ROUNDING = 1e-12
"""Part of a covariance that rounding leaves nothing of."""

ROOT_STRAY = 200.0
"""mm, and rad over the size of a typical limb, that a root may deviate in a frame from its predicted motion."""


@dataclass(frozen=True, eq=False)
class PosePrediction:
    """Predicted markers.

    Attributes
    ----------
    positions : ndarray, shape (n_markers, 3), mm
        Most likely places; NaN for markers that no limb carries.
    covariances : ndarray, shape (n_markers, 3, 3), mm^2
        How far a measured point may lie from there, the marker's own deviation included.
    """

    positions: Floats
    covariances: Floats


class PoseFilter:
    """Poses of a skeleton's limbs, from frame to frame.

    Parameters
    ----------
    skeleton : Skeleton
        Rigid limbs and their joints.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        self.n_limbs, self.n_markers = skeleton.n_limbs, len(skeleton.limb_of_marker)
        self.carried: Bools = skeleton.limb_of_marker >= 0
        self.limb: Ints = np.maximum(skeleton.limb_of_marker, 0)
        self.offsets: Floats = np.where(self.carried[:, np.newaxis], skeleton.marker_offsets, 0.0)
        self.parents: Ints = np.array([joint.parent for joint in skeleton.joints], dtype=np.intp)
        self.children: Ints = np.array([joint.child for joint in skeleton.joints], dtype=np.intp)
        self.at_parent = _rows([joint.position_in_parent for joint in skeleton.joints])
        self.at_child = _rows([joint.position_in_child for joint in skeleton.joints])
        self.roots: Ints = skeleton.roots
        self.reference: Floats = np.array(skeleton.reference_pose)
        # [mm], of a typical limb
        self.size = float(np.sqrt((self.offsets[self.carried] ** 2).sum(axis=1).mean())) or 1.0
        # Deviation of each marker per coordinate [mm], not below the median one
        known = np.where(self.carried, skeleton.marker_std, np.nan)
        usual = float(np.nanmedian(known)) if self.carried.any() else 0.0
        self.deviation = np.maximum(np.nan_to_num(known), max(usual, LEAST_DEVIATION * self.size))
        self.joint_deviation = JOINT_SHARE * float(np.median(self.deviation))
        joints = np.stack([self.parents, self.children], axis=1)
        places = np.concatenate([self.at_parent, self.at_child], axis=1)
        limbs, offsets, variances, places = contiguous(self.limb, self.offsets, self.deviation**2, places)
        self._body = SpringBody(limbs, offsets, variances, Tree(*contiguous(self.roots, joints)), places)
        self._prior = np.zeros((self.n_limbs, N_FREEDOMS))
        self._prior[self.roots] = np.repeat([(self.size / ROOT_STRAY) ** 2, ROOT_STRAY**-2], 3)
        block = (N_FREEDOMS, N_FREEDOMS)
        of_limbs, of_joints = (self.n_limbs, *block), (len(places), *block)
        self._room = NormalEquations(*map(np.empty, (of_limbs, of_joints, self._prior.shape, of_limbs)))
        self.rotations: Floats = self.reference[:, :3, :3].copy()
        self.origins: Floats = self.reference[:, :3, 3].copy()
        self._steps: Floats = np.zeros((self.n_limbs, N_FREEDOMS))  # rotation vector and shift per frame
        self._spread: Floats = np.full(len(self.children), MOST_SPREAD**2)
        self._seen_spread: Floats = self._spread

    def set_pose(self, rotations: Floats, origins: Floats) -> None:
        """Start at a pose. Unknown limbs take the angle of the reference pose to their parent.

        Parameters
        ----------
        rotations : ndarray, shape (n_limbs, 3, 3)
            World from limb; NaN for unknown limbs.
        origins : ndarray, shape (n_limbs, 3), mm
            World; NaN for unknown limbs.
        """
        self.rotations, self.origins = rotations.copy(), origins.copy()
        for parent, child, at_parent, at_child in zip(
            self.parents, self.children, self.at_parent, self.at_child, strict=True
        ):
            if np.isnan(self.origins[child, 0]) and not np.isnan(self.origins[parent, 0]):
                relative = self.reference[parent, :3, :3].T @ self.reference[child, :3, :3]
                self.rotations[child] = self.rotations[parent] @ relative
                joint = self.rotations[parent] @ at_parent + self.origins[parent]
                self.origins[child] = joint - self.rotations[child] @ at_child
        lost = np.isnan(self.origins[:, 0])
        self.rotations[lost], self.origins[lost] = np.eye(3), np.nanmean(self.origins, axis=0)
        self._steps[:] = 0.0
        self._spread[:] = MOST_SPREAD**2

    def load_kernels(self) -> None:
        """Load what numba compiled now, and not amid the first frames."""
        self.fit(np.empty((0, 3)), np.empty(0, dtype=np.intp))

    def advance(self, n_steps: int) -> None:
        """Predict the pose `n_steps` frames later."""
        fade = DAMPING * (1.0 - DAMPING**n_steps) / (1.0 - DAMPING)
        poses = LimbPoses(self.rotations.copy(), self.origins.copy())
        move_limbs(poses, fade * self._steps)
        self.rotations, self.origins = poses
        self._spread = np.minimum(self._spread + n_steps * TURN_NOISE**2, MOST_SPREAD**2)

    def fit(self, points: Floats, markers: Ints) -> PosePrediction:
        """Fit the pose to the points of known markers, and predict all markers.

        Parameters
        ----------
        points : ndarray, shape (n, 3), mm
            What was seen.
        markers : ndarray of intp, shape (n,)
            The marker of each.
        """
        places, numbers = contiguous(points, markers)
        seen = SeenMarkers(places, numbers, ROBUST)
        poses = LimbPoses(self.rotations.copy(), self.origins.copy())
        springs = Springs(self._prior, 1.0 / self._spread, self.joint_deviation**-2)
        inverse = np.empty((self.n_limbs, N_FREEDOMS, N_FREEDOMS))
        fit_poses(self._body, springs, seen, poses, self._room, inverse)
        self.rotations, self.origins = poses
        turned = inverse.diagonal(axis1=1, axis2=2)[self.children, :3]
        self._seen_spread = turned.sum(axis=1) / 3
        predicted, spread = np.empty((self.n_markers, 3)), np.empty((self.n_markers, 3, 3))
        predict_markers(self._body, poses, inverse, predicted, spread)
        predicted[~self.carried] = np.nan
        return PosePrediction(predicted, _invertible(spread, self._body.variances))

    def learn_motion(self, rotations: Floats, origins: Floats, n_steps: int) -> None:
        """Take the motion since an earlier pose as what continues.

        Parameters
        ----------
        rotations : ndarray, shape (n_limbs, 3, 3)
            World from limb, in the earlier pose.
        origins : ndarray, shape (n_limbs, 3), mm
            World, in the earlier pose.
        n_steps : int
            Frames since then.
        """
        turned = self.rotations @ rotations.swapaxes(1, 2)
        antisymmetric = (turned - turned.swapaxes(1, 2)) / 2
        rotated = np.stack([antisymmetric[:, 2, 1], antisymmetric[:, 0, 2], antisymmetric[:, 1, 0]], axis=1)
        self._steps = np.concatenate([rotated, self.origins - origins], axis=1) / n_steps
        self._spread = np.minimum(self._spread, self._seen_spread)

    def positions_of(self, markers: Ints) -> Floats:
        """Positions [mm] of some markers in the present pose, shape (n, 3)."""
        limb = self.limb[markers]
        return np.asarray((self.rotations[limb] @ self.offsets[markers, :, np.newaxis])[..., 0] + self.origins[limb])


def _rows(vectors: list[Floats]) -> Floats:
    return np.array(vectors, dtype=np.float64).reshape(-1, 3)


def _invertible(covariances: Floats, variances: Floats) -> Floats:
    """Covariances (n_markers, 3, 3) that can be inverted, however badly a pose is known beside the errors of points."""
    largest = covariances.trace(axis1=1, axis2=2)
    added = np.where(largest > variances / ROUNDING, ROUNDING * largest, 0.0)
    return np.asarray(covariances + added[:, np.newaxis, np.newaxis] * np.eye(3))
