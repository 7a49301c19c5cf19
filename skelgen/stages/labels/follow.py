"""Follow points from frame to frame into tracks, compiled where that pays and plain elsewhere."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator

import numpy as np

from skelgen.errors import InputError
from skelgen.model import PointCloud
from skelgen.model.arrays import Floats, Ints
from skelgen.progress import SILENT, Monitor
from skelgen.stages.labels import plain
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.tracks import Rules, Tracks

# More points than this in a frame are no markers but a scanner's surface or noise; it bounds the work per frame.
MOST_POINTS_PER_FRAME = 1000
# Below this number of pairs of points the plain twin is done before numba is imported, let alone has compiled.
_WORTH_COMPILING = 40_000_000
# Work between two calls of the monitor, in pairs of points; about a tenth of a second plain.
_PAIRS_PER_CHUNK = 2_000_000
# Frames that the automatic jump threshold is found from.
_TRIAL_FRAMES = 1500
# The threshold is this often the innovation that all but one in a thousand stay below, within bounds in typical
# spacings: beyond one spacing identity is a guess, and below a quarter single bad points would break tracks.
_QUANTILE, _MARGIN = 0.999, 1.5
_LEAST_SPACINGS, _MOST_SPACINGS = 0.25, 1.0
# Where no marker is ever lost every point has its track: the threshold in spacings is as good as none.
_OPEN_SPACINGS = 20.0

_Follow = Callable[[Floats, Ints, tuple[Floats, Ints, Ints], Rules, Ints, Floats], None]


def follow_points(
    cloud: PointCloud, parameters: LabelParameters, monitor: Monitor = SILENT, *, compiled: bool | None = None
) -> tuple[Ints, float]:
    """Give each point the identity of the track that it belongs to.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    parameters : LabelParameters
        How to match, predict and bridge gaps.
    monitor : Monitor
        Hears of the progress and may cancel.
    compiled : bool or None
        Use the compiled twin; None decides by the amount of work.

    Returns
    -------
    owner : ndarray of intp, shape (n_points,)
        Identity of each point, -1 for muted points.
    reach : float
        The jump threshold [mm] that was used.

    Raises
    ------
    InputError
        If a frame holds more than `MOST_POINTS_PER_FRAME` points.
    """
    most = int(cloud.points_per_frame.max(initial=0))
    if most > MOST_POINTS_PER_FRAME:
        frame = int(np.argmax(cloud.points_per_frame))
        raise InputError(
            f"frame {frame} holds {most} points, more than the {MOST_POINTS_PER_FRAME} that can be told apart as "
            "markers; raise the tracker's threshold or remove stray points"
        )
    if compiled is None:
        compiled = float((cloud.points_per_frame**2).sum()) > _WORTH_COMPILING
    follow = (_compiled_twin() if compiled else None) or plain.follow_frames
    reach = parameters.max_jump or _find_reach(cloud, parameters, follow, monitor)
    owner, _ = _follow(cloud.points, cloud.frame_starts, rules_of(parameters, reach), follow, monitor)
    return owner, reach


def rules_of(parameters: LabelParameters, reach: float) -> Rules:
    """Return the tracker's rules for a jump threshold `reach` [mm]."""
    rest = (1.0 - parameters.smoothing) ** 2
    gains = {
        "none": (1.0, 0.0),
        "constant_velocity": (1.0, 1.0),
        "double_exponential": (1.0 - rest, parameters.smoothing**2),
    }
    optimal = parameters.assignment == "optimal"
    return Rules(float(reach), parameters.mute, parameters.max_gap, *gains[parameters.prediction], optimal)


def typical_spacing(cloud: PointCloud) -> float:
    """Median distance [mm] between a point and its nearest neighbour in the same frame; 1 if there is none.

    A hundred frames spread over the take are looked at.
    """
    nearest = []
    for frame in np.unique(np.linspace(0, cloud.n_frames - 1, 100).astype(int)):
        points = cloud.frame(frame)
        if len(points) > 1:
            apart = np.linalg.norm(points[:, np.newaxis] - points, axis=2)
            np.fill_diagonal(apart, np.inf)
            nearest.append(apart.min(axis=1))
    spacing = float(np.median(np.concatenate(nearest))) if nearest else 0.0
    return spacing or 1.0


def _compiled_twin() -> _Follow | None:
    """Return the compiled loop, or None where numba cannot keep what it compiles."""
    try:
        from skelgen.stages.labels import compiled  # noqa: PLC0415 - numba takes a second to import
    except (ImportError, RuntimeError):
        return None
    return compiled.follow_frames


def _find_reach(cloud: PointCloud, parameters: LabelParameters, follow: _Follow, monitor: Monitor) -> float:
    """Find the jump threshold from how well a trial with a wide one predicts.

    It is one and a half times the 99.9 % quantile of the distance between a point and where it was expected, but no
    less than a quarter of and no more than the typical distance between neighbouring points. Where all frames hold the
    same number of points no marker is ever lost, and the threshold is wide open.
    """
    spacing = typical_spacing(cloud)
    if np.ptp(cloud.points_per_frame) == 0:
        return _OPEN_SPACINGS * spacing
    starts = cloud.frame_starts[: _TRIAL_FRAMES + 1]
    _, surprise = _follow(cloud.points, starts, rules_of(parameters, _MOST_SPACINGS * spacing), follow, monitor)
    known = surprise[~np.isnan(surprise)]
    usual = float(np.sqrt(np.quantile(known, _QUANTILE))) if len(known) else spacing
    return float(np.clip(_MARGIN * usual, _LEAST_SPACINGS * spacing, _MOST_SPACINGS * spacing))


def _follow(points: Floats, starts: Ints, rules: Rules, follow: _Follow, monitor: Monitor) -> tuple[Ints, Floats]:
    """Follow chunk by chunk; returns owner and surprise of each point."""
    counts = np.diff(starts)
    tracks = Tracks((rules.max_gap + 2) * int(counts.max(initial=1)))
    owner = np.full(starts[-1], -1, dtype=np.intp)
    surprise = np.full(starts[-1], np.nan)
    state = (tracks.motion, tracks.counters, tracks.totals)
    for first, last in _chunks(counts):
        follow(points, starts[first : last + 1], state, rules, owner, surprise)
        monitor.advance(last, len(counts))
    return owner, surprise


def _chunks(counts: Ints) -> Iterator[tuple[int, int]]:
    """Cut frames into spans of about equal work."""
    work = np.cumsum(counts.astype(np.float64) ** 2 + 1.0)
    cuts = np.flatnonzero(np.diff(work // _PAIRS_PER_CHUNK)) + 1
    edges = [0, *(int(cut) for cut in cuts), len(counts)]
    return ((first, last) for first, last in itertools.pairwise(edges) if last > first)
