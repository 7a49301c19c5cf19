"""The ways that markers came, as lines that fade with age. Numbers only."""

from __future__ import annotations

import numpy as np

from skelgen.model.arrays import Floats, Ints

N_AGES = 4
"""Steps in which a trail fades."""


def trail_lines(places: Floats, limb_of_marker: Ints) -> list[tuple[int, int, Floats]]:
    """Cut trails into lines that share a colour.

    Parameters
    ----------
    places : ndarray, shape (n_steps, n_markers, 2), px
        Where each marker was, the present last; NaN breaks the line.
    limb_of_marker : ndarray of intp, shape (n_markers,)
        Limb of each marker.

    Returns
    -------
    list of (int, int, ndarray of shape (n_lines, 2, 2))
        Limb, age from 0 = old to `N_AGES` - 1 = fresh, and the lines.
    """
    n_lines = len(places) - 1
    if n_lines < 1 or not len(limb_of_marker):
        return []
    order = np.argsort(limb_of_marker, kind="stable")
    lines = np.stack([places[:-1, order], places[1:, order]], axis=2).swapaxes(0, 1)
    limbs, starts = np.unique(limb_of_marker[order], return_index=True)
    stops = [*starts[1:].tolist(), len(order)]
    ages = np.linspace(0, n_lines, N_AGES + 1).round().astype(np.intp).tolist()
    return [
        (int(limb), age, _known(lines[start:stop, ages[age] : ages[age + 1]].reshape(-1, 2, 2)))
        for limb, start, stop in zip(limbs, starts, stops, strict=True)
        for age in range(N_AGES)
    ]


def _known(lines: Floats) -> Floats:
    return lines[~np.isnan(lines).any(axis=(1, 2))]
