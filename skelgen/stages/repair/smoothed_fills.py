"""Find gaps that a program filled before it smoothed the take: markers that leave their limb for a while, on a curve.

Smoothing bends lines and curves a little, so that no difference vanishes (`fills`). But a marker that was filled is far
from where its limb takes it, and its path is nearer to a cubic curve than those of the markers beside it by far. What
skin and joints do for a while is as rough as what the rest of the limb does.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from skelgen.geometry.statistics import lengths_of
from skelgen.model import Trajectories
from skelgen.model.arrays import Floats, runs_of
from skelgen.stages.repair.departures import departures
from skelgen.stages.repair.fills import Fill

AWAY, BEGUN = 4.0, 2.0
"""Standard deviations by which distances are off in the worst frame of a piece, and from its first to its last."""

LONGEST = 1.0
"""s; what is away for longer is a limb that has moved."""

LEAST_FRAMES = 6
"""In the middle of a piece; in fewer every path is near a cubic."""

EDGE = 0.2
"""Part of a piece, at either end, where smoothing bends what was filled."""

SMOOTHER = 1.5
"""Times as near to a cubic as the paths of its mates is that of a marker that may have been filled."""

CLEARLY, LEAST_CLEAR, CLEAR_PART = 10.0, 3, 0.1
"""The same where it is sure, and so many pieces, and such a part of all, must be so: else nothing was filled."""


TINY = 1e-6
"""mm."""

ROUNDS = 2
"""Where the clearest are gaps again, distances are steadier, and more stand out."""

EVIDENCE = "on smooth curves away from their limb, as programs fill gaps before they smooth"


class _Piece(NamedTuple):
    marker: int
    first: int
    stop: int
    smoother: float


def find_smoothed_fills(trajectories: Trajectories) -> tuple[Fill, ...]:
    """Find gaps of labelled markers that were filled, after which the take was smoothed.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers.
    """
    measured, filled = trajectories, ~trajectories.seen
    for number in range(ROUNDS):
        pieces = _pieces(measured)
        n_clear = sum(piece.smoother >= CLEARLY for piece in pieces)
        if number == 0 and n_clear < max(LEAST_CLEAR, CLEAR_PART * len(pieces)):
            return ()
        for piece in pieces:
            filled[piece.first : piece.stop, piece.marker] |= piece.smoother >= SMOOTHER
        measured = replace(trajectories, positions=np.where(filled[..., np.newaxis], np.nan, trajectories.positions))
    return tuple(
        Fill(marker, trajectories.names[marker], np.flatnonzero(where), len(runs_of(where)), EVIDENCE)
        for marker, where in enumerate((filled & trajectories.seen).T)
        if where.any()
    )


def _pieces(trajectories: Trajectories) -> list[_Piece]:
    """Where markers are away from their mates for a while."""
    pieces = []
    for marker, (beside, away) in enumerate(departures(trajectories.positions)):
        for first, stop in runs_of(away > BEGUN):
            if away[first:stop].max() > AWAY and stop - first <= LONGEST * trajectories.rate:
                edge = int(EDGE * (stop - first))
                paths = trajectories.positions[first + edge : stop - edge, [marker, *beside]]
                if len(paths) >= LEAST_FRAMES:
                    pieces.append(_Piece(marker, first, stop, _smoother(paths)))
    return pieces


def _smoother(paths: Floats) -> float:
    """How many times as near to a cubic as those of the others is the first path, by the middle of these."""
    shown = paths[:, ~np.isnan(paths).any(axis=(0, 2))]
    powers = np.vander(np.linspace(-1.0, 1.0, len(shown)), 4)
    basis = np.linalg.qr(powers)[0]
    rest = shown - np.tensordot(basis, np.tensordot(basis.T, shown, 1), 1)
    own, *others = np.sqrt((lengths_of(rest) ** 2).mean(axis=0))
    return float(np.median(others) / max(own, TINY)) if others else 0.0
