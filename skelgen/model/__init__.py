"""The values that stages exchange: frozen, validated, with read-only arrays.

Units inside are mm, s, rad and Hz; coordinates are right-handed; frames come first, xyz last; NaN means unseen.

May change with every version; scripts import what they need from `skelgen`.
"""

from skelgen.model.corrections import Identities, Identity
from skelgen.model.labelling import Labelling
from skelgen.model.limbs import Limbs
from skelgen.model.project import Project, StageReport
from skelgen.model.skeleton import Joint, JointAngles, Motion, Skeleton
from skelgen.model.takes import PointCloud, Poses, Take, Trajectories
from skelgen.model.topology import Topology

__all__ = [
    "Identities",
    "Identity",
    "Joint",
    "JointAngles",
    "Labelling",
    "Limbs",
    "Motion",
    "PointCloud",
    "Poses",
    "Project",
    "Skeleton",
    "StageReport",
    "Take",
    "Topology",
    "Trajectories",
]
