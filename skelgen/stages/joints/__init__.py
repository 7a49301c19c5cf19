"""Stage 3: find the joints between limbs and the tree that they form."""

from skelgen.stages.joints.constraints import limb_called, limb_pairs
from skelgen.stages.joints.parameters import JointParameters
from skelgen.stages.joints.stage import find_joints
from skelgen.stages.joints.tree import SMALL_MARGIN

__all__ = ["SMALL_MARGIN", "JointParameters", "find_joints", "limb_called", "limb_pairs"]
