"""Errors of labels that a take came with: exchanged and moved labels are given back, slipped markers are split."""

from skelgen.stages.repair.repair import RepairParameters, repair_take
from skelgen.stages.repair.swaps import exchanged_back

__all__ = ["RepairParameters", "exchanged_back", "repair_take"]
