"""Fill the gaps of one marker by one of three methods of animators, with the error that the method makes elsewhere.

A spline continues the marker's own motion; rigid mates carry its place relative to theirs; a pattern is the path of
another marker. Each method is tried on stretches as long as the gap in which the marker is seen: its root mean square
error there is the stated deviation.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from skelgen.errors import InputError
from skelgen.geometry.orientation import fit_transform
from skelgen.model import Trajectories
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.labelling import seen_runs
from skelgen.progress import counted

_EDGE_SECONDS = 0.08  # of motion beside a gap, which give its velocity
_FEWEST_EDGE = 4  # frames of it
_MOST_TRIALS = 24  # stretches on which a way is tried
_REACH_SECONDS, _REACH_LENGTHS = 10.0, 40  # around a gap that is looked at: long takes cost no more than short ones
_FEWEST_MATES = 3  # markers that fix a rigid body

_Method = Callable[["_Marker", Ints], Floats]


@dataclass(frozen=True, eq=False)
class GapFill:
    """Positions for gaps of one marker.

    Attributes
    ----------
    frames : ndarray of intp, shape (n,)
        Which frames are filled, in their order.
    positions : ndarray, shape (n, 3), mm
        Where the marker is in them.
    std : ndarray, shape (n,), mm
        Root mean square error over the three axes where the same was tried on stretches that are seen; NaN without.
    n_trials : int
        On how many stretches it was tried for the longest gap.
    """

    frames: Ints
    positions: Floats
    std: Floats
    n_trials: int


def gaps_of(seen: Bools) -> tuple[tuple[int, int], ...]:
    """Return first and last frame of each gap of a marker, those at the ends of the take included.

    Parameters
    ----------
    seen : ndarray of bool, shape (n_frames,)
        When it is seen.
    """
    _, first, last = seen_runs(~np.asarray(seen)[:, np.newaxis])
    return tuple(zip(first.tolist(), last.tolist(), strict=True))


def fill_marker(
    trajectories: Trajectories, marker: int, span: tuple[int, int], method: str, donors: Sequence[int] = ()
) -> GapFill:
    """Fill the gaps that a marker has in a span of frames.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers.
    marker : int
        Which one.
    span : tuple of int
        First and last frame, both included; gaps that reach beyond are filled within.
    method : str
        ``spline``, ``rigid`` or ``pattern``.
    donors : sequence of int
        Markers that carry it: at least three for ``rigid``, one for ``pattern``.

    Returns
    -------
    GapFill
        Frames that the method cannot fill are left out.

    Raises
    ------
    InputError
        If the method is another one, or has not the donors that it needs.
    """
    if method not in _METHODS:
        raise InputError(f"single gaps are filled by {', '.join(_METHODS)}, not by {method!r}")
    least, most = {"spline": (0, 0), "rigid": (_FEWEST_MATES, len(donors)), "pattern": (1, 1)}[method]
    if not least <= len(donors) <= most or marker in donors:
        wanted = ("at least " if method == "rigid" else "") + counted(least, "other marker")
        raise InputError(f"filling by {method} needs {wanted}; {len(donors)} named")
    carried = _Marker(trajectories.positions[:, marker], trajectories.positions[:, list(donors)], trajectories.rate)
    parts, n_trials, longest = [], 0, 0
    for first, last in gaps_of(trajectories.seen[:, marker]):
        low, high = max(first, span[0]), min(last, span[1])
        if low <= high:
            reach = max(round(_REACH_SECONDS * trajectories.rate), _REACH_LENGTHS * (last - first + 1))
            start = max(first - reach, 0)
            near, gap = carried.part(start, last + reach + 1), np.arange(first, last + 1) - start
            positions = _METHODS[method](near, gap)[low - first : high - first + 1]
            std, n_tried = _tried(near, _METHODS[method], first - start, last - start)
            frames = np.arange(low, high + 1)
            known = ~np.isnan(positions[:, 0])
            parts.append((frames[known], positions[known], std[low - first : high - first + 1][known]))
            n_trials, longest = (n_tried, last - first) if last - first >= longest else (n_trials, longest)
    if not parts:
        return GapFill(np.zeros(0, dtype=np.intp), np.zeros((0, 3)), np.zeros(0), 0)
    frames, positions, std = (np.concatenate(part) for part in zip(*parts, strict=True))
    return GapFill(frames, positions, std, n_trials)


@dataclass(frozen=True, eq=False)
class _Marker:
    """A marker and those that carry it: shapes (n_frames, 3) and (n_frames, n_donors, 3), mm; Hz."""

    own: Floats
    donors: Floats
    rate: float

    def part(self, first: int, end: int) -> "_Marker":
        """The same in some frames alone."""
        return replace(self, own=self.own[first:end], donors=self.donors[first:end])

    def without(self, frames: Ints) -> "_Marker":
        """The same as if it were unseen in some frames."""
        own = self.own.copy()
        own[frames] = np.nan
        return replace(self, own=own)

    @property
    def edge(self) -> int:
        """Frames beside a gap which give the motion there."""
        return max(_FEWEST_EDGE, round(_EDGE_SECONDS * self.rate))


def _tried(marker: _Marker, method: _Method, first: int, last: int) -> tuple[Floats, int]:
    """The error of a method by place in the gap, and on how many stretches it was tried: those nearest in time."""
    length = last - first + 1
    starts, ends = seen_runs(~np.isnan(marker.own[:, :1]))[1:]
    beside = marker.edge
    places = [
        start
        for low, high in zip(starts.tolist(), ends.tolist(), strict=True)
        for start in range(low + beside, high - length - beside + 2, max(length // 2, 1))
    ]
    places = sorted(places, key=lambda start: abs(start - first))[:_MOST_TRIALS]
    errors = np.full((len(places), length), np.nan)
    for number, start in enumerate(places):
        frames = np.arange(start, start + length)
        off = method(marker.without(frames), frames) - marker.own[frames]
        errors[number] = (off**2).mean(axis=1)
    counts = (~np.isnan(errors)).sum(axis=0)
    with np.errstate(invalid="ignore"):
        std = np.sqrt(np.nansum(errors, axis=0) / np.where(counts, counts, np.nan))
    return np.asarray(std), int(counts.max(initial=0))


def _ends(known: Bools, frames: Ints) -> tuple[int, int]:
    """The nearest frames before and after a gap in which something is known; -1 where there is none."""
    before, after = np.flatnonzero(known[: frames[0]]), np.flatnonzero(known[frames[-1] + 1 :])
    return int(before[-1]) if len(before) else -1, int(after[0] + frames[-1] + 1) if len(after) else -1


def _spline(marker: _Marker, frames: Ints) -> Floats:
    """A cubic from the last position before the gap to the first one behind it, with the velocities there."""
    before, after = _ends(~np.isnan(marker.own[:, 0]), frames)
    if before < 0 or after < 0:
        return np.full((len(frames), 3), np.nan)
    length = after - before
    x = ((frames - before) / length)[:, np.newaxis]
    first, last = _velocity(marker, before, -1) * length, _velocity(marker, after, 1) * length
    start, end = marker.own[before], marker.own[after]
    cubic = (2 * x**3 - 3 * x**2 + 1) * start + (3 * x**2 - 2 * x**3) * end
    return np.asarray(cubic + (x**3 - 2 * x**2 + x) * first + (x**3 - x**2) * last)


def _velocity(marker: _Marker, frame: int, side: int) -> Floats:
    """The velocity [mm/frame] at an edge of a gap: the slope of a parabola through the frames beside it."""
    beside = frame + side * np.arange(marker.edge)
    beside = beside[(beside >= 0) & (beside < len(marker.own))]
    seen = ~np.isnan(marker.own[beside, 0])
    beside = beside[seen]
    if len(beside) < 2:
        return np.zeros(3)
    degree = 2 if len(beside) >= _FEWEST_EDGE else 1
    return np.asarray(np.polynomial.polynomial.polyfit(beside - frame, marker.own[beside], degree)[1])


def _pattern(marker: _Marker, frames: Ints) -> Floats:
    """The path of the donor, shifted so that it begins and ends where the marker does."""
    donor = marker.donors[:, 0]
    before, after = _ends(~np.isnan(marker.own[:, 0] + donor[:, 0]), frames)
    return donor[frames] + _between(marker.own - donor, frames, before, after)


def _rigid(marker: _Marker, frames: Ints) -> Floats:
    """The place that the marker has among its mates before and after the gap, carried by those that are seen."""
    seen = ~np.isnan(marker.donors[..., 0])
    complete = np.flatnonzero(seen.all(axis=1))
    if not len(complete):
        return np.full((len(frames), 3), np.nan)
    shape = marker.donors[complete[np.abs(complete - frames[0]).argmin()]]
    shape = shape - shape.mean(axis=0)
    usable = seen.sum(axis=1) >= _FEWEST_MATES
    before, after = _ends(usable & ~np.isnan(marker.own[:, 0]), frames)
    needed = np.array([frame for frame in (before, *frames.tolist(), after) if frame >= 0])
    poses = np.full((len(marker.own), 4, 4), np.nan)
    poses[needed] = fit_transform(
        np.broadcast_to(shape, (len(needed), *shape.shape)), np.nan_to_num(marker.donors[needed]), seen[needed]
    )
    poses[~usable] = np.nan
    local = np.full(marker.own.shape, np.nan)
    for edge in (edge for edge in (before, after) if edge >= 0):
        local[edge] = poses[edge, :3, :3].T @ (marker.own[edge] - poses[edge, :3, 3])
    place = _between(local, frames, before, after)
    return np.asarray((poses[frames, :3, :3] @ place[..., np.newaxis])[..., 0] + poses[frames, :3, 3])


def _between(values: Floats, frames: Ints, before: int, after: int) -> Floats:
    """Values from one edge of a gap to the other; those of one edge where there is only that."""
    if before < 0 and after < 0:
        return np.full((len(frames), 3), np.nan)
    if before < 0 or after < 0:
        return np.broadcast_to(values[max(before, after)], (len(frames), 3))
    part = ((frames - before) / (after - before))[:, np.newaxis]
    return np.asarray((1 - part) * values[before] + part * values[after])


_METHODS: dict[str, _Method] = {"spline": _spline, "rigid": _rigid, "pattern": _pattern}
