"""Find markers that have slipped: their place on the limb changes from one frame to the next, and stays changed.

The place is measured in a frame that the limb's other markers carry: in three coordinates where there are three others
or more, along and off the line of the others where there are two. A slip must stand out twice: as a step of a few
frames among all such steps, and as a difference of means over `slip_seconds` on both sides among all such differences.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from skelgen.geometry.robust import SIGMA_OF_MEDIAN
from skelgen.kinematics.shape import fit_shape
from skelgen.model import Limbs, Trajectories
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.repair.rigid import robust_limbs

STEP_FRAMES = 5
"""Frames on each side that a sudden step is measured over."""

LEAST_SEEN = 0.5
"""Part of the frames of a window in which the place must be known."""

LASTING = 0.7
"""Part of the step that the means on both sides must still differ by, and at most the inverse of it."""

LARGEST = 0.5
"""Of the typical distance to the limb's other markers: what jumps farther is a wrong label, not a slip."""

LEAST_SIZE = 1.0
"""mm: smaller changes are no slips, however exact the take."""

LEAST_DEVIATION = 0.05
"""mm: what places on exact limbs are taken to vary."""

MOST_SLIPS = 20
"""Slips that are looked for on one limb; more mean that it is no rigid limb."""

SHAPE_FRAMES = 300
"""Frames from which the shape of the other markers is estimated."""


@dataclass(frozen=True, eq=False)
class Slip:
    """A marker that has changed its place on its limb.

    Attributes
    ----------
    marker : int
        Index.
    name : str
        Its label.
    frame : int
        The first frame in the new place.
    old_place, new_place : ndarray, shape (3,), mm
        In the frame of the limb's other markers; along their line, off it, and 0 where there are only two.
    evidence : float
        Size of the change in its standard deviations.
    """

    marker: int
    name: str
    frame: int
    old_place: Floats
    new_place: Floats
    evidence: float

    @property
    def size(self) -> float:
        """Length of the change [mm]."""
        return float(np.linalg.norm(self.new_place - self.old_place))

    @property
    def sentence(self) -> str:
        """What the user is told."""
        return (
            f"{self.name} slips on its limb at frame {self.frame} by {self.size:.1f} mm ({self.evidence:.0f} standard "
            f"deviations), and stays there: it is another marker from then on"
        )


def find_slips(
    trajectories: Trajectories, limbs: Limbs | None = None, parameters: LabelParameters | None = None
) -> tuple[Slip, ...]:
    """Find sudden, lasting changes of a marker's place on its limb.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers without exchanged labels.
    limbs : Limbs, optional
        Rigid groups; found robustly if left out. Limbs of one or two markers tell nothing.
    parameters : LabelParameters, optional
        Their `slip_seconds` and `slip_evidence`.

    Returns
    -------
    tuple of Slip
        In the order of their frames.
    """
    parameters = parameters or LabelParameters()
    limbs = limbs or robust_limbs(trajectories)
    slips: list[Slip] = []
    for limb in range(limbs.n_limbs):
        markers = limbs.markers_of(limb)
        if len(markers) > 2:
            slips += _slips_of_limb(trajectories, markers, parameters)
    return tuple(sorted(slips, key=lambda slip: (slip.frame, slip.marker)))


def split_slipped(trajectories: Trajectories, slips: Iterable[Slip]) -> Trajectories:
    """Make a new marker of every slipped one from its slip on: ``NAME'2``, ``NAME'3``, at the end of the list.

    Returns
    -------
    Trajectories
        With a notice per slip; the same object if there is no slip.
    """
    slips = sorted(slips, key=lambda slip: (slip.marker, slip.frame))
    if not slips:
        return trajectories
    positions, names = trajectories.positions.copy(), list(trajectories.names)
    added = []
    for index, slip in enumerate(slips):
        following = slips[index + 1 :]
        end = next((later.frame for later in following if later.marker == slip.marker), len(positions))
        moved = np.full((len(positions), 3), np.nan)
        moved[slip.frame : end] = trajectories.positions[slip.frame : end, slip.marker]
        positions[slip.frame : end, slip.marker] = np.nan
        added.append(moved)
        names.append(_free_name(slip.name, names))
    positions = np.concatenate([positions, np.stack(added, axis=1)], axis=1)
    notices = tuple(slip.sentence for slip in sorted(slips, key=lambda slip: slip.frame))
    return dataclasses.replace(
        trajectories, positions=positions, names=tuple(names), notices=trajectories.notices + notices
    )


def _free_name(name: str, taken: list[str]) -> str:
    number = 2
    while f"{name}'{number}" in taken:
        number += 1
    return f"{name}'{number}"


