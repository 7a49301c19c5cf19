"""Files of bones in motion, read for the simulation to put markers on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from skelgen.errors import FormatError
from skelgen.model.arrays import check_rate
from skelgen.model.bones import BoneMotion
from skelgen_formats.bone_units import AUTO
from skelgen_formats.registry import known_formats


def read_motion(
    path: Path | str, skeleton: Path | str | None = None, unit: str = AUTO, rate: float | None = None
) -> BoneMotion:
    """Read a motion of bones; the suffix tells the format.

    Parameters
    ----------
    path : Path or str
        The file.
    skeleton : Path or str, optional
        File of the bones, for formats that keep them apart; by default looked for in the same folder.
    unit : str
        Unit of lengths where the file states none: mm, cm, m, in, a number of mm, or auto.
    rate : float, Hz, optional
        Frame rate, where the file states none or a wrong one.

    Raises
    ------
    FormatError
        If the file is not a motion, or damaged; with the line.
    ParameterError
        If an option does not belong to the format.
    """
    path = Path(path)
    motions = [entry for entry in known_formats() if entry.read_motion is not None]
    for entry in motions:
        if entry.read_motion is not None and path.name.lower().endswith(entry.suffixes):
            motion = entry.read_motion(path, skeleton=Path(skeleton) if skeleton else None, unit=unit)
            return motion if rate is None else replace(motion, rate=check_rate(rate, path.name))
    known = ", ".join(f"{entry.title} ({' '.join(entry.suffixes)})" for entry in motions)
    raise FormatError(path, "", f"no motion of bones is known by this suffix; there are {known}")
