"""The rig that the seed has measured, for the simulation and for what is compared with its figures."""

from __future__ import annotations

import numpy as np

from skelgen.geometry.rotations import matrix_from_vector, transform_from
from skelgen.model.rig import Camera, StereoRig


def seed_rig() -> StereoRig:
    """Return the two cameras of Gaschler 2011, Table 4.1: 640 x 480 px, 477 mm apart, turned 13 degrees inwards."""
    turn, shift = matrix_from_vector(np.array([0.021, 0.227, -0.013])), np.array([-474.36, -1.49, 51.03])
    left = np.array([[832.79, 0.0, 316.69], [0.0, 833.76, 240.22], [0.0, 0.0, 1.0]])
    right = np.array([[836.32, 0.0, 318.77], [0.0, 836.27, 257.80], [0.0, 0.0, 1.0]])
    return StereoRig(
        Camera(640, 480, left, np.array([-0.236, 0.304, 0.0, 0.0, 0.0]), name="left"),
        Camera(640, 480, right, np.array([-0.223, 0.201, 0.0, 0.0, 0.0]), transform_from(turn, shift), "right"),
    )
