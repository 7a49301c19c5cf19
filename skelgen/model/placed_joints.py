"""What places a joint: the motion, or else a marker set, what is usual of bodies, or a choice.

Report, window, tables, files and notices all ask `place_of`, and use its words.
"""

from collections.abc import Iterable
from enum import StrEnum

from skelgen.model.skeleton import Joint


class Place(StrEnum):
    """How the place of a joint is known; values are those of the JSON summary."""

    MOTION = "motion"
    """The motion determines it."""

    MARKER_SET = "marker_set"
    """The marker set that is worn places it, because the motion alone does not determine it."""

    USUAL = "usual"
    """What is usual of bodies places it, because the motion alone does not determine it."""

    IN_PART = "in_part"
    """In some directions the motion determines it, or what is usual of bodies does; in the others it is a choice."""

    CHOICE = "choice"
    """Nothing determines it."""

    USUAL_ALONG_AXIS = "usual_along_axis"
    """Of a hinge: the motion determines it across the axis, and what is usual of bodies places it along the axis."""

    CHOICE_ALONG_AXIS = "choice_along_axis"
    """Of a hinge: the motion determines it across the axis; along the axis nothing does."""

    @property
    def words(self) -> str:
        """What is said of such a place; empty if the motion determines it."""
        return _WORDS[self]

    @property
    def remark(self) -> str:
        """The same, with what the motion does not do."""
        return f"{self.words}: the motion does not determine it" if self.words else ""


_WORDS = {
    Place.MOTION: "",
    Place.MARKER_SET: "placed by the marker set",
    Place.USUAL: "placed by what is usual of bodies",
    Place.IN_PART: "its place is in part a choice",
    Place.CHOICE: "its place is a choice",
    Place.USUAL_ALONG_AXIS: "placed along its axis by what is usual of bodies",
    Place.CHOICE_ALONG_AXIS: "its place along its axis is a choice",
}


def place_of(joint: Joint) -> Place:
    """Return how the place of a joint is known.

    Parameters
    ----------
    joint : Joint
        Of a skeleton.
    """
    if joint.is_placed_by_marker_set:
        return Place.MARKER_SET
    if joint.open_directions == 0:
        return Place.MOTION
    n_left, n_along = joint.open_directions - joint.usual_directions, int(joint.kind == "hinge")
    if joint.is_determined:
        return Place.CHOICE_ALONG_AXIS if n_left else Place.USUAL_ALONG_AXIS
    if n_left <= n_along:
        return Place.USUAL
    return Place.IN_PART if n_left < 3 else Place.CHOICE


def count_places(joints: Iterable[Joint]) -> dict[Place, int]:
    """Return how many joints have a place that is known in each way, zero of those that none has.

    Parameters
    ----------
    joints : iterable of Joint
        Of a skeleton.
    """
    places = [place_of(joint) for joint in joints]
    return {place: places.count(place) for place in Place}
