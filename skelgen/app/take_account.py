"""What a take looks like: which axis is up, how tall it is, how much is missing, whether its unit can be right.

Up is the axis along which the lowest point of a frame keeps still best: a body stands on something. Of an axis that
is not much better than the next, one is unsure. Where names tell shoulders, knees and ankles, up is towards the former.
"""

import re
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from skelgen.kinematics.keypoints import joint_of_name
from skelgen.model import PointCloud, Poses, Take
from skelgen.model.arrays import Floats
from skelgen.simulation.people.tables import MARKER_SETS, read_table

_FRAMES = 500  # of a take that are looked at; a second for any file
_SURE, _FAIRLY = 4.0, 1.5  # how many times more the lowest points stray along the next axis
_HIGH = 99.0  # percentile of heights that counts as the top, so that a stray point does not
_BODY_MM = (300.0, 3000.0)  # what most bodies span
_SMALLEST_MM, _LARGEST_MM = 20.0, 20_000.0  # extents of what people record, from a hand to a hall
_KEYPOINTS = {
    "keypoints of COCO or MediaPipe": ("nose", "left_shoulder", "right_shoulder", "left_hip", "right_hip", "left_knee"),
    "keypoints of OpenPose, Pose2Sim or OpenCap": (
        "Neck",
        "RShoulder",
        "LShoulder",
        "RHip",
        "LHip",
        "RKnee",
    ),
}
_MOST_OF_SUIT = 0.75
_APART = re.compile(r"[^a-z0-9]")


def account_of(take: Take) -> dict[str, Any]:
    """Return what a take looks like, for `skelgen info`.

    Returns
    -------
    mapping
        ``up`` (x, y, z, -x and so on, or empty), ``up_sure`` (sure, likely, unsure), ``height_mm`` along it,
        ``missing`` (share of positions that are not seen), ``unit`` (a sentence if that of the file can hardly be
        right) and ``suit``.
    """
    frames = _sample(take)
    names = () if isinstance(take, PointCloud) else take.names
    facts: dict[str, Any] = {"missing": _missing(take), "suit": _suit(names)}
    lowest = np.array([np.nanmin(frame, axis=0) for frame in frames if not np.isnan(frame).all()]).reshape(-1, 3)
    if len(lowest) < 2 or isinstance(take, Poses):
        return {"up": "", "up_sure": "unsure", "height_mm": None, "unit": "", **facts}
    everything = np.concatenate(frames)
    everything = everything[~np.isnan(everything[:, 0])]
    straying = lowest.std(axis=0) + 1e-3
    order = np.argsort(straying)
    axis, times, sign = int(order[0]), float(straying[order[1]] / straying[order[0]]), 1.0
    rise = _rise(names, frames)
    if np.sort(np.abs(rise))[-1] > _SURE * np.sort(np.abs(rise))[-2]:
        axis, times = int(np.abs(rise).argmax()), np.inf
        sign = float(np.sign(rise[axis]))
        lowest = sign * np.array([np.nanmin(sign * frame, axis=0) for frame in frames if not np.isnan(frame).all()])
    height = float(np.percentile(sign * everything[:, axis], _HIGH) - np.median(sign * lowest[:, axis]))
    sure = "sure" if times > _SURE else "likely" if times > _FAIRLY else "unsure"
    up = "xyz"[axis] if sign > 0 else f"-{'xyz'[axis]}"
    return {"up": up, "up_sure": sure, "height_mm": height, "unit": _unit(frames), **facts}


def account_sentences(facts: Mapping[str, Any]) -> list[str]:
    """Return what `account_of` found as lines for people."""
    lines = []
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


def _sample(take: Take) -> list[Floats]:
    chosen = sorted({int(frame) for frame in np.linspace(0, take.n_frames - 1, _FRAMES)} if take.n_frames else ())
    if isinstance(take, PointCloud):
        return [take.frame(index) for index in chosen if len(take.frame(index))]
    positions = take.world_from_body[..., :3, 3] if isinstance(take, Poses) else take.positions
    return [positions[index] for index in chosen]


def _rise(names: Sequence[str], frames: Sequence[Floats]) -> Floats:
    """Median way from knees and ankles to shoulders [mm], shape (3,), if names tell them; else zeros."""
    joints = [joint_of_name(name)[1] for name in names]
    high = [point for point, joint in enumerate(joints) if joint == "shoulder"]
    low = [point for point, joint in enumerate(joints) if joint in ("knee", "ankle")]
    if not high or not low:
        return np.zeros(3)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # frames in which none is seen
        ways = np.array([np.nanmean(frame[high], axis=0) - np.nanmean(frame[low], axis=0) for frame in frames])
        return np.asarray(np.nan_to_num(np.nanmedian(ways, axis=0)))


def _missing(take: Take) -> float | None:
    if isinstance(take, PointCloud):
        return None
    column = take.world_from_body[..., 0, 0] if isinstance(take, Poses) else take.positions[..., 0]
    return float(np.isnan(column).mean())


def _unit(frames: Sequence[Floats]) -> str:
    """Say if a body of this size is hardly possible, and what unit would make it one."""
    extents = [np.ptp(frame[~np.isnan(frame[:, 0])], axis=0).max() for frame in frames if not np.isnan(frame).all()]
    extent = float(np.median(extents))
    if _SMALLEST_MM <= extent <= _LARGEST_MM or extent == 0.0:
        return ""
    units = {"m": 1000.0, "cm": 10.0, "inch": 25.4, "mm": 1e-3}
    fitting = next((name for name, mm in units.items() if _BODY_MM[0] <= extent * mm <= _BODY_MM[1]), "another unit")
    return f"a frame spans {extent:.3g} mm: the numbers are probably in {fitting}, not as stated"


def _suit(names: Sequence[str]) -> str:
    """Return the marker set most of whose names are there."""
    there = {_plain(name) for name in names}
    suits = {suit: tuple(read_table("marker_sets")[suit]["markers"]) for suit in MARKER_SETS} | _KEYPOINTS
    common = {suit: sum(_plain(name) in there for name in wanted) for suit, wanted in suits.items()}
    best = max(suits, key=lambda suit: (common[suit] / len(suits[suit]), common[suit]))
    return best if common[best] >= _MOST_OF_SUIT * len(suits[best]) else ""


def _plain(name: str) -> str:
    return _APART.sub("", name.lower())
