"""Which true marker, limb and joint those of a result are, and how well labels, limbs and tree agree with the truth.

Labelled markers are matched by name. For an unlabelled take every position of the result is traced back to the point
that it was made from, whose marker the truth knows; the identity of a marker is the optimal assignment on how often a
result and a true marker coincide. The scores are those of Ristani et al. (2016), "Performance measures and a data set
for multi-target, multi-camera tracking".
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree
from sklearn.metrics import adjusted_rand_score

from skelgen.errors import InputError
from skelgen.model import PointCloud, Project, Trajectories
from skelgen.model.arrays import Ints
from skelgen.model.joint_spans import JointSpan
from skelgen.model.topology import limbs_of_bodies
from skelgen.simulation.truth import Truth

POINT_TOLERANCE = 1.0
"""Farthest distance [mm] of a result's position from the point it was made from: smoothing and rounding in files."""

_PARTED = re.compile(r"_\d+$")
"""What a marker that slipped is called from then on, beside its name."""

_GAP = 10.0  # times the tolerance: how far the frames are kept apart in the search tree


@dataclass(frozen=True)
class LabelScore:
    """How well points were put together to markers.

    Attributes
    ----------
    idf1 : float
        Harmonic mean of `precision` and `recall`.
    precision : float
        Part of the result's positions that belong to the true marker which their marker stands for.
    recall : float
        Part of the true markers' points that their marker in the result holds.
    n_markers_found, n_markers_true : int
        Number of markers.
    """

    idf1: float
    precision: float
    recall: float
    n_markers_found: int
    n_markers_true: int


def find_identity(project: Project, truth: Truth) -> tuple[Ints, LabelScore | None]:
    """Find which true marker each marker of the result is.

    Parameters
    ----------
    project : Project
        A result with labelled markers.
    truth : Truth
        What is true of its take.

    Returns
    -------
    true_of_marker : ndarray of intp, shape (n_markers,)
        Index of the true marker, -1 where there is none.
    labels : LabelScore or None
        None when the take was labelled to begin with.

    Raises
    ------
    InputError
        If the truth is that of another take.
    """
    take, trajectories = project.take, project.trajectories
    if isinstance(take, PointCloud):
        return _identity_of_points(take, trajectories, truth, _tolerance(project))
    index_of = {_plain(name): index for index, name in enumerate(truth.marker_names)}
    plain = [_plain(name) for name in trajectories.names]
    whole = [name if name in index_of else _PARTED.sub("", name) for name in plain]
    unknown = [name for name, known in zip(trajectories.names, whole, strict=True) if known not in index_of]
    if unknown:
        raise InputError(f"the truth knows no marker {unknown[0]!r}: it belongs to another take")
    return np.array([index_of[name] for name in whole], dtype=np.intp), None


def _plain(name: str) -> str:
    """Fold what file formats do to names: upper case, and underscores for blanks."""
    return re.sub(r"[\s_]+", "_", name.strip()).casefold()


def _tolerance(project: Project) -> float:
    """Farthest distance [mm] of a position from its point: jitter that the labels stage added moves it on purpose."""
    how = project.reports["labels"].parameters if "labels" in project.reports else {}
    jitter = float(how.get("max_jitter", 0.0)) if how.get("add_random") else 0.0
    return POINT_TOLERANCE + math.sqrt(3.0) * jitter


def _identity_of_points(
    cloud: PointCloud, trajectories: Trajectories, truth: Truth, tolerance: float
) -> tuple[Ints, LabelScore]:
    if len(truth.marker_of_point) != cloud.n_points:
        found = f"{len(truth.marker_of_point)} points where the take has {cloud.n_points}"
        raise InputError(f"the truth knows {found}: it belongs to another take, or to one simulated with labels")
    marker, point = _points_of_result(cloud, trajectories, tolerance)
    counts = np.zeros((trajectories.n_markers, truth.n_markers + 1), dtype=np.intp)  # the last column takes the ghosts
    np.add.at(counts, (marker, truth.marker_of_point[point]), 1)
    true_of_marker, n_hits = _matched(counts[:, :-1])
    n_found, n_true = int(counts.sum()), int((truth.marker_of_point >= 0).sum())
    idf1 = 2 * n_hits / max(n_found + n_true, 1)
    precision, recall = n_hits / max(n_found, 1), n_hits / max(n_true, 1)
    return true_of_marker, LabelScore(idf1, precision, recall, trajectories.n_markers, truth.n_markers)


