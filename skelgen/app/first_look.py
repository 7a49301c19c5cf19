"""A first look at a take: which axis is up, how tall it is, how much is missing, whether its unit can be right.

`adapted` corrects a wrong rate, unit or axis of a take, and cuts out a part of it.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, TypedDict

import numpy as np

from skelgen.errors import InputError
from skelgen.geometry.up_axis import AS_RECORDED, TURNS, find_up, sampled_points, with_up_axis
from skelgen.marker_sets import read_table
from skelgen.model import PointCloud, Poses, Project, Take, Trajectories
from skelgen.parameters import StageParameters, declare

_BODY_MM = (300.0, 3000.0)  # what most bodies span
_SMALLEST_MM, _LARGEST_MM = 20.0, 20_000.0  # extents of what people record, from a hand to a hall
_KEYPOINTS = {
    "keypoints of COCO or MediaPipe": ("nose", "left_shoulder", "right_shoulder", "left_hip", "right_hip", "left_knee"),
    "keypoints of OpenPose, Pose2Sim or OpenCap": ("Neck", "RShoulder", "LShoulder", "RHip", "LHip", "RKnee"),
}
_MOST_OF_SUIT = 0.75
_APART = re.compile(r"[^a-z0-9]")


class TakeAccount(TypedDict):
    """What a take looks like; the keys are those of ``skelgen info --json``.

    Attributes
    ----------
    up : str
        Axis that points up: x, y, z, -x and so on, or empty.
    up_sure : str
        ``sure``, ``likely`` or ``unsure``.
    height_mm : float or None
        From the lowest points to the highest; None if no axis points up.
    unit : str
        A sentence if the unit of the file can hardly be right.
    missing : float or None
        Share of positions that are not seen; None for points without names.
    suit : str
        Marker set or keypoints whose names the take has, or empty.
    """

    up: str
    up_sure: str
    height_mm: float | None
    unit: str
    missing: float | None
    suit: str


class TakeFacts(TakeAccount):
    """What is known of a take before any stage has run.

    Attributes
    ----------
    name, kind : str
        The take's name; ``points``, ``markers`` or ``poses``.
    frames : int
        Number of frames.
    sampled_frames : int or None
        Of a large file, frames that stand for all; None if all were read.
    rate_hz, seconds : float
        Frame rate and duration.
    count : int
        Number of points, markers or bodies.
    low_mm, high_mm : list of float, or None
        Corners of the box around all positions; None if none is seen.
    notices : list of str
        What the reader noticed.
    """

    name: str
    kind: str
    frames: int
    sampled_frames: int | None
    rate_hz: float
    seconds: float
    count: int
    low_mm: list[float] | None
    high_mm: list[float] | None
    notices: list[str]


def account_of(take: Take) -> TakeAccount:
    """Return what a take looks like, for `skelgen info`."""
    up = find_up(take)
    names = () if isinstance(take, PointCloud) else take.names
    return {
        "up": up.axis,
        "up_sure": up.sure,
        "height_mm": up.height,
        "unit": doubt_of_unit(take) if up.axis else "",
        "missing": _missing(take),
        "suit": _suit(names),
    }


def account_sentences(facts: TakeFacts) -> list[str]:
    """Return what a take looks like as lines for people."""
    lines = []
    if facts["sampled_frames"]:
        of_all = f"from {facts['sampled_frames']} of {facts['frames']} frames, evenly spread"
        what = "extent, what is seen or missing and all notes are of these, gaps are not counted, and the others were"
        lines.append(f"{of_all}: {what} not checked (`--full` reads all)")
    if facts["up"]:
        standing = f"; the highest points are {facts['height_mm']:.0f} mm above the lowest"
        lines.append(f"up: {facts['up']} ({facts['up_sure']}){standing}")
    if facts["missing"]:
        lines.append(f"missing: {100 * facts['missing']:.3g} % of all positions")
    if facts["unit"]:
        lines.append(f"unit: {facts['unit']}")
    if facts["suit"]:
        lines.append(f"names: {facts['suit']}")
    return lines


def _missing(take: Take) -> float | None:
    if isinstance(take, PointCloud):
        return None
    column = take.world_from_body[..., 0, 0] if isinstance(take, Poses) else take.positions[..., 0]
    return float(np.isnan(column).mean())


def doubt_of_unit(take: Take) -> str:
    """Say if a body of this size is hardly possible, and what unit would make it one; empty where it is possible."""
    shown = [frame[~np.isnan(frame[:, 0])] for frame in sampled_points(take)]
    extent = float(np.median([np.ptp(frame, axis=0).max() for frame in shown if len(frame)] or [0.0]))
    if _SMALLEST_MM <= extent <= _LARGEST_MM or extent == 0.0:
        return ""
    units = {"m": 1000.0, "cm": 10.0, "inch": 25.4, "mm": 1e-3}
    fitting = next((name for name, mm in units.items() if _BODY_MM[0] <= extent * mm <= _BODY_MM[1]), "another unit")
    return f"a frame spans {extent:.3g} mm: the numbers are probably in {fitting}, not as stated"


def _suit(names: Sequence[str]) -> str:
    """Return the marker set most of whose names are there."""
    there = {_plain(name) for name in names}
    suits = {suit: tuple(described["markers"]) for suit, described in read_table("marker_sets").items()} | _KEYPOINTS
    common = {suit: sum(_plain(name) in there for name in wanted) for suit, wanted in suits.items()}
    best = max(suits, key=lambda suit: (common[suit] / len(suits[suit]), common[suit]))
    return best if common[best] >= _MOST_OF_SUIT * len(suits[best]) else ""


def _plain(name: str) -> str:
    return _APART.sub("", name.lower())


__all__ = ["AdaptParameters", "adapted"]

_UNITS = {"as-read": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4, "mm": 0.001}  # the last one for metres


@dataclass(frozen=True)
class AdaptParameters(StageParameters):
    """Changes to a take that was read; by default there are none."""

    stage: ClassVar[str] = "opening"

    first_frame: int = declare(0, "First frame that is taken, counted from 0.", within=(0, None), basic=True)
    last_frame: int = declare(0, "Last frame that is taken; 0 takes all to the end.", within=(0, None), basic=True)
    rate: float = declare(
        0.0, "Frame rate of the recording; 0 keeps what the file says.", unit="Hz", within=(0, None), basic=True
    )
    unit: str = declare(
        "as-read",
        "Unit of the numbers, where they were taken for millimetres by mistake; mm, where they were taken for metres.",
        choices=tuple(_UNITS),
        basic=True,
    )
    axes: str = declare(
        AS_RECORDED,
        "Axis that points up: z-to-y turns what is up along z up along y, y-to-z the other way.",
        choices=tuple(TURNS),
        basic=True,
    )


def adapted(project: Project, parameters: AdaptParameters) -> Project:
    """Return a project with a changed take, without results; the same project if nothing is to be changed.

    Parameters
    ----------
    project : Project
        As it was read.
    parameters : AdaptParameters
        What is changed.

    Raises
    ------
    InputError
        If no frames are left.
    """
    if parameters == AdaptParameters():
        return project
    take = project.take
    last = parameters.last_frame or take.n_frames - 1
    frames = range(take.n_frames)[parameters.first_frame : last + 1]
    if not len(frames):
        asked = f"frames {parameters.first_frame} to {last}"
        raise InputError(f"{take.name or 'the take'}: {asked} are asked for, and it has 0 to {take.n_frames - 1}")
    turned = with_up_axis(_with_rate(_part_of_take(take, frames), parameters.rate), parameters.axes)
    if not isinstance(turned, PointCloud | Trajectories | Poses):
        raise InputError(f"{take.name}: it cannot be turned")  # never: a take stays a take
    changed = ", ".join(
        f"{name.replace('_', ' ')} {value}"
        for name, value in parameters.as_mapping().items()
        if value != getattr(AdaptParameters(), name)
    )
    adapted = replace(_scaled(turned, _UNITS[parameters.unit]), notices=(*take.notices, f"opened with {changed}"))
    return Project(adapted, project.seed)  # no file holds this take: the project must


def _part_of_take(take: Take, frames: range) -> Take:
    part = slice(frames.start, frames.stop)
    if isinstance(take, Trajectories):
        return replace(take, positions=take.positions[part])
    if isinstance(take, Poses):
        return replace(take, world_from_body=take.world_from_body[part])
    starts = take.frame_starts[frames.start : frames.stop + 1]
    kept = slice(int(starts[0]), int(starts[-1]))
    attributes = {name: values[kept] for name, values in take.attributes.items()}
    times = take.times[part]
    return replace(take, points=take.points[kept], frame_starts=starts - starts[0], times=times, attributes=attributes)


def _with_rate(take: Take, rate: float) -> Take:
    if not rate:
        return take
    if isinstance(take, PointCloud):
        return replace(take, times=np.arange(take.n_frames) / rate)
    return replace(take, rate=rate)


def _scaled(take: Take, factor: float) -> Take:
    if isinstance(take, PointCloud):
        return replace(take, points=take.points * factor)
    if isinstance(take, Poses):
        poses = take.world_from_body.copy()
        poses[..., :3, 3] *= factor
        return replace(take, world_from_body=poses)
    return replace(take, positions=take.positions * factor)
