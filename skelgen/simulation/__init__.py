"""Articulated structures, motion, markers and occlusion with ground truth.

May change with every version; scripts import what they need from `skelgen`.
"""

from skelgen.files import TRUTH_SUFFIX
from skelgen.simulation.articulated import Structure, resized
from skelgen.simulation.parameters import SimulationParameters
from skelgen.simulation.recorded import BoneParameters, RecordedBody, recorded_body
from skelgen.simulation.structures import find_structure, random_tree, rods_chain
from skelgen.simulation.take import SimulatedTake, simulate
from skelgen.simulation.truth import Truth, read_truth, write_truth

__all__ = [
    "TRUTH_SUFFIX",
    "BoneParameters",
    "RecordedBody",
    "SimulatedTake",
    "SimulationParameters",
    "Structure",
    "Truth",
    "find_structure",
    "random_tree",
    "read_truth",
    "recorded_body",
    "resized",
    "rods_chain",
    "simulate",
    "write_truth",
]
