"""Errors of labels that a take came with: exchanged and moved labels are given back, slipped markers are split."""

from skelgen.stages.repair.moves import Move, find_moves, undo_moves
from skelgen.stages.repair.repair import Repair, RepairParameters, repair_take
from skelgen.stages.repair.slips import Slip, find_slips, split_slipped
from skelgen.stages.repair.swaps import Swap, exchanged_back, find_swaps, indistinguishable_pairs, repair_swaps

__all__ = [
    "Move",
    "Repair",
    "RepairParameters",
    "Slip",
    "Swap",
    "exchanged_back",
    "find_moves",
    "find_slips",
    "find_swaps",
    "indistinguishable_pairs",
    "repair_swaps",
    "repair_take",
    "split_slipped",
    "undo_moves",
]
