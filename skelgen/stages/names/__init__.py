"""Names of limbs by what the markers on them are called and the sets that people wear, or by shape and motion."""

from skelgen.stages.names.by_markers import name_bones, name_limbs, segments_of_markers
from skelgen.stages.names.by_shape import WornShape, contradicts_sides, names_by_shape, segments_by_shape
from skelgen.stages.names.marker_sets import (
    MARKER_SET_CHOICES,
    PARENTS,
    MarkerSet,
    find_marker_set,
    marker_names,
    plain_name,
    recognised_set,
    set_among_others,
)

__all__ = [
    "MARKER_SET_CHOICES",
    "PARENTS",
    "MarkerSet",
    "WornShape",
    "contradicts_sides",
    "find_marker_set",
    "marker_names",
    "name_bones",
    "name_limbs",
    "names_by_shape",
    "plain_name",
    "recognised_set",
    "segments_by_shape",
    "segments_of_markers",
    "set_among_others",
]
