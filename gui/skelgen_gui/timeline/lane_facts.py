"""What is told of a place on a lane."""

from __future__ import annotations

import math

from skelgen.app.report.wording import percent
from skelgen.model import Project
from skelgen_gui.timeline.lanes import Lanes, State, doubt_at

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
