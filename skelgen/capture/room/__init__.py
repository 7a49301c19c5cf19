"""A room with two to sixteen cameras around it: from the balls of all images to points, over all cameras at once."""

from skelgen.capture.room.points import PointMatcher, find_points
from skelgen.capture.room.tracks import PointTracks, RoomTracker
from skelgen.capture.room.values import RoomPoints, Views, balls_at

__all__ = ["PointMatcher", "PointTracks", "RoomPoints", "RoomTracker", "Views", "balls_at", "find_points"]
