"""How far the markers that a skeleton reconstructs are from the tracked ones, as in the seed's tables 5.2 to 5.9."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.evaluation.joints import mean_or_none
from skelgen.model import Motion, Trajectories
from skelgen.model.arrays import Ints
from skelgen.simulation.truth import Truth


@dataclass(frozen=True)
class MarkerScore:
    """Deviation of one marker.

    Attributes
    ----------
    limb : str
        True limb, empty where the marker does not exist in the truth.
    marker : str
        Its label in the result.
    from_tracked : float or None, mm
        Mean distance of the reconstructed from the tracked position over the frames where it is tracked.
    from_true : float or None, mm
        Mean distance of the reconstructed from the true position, over all frames: where the marker would be if it
        were rigidly fixed to its limb.
    """

    limb: str
    marker: str
    from_tracked: float | None
    from_true: float | None


def score_markers(
    trajectories: Trajectories, motion: Motion, true_of_marker: Ints, truth: Truth
) -> tuple[MarkerScore, ...]:
    """Score every marker that the skeleton carries, grouped by true limbs.

    Parameters
    ----------
    trajectories : Trajectories
        Tracked markers.
    motion : Motion
        Reconstructed markers.
    true_of_marker : ndarray of intp, shape (n_markers,)
        True marker of each, -1 where there is none.
    truth : Truth
        True markers and limbs.
    """
    from_tracked = np.linalg.norm(motion.marker_positions - trajectories.positions, axis=2)
    gap = motion.marker_positions - truth.marker_positions[:, true_of_marker]
    from_true = np.where(true_of_marker >= 0, np.linalg.norm(gap, axis=2), np.nan)
    is_carried = np.asarray(~np.isnan(motion.marker_positions).all(axis=(0, 2)))
    limb = np.where(true_of_marker >= 0, truth.limb_of_marker[true_of_marker], truth.n_limbs)
    names = (*truth.limb_names, "")
    return tuple(
        MarkerScore(
            limb=names[limb[marker]],
            marker=trajectories.names[marker],
            from_tracked=mean_or_none(from_tracked[:, marker]),
            from_true=mean_or_none(from_true[:, marker]),
        )
        for marker in np.lexsort((true_of_marker, limb))
        if is_carried[marker]
    )
