"""The labels stage: unlabelled points in, labelled markers out."""

from skelgen.stages.labels.confidence.label_quality import labelling_of_markers
from skelgen.stages.labels.online import Tracker
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.stage import label_and_judge, label_markers

__all__ = ["LabelParameters", "Tracker", "label_and_judge", "label_markers", "labelling_of_markers"]
