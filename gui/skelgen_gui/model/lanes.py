"""What is known of every marker in every frame, as runs of frames, and the picture of these runs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from skelgen.app.drawing.measures import subtree_markers
from skelgen.app.drawing.wording import percent
from skelgen.model import PointCloud, Project
from skelgen.model.arrays import Floats, Ints
from skelgen.model.labelling import Doubt


class State(IntEnum):
    """What is known of a marker in a frame."""

    SEEN = 0
    FILLED = 1
    """Unseen, but the skeleton says where it is."""
    DOUBTFUL = 2
    """Seen, but it is not sure that it is the one that it is called."""
    LEFT_OUT = 3
    """Seen, but on no limb."""
    UNSEEN = 4


@dataclass(frozen=True, eq=False)
class Lanes:
    """A lane for each marker, as runs of frames with the same state.

    Attributes
    ----------
    markers : ndarray of intp, shape (n_lanes,)
        Marker of each lane, limb after limb.
    limbs : ndarray of intp, shape (n_lanes,)
        Its limb; -1 = none.
    n_frames : int
        Length of every lane.
    starts : ndarray of intp, shape (n_runs,)
        Where each run begins, all lanes laid end to end: lane times `n_frames` plus frame. Runs leave no holes.
    states : ndarray of intp, shape (n_runs,)
        The `State` of each run.
    """

    markers: Ints
    limbs: Ints
    n_frames: int
    starts: Ints
    states: Ints

    @property
    def n_lanes(self) -> int:
        """Number of lanes."""
        return len(self.markers)

    def state(self, lane: int, frame: int) -> State:
        """Return the state in a frame."""
        return State(int(self.states[self._run(np.array([lane * self.n_frames + frame]))[0]]))

    def shares(self, lanes: Ints, edges: Floats) -> Floats:
        """Return the part of each state in stretches of lanes.

        Parameters
        ----------
        lanes : ndarray of intp, shape (n,)
            Which lanes.
        edges : ndarray, shape (n_stretches + 1,)
            Where stretches begin and end [frames], rising, within 0 .. n_frames.

        Returns
        -------
        ndarray, shape (n, n_stretches, 5)
            Parts of 1.
        """
        places = np.clip(edges, 0.0, self.n_frames) + lanes[:, np.newaxis] * float(self.n_frames)
        runs = self._run(places)
        into = places - self.starts[runs]
        lengths = np.diff(self.starts, append=self.n_lanes * self.n_frames)
        width = np.maximum(np.diff(edges), np.finfo(np.float64).tiny)
        parts = []
        for state in State:
            is_state = self.states == state
            before = np.concatenate([[0], np.cumsum(lengths * is_state)])[:-1]
            parts.append(np.diff(before[runs] + into * is_state[runs], axis=1) / width)
        return np.stack(parts, axis=2)

    def _run(self, places: Floats | Ints) -> Ints:
        return np.searchsorted(self.starts, places, side="right") - 1


def find_lanes(project: Project) -> Lanes:
    """Return the lanes of a project; none before its markers are labelled.

    Parameters
    ----------
    project : Project
        Doubts are known with its labels, limbs with its limbs, filled markers with its skeleton.
    """
    n_frames = project.take.n_frames
    if not project.has("labels") or n_frames == 0 or project.trajectories.n_markers == 0:
        nothing = np.zeros(0, dtype=np.intp)
        return Lanes(nothing, nothing, n_frames, nothing, nothing)
    markers = subtree_markers(project)
    limbs = project.limbs.limb_of_marker[markers] if project.has("limbs") else np.full(len(markers), -1)
    codes = np.concatenate([_states(project, int(marker)) for marker in markers.tolist()])
    is_first = np.concatenate([[True], codes[1:] != codes[:-1]])
    is_first[::n_frames] = True
    starts = np.flatnonzero(is_first)
    return Lanes(markers, limbs, n_frames, starts, codes[starts].astype(np.intp))


def _states(project: Project, marker: int) -> Ints:
    """The states of one marker: one at a time, because an hour of all markers at once would need much memory."""
    seen = ~np.isnan(project.trajectories.positions[:, marker, 0])
    codes = np.where(seen, State.SEEN, State.UNSEEN).astype(np.int8)
    if project.has("limbs") and project.limbs.limb_of_marker[marker] < 0:
        codes[seen] = State.LEFT_OUT
    if project.has("skeleton"):
        placed = ~np.isnan(project.motion.marker_positions[:, marker, 0])
        codes[~seen & placed] = State.FILLED
    if project.has_labelling:
        for doubt in project.labelling.doubts:
            if doubt.marker == marker:
                span = slice(doubt.first_frame, doubt.last_frame + 1)
                codes[span] = np.where(seen[span], State.DOUBTFUL, codes[span])
    return codes


def doubt_at(project: Project, marker: int, frame: int) -> Doubt | None:
    """Return the doubt about a marker in a frame, the least sure one if there are several."""
    if not project.has_labelling:
        return None
    here = (
        doubt
        for doubt in project.labelling.doubts
        if doubt.marker == marker and doubt.first_frame <= frame <= doubt.last_frame
    )
    return min(here, key=lambda doubt: doubt.confidence, default=None)


def next_doubt(project: Project, frame: int, direction: int) -> Doubt | None:
    """Return the doubt that begins next after a frame, or before it where `direction` is negative."""
    doubts = project.labelling.doubts if project.has_labelling else ()
    if direction < 0:
        return max((doubt for doubt in doubts if doubt.first_frame < frame), key=_first_frame, default=None)
    return min((doubt for doubt in doubts if doubt.first_frame > frame), key=_first_frame, default=None)


def _first_frame(doubt: Doubt) -> int:
    return doubt.first_frame


def point_counts(project: Project) -> Ints | None:
    """Return how many points of each frame belong to no marker, shape (n_frames,); None for takes with labels."""
    if not isinstance(project.take, PointCloud):
        return None
    if project.has("labels"):
        return project.labelling.left_out if project.has_labelling else None
    return project.take.points_per_frame


_WORDS = {
    State.SEEN: "seen",
    State.FILLED: "unseen; the skeleton says where it is",
    State.DOUBTFUL: "seen, but doubtful",
    State.LEFT_OUT: "seen, but on no limb",
    State.UNSEEN: "unseen",
}


def lane_sentence(project: Project, lanes: Lanes, lane: int, frame: int | None) -> str:
    """Return what is told of a lane, and of a frame of it.

    Parameters
    ----------
    project : Project
        With labels.
    lanes : Lanes
        Its lanes.
    lane : int
        Which one.
    frame : int, optional
        Which frame; without one only the marker is told.
    """
    marker, limb = int(lanes.markers[lane]), int(lanes.limbs[lane])
    name = project.trajectories.names[marker] + (f" · limb {limb}" if limb >= 0 else "")
    if frame is None:
        return name
    lines = [name, f"frame {frame}: {_WORDS[lanes.state(lane, frame)]}{_confidence(project, marker, frame)}"]
    doubt = doubt_at(project, marker, frame)
    if doubt is not None:
        lines.append(f"frames {doubt.first_frame} – {doubt.last_frame}: {doubt.reason}")
    return "\n".join(lines)


def _confidence(project: Project, marker: int, frame: int) -> str:
    if not project.has_labelling:
        return ""
    confidence = float(project.labelling.confidence[frame, marker])
    return "" if math.isnan(confidence) else f", {percent(confidence)} sure"


_BAR = (0.16, 0.84)  # of a lane's height
_THIN = (0.42, 0.58)
_STRIPE = (0.62, 0.94)
_FILLED, _LEFT_OUT = 0.75, 0.5  # opacity
_DIP = 0.3  # of opacity, for a gap that is shorter than a pixel
_LEAST_DOUBT = 0.7  # opacity of a doubt that is shorter than a pixel


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
