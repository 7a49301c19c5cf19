"""Rigid bodies among unlabelled points (Gaschler 2011, 3.3): matched by distances, posed with their covariance.

Pairs of balls are matched to pairs of points by their distance, and the best pair is extended depth-first; see
`skelgen._kernels.rigid_body_search`.
"""

from skelgen.capture.bodies.design import (
    AmbiguousTargetError,
    check_targets,
    find_confusions,
    propose_move,
    propose_targets,
)
from skelgen.capture.bodies.finder import BodyFinder, ExpectedPose, find_bodies, resolved_points
from skelgen.capture.parameters import BodyParameters

__all__ = [
    "AmbiguousTargetError",
    "BodyFinder",
    "BodyParameters",
    "ExpectedPose",
    "check_targets",
    "find_bodies",
    "find_confusions",
    "propose_move",
    "propose_targets",
    "resolved_points",
]
