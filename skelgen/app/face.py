"""The public face: `read` a take, `reconstruct` the skeleton, `write` the result."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from skelgen.app.configuration import Settings, Wanted
from skelgen.app.files import given_identities, open_input, write_any
from skelgen.app.pipeline import run_stages
from skelgen.app.stages import Wishes
from skelgen.errors import InputError
from skelgen.model import Identities, PointCloud, Poses, Project, Take, Trajectories
from skelgen.progress import SILENT, Monitor


def read(path: Path | str, format: str | None = None, **options: Any) -> Take:
    """Read a take from a file.

    Parameters
    ----------
    path : Path or str
        The file; its format is found by content first and suffix second. Of a project file, its take is read.
    format : str, optional
        Read as this format; ``skelgen formats`` lists them.
    **options
        What the format's reader can be told, e.g. ``timestamp_unit``.

    Returns
    -------
    PointCloud, Trajectories or Poses
        Positions in mm; NaN where unseen.

    Raises
    ------
    FormatError
        If the file is not what its format demands.

    Examples
    --------
    >>> take = read("take.c3d")  # doctest: +SKIP
    >>> take.n_frames, take.n_markers  # doctest: +SKIP
    (1101, 53)
    """
    return open_input(path, format, **options).take


def reconstruct(
    take: Take,
    n_markers: int | None = None,
    n_limbs: int | None = None,
    seed: int = 0,
    parameters: Wanted = None,
    monitor: Monitor | None = None,
    *,
    n_jobs: int = 1,
    identities: Identities | Path | str | None = None,
    hierarchy: Mapping[str, str] | None = None,
    root: str | None = None,
) -> Project:
    """Find limbs, joints and skeleton of a take, and the skeleton's motion.

    Parameters
    ----------
    take : PointCloud, Trajectories or Poses
        From `read`, or made by hand.
    n_markers : int, optional
        Number of physical markers in an unlabelled take; found if left out.
    n_limbs : int, optional
        Number of rigid limbs; found if left out.
    seed : int
        Seed of every random choice: same take and seed, same result.
    parameters : mapping, Path or str, optional
        Per stage (``labels``, ``limbs``, ``joints``, ``skeleton``) its parameters or a mapping of names to values,
        or the path of a ``config.xml``.
    monitor : Monitor, optional
        Told of progress and notices; may cancel.
    n_jobs : int
        Number of processes for work that can be shared.
    identities : Identities, Path or str, optional
        What you state of some points, or the file that states it; the labels obey.
    hierarchy : mapping of str to str, optional
        Parent of every limb by name, empty for a root: names of bodies, or limb0, limb1, ...; found if left out.
    root : str, optional
        Name of the limb that is the root of a tree that is found.

    Returns
    -------
    Project
        With trajectories, limbs, topology, skeleton and motion.

    Raises
    ------
    InputError
        If nothing can be found in the take: one marker, two frames, no motion.
    ParameterError
        If a parameter is unknown or out of bounds.

    Examples
    --------
    >>> project = reconstruct(take, n_limbs=13, parameters={"joints": {"alpha": 0.1}})  # doctest: +SKIP
    >>> project.motion.joint_positions.shape  # doctest: +SKIP
    (1101, 12, 3)
    """
    if not isinstance(take, PointCloud | Trajectories | Poses):
        raise InputError(f"a take must be a PointCloud, Trajectories or Poses, not {type(take).__name__}")
    wishes = Wishes(n_markers=n_markers, n_limbs=n_limbs, n_jobs=n_jobs, hierarchy=hierarchy, root=root)
    project = Project(take, seed, identities=given_identities(identities))
    return run_stages(project, settings=Settings(parameters), wishes=wishes, monitor=monitor or SILENT)


def write(value: Project | Take, path: Path | str, format: str | None = None, **options: Any) -> list[Path]:
    """Write a project or a take; the file appears whole or not at all.

    Parameters
    ----------
    value : Project, PointCloud, Trajectories or Poses
        What to write.
    path : Path or str
        The file; its format comes from `format` or the suffix.
    format : str, optional
        Format to write; ``skelgen formats`` lists them. ``skelgen`` is the project file.
    **options
        What the format's writer can be told.

    Returns
    -------
    list of Path
        The files written: more than one for formats that come in pairs.

    Raises
    ------
    WriteError
        If no format belongs to the suffix, the format cannot hold the value, or the file cannot be written.

    Examples
    --------
    >>> write(project, "walk.xml")  # doctest: +SKIP
    [PosixPath('walk.xml')]
    """
    return write_any(value, path, format, **options)
