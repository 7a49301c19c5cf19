"""Stage 4: fit a skeleton of rigid limbs, and fit it back to every frame."""

from skelgen.stages.skeleton.assembly import Body, assemble, cut_out
from skelgen.stages.skeleton.loops import BodyRings, all_poses
from skelgen.stages.skeleton.parameters import SkeletonParameters
from skelgen.stages.skeleton.posing import out_of_line, posed_with_care, without_outliers
from skelgen.stages.skeleton.stage import fit_skeleton

__all__ = [
    "Body",
    "BodyRings",
    "SkeletonParameters",
    "all_poses",
    "assemble",
    "cut_out",
    "fit_skeleton",
    "out_of_line",
    "posed_with_care",
    "without_outliers",
]
