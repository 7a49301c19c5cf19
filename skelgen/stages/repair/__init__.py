"""Errors of labels that a take came with: exchanged and moved labels are given back, markers that slipped are split.

Markers that fell off are left out from then on; gaps that a program filled are gaps again, and so are spikes.
"""

from dataclasses import dataclass

from skelgen.model import Trajectories
from skelgen.model.labelling import Finding
from skelgen.progress import SILENT, Monitor, counted
from skelgen.stages.repair.exchange_evidence import robust_limbs
from skelgen.stages.repair.falls import find_falls, without_fallen
from skelgen.stages.repair.fills import Fill, find_fills, without_fills
from skelgen.stages.repair.moves import find_moves, undo_moves
from skelgen.stages.repair.slips import Slip, find_slips, new_names, split_slipped
from skelgen.stages.repair.smoothed_fills import find_smoothed_fills
from skelgen.stages.repair.spikes import find_spikes
from skelgen.stages.repair.swaps import exchanged_back, find_swaps, indistinguishable_pairs, repair_swaps

__all__ = ["RepairParameters", "exchanged_back", "repair_take"]

MOST_NAMED = 6
"""Pairs that are named in a notice; the rest is counted."""


@dataclass(frozen=True)
class RepairParameters:
    """What is looked for.

    Attributes
    ----------
    repair : bool
        Whether anything is looked for.
    fills : bool
        Whether gaps that were filled are looked for.
    swap_evidence : float, nats
        Least evidence of distances for an exchange of labels.
    slips : bool
        Whether slips are looked for.
    slip_seconds : float, s
        How long a marker stays at its new place if it has slipped.
    slip_evidence : float
        By how many times its usual step a marker jumps if it has slipped.
    """

    repair: bool = True
    fills: bool = True
    swap_evidence: float = 5.0
    slips: bool = True
    slip_seconds: float = 1.0
    slip_evidence: float = 6.0


@dataclass(frozen=True, eq=False)
class Repair:
    """A take whose labels were searched for errors.

    Attributes
    ----------
    trajectories : Trajectories
        Repaired; the same object as before if nothing is wrong.
    findings : tuple of Finding
        What was found, in the order of first frames; filled gaps and spikes come last.
    """

    trajectories: Trajectories
    findings: tuple[Finding, ...] = ()


def repair_take(
    trajectories: Trajectories, parameters: RepairParameters | None = None, *, monitor: Monitor = SILENT
) -> Repair:
    """Look for errors in labelled markers and repair them.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers.
    parameters : RepairParameters, optional
        What is looked for.
    monitor : Monitor
        Receives a notice of every change.

    Returns
    -------
    Repair
        The take and what was found.
    """
    parameters = parameters or RepairParameters()
    if not parameters.repair:
        monitor.notice("the markers are labelled already: this stage is skipped")
        return Repair(trajectories)
    falls = find_falls(trajectories)
    attached = without_fallen(trajectories, falls)
    exact = find_fills(attached) if parameters.fills else ()
    measured = without_fills(attached, exact)
    smoothed = find_smoothed_fills(measured) if parameters.fills else ()
    measured, fills = without_fills(measured, smoothed), exact + smoothed
    limbs = robust_limbs(measured)
    swaps = find_swaps(measured, parameters.swap_evidence, limbs=limbs, monitor=monitor)
    repaired = repair_swaps(measured, swaps)
    moves = find_moves(repaired, limbs=robust_limbs(repaired) if swaps else limbs)
    repaired = undo_moves(repaired, moves)
    spikes = find_spikes(repaired)
    repaired = without_fills(repaired, spikes)
    slips = find_slips(repaired, parameters.slip_seconds, parameters.slip_evidence) if parameters.slips else ()
    found = [fill.finding for fill in (*fills, *spikes)]
    found += [swap.finding for swap in swaps] + [move.finding for move in moves]
    names, last = new_names(repaired.names, slips), repaired.n_frames - 1
    found += [one.finding(last) for one in falls]
    found += [slip.finding(last, names.get(slip, "")) for slip in slips]
    findings = tuple(sorted(found, key=lambda one: (one.kind in {"filled", "spike"}, one.first_frame, one.names)))
    repaired = split_slipped(repaired, slips)
    monitor.notice(f"the markers are labelled already: {_outcome(len(swaps), len(moves), len(falls), slips)}")
    if fills:
        monitor.notice(_told(fills, trajectories))
    if spikes:
        monitor.notice(_told_of_spikes(spikes))
    for sentence in repaired.notices[len(trajectories.notices) :]:
        monitor.notice(sentence)
    if swaps:
        _warn_of_twins(repaired, monitor)
    return Repair(repaired, findings)


def _outcome(n_swaps: int, n_moves: int, n_falls: int, slips: tuple[Slip, ...]) -> str:
    n_split = sum(slip.sure for slip in slips)
    exchanges = counted(n_swaps, "exchange of labels is", "exchanges of labels are")
    parts = [f"{exchanges} repaired" if n_swaps else "no exchanged labels are found"]
    if n_moves:
        others = counted(n_moves, "label on another marker is", "labels on other markers are")
        parts.append(f"{others} given back")
    if n_falls:
        parts.append(f"{counted(n_falls, 'marker is', 'markers are')} left out from where they fall off")
    if n_split:
        parts.append(f"{counted(n_split, 'slipped marker is', 'slipped markers are')} split")
    if len(slips) > n_split:
        left = "is left as it is" if len(slips) == n_split + 1 else "are left as they are"
        others = f"{len(slips) - n_split} more" if n_split else counted(len(slips), "marker")
        parts.append(f"{others} may have slipped and {left}")
    return ", ".join(parts)


def _told(fills: tuple[Fill, ...], trajectories: Trajectories) -> str:
    n_gaps, n_filled = sum(fill.n_gaps for fill in fills), sum(len(fill.frames) for fill in fills)
    n_markers = len({fill.marker for fill in fills})
    part = 100.0 * n_filled / max(int(trajectories.seen.sum()), 1)
    return (
        f"{counted(n_gaps, 'gap')} of {counted(n_markers, 'marker')}, {part:.2g} % of all positions, were filled by "
        "straight lines or smooth curves, which say nothing of the body: they are gaps again (`--set labels.fills=no` "
        "keeps them)"
    )


def _told_of_spikes(spikes: tuple[Fill, ...]) -> str:
    n_spikes, n_frames = sum(spike.n_gaps for spike in spikes), sum(len(spike.frames) for spike in spikes)
    return (
        f"{counted(n_spikes, 'spike')} of {counted(len(spikes), 'marker')}, {counted(n_frames, 'position')} that "
        "jump away from their limb and back within a tenth of a second, are gaps"
    )


def _warn_of_twins(trajectories: Trajectories, monitor: Monitor) -> None:
    pairs = indistinguishable_pairs(trajectories)
    if pairs:
        named = ", ".join(f"{first} and {second}" for first, second in pairs[:MOST_NAMED])
        more = f" and {counted(len(pairs) - MOST_NAMED, 'more pair')}" if len(pairs) > MOST_NAMED else ""
        monitor.notice(
            f"no distance tells apart {named}{more}: their labels are exchanged back only where they are seen jumping"
        )