def _slips_of_limb(trajectories: Trajectories, markers: Ints, parameters: LabelParameters) -> list[Slip]:
    """The clearest slip of the limb, then those before and after it: a slip spoils the frame of the other markers."""
    window = max(STEP_FRAMES, round(parameters.slip_seconds * trajectories.rate))
    spans = [(0, trajectories.n_frames)]
    slips: list[Slip] = []
    while spans and len(slips) < MOST_SLIPS:
        first, last = spans.pop()
        if last - first < 2 * window:
            continue
        part = trajectories.positions[first:last, markers]
        found = [_clearest(part, index, window, parameters.slip_evidence) for index in range(len(markers))]
        best = max(range(len(markers)), key=lambda index: found[index][0])
        evidence, frame, old, new = found[best]
        if evidence <= 0:
            continue
        marker = int(markers[best])
        slips.append(Slip(marker, trajectories.names[marker], first + frame, old, new, evidence))
        spans += [(first, first + frame), (first + frame, last)]
    return slips


def _clearest(positions: Floats, index: int, window: int, factor: float) -> tuple[float, int, Floats, Floats]:
    """Evidence (0 if there is none), frame, old and new place of one marker's clearest slip."""
    nothing = (0.0, 0, np.zeros(3), np.zeros(3))
    places, reach = _places(positions, index)
    lasting, before, after = _differences(places, window)
    step = _differences(places, STEP_FRAMES)[0]
    sudden, size, width = _standing_out(step), np.linalg.norm(lasting, axis=1), np.linalg.norm(step, axis=1)
    lasts: Bools = (size > LASTING * width) & (size < width / LASTING) & (size > LEAST_SIZE) & (size < LARGEST * reach)
    clear = (_standing_out(lasting) > factor) & (sudden > factor) & lasts
    if not clear.any():
        return nothing
    frame = int(np.argmax(np.where(clear, sudden, 0.0)))
    return float(sudden[frame]), frame, before[frame], after[frame]


def _differences(places: Floats, window: int) -> tuple[Floats, Floats, Floats]:
    """Mean places of the `window` frames from each on less those before, and both means; NaN where little is known."""
    known = ~np.isnan(places[:, :1])
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(np.where(known, places, 0.0), axis=0)])
    count = np.concatenate([np.zeros((1, 1)), np.cumsum(known, axis=0)])
    n_frames = len(places)
    middle = np.arange(n_frames)
    low, high = np.maximum(middle - window, 0), np.minimum(middle + window, n_frames)
    means = []
    for start, end in ((low, middle), (middle, high)):
        number = count[end] - count[start]
        whole = (end - start == window)[:, np.newaxis]  # nothing is said of what lasts beyond the take
        enough = whole & (number >= LEAST_SEEN * window)
        means.append(np.where(enough, (total[end] - total[start]) / np.maximum(number, 1.0), np.nan))
    return means[1] - means[0], means[0], means[1]


def _standing_out(differences: Floats) -> Floats:
    """Length of differences in their robust standard deviations; 0 where unknown."""
    known = differences[~np.isnan(differences[:, 0])]
    if not len(known):
        return np.zeros(len(differences))
    deviation = np.maximum(SIGMA_OF_MEDIAN * np.median(np.abs(known), axis=0), LEAST_DEVIATION)
    return np.asarray(np.linalg.norm(np.nan_to_num(differences) / deviation, axis=1))


def _places(positions: Floats, index: int) -> tuple[Floats, float]:
    """Places of a marker on its limb [mm], shape (n_frames, 3), and its typical distance to the others."""
    own, others = positions[:, index], np.delete(positions, index, axis=1)
    lengths = np.linalg.norm(others - own[:, np.newaxis], axis=2)
    reach = float(np.median(lengths[~np.isnan(lengths)])) if not np.isnan(lengths).all() else 0.0
    if others.shape[1] == 2:
        return _off_a_line(own, others), reach
    frames = np.unique(np.linspace(0, len(own) - 1, SHAPE_FRAMES).astype(np.intp))
    poses = fit_shape(others, frames).world_from_limb
    return np.asarray(np.einsum("fji,fj->fi", poses[:, :3, :3], own - poses[:, :3, 3])), reach


def _off_a_line(own: Floats, others: Floats) -> Floats:
    line = others[:, 1] - others[:, 0]
    with np.errstate(invalid="ignore", divide="ignore"):
        line = line / np.linalg.norm(line, axis=1)[:, np.newaxis]
    away = own - others.mean(axis=1)
    along = (away * line).sum(axis=1)
    off = np.sqrt(np.maximum((away**2).sum(axis=1) - along**2, 0.0))
    return np.stack([along, off, np.where(np.isnan(off), np.nan, 0.0)], axis=1)
