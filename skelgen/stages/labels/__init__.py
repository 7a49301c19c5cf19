"""Stage 1: unlabelled points become labelled markers, and labels of a take that carries some are checked.

tracking/      points are followed from frame to frame into tracks, and these into tracklets
merging/       tracklets are merged into markers by the likelihood of their distances
model_fit/     a skeleton of these markers says which marker every point is
confidence/    how sure each identity is, and why
user_labels/   identities that the user states, and corrections
by_skeleton/   which point is which marker of a whole skeleton: a calibrated one, or that of the take itself
online/        labels while points arrive
"""

from skelgen.stages.labels.by_skeleton.matching import by_track_votes, gates_of, match_points, n_carried
from skelgen.stages.labels.by_skeleton.points import FollowedPoints, tracked_points
from skelgen.stages.labels.by_skeleton.posing import SkeletonPoses, pose_skeleton, with_free_joints
from skelgen.stages.labels.by_skeleton.refit import refit_labels
from skelgen.stages.labels.confidence.label_quality import (
    PointLabels,
    history_of,
    labelling_of_cloud,
    labelling_of_markers,
)
from skelgen.stages.labels.online.tracker import Tracker
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.stage import check_labels, label_markers
from skelgen.stages.labels.tracking.statistics import typical_spacing
from skelgen.stages.labels.user_labels.corrections import (
    CorrectedLabels,
    apply_corrections,
    corrected_quality,
    stated_positions,
)

__all__ = [
    "CorrectedLabels",
    "FollowedPoints",
    "LabelParameters",
    "PointLabels",
    "SkeletonPoses",
    "Tracker",
    "apply_corrections",
    "by_track_votes",
    "check_labels",
    "corrected_quality",
    "gates_of",
    "history_of",
    "label_markers",
    "labelling_of_cloud",
    "labelling_of_markers",
    "match_points",
    "n_carried",
    "pose_skeleton",
    "refit_labels",
    "stated_positions",
    "tracked_points",
    "typical_spacing",
    "with_free_joints",
]
