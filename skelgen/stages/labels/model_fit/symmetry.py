"""Limbs whose markers fit them in more than one way: which way is right, their joints say.

Three markers with two equal sides, or five that wind around a limb, keep all their distances when they are exchanged in
pairs. When most of them were hidden for a moment, distances cannot tell afterwards which is which, and a limb that is
posed by exchanged markers looks as right as before; but it does not meet its neighbours any more. In each frame an
exchange is worth what it brings the limb's markers and joints nearer to where they belong. Which way is right in each
frame is the most probable path of a hidden Markov chain, in which ways seldom change.
"""

from itertools import permutations

import numpy as np

from skelgen.geometry.orientation import fit_transform
from skelgen.kinematics.chain.chain import Chain
from skelgen.kinematics.inverse.root_outward import pose_by_own_markers
from skelgen.model import PointCloud
from skelgen.model.arrays import Floats, Ints
from skelgen.stages.labels import point_labels
from skelgen.stages.labels.model_fit.model import MarkerModel, Tree

MOST_MARKERS = 6
"""Markers of a limb whose exchanges are tried: their number grows with the factorial."""

CHANGE = 10.0
"""nats that a change from one way to another costs."""

LEAST_GAIN = 8.0
"""nats that exchanges gain per frame in the mean; a limb that hangs the wrong way round misses its joints by far."""

CORRELATED_SECONDS = 0.1
"""Evidence within this time is correlated; together it counts like that of one frame."""

SUSPECTED = 0.5
"""Of what a change costs: who gains less by exchanges in some of the frames is not looked at in all."""

LEAST_POINTS = 3
"""Markers and joints that must be seen to pose a limb."""

EXACT = 1e-9
"""mm^2; keeps the usual deviation of exact takes above zero."""

MOST_EVIDENCE = 10.0
"""nats of one joint or marker in one frame; labels may jump."""


def turned_limbs(cloud: PointCloud, marker_of_point: Ints, model: MarkerModel, rate: float) -> Ints:
    """Exchange the markers of limbs in those frames in which their joints say that they are exchanged.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    model : MarkerModel
        Fitted to these markers.
    rate : float, Hz
        Frame rate.
    """
    ways = [_ways_of_tree(tree, model.gate) for tree in model.trees]
    if not any(ways):
        return marker_of_point
    result = marker_of_point.copy()
    share = max(1.0, CORRELATED_SECONDS * rate)
    stride = max(1, int(share / 2))
    for block in point_labels.blocks_of(cloud):
        marker = result[block.points]
        positions = point_labels.marker_positions(cloud, result, model.n_markers, block)
        for tree, of_limbs in zip(model.trees, ways, strict=True):
            poses: Floats | None = None
            for limb in _suspected(tree, of_limbs, positions[::stride, tree.markers], share / stride):
                if poses is None:
                    poses = pose_by_own_markers(tree.chain, positions[:, tree.markers])[0]
                members, orders = tree.markers[tree.chain.limb_of_marker == limb], of_limbs[limb]
                losses = _losses(tree.chain, limb, orders, positions[:, tree.markers], poses)
                way = _best_ways(losses / share)
                if not _is_sure(losses, way):
                    continue
                becomes = np.tile(np.arange(model.n_markers), (block.n_frames, 1))
                becomes[:, members] = members[orders[way]]
                owned = np.flatnonzero(marker >= 0)
                marker[owned] = becomes[block.frames[owned], marker[owned]]
                result[block.points] = marker
                positions = point_labels.marker_positions(cloud, result, model.n_markers, block)
                poses = None  # those of this limb have changed
    return result


def _suspected(tree: Tree, ways: dict[int, Ints], positions: Floats, share: float) -> list[int]:
    """Limbs whose markers may be exchanged, by some of the frames, of which so many count like one."""
    if not ways:
        return []
    poses = pose_by_own_markers(tree.chain, positions)[0]
    losses = {limb: _losses(tree.chain, limb, orders, positions, poses) for limb, orders in ways.items()}
    return [limb for limb, loss in losses.items() if _most_gained(loss / share) > SUSPECTED * CHANGE]


def _ways_of_tree(tree: Tree, tolerance: float) -> dict[int, Ints]:
    """Orders of the markers of each limb that fit its shape, shape (n_ways, n_markers), of limbs with more than one."""
    found = {}
    for limb in range(tree.chain.n_limbs):
        orders = fitting_orders(tree.chain.offsets[tree.chain.limb_of_marker == limb], tolerance)
        if len(orders) > 1:
            found[limb] = orders
    return found


