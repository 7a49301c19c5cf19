"""Stage 2: group markers into rigid limbs.

`stage` is the order of its steps: `distances` says how much distances between markers vary, `rigid_clusters` parts
markers into clusters that are rigid as far as noise can tell, `merging` joins these into limbs by `relative_motion`.
"""

from skelgen.stages.limbs.bodies import Distances, bodies_by_distances
from skelgen.stages.limbs.distances import rigid_groups
from skelgen.stages.limbs.membership import doubt_notices
from skelgen.stages.limbs.parameters import LimbConstraints, LimbParameters
from skelgen.stages.limbs.stage import draft_limbs, find_limbs
from skelgen.stages.limbs.worn_body import markers_of_set, worn_body, worn_neighbours

__all__ = [
    "Distances",
    "LimbConstraints",
    "LimbParameters",
    "bodies_by_distances",
    "doubt_notices",
    "draft_limbs",
    "find_limbs",
    "markers_of_set",
    "rigid_groups",
    "worn_body",
    "worn_neighbours",
]
