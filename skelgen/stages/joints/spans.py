"""Joints that hold for a span of a take: partners who hold hands, a tool that is taken, a joint that is let go.

The joint of each two limbs is fitted in windows of time (O'Brien et al. 2000, eq. 8 to 13); where its gap is one of
noise in several windows on end, it is fitted to all of them, and the span goes as far as the gap stays small.

Limbs between which joints stand still for a while, or feet that stand on the floor, keep a point in common too. So a
joint must be needed: if one of both limbs were as it was at another time, seen from the world or from any limb between
them, the gap would have to be large. It must be overdetermined: fitted without a part of its span, it must hold there.
And limbs of one body must rotate against each other about all axes, as limbs of synchronous motions do not.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from skelgen.kinematics.joints.closed_form import RELATIVE_RIDGE, FixedPoint, fit_fixed_point
from skelgen.model.arrays import Bools, Floats, Ints, runs_of
from skelgen.model.joint_spans import JointSpan
from skelgen.stages.joints.parameters import Pair

BLOCK_SECONDS, BLOCK_FRAMES = 0.25, 10
"""A window is four blocks; a block has at least so many frames."""

BLOCKS = 4

LEAST_BLOCKS = 6
"""Spans that are shorter are not reported."""

TOLERANCE = 3.0
"""Times the usual gap of the tree's joints in a window: up to there it is noise."""

MOST_GAP = 2.0
"""Times the usual gap: that of a joint in its whole span."""

LEAST_GAP = 0.3
"""mm; the usual gap is at least that."""

UNKNOWN_GAP = 2.0
"""mm; taken as the usual gap where no limbs are joined."""

LOOSE_TIMES, LOOSE_GAP = 10.0, 50.0
"""Edges of the tree whose gap is so many times the usual one, and so many mm, hold nothing together all the time."""

NEEDED = 5.0
"""Times the gap in a span: with limbs as they were at another time, the gap must be larger than that."""

LEFT_OUT = 4
"""A span is cut into so many parts, and each is left out once."""

TURNS = 0.02
"""Least determinacy of a joint within one body: rotations by some 8 degrees about two axes."""

ARM, FIXED = 200.0, 4.0
"""Limbs are fixed to each other where points so far around them, in mm, move so little: times the gap of the joint."""

WHOLE = 0.9
"""Part of the take: a joint outside the tree that holds longer closes a loop, which another notice reports."""

ROUNDS = 4
LAGS = (0.25, 0.5, 0.75)


@dataclass(frozen=True, eq=False)
class _Take:
    """Poses [mm], shape (n_frames, n_limbs, 4, 4), frames of a block, and the usual gap [mm] of a joint in a window."""

    world: Floats
    block: int
    typical_gap: float

    def gaps(self, pair: Pair, fit: FixedPoint) -> Floats:
        """How far both images of a point are apart in each frame [mm], shape (n_frames,); NaN where unknown."""
        first, second = self.world[:, pair[0]], self.world[:, pair[1]]
        return np.asarray(np.linalg.norm(_carried(first, fit.in_first) - _carried(second, fit.in_second), axis=1))

    def is_short(self, span: JointSpan) -> bool:
        """Whether a joint holds for a part of the take only."""
        return span.last_frame - span.first_frame < WHOLE * len(self.world)

    def fit(self, pair: Pair, frames: Ints) -> FixedPoint | None:
        """The joint of two limbs in some frames."""
        return fit_fixed_point(self.world[frames, pair[0]], self.world[frames, pair[1]], np.zeros(3), np.zeros(3))


def find_joint_spans(world: Floats, parents: Ints, rate: float) -> tuple[tuple[JointSpan, ...], tuple[Pair, ...]]:
    """Find joints that hold for a part of a take.

    Parameters
    ----------
    world : ndarray, shape (n_frames, n_limbs, 4, 4), translations in mm
        world_from_limb; NaN where unseen.
    parents : ndarray of intp, shape (n_limbs,)
        The tree over the whole take.
    rate : float, Hz
        Frame rate.

    Returns
    -------
    tuple of JointSpan
        In the order of time.
    tuple of pairs of int
        Limbs that are not joined all the time: those of two parts that only a span joins, although the tree does.
    """
    children = np.flatnonzero(parents >= 0)
    edges = [(min(pair), max(pair)) for pair in zip(parents[children].tolist(), children.tolist(), strict=True)]
    block = max(round(BLOCK_SECONDS * rate), BLOCK_FRAMES)
    if len(world) < 2 * LEAST_BLOCKS * block:
        return (), ()
    every = list(combinations(range(len(parents)), 2))
    windows = {pair: _window_gaps(world[:, pair[0]], world[:, pair[1]], block) for pair in every}
    take = _Take(world, block, _typical_gap([windows[edge] for edge in edges]))
    spans = {pair: list(_candidates(take, pair, gaps)) for pair, gaps in windows.items()}
    loose = [edge for edge in edges if _is_loose(take, edge, spans[edge])]
    solid = [edge for edge in edges if edge not in loose]
    found = _accepted(take, [span for pair in every if pair not in solid for span in spans[pair]], solid)
    for_a_span = [edge for edge in loose if _way(edge, [*solid, *(span.limbs for span in found)])]
    kept = [edge for edge in edges if edge not in for_a_span]
    return found, tuple(pair for pair in every if for_a_span and not _way(pair, kept))