def fitting_orders(places: Floats, tolerance: float) -> Ints:
    """Return the orders in which markers fit the same places, first the order that they have, shape (n_orders, n).

    Parameters
    ----------
    places : ndarray, shape (n, 3), mm
        Markers of a limb.
    tolerance : float, mm
        Root mean square deviation up to which they fit.
    """
    n = len(places)
    if not 3 <= n <= MOST_MARKERS:
        return np.arange(n)[np.newaxis]
    orders = np.array(list(permutations(range(n))))
    targets, seen = np.tile(places, (len(orders), 1, 1)), np.ones((len(orders), n), dtype=bool)
    turned = fit_transform(places[orders], targets, seen)
    off = np.einsum("oij,onj->oni", turned[:, :3, :3], places[orders]) + turned[:, np.newaxis, :3, 3] - targets
    fits = np.sqrt((off**2).sum(axis=2).mean(axis=1)) <= tolerance
    return np.asarray(orders[fits], dtype=np.intp)


def _losses(chain: Chain, limb: int, orders: Ints, positions: Floats, poses: Floats) -> Floats:
    """Minus the log likelihood of each way in each frame, shape (n_frames, n_ways); 0 where less than three points are.

    The limb is fitted to its markers and to the joints where its neighbours, posed by their own markers, have them.
    """
    members, parent = chain.limb_of_marker == limb, int(chain.parents[limb])
    children = np.flatnonzero(chain.parents == limb)
    ends = np.concatenate([chain.joints[children], np.zeros((int(parent >= 0), 3))])
    met = [poses[:, child, :3, 3] for child in children]
    if parent >= 0:
        met.append(_moved(poses[:, parent], chain.joints[[limb]])[:, 0])
    targets = np.concatenate([positions[:, members], *(one[:, np.newaxis] for one in met)], axis=1)
    losses = np.zeros((len(positions), len(orders)))
    shown = np.flatnonzero((~np.isnan(targets[..., 0])).sum(axis=1) >= LEAST_POINTS)
    targets = targets[shown]
    seen, usual, places = ~np.isnan(targets[..., 0]), np.ones(targets.shape[1]), chain.offsets[members]
    for way, order in enumerate(orders):
        source = np.concatenate([places[order], ends])
        squares = ((targets - _moved(fit_transform(source, targets, seen), source)) ** 2).sum(axis=2)
        if way == 0:
            usual = np.array([np.median(one[~np.isnan(one)]) if (~np.isnan(one)).any() else 1.0 for one in squares.T])
        evidence = np.minimum(squares / (2.0 * np.maximum(usual, EXACT)), MOST_EVIDENCE)
        losses[shown, way] = np.nan_to_num(evidence).sum(axis=1)
    return losses


def _is_sure(losses: Floats, way: Ints) -> bool:
    """Whether exchanges gain enough where they are made: where joints are not known, they gain a little."""
    turned = np.flatnonzero((way > 0) & losses.any(axis=1))
    return bool(len(turned)) and float((losses[turned, 0] - losses[turned, way[turned]]).mean()) >= LEAST_GAIN


def _moved(pose: Floats, places: Floats) -> Floats:
    """Places on a posed limb in the world [mm], shape (n_frames, n, 3)."""
    return np.asarray(places @ pose[:, :3, :3].swapaxes(1, 2) + pose[:, np.newaxis, :3, 3])


def _most_gained(losses: Floats) -> float:
    """What the best other way gains [nats] in the frames in a row in which it gains most."""
    gained = np.cumsum(losses[:, :1] - losses, axis=0)
    return float((gained - np.minimum.accumulate(np.minimum(gained, 0.0), axis=0)).max(initial=0.0))


def _best_ways(losses: Floats) -> Ints:
    """The most probable way of each frame, shape (n_frames,)."""
    if _most_gained(losses) <= CHANGE:
        return np.zeros(len(losses), dtype=np.intp)
    total, before = losses[0].tolist(), []
    for loss in losses[1:].tolist():  # of two ways or six: lists are faster than arrays
        least = min(total)
        best = total.index(least)
        before.append([way if value <= least + CHANGE else best for way, value in enumerate(total)])
        total = [min(value, least + CHANGE) + more for value, more in zip(total, loss, strict=True)]
    ways = [total.index(min(total))]
    for came_from in reversed(before):
        ways.append(came_from[ways[-1]])
    return np.array(ways[::-1], dtype=np.intp)
