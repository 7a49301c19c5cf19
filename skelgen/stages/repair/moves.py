"""Find labels that sit on another marker, which has lost its own label there, and give the points to that marker.

If a label moves onto a marker of another limb while that marker has no label, nothing is exchanged. The move is
recognised by distances: those to the other marker's limb are as that marker's usually are, and those to the label's own
limb are not.
"""

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from skelgen.geometry.statistics import lengths_of, median_of_known
from skelgen.model import Limbs, Trajectories
from skelgen.model.arrays import Bools, Floats
from skelgen.model.labelling import Finding
from skelgen.progress import frames_between
from skelgen.stages.repair.exchange_evidence import RigidModel, rigid_model, robust_limbs

FITS = 3.0
"""Standard deviations within which the median distance to the other marker's limb must lie."""

BAD = 5.0
"""Standard deviations by which half of a label's own distances deviate where it is not consistent."""

LEAST_DISTANCES = 2
"""Distances that must fit; fewer do so by chance."""

LEAST_SECONDS = 0.1
"""Distances within this time are correlated: they may fit by chance for a shorter time."""

LEAST_FRAMES = 5
"""The same for slow cameras."""

LEAST_ELSEWHERE = 20
"""Frames in which the label is known to be elsewhere: fewer do not show that it usually does not fit."""

FITS_ANYWAY = 0.01
"""Part of these frames in which it may fit by chance."""


@dataclass(frozen=True)
class Move:
    """A label that sits on another marker for some frames.

    Attributes
    ----------
    marker, other : int
        Indices of the label, and of the marker that it sits on.
    name, other_name : str
        Their labels.
    first_frame, last_frame : int
        Both included.
    misfit : float, mm
        Median deviation of the distances to the other marker's limb from their usual lengths.
    mates : tuple of str
        Markers of that limb.
    """

    marker: int
    other: int
    name: str
    other_name: str
    first_frame: int
    last_frame: int
    misfit: float
    mates: tuple[str, ...]

    @property
    def evidence(self) -> str:
        """Evidence in words."""
        return f"its distances to {', '.join(self.mates)} are those of {self.other_name} within {self.misfit:.1f} mm"

    @property
    def finding(self) -> Finding:
        """Finding for the label quality."""
        outcome = f"these points are given to {self.other_name}"
        return Finding("moved", (self.name, self.other_name), self.first_frame, self.last_frame, self.evidence, outcome)

    @property
    def sentence(self) -> str:
        """Notice for the user."""
        frames = frames_between(self.first_frame, self.last_frame)
        return (
            f"{self.name} is where {self.other_name} was in {frames}, in which "
            f"{self.other_name} has no label: {self.evidence}; these points are given to {self.other_name}"
        )


def find_moves(trajectories: Trajectories, *, limbs: Limbs | None = None) -> tuple[Move, ...]:
    """Find labels that sit on another marker, unseen meanwhile, for some frames.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers without exchanged labels.
    limbs : Limbs, optional
        Rigid groups; found robustly if left out.

    Returns
    -------
    tuple of Move
        In the order of their first frames; no two of them concern the same frames of a marker.
    """
    if trajectories.n_markers < LEAST_DISTANCES + 2 or trajectories.seen.all():
        return ()
    model = rigid_model(trajectories, limbs or robust_limbs(trajectories))
    seen = trajectories.seen
    hosts = [m for m in range(trajectories.n_markers) if len(model.partners(m)) >= LEAST_DISTANCES]
    found: list[Move] = []
    for marker in range(trajectories.n_markers):
        # Frames in which the distances of a label to its own limb are as usual
        off = np.abs(_deviations(trajectories.positions, marker, marker, model))
        off /= model.spread[marker, model.partners(marker)]
        known = (~np.isnan(off)).sum(axis=1)
        consistent = (known > 0) & ((off > BAD).sum(axis=1) * 2 < known)
        doubted = seen[:, marker] & ~consistent
        for other in hosts:
            if other != marker and np.count_nonzero(doubted & ~seen[:, other]) >= LEAST_FRAMES:
                found += _moves(trajectories, (marker, other), consistent | seen[:, other], model)
    return _apart(found)


def undo_moves(trajectories: Trajectories, moves: Iterable[Move]) -> Trajectories:
    """Give the points of moved labels to the markers that they sit on; nothing else changes.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers.
    moves : iterable of Move
        From `find_moves`.

    Returns
    -------
    Trajectories
        With a notice per move; the same object if there is none.
    """
    moves = tuple(moves)
    if not moves:
        return trajectories
    positions = trajectories.positions.copy()
    for move in moves:
        shown = trajectories.seen[move.first_frame : move.last_frame + 1, move.marker]
        frames = move.first_frame + np.flatnonzero(shown)
        positions[frames, move.other] = positions[frames, move.marker]
        positions[frames, move.marker] = np.nan
    notices = (*trajectories.notices, *(move.sentence for move in moves))
    return dataclasses.replace(trajectories, positions=positions, notices=notices)


def _moves(trajectories: Trajectories, pair: tuple[int, int], barred: Bools, model: RigidModel) -> list[Move]:
    """All moves of one label onto one other marker, between the frames that are barred to them."""
    marker, other = pair
    mates = model.partners(other)
    mates = mates[mates != marker]
    off = _deviations(trajectories.positions, marker, other, model)
    deviations = np.abs(off) / model.spread[other, mates]
    testable = (~np.isnan(off)).sum(axis=1) >= LEAST_DISTANCES
    fits = testable & (median_of_known(deviations.T) <= FITS)
    elsewhere = testable & barred
    if elsewhere.sum() < LEAST_ELSEWHERE or fits[elsewhere].mean() > FITS_ANYWAY:
        return []
    fits &= ~elsewhere
    least = max(LEAST_FRAMES, round(LEAST_SECONDS * trajectories.rate))
    found = []
    # First and last fitting frame of every run between barriers
    run = np.cumsum(barred | (testable & ~fits))
    frames = np.flatnonzero(fits)
    _, starts, counts = np.unique(run[frames], return_index=True, return_counts=True)
    for first, last in zip(frames[starts].tolist(), frames[starts + counts - 1].tolist(), strict=True):
        rows = slice(first, last + 1)
        if fits[rows].sum() < least:
            continue
        known = np.flatnonzero((~np.isnan(off[rows])).any(axis=0))
        misfit = float(np.nanmedian(np.abs(off[rows])))
        names = tuple(trajectories.names[mate] for mate in mates[known])
        label, place = trajectories.names[marker], trajectories.names[other]
        found.append(Move(marker, other, label, place, first, last, misfit, names))
    return found


def _deviations(positions: Floats, marker: int, other: int, model: RigidModel) -> Floats:
    """How far a label's distances to another marker's limb are from those of that marker [mm], (n_frames, n_mates)."""
    mates = model.partners(other)
    mates = mates[mates != marker]
    lengths = lengths_of(positions[:, mates] - positions[:, [marker]])
    return np.asarray(lengths - model.distance[other, mates])


def _apart(moves: list[Move]) -> tuple[Move, ...]:
    """Of moves that share a marker and frames, the longest."""
    kept: list[Move] = []
    for move in sorted(moves, key=lambda one: (one.first_frame - one.last_frame, one.misfit)):
        clash = [
            one
            for one in kept
            if {one.marker, one.other} & {move.marker, move.other}
            and one.first_frame <= move.last_frame
            and move.first_frame <= one.last_frame
        ]
        if not clash:
            kept.append(move)
    return tuple(sorted(kept, key=lambda one: (one.first_frame, one.marker)))
