"""The labels stage: unlabelled points in, labelled markers out."""

from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.stage import label_markers

__all__ = ["LabelParameters", "label_markers"]
