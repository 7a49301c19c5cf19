"""The labels stage: unlabelled points in, labelled markers out."""

from skelgen.stages.labels.confidence.label_quality import labelling_of_markers
from skelgen.stages.labels.online import Tracker
from skelgen.stages.labels.online.pose_filter import Chain
from skelgen.stages.labels.online.skeleton_labels import ModelLabels
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.stage import label_and_judge, label_markers
from skelgen.stages.labels.tracking.follow import follow_points, typical_spacing

__all__ = [
    "Chain",
    "LabelParameters",
    "ModelLabels",
    "Tracker",
    "follow_points",
    "label_and_judge",
    "label_markers",
    "labelling_of_markers",
    "typical_spacing",
]
