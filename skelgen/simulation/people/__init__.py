"""People as laboratories record them: bodies of all sizes, the marker sets they wear, natural motions, soft tissue.

What is known of them stands in readable tables, `tables/*.toml`, each with its sources.
"""

from skelgen.simulation.people.body import HEIGHTS, Person, person, realistic_soft_tissue, usual_person
from skelgen.simulation.people.motions import MOTIONS, SLOWEST, natural_motion
from skelgen.simulation.people.tables import EVERY_PLACE, LABORATORY_SETS, MARKER_SETS, worn_markers

__all__ = [
    "EVERY_PLACE",
    "HEIGHTS",
    "LABORATORY_SETS",
    "MARKER_SETS",
    "MOTIONS",
    "SLOWEST",
    "Person",
    "natural_motion",
    "person",
    "realistic_soft_tissue",
    "usual_person",
    "worn_markers",
]
