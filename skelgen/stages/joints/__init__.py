"""Stage 3: find the joints between limbs and the tree that they form.

`stage` is the order of its steps: `segments` are limbs with their rigid shapes, `pairs` finds the joint of two of them,
`search` those of all pairs and of the tree in all frames, `costs` makes them comparable, `tree` decides between them.
"""

from skelgen.stages.joints.parameters import JointConstraints, JointParameters, limb_pairs
from skelgen.stages.joints.sensor_slips import slips_moved_back
from skelgen.stages.joints.spans import find_joint_spans
from skelgen.stages.joints.stage import JointSearch, find_joints

__all__ = [
    "JointConstraints",
    "JointParameters",
    "JointSearch",
    "find_joint_spans",
    "find_joints",
    "limb_pairs",
    "slips_moved_back",
]
