"""Scores against ground truth."""

from skelgen.evaluation.evaluation import Evaluation, evaluate
from skelgen.evaluation.joints import JointScore, LengthScore, MarkerScore
from skelgen.evaluation.matching import LabelScore, LimbScore, TopologyScore
from skelgen.evaluation.tables import Table, evaluation_lines, evaluation_tables

__all__ = [
    "Evaluation",
    "JointScore",
    "LabelScore",
    "LengthScore",
    "LimbScore",
    "MarkerScore",
    "Table",
    "TopologyScore",
    "evaluate",
    "evaluation_lines",
    "evaluation_tables",
]
