"""Stage 4: fit a skeleton of rigid limbs, and fit it back to every frame.

`stage` is the order of its steps: `assembly` averages limbs and joins them, `fitting` fits one tree with its `joints`
and `loops`, `posing` finds its poses without outliers, `long_takes` does so block by block.
"""

from skelgen.stages.skeleton.assembly import BodyOfTake, StructuredTake, assemble
from skelgen.stages.skeleton.parameters import SkeletonParameters
from skelgen.stages.skeleton.posing import ConstrainedChain, out_of_line, without_outliers
from skelgen.stages.skeleton.stage import fit_skeleton

__all__ = [
    "BodyOfTake",
    "ConstrainedChain",
    "SkeletonParameters",
    "StructuredTake",
    "assemble",
    "fit_skeleton",
    "out_of_line",
    "without_outliers",
]
