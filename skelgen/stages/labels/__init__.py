"""Stage 1: unlabelled points become labelled markers, and labels of a take that carries some are checked.

tracking/      points are followed from frame to frame into tracks, and these into tracklets
merging/       tracklets are merged into markers by the likelihood of their distances
model_fit/     a skeleton of these markers says which marker every point is
confidence/    how sure each identity is, and why
user_labels/   identities that the user states, and corrections
online/        labels while points arrive
"""

from skelgen.stages.labels.confidence.label_quality import (
    PointLabels,
    history_of,
    labelling_of_cloud,
    labelling_of_markers,
)
from skelgen.stages.labels.merging.bridges import follow_over_gaps
from skelgen.stages.labels.online.pose_filter import PoseFilter
from skelgen.stages.labels.online.skeleton_labels import SkeletonLabels
from skelgen.stages.labels.online.tracker import Tracker
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.point_labels import filled_labels
from skelgen.stages.labels.stage import check_labels, label_markers, refit_labels
from skelgen.stages.labels.tracking.statistics import typical_spacing
from skelgen.stages.labels.user_labels.corrections import (
    CorrectedLabels,
    apply_corrections,
    corrected_quality,
    stated_positions,
)

__all__ = [
    "CorrectedLabels",
    "LabelParameters",
    "PointLabels",
    "PoseFilter",
    "SkeletonLabels",
    "Tracker",
    "apply_corrections",
    "check_labels",
    "corrected_quality",
    "filled_labels",
    "follow_over_gaps",
    "history_of",
    "label_markers",
    "labelling_of_cloud",
    "labelling_of_markers",
    "refit_labels",
    "stated_positions",
    "typical_spacing",
]
