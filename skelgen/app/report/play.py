"""The view that plays: a take and its skeleton packed into the page, for the canvas that play.js draws.

Positions are turned so that y points up and z towards who sees the front, rounded to 65535 steps of the largest extent,
and kept as second differences over time: mostly small numbers, which deflate. What is unseen keeps its gap.
"""

import base64
import hashlib
import json
import zlib
from dataclasses import dataclass
from importlib import resources
from typing import Any

import numpy as np
from markupsafe import Markup

from skelgen.app.drawing import poses
from skelgen.model import PointCloud, Poses, Project, Trajectories
from skelgen.model.arrays import Floats, Ints
from skelgen.progress import counted

MOST_VALUES = 600_000
"""Coordinates that a page carries, somewhat more than a byte each: of longer takes it shows every n-th frame."""

_SCRIPTS = ("play_take.js", "play.js")
_STEPS = 65_534  # of 16 bits; the rest is room for rounding
_EFFORT = 4  # of packing, 1 .. 9: more takes twice as long, for a hundredth of the size
_OUTLIERS = 1.0  # percent of positions on each side that do not count for what is seen at first
_NEAR_ZERO = 0.15  # of the body's size: the floor is at zero, where most systems have it, if the lowest marker is near
_SAMPLES = 300  # frames that tell which way is up


@dataclass(frozen=True, eq=False)
class _Points:
    """What moves: joints, then markers; and points without identity.

    Attributes
    ----------
    places : ndarray, shape (n_frames, n_points, 3), mm
        NaN where unknown.
    states : ndarray, shape (n_frames, n_points + n_limbs)
        A `MarkerState` of each point; then for each limb whether its rotation is interpolated.
    cloud : ndarray, shape (n, 3), mm
        Points without identity, frame after frame.
    counts : ndarray, shape (n_frames,)
        How many of these each frame has.
    """

    places: Floats
    states: Ints
    cloud: Floats
    counts: Ints


@dataclass(frozen=True)
class PlayContent:
    """What the template of the view shows.

    Attributes
    ----------
    data, script : Markup
        The take as JSON, and the program that draws it.
    hash : str
        SHA-256 of the program in base64: nothing else may run in the page.
    label : str
        What the view shows, for those who do not see it.
    stride : int
        Every how many-th frame is shown.
    last : int
        Number of the last frame that is shown.
    has_skeleton, has_doubt, has_gaps : bool
        Whether there are bones, doubtful markers, markers that are not seen.
    n_open, n_doubtful : int
        Joints whose place the motion does not determine, and joints that may connect other limbs.
    """

    data: Markup
    script: Markup
    hash: str
    label: str
    stride: int
    last: int
    has_skeleton: bool
    has_doubt: bool
    has_gaps: bool
    n_open: int
    n_doubtful: int


def play_content(project: Project) -> PlayContent | None:
    """Return what the template of the view shows; None if nothing is ever seen.

    Parameters
    ----------
    project : Project
        Any project, from a bare take to a fitted skeleton.
    """
    stride = _stride(project)
    points = _points(project, slice(None, None, stride))
    known = points.places[~np.isnan(points.places[..., 0])]
    known = np.concatenate([known, points.cloud])
    if not len(known):
        return None
    view = _front(project)
    basis = np.stack([view.across, view.up, view.toward], axis=1)
    box = np.percentile(known @ basis, [0, _OUTLIERS, 100 - _OUTLIERS, 100], axis=0)
    step = max(float((box[3] - box[0]).max()) / _STEPS, 1e-6)
    lowest = box[1, 1]
    data = _drawn(project) | {
        "rate": project.take.rate,
        "stride": stride,
        "nFrames": len(points.places),
        "nAllFrames": project.take.n_frames,
        "nCloud": len(points.cloud),
        "low": box[0].tolist(),
        "step": step,
        "box": box[1:3].tolist(),
        "floor": 0.0 if abs(lowest) < _NEAR_ZERO * (box[2, 1] - lowest) else lowest,
        "axes": basis.tolist(),  # of the world, in those of the view
        "packed": _packed(points, basis, box[0], step),
    }
    folder = resources.files(__package__)
    script = "".join(folder.joinpath(name).read_text(encoding="utf-8") for name in _SCRIPTS)
    return PlayContent(
        data=Markup(json.dumps(data, allow_nan=False).replace("<", "\\u003c")),  # a name stays a name
        script=Markup(script),
        hash=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
        label=_label(project, points),
        stride=stride,
        last=len(points.places) - 1,
        has_skeleton=bool(data["bones"]),
        has_doubt=bool((points.states == poses.MarkerState.DOUBTFUL).any()),
        has_gaps=bool((points.states == poses.MarkerState.FILLED).any()),
        n_open=sum(joint["open"] for joint in data["joints"]),
        n_doubtful=sum(joint["doubtful"] for joint in data["joints"]),
    )


def _label(project: Project, points: _Points) -> str:
    n_joints = project.topology.n_joints if project.has("joints") else 0
    n_markers = points.places.shape[1] - n_joints
    parts = [counted(n_markers, "marker")] if n_markers else ["points without names"]
    parts += [counted(project.limbs.n_limbs, "limb")] if project.has("limbs") else []
    return f"3-D view of {project.name or 'the take'}: {', '.join(parts)}. Arrow keys turn it, the space bar plays it."


def _markers_of(project: Project) -> Trajectories | None:
    labelled = project.trajectories if project.has("labels") else project.take
    return labelled if isinstance(labelled, Trajectories) else None


