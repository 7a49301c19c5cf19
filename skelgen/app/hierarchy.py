"""A hierarchy that the user knows: read from a small text file, and turned into parents of limbs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from skelgen.errors import FormatError, InputError
from skelgen.model import Poses, Project
from skelgen.model.topology import parents_from_names


def read_hierarchy(path: Path | str) -> dict[str, str]:
    """Read a hierarchy: a line ``child,parent`` for every limb, the parent of a root left empty.

    Lines that begin with ``#`` and empty lines are skipped.

    Raises
    ------
    FormatError
        If a line has another form, or a child has two parents.
    """
    path = Path(path)
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except OSError as error:
        raise FormatError(path, "", f"cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise FormatError(path, "", "is no text in UTF-8") from error
    parents: dict[str, str] = {}
    for number, line in enumerate(lines, start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        child, _, parent = (part.strip() for part in line.partition(","))
        if not child or "," in parent:
            raise FormatError(path, number, f"{line.strip()[:60]!r} where child,parent belongs")
        if child in parents:
            raise FormatError(path, number, f"{child!r} has a parent already; a limb has one")
        parents[child] = parent
    if not parents:
        raise FormatError(path, "", "names no limb; a line child,parent belongs to each")
    return parents


def known_tree(project: Project, hierarchy: Mapping[str, str] | None, root: str | None) -> dict[str, Any]:
    """Return what `find_joints` is told of the tree: nothing, its parents, or its root.

    Parameters
    ----------
    project : Project
        With limbs.
    hierarchy : mapping of str to str, or None
        Parent of every limb by name, empty for a root.
    root : str or None
        Name of the root, or of a marker on it.

    Raises
    ------
    InputError
        If both are given, a name is unknown, or the parents go round in a circle.
    """
    names = project.take.names if isinstance(project.take, Poses) else _numbered(project.limbs.n_limbs)
    if hierarchy is not None and root is not None:
        raise InputError("a hierarchy says which limb is the root: give either of both")
    if hierarchy is not None:
        return {"parents": parents_from_names(names, hierarchy)}
    if root is None:
        return {}
    if root in names:
        return {"root": names.index(root)}
    markers = () if isinstance(project.take, Poses) else project.trajectories.names
    limb = int(project.limbs.limb_of_marker[markers.index(root)]) if root in markers else -1
    if limb < 0:
        raise InputError(f"there is no limb {root!r} to be the root; there are {', '.join(names)}")
    return {"root": limb}


def _numbered(n_limbs: int) -> tuple[str, ...]:
    return tuple(f"limb{limb}" for limb in range(n_limbs))
