"""What a project consists of, so that each format can declare which of it a file keeps, and may demand a skeleton."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from skelgen.errors import WriteError
from skelgen.model import PointCloud, Poses, Project, Trajectories
from skelgen_formats.options import Writable


@dataclass(frozen=True)
class Part:
    """One kind of thing that a project holds.

    Attributes
    ----------
    name : str
        What formats declare in `Format.keeps`.
    title : str
        How a sentence names it.
    is_in : callable (project) -> bool
        Whether a project has it.
    in_every_frame : bool
        Whether it has a value in every frame.
    """

    name: str
    title: str
    is_in: Callable[[Project], bool]
    in_every_frame: bool = False


def _has_markers(project: Project) -> bool:
    return project.has("labels") or isinstance(project.take, Trajectories)


PARTS: tuple[Part, ...] = (
    Part("points", "the points of the recording", lambda project: isinstance(project.take, PointCloud), True),
    Part("bodies", "the bodies with their orientations", lambda project: isinstance(project.take, Poses), True),
    Part("markers", "the positions of the markers", _has_markers, True),
    Part("names", "the names of the markers", _has_markers),
    Part("confidence", "how sure the labels are", lambda project: project.has_labelling),
    Part("limbs", "which marker is on which limb", lambda project: project.has("limbs")),
    Part("joints", "the positions of the joints", lambda project: project.has("skeleton"), True),
    Part("angles", "the angles of the joints with their deviations", lambda project: project.has("skeleton"), True),
    Part("kinds", "kinds and axes of the joints", lambda project: project.has("skeleton")),
    Part("uncertainty", "how sure the joints are", lambda project: project.has("skeleton")),
    Part("motion", "how the limbs turn", lambda project: project.has("skeleton"), True),
)
"""All parts, in the order in which the stages find them."""


def parts_in(project: Project) -> tuple[Part, ...]:
    """Return the parts that a project has."""
    return tuple(part for part in PARTS if part.is_in(project))


def finished_project(value: Writable, title: str) -> Project:
    """Return a project that has its skeleton and its motion.

    Parameters
    ----------
    value : Project, PointCloud, Trajectories, Poses or Filled
        What is to be written.
    title : str
        Of the format, for errors.

    Raises
    ------
    WriteError
        If it is no project.
    MissingResultError
        If a stage has not run.
    """
    if not isinstance(value, Project):
        raise WriteError(
            f"{title} holds what is found of a skeleton, not a take; run the four stages first, or choose a format for"
            " takes"
        )
    _ = value.motion  # says which stage is missing
    return value


def moving_project(value: Writable, title: str) -> Project:
    """Return a finished project with at least one limb and one frame; parameters and errors as `finished_project`.

    Parameters
    ----------
    value : Project, PointCloud, Trajectories, Poses or Filled
        What is to be written.
    title : str
        Of the format, for errors.
    """
    project = finished_project(value, title)
    if project.skeleton.n_limbs == 0 or project.motion.n_frames == 0:
        raise WriteError(f"{title} needs at least one limb and one frame")
    return project
