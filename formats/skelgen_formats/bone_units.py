"""What readers of bones share: the unit of lengths in files that state none, and names that differ."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from skelgen.errors import FormatError, ParameterError
from skelgen.model.arrays import Floats, Ints
from skelgen_formats.markers import MM_PER_UNIT

AUTO = "auto"
"""The wish that the unit be told from the size of the body."""

LARGEST_MM = 1e9
"""No place of a motion lies farther from the origin: a thousand kilometres; what does is a damaged number."""

_USUAL_MM = 1000.0  # from the root of a body to its farthest tip: a human's hands and feet, within a factor of three
_CANDIDATES = ("mm", "cm", "m")


def bone_unit(
    path: Path, unit: str, parents: Ints, offsets: Floats, tips: Sequence[Floats]
) -> tuple[float, tuple[str, ...]]:
    """Return the mm per unit of a file, and what the user should know of it.

    Parameters
    ----------
    path : Path
        The file.
    unit : str
        A unit's name, a number of mm, or `AUTO`: that of mm, cm, m which brings the longest way along the bones from
        the root nearest to a metre, in proportion.
    parents : ndarray of intp, shape (n_bones,)
        Parents, -1 for roots.
    offsets : ndarray, shape (n_bones, 3)
        Each bone in its parent, in the file's unit.
    tips : sequence of ndarray, shape (n_tips, 3)
        Ends of each bone.

    Raises
    ------
    ParameterError
        If there is no such unit.
    FormatError
        If the unit is to be told from a body without size.
    """
    if unit != AUTO:
        return _stated(unit), ()
    reach = np.zeros(len(parents))
    for bone, parent in enumerate(parents.tolist()):
        if parent >= 0:
            reach[bone] = reach[parent] + np.linalg.norm(offsets[bone])
    longest = max(reach[bone] + np.linalg.norm(ends, axis=1).max(initial=0.0) for bone, ends in enumerate(tips))
    if not 0 < longest < LARGEST_MM:
        raise FormatError(path, "", "no bone has a length, so that the unit cannot be told; give --motion-unit")
    best = min(_CANDIDATES, key=lambda name: abs(np.log(longest * MM_PER_UNIT[name] / _USUAL_MM)))
    size = longest * MM_PER_UNIT[best]
    said = f"the file states no unit; taken as {best}, which makes its longest row of bones {size:.0f} mm"
    return MM_PER_UNIT[best], (f"{said}; --motion-unit says otherwise",)


def _stated(unit: str) -> float:
    try:
        scale = MM_PER_UNIT[unit.lower()] if unit.lower() in MM_PER_UNIT else float(unit)
    except ValueError:
        scale = np.nan
    if not 0 < scale < LARGEST_MM:
        raise ParameterError(f"motion-unit is {unit!r}; it must be auto, mm, cm, m, in, or a number of mm")
    return scale


def distinct_names(names: Sequence[str]) -> tuple[str, ...]:
    """Return names that differ: the second of a name gets `` 2`` behind it, and so on."""
    taken, count, distinct = set(names), Counter[str](), []
    for name in names:
        count[name] += 1
        candidate = name
        while count[name] > 1 and candidate in taken:
            candidate = f"{name} {count[name]}"
            count[name] += candidate in taken
        taken.add(candidate)
        distinct.append(candidate)
    return tuple(distinct)
