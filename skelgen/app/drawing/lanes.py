"""Whether each marker is seen, filled, doubtful or unseen in every frame: a lane of runs per marker."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from skelgen.app.drawing.measures import subtree_markers
from skelgen.model import Project
from skelgen.model.arrays import Floats, Ints


class State(IntEnum):
    """State of a marker in a frame."""

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
        """Return the state in a frame.

        Parameters
        ----------
        lane, frame : int
            Indices.
        """
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
