"""Errors of labels, found and repaired."""

from skelgen.stages.labels.repair.swaps import Swap, find_swaps, indistinguishable_pairs, repair_swaps
from skelgen.stages.labels.repair.take import repair_take

__all__ = ["Swap", "find_swaps", "indistinguishable_pairs", "repair_swaps", "repair_take"]
