"""A correction is taken back; where a calibrated skeleton labelled the take, it labels the take again."""

from dataclasses import replace

import numpy as np

from skelgen.app.configuration import ParameterValues, Settings
from skelgen.app.corrections import EDITS, is_by_subject, without_correction
from skelgen.app.inputs import with_checked_arguments
from skelgen.app.subject import run_with_subject
from skelgen.errors import InputError
from skelgen.model import Limbs, Project, Skeleton
from skelgen.model.arrays import Bools
from skelgen.model.corrections import names_after
from skelgen.progress import SILENT, Monitor
from skelgen.stages.labels import stated_positions
from skelgen.stages.subject import reposed_subject


@with_checked_arguments
def take_back(
    project: Project, index: int, parameters: ParameterValues = None, monitor: Monitor | None = None
) -> Project:
    """Take back something that you stated with `skelgen.correct`; later runs no longer obey it.

    Parameters
    ----------
    project : Project
        Its ``corrections`` say what was stated.
    index : int
        Which of them, from 0; -1 is the last.
    parameters : mapping, Path or str, optional
        As for `skelgen.reconstruct`, where a calibrated skeleton labels the take again.
    monitor : Monitor, optional
        Receives progress and notices; may cancel.

    Returns
    -------
    Project
        Results that rested on it are dropped, and `reconstruct` finds them anew; a calibrated skeleton that labelled
        the take stays.

    Raises
    ------
    InputError
        If there is no such correction.

    Examples
    --------
    >>> import skelgen
    >>> project = skelgen.reconstruct(skelgen.simulate("rods", n_frames=100).take)
    >>> project = skelgen.correct(project, "root", project.trajectories.names[:1])
    >>> [correction.sentence for correction in project.corrections]
    ['the limb of middle rod 1 is the root']
    >>> skelgen.take_back(project, 0).corrections
    ()
    """
    n_stated = len(project.corrections)
    if not -n_stated <= index < n_stated:
        there = f"0 to {n_stated - 1}" if n_stated else "none"
        raise InputError(f"there is no correction {index} that could be taken back; there are {there}")
    return taken_back(project, index % n_stated, Settings(parameters), monitor or SILENT)


def taken_back(project: Project, index: int, settings: Settings | None = None, monitor: Monitor = SILENT) -> Project:
    """Return a project without one of its corrections; a calibrated skeleton that labelled the take stays.

    Parameters
    ----------
    project : Project
        With corrections. Of a take without a calibrated skeleton results are dropped: see `without_correction`.
    index : int
        Which of them.
    settings : Settings, optional
        Parameters of the stages, as for `run_with_subject`.
    monitor : Monitor
        Receives progress and notices; may cancel.
    """
    removed = project.corrections[index]
    if not is_by_subject(project):
        return without_correction(project, index)
    if removed.kind in EDITS:
        kept = (*project.corrections[:index], *project.corrections[index + 1 :])
        bare = replace(project, corrections=kept)
        done = run_with_subject(bare, _own_subject(project), settings=settings, monitor=monitor)
        done = replace(done, _labelling=replace(done.labelling, subject=project.labelling.subject))
    else:
        done = without_correction(project, index)
    labels = project.reports["labels"]
    notices = tuple(notice for notice in labels.notices if removed.sentence not in notice)
    return replace(done, reports={**project.reports, "labels": replace(labels, notices=notices)})


def _own_subject(project: Project) -> Project:
    """The take as a subject: its skeleton, and its markers as they were called before the corrections.

    Positions that the user gave to another marker are left out, and say nothing of how far markers stray.
    """
    names = list(project.trajectories.names)
    for one in reversed(project.corrections):
        if one.kind == "rename" and one.value in names:
            names[names.index(one.value)] = one.names[0]
    called = zip(project.corrections, names_after(project.corrections), strict=True)
    split_off = {after[-1] for one, after in called if one.kind == "split"}
    is_split_off = np.array([name in split_off for name in project.trajectories.names], dtype=np.bool_)
    kept = ~(is_split_off & (project.limbs.limb_of_marker < 0))
    changed = [one for one in project.corrections if one.kind != "confirm"]
    is_stated = stated_positions(project.trajectories, changed)
    positions = np.where(is_stated[..., np.newaxis], np.nan, project.trajectories.positions)[:, kept]
    names = [name for name, is_kept in zip(names, kept.tolist(), strict=True) if is_kept]
    trajectories = replace(project.trajectories, positions=positions, names=tuple(names))
    skeleton, _ = reposed_subject(_skeleton_of(project.skeleton, kept), trajectories)
    limbs = _limbs_of(project.limbs, kept)
    return replace(project, _trajectories=trajectories, _limbs=limbs, _skeleton=skeleton)


def _limbs_of(limbs: Limbs, kept: Bools) -> Limbs:
    """The limbs with some of the markers only."""
    return replace(
        limbs,
        limb_of_marker=limbs.limb_of_marker[kept],
        distance_deviation=limbs.distance_deviation[np.ix_(kept, kept)],
        membership=None if limbs.membership is None else limbs.membership[kept],
    )


def _skeleton_of(skeleton: Skeleton, kept: Bools) -> Skeleton:
    """The skeleton with some of the markers only."""
    offset_std, noise = skeleton.offset_std, skeleton.marker_noise
    return replace(
        skeleton,
        limb_of_marker=skeleton.limb_of_marker[kept],
        marker_offsets=skeleton.marker_offsets[kept],
        marker_std=skeleton.marker_std[kept],
        offset_std=None if offset_std is None else offset_std[kept],
        marker_noise=None if noise is None else noise[kept],
    )
