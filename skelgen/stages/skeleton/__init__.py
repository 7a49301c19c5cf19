"""Stage 4: fit a skeleton of rigid limbs, and fit it back to every frame."""

from skelgen.stages.skeleton.assemble import Body, assemble, cut_out
from skelgen.stages.skeleton.outliers import out_of_line
from skelgen.stages.skeleton.outward import pose_outward
from skelgen.stages.skeleton.parameters import SkeletonParameters
from skelgen.stages.skeleton.ringed import BodyRings, all_poses
from skelgen.stages.skeleton.second_look import posed_with_care
from skelgen.stages.skeleton.stage import fit_skeleton
from skelgen.stages.skeleton.trusted import without_outliers

__all__ = [
    "Body",
    "BodyRings",
    "SkeletonParameters",
    "all_poses",
    "assemble",
    "cut_out",
    "fit_skeleton",
    "out_of_line",
    "pose_outward",
    "posed_with_care",
    "without_outliers",
]
