"""A subject: a calibrated skeleton applied to other takes of the same body.

`labels` finds which point is which marker, `present` which of several bodies are there, `points` places what remains,
`changes` tests what differs from the calibrated take, `fit` does all of that; `sensors` finds sensors that moved on
their limbs.
"""

from skelgen.stages.subject.changes import with_joints_as_fitted
from skelgen.stages.subject.fit import SubjectFit, fit_subject, reposed_subject, subject_motion
from skelgen.stages.subject.sensors import SensorShift, find_moved_sensors

__all__ = [
    "SensorShift",
    "SubjectFit",
    "find_moved_sensors",
    "fit_subject",
    "reposed_subject",
    "subject_motion",
    "with_joints_as_fitted",
]
