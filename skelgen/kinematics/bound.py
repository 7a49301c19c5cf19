"""The Cramer-Rao bound of a take whose truth is known: no unbiased method can place its joints better.

The Fisher information of marker offsets, joints, axes and the poses of all frames is that of the whole-chain fit at
the truth; poses are eliminated frame by frame, and the free choice of the limbs' frames is left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.kinematics.articulation import Articulation
from skelgen.kinematics.chain import Chain, ChainPoses
from skelgen.kinematics.information import total_information
from skelgen.kinematics.uncertainty import axis_projectors, expected_distance, frame_covariances, inverse_root
from skelgen.model.arrays import Bools, Floats

DETERMINED = 10.0
"""Frames count in which a joint's bound is at most this many times its median: in others too few markers are seen."""


@dataclass(frozen=True, eq=False)
class Bound:
    """The smallest possible uncertainty of joints.

    Attributes
    ----------
    covariances : ndarray, shape (n_frames, n_limbs, 3, 3), mm^2
        Of the joint above each limb in the world; of hinges across their axes.
    distance : ndarray, shape (n_frames, n_limbs), mm
        Mean distance from the truth that goes with it.
    determined : ndarray of bool, shape (n_frames, n_limbs)
        Whether the frame shows enough to place the joint.
    information : ndarray, shape (n_constants, n_constants)
        Of the constants, for noise 1.
    """

    covariances: Floats
    distance: Floats
    determined: Bools
    information: Floats


def cramer_rao_bound(
    chain: Chain, articulation: Articulation, poses: ChainPoses, positions: Floats, noise: float
) -> Bound:
    """Return the bound at the truth.

    Parameters
    ----------
    chain, articulation, poses
        The truth.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers: only which are seen counts.
    noise : float, mm
        Standard deviation of a marker's coordinate.
    """
    information = total_information(chain, articulation, poses, positions)
    exact = np.where(np.isnan(positions), np.nan, poses.markers(chain))
    found = frame_covariances(chain, articulation, poses, exact, inverse_root(information), noise)
    across = axis_projectors(chain, articulation, poses)
    covariances = across @ found.joints @ across
    distance = expected_distance(covariances)
    return Bound(covariances, distance, distance <= DETERMINED * np.median(distance, axis=0), information)
