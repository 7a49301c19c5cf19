"""Scores against ground truth.

May change with every version; scripts import what they need from `skelgen`.
"""

from skelgen.evaluation.evaluation import Evaluation, Table, evaluate, evaluation_tables
from skelgen.evaluation.joints import JointScore, LengthScore, MarkerScore
from skelgen.evaluation.matching import LabelScore, LimbScore, SpanScore, TopologyScore

__all__ = [
    "Evaluation",
    "JointScore",
    "LabelScore",
    "LengthScore",
    "LimbScore",
    "MarkerScore",
    "SpanScore",
    "Table",
    "TopologyScore",
    "evaluate",
    "evaluation_tables",
]
