"""Names of limbs by what the markers on them are called, and the marker sets that people wear."""

from skelgen.stages.names.by_markers import name_limbs, segments_of_markers
from skelgen.stages.names.marker_sets import (
    MARKER_SET_CHOICES,
    PARENTS,
    MarkerSet,
    find_marker_set,
    recognised_set,
)

__all__ = [
    "MARKER_SET_CHOICES",
    "PARENTS",
    "MarkerSet",
    "find_marker_set",
    "name_limbs",
    "recognised_set",
    "segments_of_markers",
]
