"""A calibrated skeleton applied to another take of the same subject."""

from skelgen.stages.subject.fit import KnownFit, fit_known
from skelgen.stages.subject.labels import KnownLabels, label_known
from skelgen.stages.subject.posing import KnownPoses, known_motion, pose_known
from skelgen.stages.subject.sensors import Seat, reseated

__all__ = [
    "KnownFit",
    "KnownLabels",
    "KnownPoses",
    "Seat",
    "fit_known",
    "known_motion",
    "label_known",
    "pose_known",
    "reseated",
]
