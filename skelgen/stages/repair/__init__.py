"""Errors of labels: exchanged labels and those on other markers are repaired, slipped markers are split."""

from skelgen.stages.repair.moves import Move, find_moves, undo_moves
from skelgen.stages.repair.repair import Repair, repair_take
from skelgen.stages.repair.slips import Slip, find_slips, split_slipped
from skelgen.stages.repair.swaps import Swap, find_swaps, indistinguishable_pairs, repair_swaps

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