def _matched(shared: Ints) -> tuple[Ints, int]:
    """Match rows to columns that share most; return the column of each row, -1 without one, and what all share."""
    rows, columns = linear_sum_assignment(shared, maximize=True)
    hits = shared[rows, columns]
    column_of_row = np.full(len(shared), -1, dtype=np.intp)
    column_of_row[rows[hits > 0]] = columns[hits > 0]
    return column_of_row, int(hits.sum())


def _points_of_result(cloud: PointCloud, trajectories: Trajectories, tolerance: float) -> tuple[Ints, Ints]:
    """Return marker and point of every position that was made from a point; filled gaps were not."""
    frame, marker = np.nonzero(trajectories.seen)
    if not cloud.n_points or not len(frame):
        return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp)
    apart = _GAP * tolerance
    frame_of_point = np.repeat(np.arange(cloud.n_frames), cloud.points_per_frame)
    tree = cKDTree(np.column_stack([cloud.points, apart * frame_of_point]))
    wanted = np.column_stack([trajectories.positions[frame, marker], apart * frame])
    distance, point = tree.query(wanted, distance_upper_bound=tolerance)
    made = np.isfinite(distance)
    return marker[made], point[made]


@dataclass(frozen=True)
class LimbScore:
    """How well markers were put together to limbs.

    Attributes
    ----------
    adjusted_rand : float
        Adjusted Rand index over the markers that exist in the truth; 1 is perfect, 0 is chance. A marker that was left
        out counts as a limb of its own.
    is_exact : bool
        Whether all true markers are there, none was left out, and the groups are the true ones.
    n_limbs_found, n_limbs_true : int
        Number of limbs.
    n_left_out : int
        Markers that were put on no limb.
    """

    adjusted_rand: float
    is_exact: bool
    n_limbs_found: int
    n_limbs_true: int
    n_left_out: int


@dataclass(frozen=True)
class BodyScore:
    """How well the trees agree with the bodies.

    Attributes
    ----------
    n_bodies_found, n_bodies_true : int
        Number of trees in the result and in the truth.
    share : float
        Part of the markers on limbs that are in the tree which their body is matched with.
    is_exact : bool
        Whether each body is one tree and each tree one body.
    """

    n_bodies_found: int
    n_bodies_true: int
    share: float
    is_exact: bool


@dataclass(frozen=True)
class TopologyScore:
    """How well the limbs were joined; edges have no direction, as the choice of the root is free.

    Attributes
    ----------
    found, missed : tuple of str
        True joints that are in the result's tree, and those that are not.
    extra : tuple of str
        Joints of the result that are not true; a limb that matches none is called by its number.
    is_exact : bool
        Whether nothing is missed and nothing extra.
    """

    found: tuple[str, ...]
    missed: tuple[str, ...]
    extra: tuple[str, ...]
    is_exact: bool


def score_limbs(limb_of_marker: Ints, true_of_marker: Ints, truth: Truth) -> LimbScore:
    """Compare limbs with the true ones.

    Parameters
    ----------
    limb_of_marker : ndarray of intp, shape (n_markers,)
        Limb of each marker of the result, -1 = left out.
    true_of_marker : ndarray of intp, shape (n_markers,)
        True marker of each marker of the result, -1 where there is none.
    truth : Truth
        The true limbs.
    """
    known = true_of_marker >= 0
    found = limb_of_marker[known]
    alone = found < 0
    groups = np.where(alone, len(found) + np.arange(len(found)), found)
    index = float(adjusted_rand_score(truth.limb_of_marker[true_of_marker[known]], groups)) if known.any() else 0.0
    n_found = int(limb_of_marker.max(initial=-1)) + 1
    is_complete = set(true_of_marker[known].tolist()) == set(range(truth.n_markers)) and not alone.any()
    is_exact = bool(is_complete and index == 1.0 and n_found == truth.n_limbs)
    return LimbScore(index, is_exact, n_found, truth.n_limbs, n_left_out=int((limb_of_marker < 0).sum()))


