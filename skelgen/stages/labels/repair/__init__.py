"""Errors of labels: exchanged labels are found and repaired, slipped markers found and split."""

from skelgen.stages.labels.repair.slips import Slip, find_slips, split_slipped
from skelgen.stages.labels.repair.swaps import Swap, find_swaps, indistinguishable_pairs, repair_swaps
from skelgen.stages.labels.repair.take import repair_take

__all__ = [
    "Slip",
    "Swap",
    "find_slips",
    "find_swaps",
    "indistinguishable_pairs",
    "repair_swaps",
    "repair_take",
    "split_slipped",
]
