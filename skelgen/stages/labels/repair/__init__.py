"""Errors of labels: exchanged labels and those on other markers are repaired, slipped markers are split."""

from skelgen.stages.labels.repair.moved import Move, find_moves, undo_moves
from skelgen.stages.labels.repair.slips import Slip, find_slips, split_slipped
from skelgen.stages.labels.repair.swaps import Swap, find_swaps, indistinguishable_pairs, repair_swaps
from skelgen.stages.labels.repair.take import Repair, repair_take

__all__ = [
    "Move",
    "Repair",
    "Slip",
    "Swap",
    "find_moves",
    "find_slips",
    "find_swaps",
    "indistinguishable_pairs",
    "repair_swaps",
    "repair_take",
    "split_slipped",
    "undo_moves",
]
