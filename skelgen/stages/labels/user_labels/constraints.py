"""Labels are made to agree with what the user states: those found in a cloud, and those that a file came with."""

import dataclasses

import numpy as np

from skelgen.errors import InputError
from skelgen.model import PointCloud, Trajectories
from skelgen.model.arrays import Ints
from skelgen.model.corrections import Identities, Identity
from skelgen.progress import SILENT, Monitor, counted
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.point_labels import all_positions, find_points, marker_names, renumbered
from skelgen.stages.labels.tracking.follow import follow_points
from skelgen.stages.labels.user_labels import statements


def apply_constraints(
    cloud: PointCloud,
    marker_of_point: Ints,
    constraints: statements.PointConstraints,
    labels: tuple[str, ...] = (),
    n_markers: int | None = None,
) -> tuple[Ints, tuple[str, ...]]:
    """Make the markers of points agree with what the user states.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    constraints : PointConstraints
        What the user states.
    labels : tuple of str
        Names that the markers have; without any they are numbered.
    n_markers : int or None
        Most markers; of those without a stated name the ones seen least go first.

    Returns
    -------
    marker_of_point : ndarray of intp, shape (n_points,)
        Numbered without holes, in the old order, new ones last.
    names : tuple of str, length n_left
        Their names: stated, as before, or numbered.

    Raises
    ------
    InputError
        If more names are stated than markers are wanted, or no marker is left.
    """
    if n_markers is not None and len(constraints.names) > n_markers:
        raise InputError(
            f"{len(constraints.names)} names are stated by hand, more than the {counted(n_markers, 'marker')} asked for"
        )
    frames = np.repeat(np.arange(cloud.n_frames), cloud.points_per_frame)
    n_before = max(int(marker_of_point.max(initial=-1)) + 1, len(labels))
    target = statements.markers_of_names(marker_of_point, constraints, n_before, labels)
    marker_of_point = statements.with_constraints(marker_of_point, frames, constraints, target)
    size = max(n_before, int(target.max(initial=-1)) + 1)
    counts = np.bincount(marker_of_point[marker_of_point >= 0], minlength=size)
    rank = counts + np.where(np.isin(np.arange(size), target), cloud.n_frames + 1, 0)  # stated ones before all others
    kept = np.sort(np.argsort(-rank, kind="stable")[:n_markers])
    kept = kept[counts[kept] > 0]
    if not len(kept):
        raise InputError("no marker is left: all points are nobody's, as is stated by hand")
    # Names of markers: stated, as before, or numbered so that they differ from both
    known = dict(enumerate(labels)) | dict(zip(target.tolist(), constraints.names, strict=True))
    free = (name for name in marker_names(len(kept) + len(known)) if name not in known.values())
    names = tuple(known[marker] if marker in known else next(free) for marker in kept.tolist())
    return renumbered(marker_of_point, np.isin(np.arange(size), kept)), names


def constrain_labelled(
    file: Trajectories,
    repaired: Trajectories,
    identities: Identities,
    parameters: LabelParameters,
    monitor: Monitor = SILENT,
) -> Trajectories:
    """Make a take that came with labels agree with what the user states.

    A stated point takes its track with it, as far as that can be followed; points that sit in its place change places
    with it. A name that no marker has yet becomes the name of the marker that holds most of what it is stated of.

    Parameters
    ----------
    file : Trajectories
        As it was read: where a statement gives the index of a point, it is that of one of its markers.
    repaired : Trajectories
        The same positions, perhaps with other labels.
    identities : Identities
        What the user states.
    parameters : LabelParameters
        How points are followed.
    monitor : Monitor
        Receives a notice of what was changed.
    """
    starts = np.concatenate([[0], np.cumsum(file.seen.sum(axis=1))])
    cloud = PointCloud(file.positions[file.seen], starts, file.times, name=file.name)
    # Statements about markers by their index, as statements about positions
    entries = tuple(_located(identities, entry, file) for entry in identities.entries)
    tracks, _ = follow_points(cloud, parameters, monitor)
    constraints = statements.find_constraints(cloud, tracks, dataclasses.replace(identities, entries=entries))
    found, names = apply_constraints(cloud, find_points(cloud, repaired.positions), constraints, repaired.names)
    lost = int(repaired.seen.sum() - (found >= 0).sum())
    stated = counted(len(identities.entries), "identity stated by hand is", "identities stated by hand are")
    sentence = f"{stated} obeyed"
    if lost:
        one = "position that had to make room or is nobody's is left out"
        several = "positions that had to make room or are nobody's are left out"
        sentence += f"; {counted(lost, one, several)}"
    monitor.notice(sentence)
    positions = all_positions(cloud, found, len(names))
    return Trajectories(positions, names, file.rate, file.name, (*repaired.notices, sentence))


def _located(identities: Identities, entry: Identity, take: Trajectories) -> Identity:
    if entry.point is None or entry.frame >= take.n_frames:
        return entry
    if entry.point >= take.n_markers:
        raise identities.error(entry, f"there is no marker {entry.point}; markers are 0 to {take.n_markers - 1}")
    if not take.seen[entry.frame, entry.point]:
        raise identities.error(entry, f"{take.names[entry.point]} is not seen in frame {entry.frame}")
    x, y, z = take.positions[entry.frame, entry.point].tolist()
    return dataclasses.replace(entry, position=(x, y, z), point=None)
