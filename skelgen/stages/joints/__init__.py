"""Stage 3: find the joints between limbs and the tree that they form."""

from skelgen.stages.joints.parameters import JointParameters
from skelgen.stages.joints.said import SMALL_MARGIN
from skelgen.stages.joints.stage import find_joints
from skelgen.stages.joints.wishes import limb_called, limb_pairs

__all__ = ["SMALL_MARGIN", "JointParameters", "find_joints", "limb_called", "limb_pairs"]
