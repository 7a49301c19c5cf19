"""Takes whose file says rate, unit or axis wrongly, and the part of a take that is wanted."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from skelgen.errors import InputError
from skelgen.geometry.up_axis import AS_RECORDED, TURNS, with_up_axis
from skelgen.model import PointCloud, Poses, Project, Take, Trajectories
from skelgen.parameters import StageParameters, declare

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
    turned = with_up_axis(_with_rate(_cut(take, frames), parameters.rate), parameters.axes)
    if not isinstance(turned, PointCloud | Trajectories | Poses):
        raise InputError(f"{take.name}: it cannot be turned")  # never: a take stays a take
    changed = ", ".join(
        f"{name.replace('_', ' ')} {value}"
        for name, value in parameters.as_mapping().items()
        if value != getattr(AdaptParameters(), name)
    )
    adapted = replace(_scaled(turned, _UNITS[parameters.unit]), notices=(*take.notices, f"opened with {changed}"))
    return Project(adapted, project.seed)  # no file holds this take: the project must


def _cut(take: Take, frames: range) -> Take:
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
