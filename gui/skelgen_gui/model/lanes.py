"""The state of every marker in every frame (seen, doubtful, missing ...), as runs of frames, and their picture."""

import math
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from skelgen.app.drawing.lanes import Lanes, State
from skelgen.app.drawing.wording import percent
from skelgen.model import PointCloud, Project
from skelgen.model.arrays import Floats, Ints
from skelgen.model.labelling import Doubt
from skelgen_gui.model import translate
from skelgen_gui.model.wording import limb_words

_BAR = (0.16, 0.84)  # of a lane's height
_THIN = (0.42, 0.58)
_STRIPE = (0.62, 0.94)
_FILLED, _LEFT_OUT = 0.75, 0.5  # opacity
_DIP = 0.3  # of opacity, for a gap that is shorter than a pixel
_LEAST_DOUBT = 0.7  # opacity of a doubt that is shorter than a pixel


def doubt_at(project: Project, marker: int, frame: int) -> Doubt | None:
    """Return the doubt about a marker in a frame, the least sure one if there are several.

    Parameters
    ----------
    project : Project
        With labels.
    marker, frame : int
        Which marker, and in which frame.
    """
    if not project.has_labelling:
        return None
    here = (
        doubt
        for doubt in project.labelling.doubts
        if doubt.marker == marker and doubt.first_frame <= frame <= doubt.last_frame
    )
    return min(here, key=lambda doubt: doubt.confidence, default=None)


def next_doubt(project: Project, frame: int, direction: int) -> Doubt | None:
    """Return the doubt that begins next after a frame, or before it where `direction` is negative.

    Parameters
    ----------
    project : Project
        With labels.
    frame : int
        Where the search begins.
    direction : int
        Negative searches backward.
    """
    first_frame = attrgetter("first_frame")
    doubts = project.labelling.doubts if project.has_labelling else ()
    if direction < 0:
        return max((doubt for doubt in doubts if doubt.first_frame < frame), key=first_frame, default=None)
    return min((doubt for doubt in doubts if doubt.first_frame > frame), key=first_frame, default=None)


def point_counts(project: Project) -> Ints | None:
    """Return how many points of each frame belong to no marker, shape (n_frames,); None for takes with labels."""
    if not isinstance(project.take, PointCloud):
        return None
    if project.has("labels"):
        return project.labelling.left_out if project.has_labelling else None
    return project.take.points_per_frame


def lane_sentence(project: Project, lanes: Lanes, lane: int, frame: int | None) -> str:
    """Describe a lane, and a frame of it.

    Parameters
    ----------
    project : Project
        With labels.
    lanes : Lanes
        Its lanes.
    lane : int
        Which one.
    frame : int, optional
        Which frame; without one only the marker is named.
    """
    marker, limb = int(lanes.markers[lane]), int(lanes.limbs[lane])
    name = project.trajectories.names[marker]
    name += " · " + limb_words(project, limb) if limb >= 0 else ""
    if frame is None:
        return name
    known = _state_words(lanes.state(lane, frame)) + _confidence(project, marker, frame)
    lines = [name, _tr("frame {0}: {1}").format(frame, known)]
    doubt = doubt_at(project, marker, frame)
    if doubt is not None:
        lines.append(_tr("frames {0} – {1}: {2}").format(doubt.first_frame, doubt.last_frame, doubt.reason))
    return "\n".join(lines)


def _state_words(state: State) -> str:
    return {
        State.SEEN: _tr("seen"),
        State.FILLED: _tr("unseen; placed by the skeleton"),
        State.DOUBTFUL: _tr("seen, but doubtful"),
        State.LEFT_OUT: _tr("seen, but on no limb"),
        State.UNSEEN: _tr("unseen"),
    }[state]


def _confidence(project: Project, marker: int, frame: int) -> str:
    if not project.has_labelling:
        return ""
    confidence = float(project.labelling.confidence[frame, marker])
    return "" if math.isnan(confidence) else ", " + _tr("{0} sure").format(percent(confidence))


def _tr(text: str) -> str:
    return translate("Lanes", text)


def lane_picture(
    shares: Floats, colours: NDArray[np.uint8], doubt: NDArray[np.uint8], height: int
) -> NDArray[np.uint8]:
    """Draw lanes.

    Parameters
    ----------
    shares : ndarray, shape (n_lanes, n_columns, 5)
        Part of each `State` in each column of pixels.
    colours : ndarray of uint8, shape (n_lanes, 3)
        Red, green and blue of each lane.
    doubt : ndarray of uint8, shape (3,)
        Colour of what is doubtful.
    height : int, px
        Of a lane.

    Returns
    -------
    ndarray of uint8, shape (n_lanes * height, n_columns, 4)
        Red, green, blue and opacity. Gaps and doubts shorter than a pixel can still be seen.
    """
    n_lanes, n_columns, _ = shares.shape
    solid = shares[..., State.SEEN] + shares[..., State.DOUBTFUL] + _LEFT_OUT * shares[..., State.LEFT_OUT]
    missing = shares[..., State.FILLED] + shares[..., State.UNSEEN]
    solid = np.where(missing > 0, np.minimum(solid, 1 - _DIP), solid)
    doubtful = shares[..., State.DOUBTFUL]
    doubtful = np.where(doubtful > 0, np.maximum(doubtful, _LEAST_DOUBT), 0.0)
    thin = np.maximum(solid, solid + _FILLED * shares[..., State.FILLED])

    picture = np.zeros((n_lanes, height, n_columns, 4), dtype=np.uint8)
    picture[..., :3] = colours[:, np.newaxis, np.newaxis]
    picture[:, _rows(_BAR, height), :, 3] = _opacity(solid)
    picture[:, _rows(_THIN, height), :, 3] = _opacity(thin)
    stripe = picture[:, _rows(_STRIPE, height)]
    marked = np.broadcast_to((doubtful > 0)[:, np.newaxis], stripe.shape[:3])
    stripe[marked, :3] = doubt
    stripe[..., 3] = np.where(marked, _opacity(doubtful), stripe[..., 3])
    return picture.reshape(n_lanes * height, n_columns, 4)


def _rows(part: tuple[float, float], height: int) -> slice:
    first = round(part[0] * height)
    return slice(first, max(round(part[1] * height), first + 1))


def _opacity(part: Floats) -> NDArray[np.uint8]:
    return np.round(255 * np.clip(part, 0.0, 1.0)).astype(np.uint8)[:, np.newaxis]
