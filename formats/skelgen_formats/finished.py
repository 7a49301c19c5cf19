"""What writers of skeletons share: the value must be a project whose skeleton is fitted."""

from __future__ import annotations

from skelgen.errors import WriteError
from skelgen.model import Project, Take
from skelgen.model.filled import Filled


def finished_project(value: Project | Take | Filled, title: str) -> Project:
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
