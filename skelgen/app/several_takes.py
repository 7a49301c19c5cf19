"""Several takes of one body calibrated together: one skeleton from the frames of all, and the motion of each take.

A take alone may show too little for limbs: a squat nothing of the arms. Labelled takes with the same names are put one
after the other; no skeleton is needed to know which marker is which. Otherwise the longest take is reconstructed by
itself, and its skeleton labels the others, by names or by rigidity, so that markers are the same in all takes. Limbs,
tree, joints and lengths are then found from all frames at once, and each take is posed by the result. A marker that
moved between takes has other distances to those that keep theirs to each other; it counts as two markers.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from skelgen.app.configuration import Settings
from skelgen.app.pipeline import run_stages
from skelgen.app.subject import check_subject
from skelgen.errors import InputError
from skelgen.geometry.statistics import median_of_known, pair_lengths
from skelgen.model import PointCloud, Poses, Project, StageReport, Take, Trajectories
from skelgen.model.arrays import Floats, Ints, spread_frames
from skelgen.progress import SILENT, Monitor
from skelgen.stages.labels import pose_skeleton
from skelgen.stages.subject import SubjectFit, fit_subject, subject_motion, with_joints_as_fitted

_LEAST_TAKES = 2


@dataclass(frozen=True, eq=False)
class SharedSkeleton:
    """One skeleton from several takes.

    Attributes
    ----------
    skeleton : Project
        The frames of all takes one after the other, with the skeleton that they share; a subject for further takes.
    takes : tuple of Project
        Each take with that skeleton and its own motion, in the order in which they were given.
    """

    skeleton: Project
    takes: tuple[Project, ...]


def calibrate_together(
    takes: Sequence[Take], *, settings: Settings | None = None, seed: int = 0, monitor: Monitor = SILENT
) -> SharedSkeleton:
    """Find one skeleton from several takes of a body.

    Parameters
    ----------
    takes : sequence of PointCloud or Trajectories
        At least two.
    settings : Settings, optional
        Parameters of the stages.
    seed : int
        Seed of every random choice.
    monitor : Monitor
        Receives progress and notices; may cancel.

    Raises
    ------
    InputError
        If there are fewer than two takes, one shows another body, or one is of bodies with orientation.
    """
    settings = settings or Settings()
    checked = _checked(takes)
    labelled = _by_names(checked, settings, seed, monitor) or _by_skeleton(checked, settings, seed, monitor)
    parts = [one.trajectories for one in labelled]
    together = _one_after_the_other(parts)
    titles = ", ".join(take.name or f"take {number}" for number, take in enumerate(checked, start=1))
    report = StageReport({}, 0.0, (f"frames of {len(parts)} takes: {titles}",))
    shared = Project(together, seed).with_trajectories(together, report)
    shared = run_stages(shared, "limbs", settings=settings, monitor=monitor)
    ends = np.cumsum([0, *(part.n_frames for part in parts)])
    posed = []
    for index, (take, part) in enumerate(zip(checked, parts, strict=True)):
        frames = slice(int(ends[index]), int(ends[index + 1]))
        own = replace(together, positions=together.positions[frames], rate=part.rate, name=part.name)
        posed.append(_posed(Project(take, seed).with_trajectories(own, labelled[index].report), shared, frames))
    _check_one_body(posed)
    return SharedSkeleton(shared, tuple(posed))


@dataclass(frozen=True, eq=False)
class _Labelled:
    """A take with the markers of all takes, and how they were found."""

    trajectories: Trajectories
    report: StageReport


def _by_names(
    takes: Sequence[PointCloud | Trajectories], settings: Settings, seed: int, monitor: Monitor
) -> list[_Labelled] | None:
    """Labelled takes by the names of their markers; None where these do not say which marker is which."""
    named = [take for take in takes if isinstance(take, Trajectories)]
    if len(named) < len(takes) or not are_named_alike(named):
        return None
    reference = max(named, key=lambda take: take.n_frames)
    moved = [() if take is reference else moved_markers(reference, take) for take in named]
    if any(names is None for names in moved):
        return None
    monitor.notice("markers are matched by their names, which are the same in all takes")
    found = []
    for take, names in zip(named, moved, strict=True):
        checked = run_stages(Project(take, seed), None, "labels", settings=settings, monitor=monitor)
        markers, report = checked.trajectories, checked.reports["labels"]
        if names:
            sentence = f"{take.name}: {', '.join(names)} sit elsewhere than in {reference.name}: other markers here"
            monitor.notice(sentence)
            report = replace(report, notices=(*report.notices, sentence))
            other = take.name or "another take"
            renamed = tuple(f"{name} in {other}" if name in names else name for name in markers.names)
            markers = replace(markers, names=renamed)
        found.append(_Labelled(markers, report))
    return found


def _by_skeleton(
    takes: Sequence[PointCloud | Trajectories], settings: Settings, seed: int, monitor: Monitor
) -> list[_Labelled]:
    """Takes whose markers are recognised by the skeleton of the longest."""
    first = max(range(len(takes)), key=lambda index: takes[index].n_frames)
    monitor.notice(f"markers are those of the longest take, {takes[first].name or f'take {first + 1}'}")
    base = check_subject(
        run_stages(Project(takes[first], seed), settings=settings, monitor=monitor), "the longest take"
    )
    found = []
    for index, take in enumerate(takes):
        if index == first:
            found.append(_Labelled(base.trajectories, base.reports["labels"]))
            continue
        fit = _fit(take, base, settings, monitor)
        found.append(_Labelled(_own_names(fit, base), StageReport(settings.labels.as_mapping(), 0.0, fit.notices)))
    return found


def _checked(takes: Sequence[Take]) -> list[PointCloud | Trajectories]:
    checked: list[PointCloud | Trajectories] = []
    for take in takes:
        if isinstance(take, Poses):
            raise InputError(f"{take.name}: holds bodies with orientation; takes with markers are calibrated together")
        if not isinstance(take, PointCloud | Trajectories):
            raise InputError(f"a take is {take!r:.60}; it must be a PointCloud or Trajectories")
        checked.append(take)
    if len(checked) < _LEAST_TAKES:
        raise InputError("one take alone is calibrated by `skelgen run`; give at least two to calibrate them together")
    return checked


def _fit(take: PointCloud | Trajectories, base: Project, settings: Settings, monitor: Monitor) -> SubjectFit:
    fit = fit_subject(take, base, labelling=settings.labels, posing=settings.skeleton, monitor=monitor)
    for sentence in fit.notices:
        monitor.notice(f"{take.name}: {sentence}")
    if fit.is_other_subject:
        raise InputError(f"{take.name}: {fit.notices[1]}")
    return fit


def _own_names(fit: SubjectFit, base: Project) -> Trajectories:
    """Labels of a take; markers that moved, and new ones without a name, are called after the take."""
    names = list(fit.trajectories.names)
    n_known = base.trajectories.n_markers
    strangers = [n_known + index for index, one in enumerate(fit.labels.new) if not one.name]
    for marker in (*fit.moved, *strangers):
        names[marker] = f"{names[marker]} in {fit.trajectories.name or 'another take'}"
    return replace(fit.trajectories, names=tuple(names))


def _one_after_the_other(parts: Sequence[Trajectories]) -> Trajectories:
    """The frames of all takes, markers by name; markers that are seen nowhere are left out."""
    names = list(dict.fromkeys(name for part in parts for name in part.names))
    blocks: list[Floats] = []
    for part in parts:
        block = np.full((part.n_frames, len(names), 3), np.nan)
        block[:, [names.index(name) for name in part.names]] = part.positions
        blocks.append(block)
    positions = np.concatenate(blocks)
    seen = np.flatnonzero(~np.isnan(positions[:, :, 0]).all(axis=0))
    name = " + ".join(part.name for part in parts)
    return Trajectories(positions[:, seen], tuple(names[index] for index in seen), parts[0].rate, name)


def _posed(project: Project, shared: Project, frames: slice) -> Project:
    """A take with the shared skeleton, posed by its own frames alone."""
    trajectories = project.trajectories
    held = with_joints_as_fitted(shared.skeleton, shared.motion)
    poses = pose_skeleton(held, trajectories.positions)
    motion = subject_motion(shared.skeleton, poses, trajectories.positions, trajectories.rate)
    topology = replace(shared.topology, raw_joint_positions=shared.topology.raw_joint_positions[frames])
    done = project.with_limbs(shared.limbs, shared.reports["limbs"])
    done = done.with_topology(topology, shared.reports["joints"])
    return done.with_skeleton(shared.skeleton, motion, shared.reports["skeleton"])


def _check_one_body(posed: Sequence[Project]) -> None:
    """Refuse takes if markers of one lie far from where the skeleton of all has them, beside how its limbs vary."""
    found = [_misfit(one) for one in posed]
    index = max(range(len(posed)), key=lambda index: found[index][0] / found[index][1])
    (off, varying), name = found[index], posed[index].take.name or f"take {index + 1}"
    if off > OTHER_BODY * varying:
        where = f"markers of {name} lie {off:.0f} mm from where the skeleton of all takes has them"
        raise InputError(f"the takes are not all of one body: {where}, though its limbs vary by {varying:.1f} mm only")


def _misfit(posed: Project) -> tuple[float, float]:
    """Median of the residuals of a take, and of the deviations of distances between markers of one limb [mm]."""
    limbs, take = posed.skeleton.limb_of_marker, posed.trajectories
    deviation = _distances(take, take.names)[1]
    on_one = (limbs == limbs[:, np.newaxis]) & (limbs >= 0) & np.isfinite(deviation) & ~np.eye(len(limbs), dtype=bool)
    residuals = posed.motion.residuals[:, limbs >= 0].reshape(-1, 1)
    varying = float(np.median(deviation[on_one])) if on_one.any() else np.inf
    return float(np.nan_to_num(median_of_known(residuals)[0])), max(varying, LEAST_VARYING)


OTHER_BODY, LEAST_VARYING = 10.0, 1.0
"""Median misfit of a take in what distances on its limbs vary by, in mm at least: takes of one body have 1 to 4."""

SHARED = 0.8
"""Of the names of the take that has fewer."""

LOOKED_AT = 300
"""Frames of a take in which distances are measured."""

MATES = 2
"""Markers to which distances of one are compared: those with the least product of distance and deviation."""

FAR, SURE = 8.0, 6.0
"""A distance differs between takes by more than so many mm and so many of its standard deviations."""

LEAST_DEVIATION = 0.5
"""mm; the least standard deviation of a distance that is assumed."""

MOST_MOVED = 0.25
"""Share of the markers; if more sit elsewhere, names do not identify markers, or the body is another one."""


def are_named_alike(takes: Sequence[Trajectories]) -> bool:
    """Whether all takes name mostly the same markers."""
    first = set(takes[0].names)
    return all(len(first & set(take.names)) >= SHARED * min(len(first), take.n_markers) for take in takes[1:])


def moved_markers(reference: Trajectories, take: Trajectories) -> tuple[str, ...] | None:
    """Return the names of the markers that sit elsewhere in a take; None if these are too many to be believed.

    Parameters
    ----------
    reference, take : Trajectories
        Labelled; markers of the same name are compared.
    """
    names = [name for name in take.names if name in reference.names]
    old, new = (_distances(one, names) for one in (reference, take))
    deviation = np.maximum(np.maximum(old[1], new[1]), LEAST_DEVIATION)
    differs = np.abs(np.nan_to_num(new[0], posinf=0.0) - np.nan_to_num(old[0], posinf=0.0)) > np.maximum(
        SURE * deviation, FAR
    )
    mates = np.argsort(deviation * np.maximum(old[0], new[0]), axis=1, kind="stable")[:, :MATES]
    believed, moved = np.isfinite(deviation), list[int]()
    while True:
        usable = np.take_along_axis(believed, mates, axis=1)
        shares = (usable & np.take_along_axis(differs, mates, axis=1)).sum(axis=1) / np.maximum(usable.sum(axis=1), 1)
        worst = int(shares.argmax()) if len(shares) else 0
        if not len(shares) or shares[worst] <= 0.5:
            return tuple(names[marker] for marker in sorted(moved))
        moved.append(worst)
        if len(moved) > MOST_MOVED * len(names):
            return None
        believed[worst] = believed[:, worst] = False


def _distances(take: Trajectories, names: Sequence[str]) -> tuple[Floats, Floats]:
    """Median and standard deviation of the distance between each two markers [mm]; infinite deviations if unknown."""
    columns: Ints = np.array([take.names.index(name) for name in names], dtype=np.intp)
    shown = take.positions[spread_frames(take.n_frames, LOOKED_AT)][:, columns]
    first, second = np.triu_indices(len(names), 1)
    gaps = pair_lengths(shown, first, second)
    known = ~np.isnan(gaps).all(axis=1)
    usual, deviation = np.full((2, len(names), len(names)), np.inf)
    for table, values in ((usual, median_of_known(gaps[known].T)), (deviation, np.nanstd(gaps[known], axis=1))):
        table[first[known], second[known]] = table[second[known], first[known]] = values
    return usual, deviation
