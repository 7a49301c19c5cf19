"""SCoRE, the peer of our joints: given limbs and tree, linear least squares on the limbs' poses.

Ehrig, Taylor, Duda and Heller (2006), A survey of formal methods for determining the centre of rotation of ball joints.
"""

from __future__ import annotations

from typing import cast

import numpy as np

from skelgen.evaluation.joints import joint_distances
from skelgen.kinematics.shape import fit_shape
from skelgen.model import Trajectories
from skelgen.model.arrays import Floats
from skelgen.simulation.take import SimulatedTake


def score_error(case: SimulatedTake) -> float:
    """Return the mean joint error [mm] of SCoRE with the true limbs and tree, hinges across their axes.

    Parameters
    ----------
    case : SimulatedTake
        A labelled take and its truth.
    """
    truth, positions = case.truth, cast(Trajectories, case.take).positions
    frames = np.arange(truth.n_frames)
    poses = [
        fit_shape(positions[:, truth.limb_of_marker == limb], frames).world_from_limb for limb in range(truth.n_limbs)
    ]
    joints = np.stack([rotation_centre(poses[one], poses[other]) for one, other in truth.edges.tolist()], axis=1)
    return float(np.nanmean(joint_distances(joints, np.arange(truth.n_joints), truth)))


def rotation_centre(first: Floats, second: Floats) -> Floats:
    """Return the centre of rotation of two bodies by SCoRE.

    With poses R, t of both, p and q minimise the sum of |R_1 p + t_1 - R_2 q - t_2|^2 over the frames.

    Parameters
    ----------
    first, second : ndarray, shape (n_frames, 4, 4)
        Poses of the bodies, NaN where they are not known.

    Returns
    -------
    ndarray, shape (n_frames, 3), mm
        The mean of both bodies' points.
    """
    both = ~np.isnan(first[:, 0, 0]) & ~np.isnan(second[:, 0, 0])
    rows = np.concatenate([first[both, :3, :3], -second[both, :3, :3]], axis=2).reshape(-1, 6)
    right = (second[both, :3, 3] - first[both, :3, 3]).ravel()
    place = np.linalg.lstsq(rows, right, rcond=None)[0]
    ends = (first[:, :3, :3] @ place[:3] + first[:, :3, 3], second[:, :3, :3] @ place[3:] + second[:, :3, 3])
    return np.asarray((ends[0] + ends[1]) / 2)