def score_bodies(limb_of_marker: Ints, parents: Ints, true_of_marker: Ints, truth: Truth) -> BodyScore:
    """Compare trees with the true ones, marker by marker.

    Parameters
    ----------
    limb_of_marker, true_of_marker, truth
        As for `score_limbs`.
    parents : ndarray of intp, shape (n_limbs,)
        The result's forest, -1 for roots.
    """
    known = (true_of_marker >= 0) & (limb_of_marker >= 0)
    found, true = limbs_of_bodies(parents), limbs_of_bodies(truth.parents)
    of_limb, of_true_limb = np.empty(len(parents), dtype=np.intp), np.empty(truth.n_limbs, dtype=np.intp)
    for bodies, body_of in ((found, of_limb), (true, of_true_limb)):
        for body, limbs in enumerate(bodies):
            body_of[limbs] = body
    shared = np.zeros((len(found), len(true)), dtype=np.intp)
    np.add.at(shared, (of_limb[limb_of_marker[known]], of_true_limb[truth.limb_of_marker[true_of_marker[known]]]), 1)
    share = _matched(shared)[1] / max(int(shared.sum()), 1)
    return BodyScore(len(found), len(true), share, len(found) == len(true) and share == 1.0)


def match_limbs(limb_of_marker: Ints, true_of_marker: Ints, truth: Truth) -> Ints:
    """Match the result's limbs to the true ones so that they share as many markers as possible.

    Parameters
    ----------
    limb_of_marker, true_of_marker, truth
        As for `score_limbs`.

    Returns
    -------
    ndarray of intp, shape (n_limbs,)
        True limb of each limb of the result, -1 where there is none.
    """
    n_limbs = int(limb_of_marker.max(initial=-1)) + 1
    shared = np.zeros((n_limbs, truth.n_limbs), dtype=np.intp)
    usable = (limb_of_marker >= 0) & (true_of_marker >= 0)
    np.add.at(shared, (limb_of_marker[usable], truth.limb_of_marker[true_of_marker[usable]]), 1)
    return _matched(shared)[0]


def match_joints(edges: Ints, true_of_limb: Ints, truth: Truth) -> Ints:
    """Match joints by the limbs that they connect.

    Parameters
    ----------
    edges : ndarray of intp, shape (n_joints, 2)
        Limbs of each joint of the result.
    true_of_limb : ndarray of intp, shape (n_limbs,)
        From `match_limbs`.
    truth : Truth
        The true joints.

    Returns
    -------
    ndarray of intp, shape (n_joints,)
        True joint of each joint of the result, -1 where there is none.
    """
    joint_of = {frozenset(edge): index for index, edge in enumerate(truth.edges.tolist())}
    matched = true_of_limb[edges]
    return np.array([joint_of.get(frozenset(edge), -1) for edge in matched.tolist()], dtype=np.intp)


def score_topology(edges: Ints, true_of_limb: Ints, truth: Truth) -> TopologyScore:
    """Compare a tree with the true one.

    Parameters
    ----------
    edges, true_of_limb, truth
        As for `match_joints`.
    """
    true_of_joint = match_joints(edges, true_of_limb, truth)
    hit = set(true_of_joint.tolist())
    wrong, names = edges[true_of_joint < 0].tolist(), (*truth.limb_names, "")
    named = {limb: names[true] or f"limb {limb} of the result" for limb, true in enumerate(true_of_limb.tolist())}
    extra = tuple(" - ".join(named[limb] for limb in edge) for edge in wrong)
    found = tuple(name for index, name in enumerate(truth.joint_names) if index in hit)
    missed = tuple(name for index, name in enumerate(truth.joint_names) if index not in hit)
    return TopologyScore(found, missed, extra, is_exact=not missed and not extra)


@dataclass(frozen=True)
class SpanScore:
    """How well joints that hold for a part of the take only were found.

    Attributes
    ----------
    n_true, n_found, n_extra : int
        True ones, those of them that were found, and those that were found but are not true.
    frames_off : int or None
        How far the first or last frame of one is off at most; None where none was found.
    """

    n_true: int
    n_found: int
    n_extra: int
    frames_off: int | None


def score_spans(spans: Sequence[JointSpan], true_of_limb: Ints, truth: Truth) -> SpanScore:
    """Compare joints that hold for a part of the take with the true ones.

    Parameters
    ----------
    spans : sequence of JointSpan
        What was found.
    true_of_limb : ndarray of intp, shape (n_limbs,)
        The true limb of each.
    truth : Truth
        Who held whom, and when.
    """
    found = [({int(limb) for limb in true_of_limb[list(span.limbs)]}, span) for span in spans]
    off = []
    for pair, (first, last) in zip(truth.hold_limbs.tolist(), truth.hold_frames.tolist(), strict=True):
        same = [
            max(abs(one.first_frame - first), abs(one.last_frame - last)) for limbs, one in found if limbs == set(pair)
        ]
        off += [min(same)] if same else []
    return SpanScore(len(truth.hold_limbs), len(off), len(spans) - len(off), max(off, default=None))
