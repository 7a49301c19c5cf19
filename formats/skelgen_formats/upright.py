"""The choice of axes of formats that say which axis is up: by what is found to be up in the recording."""

from dataclasses import replace

import numpy as np

from skelgen.geometry.up_axis import AS_RECORDED, TURNS
from skelgen.model import Project
from skelgen.model.arrays import Floats
from skelgen_formats.options import AUTO, AXES, Options, Writable

_GRAVITY = 9.80665  # m/s^2, the standard

UPRIGHTABLE = replace(
    AXES,
    help="Axes of the world: as recorded; auto: what is found to be up is up as the format has it; or turned by hand.",
    choices=(*TURNS, AUTO),
)
UPRIGHT = replace(UPRIGHTABLE, default=AUTO)
"""Those of formats that say which axis is up, see `Format.up`; by default as recorded, and turned."""


def turn_wished(value: Writable, options: Options, up: str) -> str:
    """Return the turn of the world, a key of `TURNS`, that a user wants for a value.

    Parameters
    ----------
    value : Project, PointCloud, Trajectories, Poses or Filled
        What is to be written.
    options : Options
        With the choice of axes.
    up : str
        See `Format.up`.
    """
    if options.axes != AUTO:
        return options.axes
    from skelgen.geometry.up_axis import turn_to  # noqa: PLC0415 - scipy is slow to load

    return turn_to(value, up)


def remark_on_up(project: Project, options: Options, up: str, title: str) -> tuple[str, ...]:
    """Say if what is up in the file will not be what is up in the recording, or may not be.

    Parameters
    ----------
    project : Project
        As recorded.
    options : Options
        With the choice of axes.
    up : str
        See `Format.up`.
    title : str
        Of the format.
    """
    from skelgen.geometry.up_axis import turn_to, up_of  # noqa: PLC0415 - scipy is slow to load

    found, turn = up_of(project), turn_wished(project, options, up)
    if not found:
        return (f"{title} takes {up} to be up, and the recording does not tell what is: see which axes are right.",)
    comes = found if turn == AS_RECORDED else turn[-1] if turn.startswith(found) else ""
    if comes == up:
        return ()
    wish = turn_to(project, up)
    advice = f": choose axes {wish}" if wish != AS_RECORDED else ""
    return (f"{title} takes {up} to be up; in the recording it is {found}{advice}.",)


def gravity(project: Project, up: str) -> Floats:
    """Return the acceleration of gravity [m/s^2], shape (3,), against what is found to be up.

    Parameters
    ----------
    project : Project
        In the axes of the file.
    up : str
        The axis that is up where nothing is found, see `Format.up`.
    """
    from skelgen.geometry.up_axis import up_of  # noqa: PLC0415 - scipy is slow to load

    found = up_of(project) or up
    return np.where(np.array(list("xyz")) == found[-1], _GRAVITY if found.startswith("-") else -_GRAVITY, 0.0)
