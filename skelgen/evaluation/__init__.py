"""Scores against ground truth.

May change with every version; scripts import what they need from `skelgen`.
"""

from skelgen.evaluation.evaluation import Evaluation, Table, evaluate, evaluation_tables

__all__ = ["Evaluation", "Table", "evaluate", "evaluation_tables"]
