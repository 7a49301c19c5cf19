"""What the labels stage does with takes that are labelled already: errors are looked for, repaired and told."""

from __future__ import annotations

from skelgen.model import Trajectories
from skelgen.progress import SILENT, Monitor
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.repair.slips import Slip, find_slips, split_slipped
from skelgen.stages.labels.repair.swaps import find_swaps, indistinguishable_pairs, repair_swaps

MOST_NAMED = 6
"""Pairs that are named in a notice; the rest is counted."""


def repair_take(
    trajectories: Trajectories, parameters: LabelParameters | None = None, *, monitor: Monitor = SILENT
) -> Trajectories:
    """Look for errors in labelled markers and repair them.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers.
    parameters : LabelParameters, optional
        With `repair` off nothing is looked for.
    monitor : Monitor
        Told of every change.

    Returns
    -------
    Trajectories
        The same object if nothing is wrong.
    """
    parameters = parameters or LabelParameters()
    if not parameters.repair:
        monitor.notice("the markers are labelled already: this stage is skipped")
        return trajectories
    swaps = find_swaps(trajectories, parameters, monitor=monitor)
    repaired = repair_swaps(trajectories, swaps)
    slips = find_slips(repaired, parameters) if parameters.slips else ()
    repaired = split_slipped(repaired, slips)
    monitor.notice(f"the markers are labelled already: {_outcome(len(swaps), slips)}")
    for sentence in repaired.notices[len(trajectories.notices) :]:
        monitor.notice(sentence)
    if swaps:
        _warn_of_twins(repaired, monitor)
    return repaired


def _outcome(n_swaps: int, slips: tuple[Slip, ...]) -> str:
    n_split = sum(slip.sure for slip in slips)
    parts = [f"{n_swaps} exchanges of labels are repaired" if n_swaps else "no exchanged labels are found"]
    if n_split:
        parts.append(f"{n_split} slipped markers are split")
    if len(slips) > n_split:
        parts.append(f"{len(slips) - n_split} more may have slipped and are left as they are")
    return ", ".join(parts)


def _warn_of_twins(trajectories: Trajectories, monitor: Monitor) -> None:
    pairs = indistinguishable_pairs(trajectories)
    if pairs:
        named = ", ".join(f"{first} and {second}" for first, second in pairs[:MOST_NAMED])
        more = f" and {len(pairs) - MOST_NAMED} more pairs" if len(pairs) > MOST_NAMED else ""
        monitor.notice(
            f"no distance tells apart {named}{more}: their labels are exchanged back only where they are seen jumping"
        )