def _typical_gap(windows: Sequence[Floats]) -> float:
    quarters = [float(np.nanquantile(gaps, 0.25)) for gaps in windows if not np.isnan(gaps).all()]
    return max(float(np.median(quarters)), LEAST_GAP) if quarters else UNKNOWN_GAP


def _window_gaps(first: Floats, second: Floats, block: int) -> Floats:
    """Root mean square gap [mm] of the best joint in each window, shape (n_windows,); NaN where little is seen."""
    known = ~np.isnan(first[:, 0, 0] + second[:, 0, 0])
    a, b = first[:, :3, :3], second[:, :3, :3]
    way = second[:, :3, 3] - first[:, :3, 3]
    relative = a.swapaxes(1, 2) @ b
    terms = [relative.reshape(-1, 9), np.einsum("fki,fk->fi", a, way), np.einsum("fki,fk->fi", b, way)]
    table = np.concatenate([*terms, (way**2).sum(axis=1)[:, np.newaxis], np.ones((len(way), 1))], axis=1)
    table[~known] = 0.0
    n_blocks = len(table) // block
    blocks = table[: n_blocks * block].reshape(n_blocks, block, -1).sum(axis=1)
    sums = sum(blocks[start : n_blocks - BLOCKS + 1 + start] for start in range(BLOCKS))
    count = sums[:, -1]
    means = sums / np.maximum(count, 1.0)[:, np.newaxis]
    normal = np.tile(np.eye(6), (len(means), 1, 1))
    normal[:, :3, 3:] = -means[:, :9].reshape(-1, 3, 3)
    normal[:, 3:, :3] = normal[:, :3, 3:].swapaxes(1, 2)
    right = np.concatenate([means[:, 9:12], -means[:, 12:15]], axis=1)
    point = np.linalg.solve(normal + RELATIVE_RIDGE * np.eye(6), right[..., np.newaxis])[..., 0]
    square = means[:, 15] - 2 * (point * right).sum(axis=1) + np.einsum("wi,wij,wj->w", point, normal, point)
    return np.where(count >= BLOCKS * block / 2, np.sqrt(np.maximum(square, 0.0)), np.nan)


def _is_loose(take: _Take, edge: Pair, spans: list[JointSpan]) -> bool:
    """Whether an edge of the tree holds nothing together in a part of the take, or in all of it."""
    if sum(span.last_frame - span.first_frame for span in spans) >= WHOLE * len(take.world):
        return False  # it goes on elsewhere in a body: a sensor slipped
    limit = max(LOOSE_TIMES * take.typical_gap, LOOSE_GAP)
    fit = take.fit(edge, np.arange(len(take.world)))
    return (fit is not None and np.sqrt(fit.gap) > limit) or any(span.gap_beyond > limit for span in spans)


def _candidates(take: _Take, pair: Pair, windows: Floats) -> Iterator[JointSpan]:
    """Spans in which two limbs keep a point in common."""
    is_good = np.nan_to_num(windows, nan=np.inf) <= TOLERANCE * take.typical_gap
    last_frame = -1
    for start, stop in runs_of(is_good):
        if stop - start + BLOCKS - 1 < LEAST_BLOCKS or start * take.block <= last_frame:
            continue
        span = _grown(take, pair, np.arange(start * take.block, (stop + BLOCKS - 1) * take.block))
        if span is not None and span.first_frame > last_frame:
            last_frame = span.last_frame
            yield span


