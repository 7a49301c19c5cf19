"""Curves of markers: where they are, how fast, how far from their limb mates; their gaps, and what would fill these."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np

from skelgen.app.drawing.scales import Extremes
from skelgen.app.drawing.wording import digits
from skelgen.errors import InputError
from skelgen.geometry.frame_rate import smoothed
from skelgen.kinematics.gap_filling.filling import unfilled, with_stated
from skelgen.kinematics.gap_filling.single_gaps import GapFill, fill_marker, gaps_of
from skelgen.model import Motion, Project, Skeleton, Trajectories
from skelgen.model.arrays import Floats
from skelgen.model.corrections import BY_SKELETON, Correction
from skelgen.model.filled import Filled
from skelgen_gui.model import translate
from skelgen_gui.model.curves import MOST_CURVES, Curve, Panel, marker_curves, sure_band

QUANTITIES = ("position", "speed", "distance")
"""What is drawn of markers."""

_LEAST_MATES = 3  # markers that carry another one rigidly


@dataclass(frozen=True)
class GapRow:
    """A gap of a marker.

    Attributes
    ----------
    marker : int
        Which one.
    name : str
        What it is called.
    first, last : int
        Frames, both included.
    stated : str
        How the user fills it; empty if nothing is stated.
    """

    marker: int
    name: str
    first: int
    last: int
    stated: str


@dataclass(frozen=True, eq=False)
class FillPreview:
    """A filling or a smoothing that the user tries: its statement, and the positions that it gives.

    Attributes
    ----------
    correction : Correction
        The statement.
    marker : int
        The marker that it is about.
    path : GapFill
        Its positions: those that fill, or the smoothed ones.
    words : str
        The deviation in a sentence.
    """

    correction: Correction
    marker: int
    path: GapFill
    words: str


def gap_rows(project: Project) -> tuple[GapRow, ...]:
    """Return all gaps of the markers of a project with labels, the longest first."""
    names, seen = project.trajectories.names, project.trajectories.seen
    stated = [one for one in project.corrections if one.kind == "fill"]
    rows = [
        GapRow(marker, name, first, last, _stated_way(stated, name, first, last))
        for marker, name in enumerate(names)
        for first, last in gaps_of(seen[:, marker])
    ]
    return tuple(sorted(rows, key=lambda row: (row.first - row.last, row.first, row.marker)))


def _stated_way(stated: Sequence[Correction], name: str, first: int, last: int) -> str:
    for one in reversed(stated):
        ends = one.first_frame or 0, np.inf if one.last_frame is None else one.last_frame
        if one.names[0] == name and ends[0] <= first and last <= ends[1]:
            return one.value
    return ""


def mates_of(project: Project, marker: int) -> tuple[int, ...]:
    """Return the other markers on a marker's limb; before limbs are known, none.

    Parameters
    ----------
    project : Project
        With labels.
    marker : int
        Which one.
    """
    limb = int(project.limbs.limb_of_marker[marker]) if project.has("limbs") else -1
    return () if limb < 0 else tuple(mate for mate in project.limbs.markers_of(limb).tolist() if mate != marker)


def preview_fill(project: Project, gap: tuple[int, int, int], method: str, donors: Sequence[int]) -> FillPreview | str:
    """Return what fills a gap in one way, or a sentence on why nothing does.

    Parameters
    ----------
    project : Project
        With labels.
    gap : tuple of int
        Marker, first and last frame.
    method : str
        One of `skelgen.model.corrections.FILL_METHODS`.
    donors : sequence of int
        Markers that carry it, where the method needs some; limb mates if there are none, or too few.
    """
    marker, first, last = gap
    names = project.trajectories.names
    donors = [donor for donor in donors if donor != marker]
    if method == "rigid" and len(donors) < _LEAST_MATES:
        donors = list(mates_of(project, marker))
    elif method not in {"rigid", "pattern"}:
        donors = []
    try:
        stated = (names[marker], *(names[donor] for donor in donors))
        correction = Correction("fill", stated, first, last, method)
        if method == BY_SKELETON:
            if not project.has("skeleton"):
                return translate("Gaps", "Run the step Skeleton first")
            found = _filled_part(_by_skeleton(project.trajectories, project.skeleton, project.motion), gap)
        else:
            found = fill_marker(project.trajectories, marker, (first, last), method, donors)
    except InputError as error:
        return str(error)
    if not len(found.frames):
        return translate("Gaps", "Nothing fills this gap in this way")
    return FillPreview(correction, marker, found, _deviation_words(found, method, last - first + 1))


def _deviation_words(found: GapFill, method: str, length: int) -> str:
    known = found.std[~np.isnan(found.std)]
    if not len(known):
        return translate("Gaps", "How far it is off is not known: no stretch as long is seen elsewhere")
    value = digits(float(np.sqrt((known**2).mean())))
    if method == BY_SKELETON:
        words = translate("Gaps", "±{value} mm expected, as the skeleton tells")
    else:
        words = translate("Gaps", "±{value} mm expected, as tried on {n} stretches that are seen")
    words = words.format(value=value, n=found.n_trials)
    if len(found.frames) < length:
        words += " " + translate("Gaps", "{n} frames stay empty").format(n=length - len(found.frames))
    return words


@lru_cache(maxsize=1)
def _by_skeleton(trajectories: Trajectories, skeleton: Skeleton, motion: Motion) -> Filled:
    from skelgen.kinematics.gap_filling.filling import fill_gaps  # noqa: PLC0415 - loads scipy

    return fill_gaps(trajectories, skeleton, motion)


def _filled_part(filled: Filled, gap: tuple[int, int, int]) -> GapFill:
    """The part of a gap that is filled: marker, first and last frame."""
    marker, first, last = gap
    frames = np.arange(first, last + 1)
    frames = frames[filled.filled[frames, marker]]
    return GapFill(frames, filled.positions[frames, marker], filled.std[frames, marker], 0)


def preview_smooth(project: Project, markers: Sequence[int], span: tuple[int, int], cutoff: float) -> FillPreview | str:
    """Return markers without what is faster than a frequency, or why that cannot be; the path is that of the first.

    Parameters
    ----------
    project : Project
        With labels.
    markers : sequence of int
        At least one.
    span : tuple of int
        First and last frame, both included.
    cutoff : float, Hz
        The frequency.
    """
    take = project.trajectories
    frames = np.arange(span[0], span[1] + 1)
    try:
        paths = [smoothed(take.positions[:, marker], take.rate, cutoff)[frames] for marker in markers]
    except InputError as error:
        return str(error)
    off = np.stack(paths, axis=1) - take.positions[frames][:, list(markers)]
    moved = np.linalg.norm(off, axis=2)[~np.isnan(off[..., 0])]
    change, most = (float(np.sqrt((moved**2).mean())), float(moved.max())) if len(moved) else (0.0, 0.0)
    whole = (span[0] or None, None if span[1] == take.n_frames - 1 else span[1])
    names = tuple(take.names[marker] for marker in markers)
    words = translate("Gaps", "Smoothing moves positions by {value} mm (root mean square), {most} mm at most")
    words = words.format(value=digits(change), most=digits(most))
    path = GapFill(frames, paths[0], np.full(len(frames), np.nan), 0)
    return FillPreview(Correction("smooth", names, *whole, f"{cutoff:g}"), markers[0], path, words)


def marker_panels(
    project: Project, markers: Sequence[int], quantity: str, preview: FillPreview | None = None
) -> tuple[Panel, ...]:
    """Return the curves of markers, with what the user states for their gaps, and what is previewed.

    Parameters
    ----------
    project : Project
        With labels.
    markers : sequence of int
        Which are drawn; at most six of them are.
    quantity : str
        One of `QUANTITIES`. Distances are those of all pairs, of a single marker those to its limb mates.
    preview : FillPreview, optional
        Drawn in a colour of its own, with a band of 95 %.
    """
    drawn = list(markers)[:MOST_CURVES]
    if quantity == "distance":
        pairs = list(combinations(drawn, 2))
        if len(drawn) == 1:
            pairs = [(drawn[0], mate) for mate in mates_of(project, drawn[0])]
        return _distances(project, pairs[:MOST_CURVES], preview)
    paths = [_path(project, marker) for marker in drawn]
    if quantity == "speed":
        title, about = translate("Curves", "Speed"), translate("Curves", "How fast markers move, from frame to frame.")
        curves = marker_curves(project, drawn, [_speed(path, project) for path in paths])
        if preview is not None:
            curves.append(_previewed(_speed(_spread(project, preview), project), None))
        return (Panel(title, "mm/s", tuple(curves), "", about),)
    panels = []
    for axis, title in enumerate("xyz"):
        curves = marker_curves(project, drawn, [path[:, axis] for path in paths])
        if preview is not None:
            values, std = _spread(project, preview)[:, axis], np.full(project.trajectories.n_frames, np.nan)
            std[preview.path.frames] = preview.path.std
            curves.append(_previewed(values, std))
        about = translate("Curves", "Where selected markers are, with what is stated for their gaps.")
        panels.append(Panel(title, "mm", tuple(curves), "", about, from_zero=False))
    return tuple(panels)


def _previewed(values: Floats, std: Floats | None) -> Curve:
    band = None if std is None else sure_band(values, std)
    return Curve(translate("Curves", "preview"), Extremes.of(values), band, component=0)


def _path(project: Project, marker: int) -> Floats:
    """Positions of a marker, with gaps filled as the user states, shape (n_frames, 3)."""
    name = project.trajectories.names[marker]
    stated = [one for one in project.corrections if one.kind == "fill" and one.names[0] == name]
    positions = np.array(project.trajectories.positions[:, marker])
    if not stated:
        return positions
    by_skeleton = any(one.value == BY_SKELETON for one in stated) and project.has("skeleton")
    of_skeleton = (project.skeleton, project.motion) if by_skeleton else None
    for part in _stated_parts(project.trajectories, of_skeleton, marker, tuple(stated)):
        positions[part.frames] = part.positions
    return positions


@lru_cache(maxsize=16)
def _stated_parts(
    trajectories: Trajectories, of_skeleton: tuple[Skeleton, Motion] | None, marker: int, stated: tuple[Correction, ...]
) -> tuple[GapFill, ...]:
    """The fillings that the user states for a marker; kept, since every other curve needs them again."""
    base = unfilled(trajectories) if of_skeleton is None else _by_skeleton(trajectories, *of_skeleton)
    filled, last = with_stated(base, list(stated)), trajectories.n_frames - 1
    return tuple(
        _filled_part(filled, (marker, one.first_frame or 0, last if one.last_frame is None else one.last_frame))
        for one in stated
    )


def _spread(project: Project, preview: FillPreview) -> Floats:
    """The previewed path over all frames, with a measured frame at either side of what fills, shape (n_frames, 3)."""
    values = np.full((project.trajectories.n_frames, 3), np.nan)
    frames = preview.path.frames
    for beside in (frames[0] - 1, frames[-1] + 1):
        if 0 <= beside < len(values):
            values[beside] = project.trajectories.positions[beside, preview.marker]
    values[frames] = preview.path.positions
    return values


def _speed(path: Floats, project: Project) -> Floats:
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1) * project.trajectories.rate
    return np.concatenate([steps[:1], steps])


def _distances(project: Project, pairs: Sequence[tuple[int, int]], preview: FillPreview | None) -> tuple[Panel, ...]:
    """Distances of pairs of markers [mm]."""
    title = translate("Curves", "Distance")
    about = translate("Curves", "Distances to the limb mates of a marker, or between the markers that are selected.")
    if not pairs:
        return ()
    names, curves = project.trajectories.names, []
    for number, (one, other) in enumerate(pairs):
        values = np.linalg.norm(_path(project, one) - _path(project, other), axis=1)
        name = translate("Curves", "{0} – {1}").format(names[one], names[other])
        curves.append(Curve(name, Extremes.of(values), limb=0, shade=number))
        if preview is not None and preview.marker == one:
            values = np.linalg.norm(_spread(project, preview) - _path(project, other), axis=1)
            curves.append(_previewed(values, None))
    return (Panel(title, "mm", tuple(curves), "", about, from_zero=False),)
