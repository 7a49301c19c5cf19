"""How well limbs and tree of a result agree with the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment
from sklearn.metrics import adjusted_rand_score

from skelgen.model.arrays import Ints
from skelgen.simulation.truth import Truth


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
    return LimbScore(
        adjusted_rand=index,
        is_exact=bool(is_complete and index == 1.0 and n_found == truth.n_limbs),
        n_limbs_found=n_found,
        n_limbs_true=truth.n_limbs,
        n_left_out=int((limb_of_marker < 0).sum()),
    )


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
    rows, columns = linear_sum_assignment(shared, maximize=True)
    is_match = shared[rows, columns] > 0
    true_of_limb = np.full(n_limbs, -1, dtype=np.intp)
    true_of_limb[rows[is_match]] = columns[is_match]
    return true_of_limb


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
    """Compare a tree with the true one; parameters as for `match_joints`."""
    true_of_joint = match_joints(edges, true_of_limb, truth)
    hit = set(true_of_joint.tolist())
    extra = tuple(
        " - ".join(_limb_name(int(limb), true_of_limb, truth) for limb in edge) for edge in edges[true_of_joint < 0]
    )
    found = tuple(name for index, name in enumerate(truth.joint_names) if index in hit)
    missed = tuple(name for index, name in enumerate(truth.joint_names) if index not in hit)
    return TopologyScore(found, missed, extra, is_exact=not missed and not extra)


def _limb_name(limb: int, true_of_limb: Ints, truth: Truth) -> str:
    true_limb = int(true_of_limb[limb])
    return truth.limb_names[true_limb] if true_limb >= 0 else f"limb {limb} of the result"