def _grown(take: _Take, pair: Pair, frames: Ints) -> JointSpan | None:
    """The span around some frames in which the gap of one joint stays small.

    Both ends are left out of the fit: limbs that are fixed to each other keep more than one point in common, and one
    of these may go on for a while after they are released.
    """
    middle = int(frames[len(frames) // 2])
    for _ in range(ROUNDS):
        fit = take.fit(pair, frames[take.block : -take.block])
        if fit is None or np.sqrt(fit.gap) > MOST_GAP * take.typical_gap:
            return None
        gaps = take.gaps(pair, fit)
        found = _around(gaps, TOLERANCE * max(float(np.sqrt(fit.gap)), take.typical_gap), middle, take.block)
        if found is None or len(found) < LEAST_BLOCKS * take.block:
            return None
        frames, in_first, in_second = found, fit.in_first, fit.in_second
    moved = _relative_motion(take.world[:, pair[0]], take.world[:, pair[1]], frames[take.block : -take.block])
    motion = float(np.sqrt(np.mean(moved[frames[take.block : -take.block]] ** 2)))
    is_fixed = motion < FIXED * take.typical_gap
    if is_fixed:
        found = _around(moved, TOLERANCE * motion, middle, take.block)
        frames = frames if found is None else found
    beyond = np.delete(gaps, np.arange(frames[0], frames[-1] + 1))
    beyond = beyond[~np.isnan(beyond)]
    apart = float(np.median(beyond)) if len(beyond) else 0.0
    gap = float(np.sqrt(np.mean(gaps[frames] ** 2)))
    return JointSpan(pair, int(frames[0]), int(frames[-1]), in_first, in_second, gap, apart, is_fixed)


def _around(values: Floats, most: float, middle: int, block: int) -> Ints | None:
    """The known frames around one in which values are small, short exceptions apart; None where there are none."""
    runs = runs_of(_without_short_runs(~(values > most), block // 2))
    return next((np.arange(*run)[~np.isnan(values[slice(*run)])] for run in runs if run[0] <= middle < run[1]), None)


def _relative_motion(first: Floats, second: Floats, frames: Ints) -> Floats:
    """How far points around the second body are from where they usually are in the first, shape (n_frames,), mm."""
    points = ARM * np.vstack([np.eye(3), -np.eye(3)])
    inward = first[:, :3, :3].swapaxes(1, 2)
    way = np.einsum("fij,fj->fi", inward, second[:, :3, 3] - first[:, :3, 3])
    seen = np.einsum("fij,kj->fki", inward @ second[:, :3, :3], points) + way[:, np.newaxis]
    return np.asarray(np.sqrt(((seen - seen[frames].mean(axis=0)) ** 2).sum(axis=2).mean(axis=1)))


def _accepted(take: _Take, found: list[JointSpan], solid: list[Pair]) -> tuple[JointSpan, ...]:
    """The spans that no other joint explains: limbs that are fixed to each other first, then the longest."""
    order = sorted(found, key=lambda span: (not span.is_fixed, span.gap / (span.last_frame - span.first_frame)))
    spans: list[JointSpan] = []
    for span in order:
        joined = [*solid, *(one.limbs for one in spans if _overlap(one, span))]
        way = _way(span.limbs, joined)
        least = NEEDED * max(span.gap, take.typical_gap)
        if take.is_short(span) and span.gap_beyond > least and _is_joint(take, span, way):
            spans.append(span)
    return tuple(sorted(spans, key=lambda span: (span.first_frame, span.limbs)))


def _is_joint(take: _Take, span: JointSpan, way: list[int]) -> bool:
    """Whether a span is overdetermined, and no limb between its limbs, nor the world, explains it by standing still."""
    frames = np.arange(span.first_frame, span.last_frame + 1)
    first, second = (take.world[frames, limb] for limb in span.limbs)
    known, noise = ~np.isnan(first[:, 0, 0] + second[:, 0, 0]), max(span.gap, take.typical_gap)
    if way:
        fit = take.fit(span.limbs, frames[known])
        if fit is None or fit.determinacy[0] < TURNS:
            return False
    for part in np.array_split(frames[known], LEFT_OUT):
        fit = take.fit(span.limbs, np.setdiff1d(frames[known], part))
        if fit is None or np.sqrt(np.mean(take.gaps(span.limbs, fit)[part] ** 2)) > TOLERANCE * noise:
            return False
    one, other = _carried(first, span.in_first), _carried(second, span.in_second)
    seen_from = [np.broadcast_to(np.eye(4), first.shape), *(take.world[frames, limb] for limb in way[1:-1])]
    return all(_shifted_gap(one, other, body) > NEEDED * noise for body in seen_from)


def _shifted_gap(one: Floats, other: Floats, body: Floats) -> float:
    """Root mean square distance [mm] of two points, seen from a body, if one of them were as at another time."""
    inward, origins = body[:, :3, :3].swapaxes(1, 2), body[:, :3, 3]
    one, other = (np.einsum("fij,fj->fi", inward, points - origins) for points in (one, other))
    shifts = [one - np.roll(other, int(lag * len(other)), axis=0) for lag in LAGS]
    squares = [(shift**2).sum(axis=1) for shift in shifts]
    return float(np.sqrt(max(np.nanmean(square) if not np.isnan(square).all() else 0.0 for square in squares)))


def _way(pair: Pair, joined: Sequence[Pair]) -> list[int]:
    """The limbs from one to another over joints, both included; none where no joints lead there."""
    from networkx import Graph, NetworkXNoPath, NodeNotFound, shortest_path  # noqa: PLC0415 - takes time to load

    try:
        return [int(limb) for limb in shortest_path(Graph(list(joined)), *pair)]
    except (NetworkXNoPath, NodeNotFound):
        return []


def _overlap(one: JointSpan, other: JointSpan) -> bool:
    return one.first_frame <= other.last_frame and other.first_frame <= one.last_frame


def _carried(body: Floats, point: Floats) -> Floats:
    return np.asarray(body[:, :3, :3] @ point + body[:, :3, 3])


def _without_short_runs(values: Bools, length: int) -> Bools:
    """Values whose runs of false ones that are shorter than `length`, between true ones, are true."""
    filled = values.copy()
    for start, stop in runs_of(~values):
        if start > 0 and stop < len(values) and stop - start < length:
            filled[start:stop] = True
    return filled
