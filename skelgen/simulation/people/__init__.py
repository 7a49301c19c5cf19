"""People as laboratories record them: bodies of all sizes, the marker sets they wear, natural motions, soft tissue.

What is known of them stands in readable tables, `tables/*.toml`, each with its sources; their marker sets are those of
`skelgen.marker_sets`.
"""

from skelgen.simulation.people.body import HEIGHTS, Person, person, realistic_soft_tissue, usual_person
from skelgen.simulation.people.motions import MOTIONS, SLOWEST, natural_motion

__all__ = [
    "HEIGHTS",
    "MOTIONS",
    "SLOWEST",
    "Person",
    "natural_motion",
    "person",
    "realistic_soft_tissue",
    "usual_person",
]
