"""Which axis is up in a take.

Up is the axis along which the lowest point of a frame keeps still best: a body stands on something. Of an axis that
is not much better than the next, one is unsure. Where names tell shoulders, knees and ankles, up is towards the former.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from skelgen.geometry.keypoints import joint_of_name
from skelgen.geometry.up_axis import AS_RECORDED, TURNS
from skelgen.model import PointCloud, Poses, Project, Take
from skelgen.model.arrays import Floats, spread_frames
from skelgen.model.filled import Filled

SURE, LIKELY, UNSURE = "sure", "likely", "unsure"
"""How sure an axis is."""

_FRAMES = 500  # of a take that are looked at; a second for any file
_SURE, _FAIRLY = 4.0, 1.5  # how many times more the lowest points stray along the next axis
_HIGH = 99.0  # percentile of heights that counts as the top, so that a stray point does not


@dataclass(frozen=True)
class Up:
    """Which axis is up.

    Attributes
    ----------
    axis : str
        ``x``, ``y``, ``z``, ``-x`` and so on; empty where nothing tells.
    sure : str
        `SURE`, `LIKELY` or `UNSURE`.
    height : float, mm, or None
        Of the highest points above the lowest ones.
    """

    axis: str
    sure: str
    height: float | None

    @property
    def believed(self) -> str:
        """The axis, or nothing if it is unsure."""
        return "" if self.sure == UNSURE else self.axis


def find_up(take: Take) -> Up:
    """Find the axis that is up in a take of points."""
    frames = sampled_points(take)
    shown = [frame for frame in frames if not np.isnan(frame).all()]
    if len(shown) < 2 or isinstance(take, Poses):
        return Up("", UNSURE, None)
    straying = np.array([np.nanmin(frame, axis=0) for frame in shown]).std(axis=0) + 1e-3
    order = np.argsort(straying)
    axis, times, sign = int(order[0]), float(straying[order[1]] / straying[order[0]]), 1.0
    rise = _rise(() if isinstance(take, PointCloud) else take.names, frames)
    if np.sort(np.abs(rise))[-1] > _SURE * np.sort(np.abs(rise))[-2]:
        axis, times = int(np.abs(rise).argmax()), np.inf
        sign = float(np.sign(rise[axis]))
    heights = [sign * frame[~np.isnan(frame[:, 0]), axis] for frame in shown]
    lowest = np.array([frame.min() for frame in heights])
    height = float(np.percentile(np.concatenate(heights), _HIGH) - np.median(lowest))
    name = "xyz"[axis] if sign > 0 else f"-{'xyz'[axis]}"
    return Up(name, SURE if times > _SURE else LIKELY if times > _FAIRLY else UNSURE, height)


def sampled_points(take: Take) -> Sequence[Floats]:
    """Return the points of some frames spread evenly over a take [mm], shape (n_points, 3), NaN where unseen."""
    chosen = spread_frames(take.n_frames, _FRAMES).tolist()
    if isinstance(take, PointCloud):
        return [take.frame(index) for index in chosen if len(take.frame(index))]
    positions = take.world_from_body[..., :3, 3] if isinstance(take, Poses) else take.positions
    return [positions[index] for index in chosen]


def up_of(value: Project | Take | Filled) -> str:
    """Return the axis that is up in what is to be written, ``z``, ``-y`` and so on; empty where that is unsure."""
    take = value.take if isinstance(value, Project) else value.measured if isinstance(value, Filled) else value
    return find_up(take).believed


def turn_to(value: Project | Take | Filled, up: str) -> str:
    """Return the turn, a key of `TURNS`, that brings what is found to be up to an axis; `AS_RECORDED` if none does.

    Parameters
    ----------
    value : Project, PointCloud, Trajectories, Poses or Filled
        What is to be written.
    up : str
        ``y`` or ``z``.
    """
    wish = f"{up_of(value)}-to-{up}"
    return wish if wish in TURNS else AS_RECORDED


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
