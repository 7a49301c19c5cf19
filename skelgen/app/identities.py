"""What the user states of points, in a project that has labels already: a name means the marker that has it there."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from skelgen_formats.identities_csv import read_identities

from skelgen.model import Identities, Identity, PointCloud, Project


def with_identities(project: Project, identities: Identities | Path | str | None) -> Project:
    """Return a project whose labels, once they are found anew, obey what the user states; as it is without statements.

    Parameters
    ----------
    project : Project
        With or without labels.
    identities : Identities, Path, str or None
        The statements, or the file that holds them; they replace earlier ones.
    """
    stated = read_identities(identities) if isinstance(identities, Path | str) else identities
    if stated is None:
        return project
    earlier = project.identities or Identities(())
    known = set(earlier.names)
    is_own = bool(earlier.source)  # beside the lines of a file there are none but own points
    added = [one for one in earlier.entries if is_own and not one.line and one.name in stated.names]
    for name in stated.names:
        if name not in known and not _is_seen_where_stated(project, name, stated.entries):
            added += own_point(project, name)
    return replace(project, identities=Identities((*added, *stated.entries), stated.source))


def own_point(project: Project, name: str) -> tuple[Identity, ...]:
    """Return a statement on a point amid the longest track of the marker of this name, if there is one.

    Names that the program gives come anew with the labels. Beside this statement, one on another point means that the
    point goes on with the marker; alone it would make a marker of that point's track.

    Parameters
    ----------
    project : Project
        With or without labels.
    name : str
        What the marker is called now.
    """
    if not isinstance(project.take, PointCloud) or not project.has_labelling or project.labelling.tracklets is None:
        return ()
    markers, tracklets = project.trajectories, project.labelling.tracklets
    marker = markers.names.index(name) if name in markers.names else -1
    parts = np.flatnonzero((tracklets.marker == marker) & (marker >= 0))
    if not len(parts):
        return ()
    longest = parts[tracklets.n_points[parts].argmax()]
    first, last = int(tracklets.first[longest]), int(tracklets.last[longest])
    frames = first + np.flatnonzero(markers.seen[first : last + 1, marker])
    if not len(frames):
        return ()
    frame = int(frames[len(frames) // 2])
    x, y, z = markers.positions[frame, marker].tolist()
    return (Identity(name, frame, (x, y, z)),)


def _is_seen_where_stated(project: Project, name: str, stated: Sequence[Identity]) -> bool:
    """Whether the marker of this name is seen where it is stated: then its point may be meant to be another one's."""
    if not project.has("labels") or name not in project.trajectories.names:
        return False
    seen = project.trajectories.seen[:, project.trajectories.names.index(name)]
    return any(one.name == name and one.frame < len(seen) and bool(seen[one.frame]) for one in stated)