def _stride(project: Project) -> int:
    """Every how many-th frame is kept."""
    take, markers = project.take, _markers_of(project)
    if markers is None and isinstance(take, PointCloud):
        n_values = 3 * take.n_points
    else:
        n_joints = project.topology.n_joints if project.has("joints") else 0
        n_points = markers.n_markers if markers is not None else take.n_bodies if isinstance(take, Poses) else 0
        n_values = 3 * take.n_frames * (n_points + n_joints)
    return max(-(-n_values // MOST_VALUES), 1)


def _points(project: Project, frames: slice) -> _Points:
    take, markers = project.take, _markers_of(project)
    n_frames = len(range(take.n_frames)[frames])
    cloud, counts = np.zeros((0, 3)), np.zeros(n_frames, dtype=np.intp)
    if markers is not None:
        places, states = poses.place_markers(project, markers, frames)
    else:
        places = take.world_from_body[frames, :, :3, 3] if isinstance(take, Poses) else np.zeros((n_frames, 0, 3))
        states = np.where(np.isnan(places[..., 0]), poses.MarkerState.ABSENT, poses.MarkerState.SEEN)
        if isinstance(take, PointCloud):
            kept = [take.frame(frame) for frame in range(take.n_frames)[frames]]
            cloud, counts = np.concatenate([cloud, *kept]), np.array([len(points) for points in kept], dtype=np.intp)
    if project.has("joints"):
        is_fitted = project.has("skeleton")
        joints = project.motion.joint_positions if is_fitted else project.topology.raw_joint_positions
        places = np.concatenate([joints[frames], places], axis=1)
        states = np.concatenate([poses.MarkerState.ABSENT * np.isnan(joints[frames, :, 0]), states], axis=1)
    if project.has("limbs"):
        is_fitted = project.has("skeleton")
        shape = (n_frames, project.limbs.n_limbs)
        states = np.concatenate([states, ~project.motion.limb_seen[frames] if is_fitted else np.zeros(shape)], axis=1)
    return _Points(places, states.astype(np.intp), cloud, counts)


def _front(project: Project) -> poses.View:
    """The view of the front, as the pictures of the reference pose have it."""
    sample = slice(None, None, max(project.take.n_frames // _SAMPLES, 1))
    points = _points(project, sample)
    if project.has("skeleton") and project.skeleton.n_limbs:
        body = np.concatenate([poses.reference_markers(project.skeleton), poses.reference_joints(project.skeleton)])
        left = poses.left_side(project.skeleton)
        return poses.find_views(body[~np.isnan(body[:, 0])], project.motion.marker_positions, left)[0]
    places = points.places
    if not places.shape[1]:
        places = np.full((len(points.counts), int(points.counts.max(initial=0)), 3), np.nan)
        is_there = np.arange(places.shape[1]) < points.counts[:, np.newaxis]
        places[is_there] = points.cloud
    known = places[~np.isnan(places[..., 0])]
    return poses.find_views(known[: places.shape[1]], places)[0]


def _drawn(project: Project) -> dict[str, Any]:
    """Names, and what is drawn between which points."""
    markers, has_limbs, has_joints = _markers_of(project), project.has("limbs"), project.has("joints")
    take = project.take
    names = markers.names if markers is not None else take.names if isinstance(take, Poses) else ()
    limb_of_marker = project.limbs.limb_of_marker if has_limbs else np.full(len(names), -1)
    edges = project.topology.edges if has_joints else np.zeros((0, 2), dtype=np.intp)
    bones = poses.find_bones(edges, limb_of_marker)
    doubtful = set(project.topology.doubtful.tolist()) if has_joints else set()
    joints = project.skeleton.joints if project.has("skeleton") else [None] * len(edges)
    return {
        "name": project.name,
        "names": names,
        "limbs": [project.limbs.called(limb) for limb in range(project.limbs.n_limbs)] if has_limbs else [],
        "limbOfMarker": limb_of_marker.tolist(),
        "joints": [
            {"open": joint is not None and not joint.is_fully_determined, "doubtful": index in doubtful}
            for index, joint in enumerate(joints)
        ],
        "bones": np.column_stack([bones.ends, bones.limb, bones.is_spoke]).tolist(),
        "members": [members.tolist() for members in bones.members],
    }


def _packed(points: _Points, basis: Floats, low: Floats, step: float) -> str:
    """Return states, coordinates, counts and the cloud as deflated bytes in base64; see `unpack` of play_take.js."""
    coordinates = _rounded(_without_gaps(points.places) @ basis, low, step).transpose(1, 2, 0)
    before = np.zeros((*coordinates.shape[:2], 2), dtype=np.uint16)
    differences = np.diff(coordinates, n=2, prepend=before)
    cloud = _rounded(points.cloud @ basis, low, step).T
    parts = [points.states.T.astype(np.uint8).tobytes()]
    for values in (differences, points.counts.astype(np.uint16), cloud):
        parts += [(values & 255).astype(np.uint8).tobytes(), (values >> 8).astype(np.uint8).tobytes()]
    return base64.b64encode(zlib.compress(b"".join(parts), _EFFORT)).decode()


def _rounded(places: Floats, low: Floats, step: float) -> np.ndarray[Any, np.dtype[np.uint16]]:
    return np.asarray(np.clip(np.round((places - low) / step), 0, 65_535)).astype(np.uint16)


def _without_gaps(places: Floats) -> Floats:
    """Keep the last known place of each point through its gaps, which need no room then."""
    known = ~np.isnan(places[..., 0])
    last = np.maximum.accumulate(np.where(known, np.arange(len(places))[:, np.newaxis], 0), axis=0)
    return np.nan_to_num(np.take_along_axis(places, last[..., np.newaxis], axis=0))
