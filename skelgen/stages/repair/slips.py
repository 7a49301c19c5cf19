"""Find markers that have slipped: their place on the limb changes from one frame to the next, and stays changed.

A slip shows in three ways. The marker jumps against its neighbours, off the straight lines through the frames before
and after. Its distances to its mates, the markers that move rigidly with it, jump as that step demands. The means of
these distances over `seconds` before and after differ in the same way. Each of the three must exceed what it is in the
rest of the take, so that wobbling skin, bending bodies and wrong limbs raise the threshold and not an alarm.
"""

import dataclasses
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels import marker_steps as kernels
from skelgen.model import Trajectories
from skelgen.model.arrays import Floats, Ints
from skelgen.model.labelling import Finding
from skelgen.stages.repair.exchange_evidence import N_NEIGHBOURS, neighbours_of
from skelgen.stages.repair.slip_evidence import PlaceOnLimb, is_lasting, jump_frames, leaps, significance

NEAREST = 12
"""Markers among which mates are looked for."""

LEAST_SIZE = 4.0
"""mm; smaller changes are no slips, however exact the take."""


SURE, SURE_GAIN = 4.0, 0.5
"""A slip is sure if the step exceeds this many standard deviations of what distances vary, and if distances show at
least this part of it throughout."""

VARIES = 2.0
"""Standard deviations of what distances vary between such means anyway: a slip is larger."""

CORROBORATED = 4.0
"""Standard deviations by which distances must change as the marker's own step demands."""


NAMED_MATES = 3
"""Mates that are named to the user."""


ABOVE_COMMON, ABOVE_COMMON_AT_ONCE = 1.7, 1.3
"""How many times the step between lines, and that of the single frame, must exceed what is `COMMON`."""


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
    size : float, mm
        Length of the step.
    evidence : float
        Change of the distances to its mates, in standard deviations of what they vary over `seconds` anyway;
        without mates, how many times farther it leaps than elsewhere.
    mates : tuple of str
        Markers whose distances show it; none if only the leap does.
    sure : bool
        Whether the change is so clear and so lasting that the marker may be split.
    """

    marker: int
    name: str
    frame: int
    size: float
    evidence: float
    mates: tuple[str, ...]
    sure: bool

    @property
    def reason(self) -> str:
        """Evidence in words."""
        if not self.mates:
            return f"it leaps {self.evidence:.1f} times as far as in all but few other frames and does not come back"
        return (
            f"its distances to {', '.join(self.mates)} change at once, and stay changed, by {self.evidence:.1f} of "
            "their standard deviations"
        )

    @property
    def sentence(self) -> str:
        """Notice for the user."""
        verb = "slips" if self.sure else "may slip"
        return f"{self.name} {verb} on its limb at frame {self.frame} by {self.size:.1f} mm: {self.reason}"

    def finding(self, last_frame: int, new_name: str) -> Finding:
        """Finding for the label quality.

        Parameters
        ----------
        last_frame : int
            Last frame of the take.
        new_name : str
            Name of the marker from the slip on; empty if it is left as it is.
        """
        outcome = f"split: {new_name} from then on" if new_name else "not sure: left as it is"
        evidence = f"{self.size:.1f} mm at once; {self.reason}"
        names = (self.name, new_name) if new_name else (self.name,)
        return Finding("slipped", names, self.frame, last_frame, evidence, outcome)


_Found = tuple[float, Slip]


def find_slips(trajectories: Trajectories, seconds: float = 1.0, factor: float = 6.0) -> tuple[Slip, ...]:
    """Find sudden, lasting changes of a marker's place on its limb.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers without exchanged labels.
    seconds : float, s
        A marker has slipped if its new place on the limb lasts this long.
    factor : float
        It may have slipped where it jumps by this many times its usual step against its neighbours.

    Returns
    -------
    tuple of Slip
        In the order of their frames.
    """
    window = round(seconds * trajectories.rate)
    if trajectories.n_markers < 3 or trajectories.n_frames < 2 * window or window < 2:
        return ()
    (positions,), names = contiguous(trajectories.positions), trajectories.names
    near = neighbours_of(positions, NEAREST)
    steps = kernels.jumps(positions.reshape(len(positions), -1)).reshape(positions.shape)
    found: list[_Found] = []
    for marker in range(trajectories.n_markers):
        beside = near[marker, 1 : N_NEIGHBOURS + 1]
        seen = kernels.relative_steps(steps, marker, beside)
        seen[np.isnan(seen)] = 0.0
        place = PlaceOnLimb(positions, marker, near[marker, 1:], seen, window)
        found += _slips_of(names, marker, place, seen, factor)
        found += _leaps_of(names, marker, seen, partial(_pace, positions, marker, beside), place, window)
    return _one_of_each(found, near, window)


def split_slipped(trajectories: Trajectories, slips: Iterable[Slip]) -> Trajectories:
    """Make a new marker of every one that surely slipped, from its slip on: ``NAME_2``, at the end of the list.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers.
    slips : iterable of Slip
        From `find_slips`.

    Returns
    -------
    Trajectories
        With a notice per slip; the same object if there is no slip.
    """
    slips = sorted(slips, key=lambda slip: (slip.marker, slip.frame))
    if not slips:
        return trajectories
    notices = [(slip.frame, f"{slip.sentence}; it is left as it is") for slip in slips if not slip.sure]
    named = new_names(trajectories.names, slips)
    positions, added = trajectories.positions.copy(), []
    for index, (slip, name) in enumerate(named.items()):
        following = [later.frame for later in list(named)[index + 1 :] if later.marker == slip.marker]
        frames = slice(slip.frame, min(following, default=len(positions)))
        moved = np.full((len(positions), 1, 3), np.nan)
        moved[frames, 0] = trajectories.positions[frames, slip.marker]
        positions[frames, slip.marker] = np.nan
        added.append(moved)
        notices.append((slip.frame, f"{slip.sentence}; from then on it is the marker {name}"))
    positions, names = np.concatenate([positions, *added], axis=1), trajectories.names + tuple(named.values())
    all_notices = trajectories.notices + tuple(notice for _, notice in sorted(notices))
    return dataclasses.replace(trajectories, positions=positions, names=names, notices=all_notices)


def new_names(names: Iterable[str], slips: Iterable[Slip]) -> dict[Slip, str]:
    """Names of the markers that slipped ones become from each sure slip on, by marker and frame.

    Parameters
    ----------
    names : iterable of str
        Names of all markers.
    slips : iterable of Slip
        From `find_slips`.
    """
    taken, found = set(names), {}
    for slip in sorted((slip for slip in slips if slip.sure), key=lambda slip: (slip.marker, slip.frame)):
        number = 2
        while f"{slip.name}_{number}" in taken:
            number += 1
        found[slip] = f"{slip.name}_{number}"
        taken.add(found[slip])
    return found


def _slips_of(names: tuple[str, ...], marker: int, place: PlaceOnLimb, seen: Floats, factor: float) -> list[_Found]:
    """Step in space [mm] and slip, for all of one marker, of which some may be those of a mate."""
    found: list[_Found] = []
    if len(place.mates) < 2:
        return found
    for frame in jump_frames(place.step, factor):
        size, weights = float(np.linalg.norm(place.step[frame])), place.weights(frame)
        if not LEAST_SIZE < size < place.largest or not weights.any():
            continue
        gains = place.gains(frame, weights)
        if not is_lasting(gains) or _stands_out(place, frame, weights) <= CORROBORATED:
            continue
        varies = place.variations(weights)
        if varies > VARIES:
            strongest = np.argsort(-np.abs(weights), kind="stable")[:NAMED_MATES]
            sure = varies > SURE and float(np.nanmin(gains)) > SURE_GAIN
            mates = tuple(names[mate] for mate in place.mates[strongest])
            slip = Slip(marker, names[marker], frame, size, varies, mates, sure)
            found.append((float(np.linalg.norm(seen[frame])), slip))
    return found


def _stands_out(place: PlaceOnLimb, frame: int, weights: Floats) -> float:
    return min(
        significance(place.sudden, weights, frame, place.window, ABOVE_COMMON),
        significance(place.at_once, weights, frame, place.window, ABOVE_COMMON_AT_ONCE),
    )


def _leaps_of(
    names: tuple[str, ...], marker: int, seen: Floats, pace: Callable[[], Floats], place: PlaceOnLimb, window: int
) -> list[_Found]:
    """Possible slips that only the marker's own path shows."""
    found = []
    for frame, above in leaps(seen, pace, LEAST_SIZE, window):
        size = float(np.linalg.norm(seen[frame]))
        if size < place.largest:
            found.append((size, Slip(marker, names[marker], frame, size, above, (), sure=False)))
    return found


def _pace(positions: Floats, marker: int, beside: Ints) -> Floats:
    """Step of a marker from the frame before [mm], less the median one of those beside it, shape (n_frames, 3)."""
    paces = np.diff(positions[:, [marker, *beside]], axis=0, prepend=np.nan)
    (paces,) = contiguous(paces)
    relative = kernels.relative_steps(paces, 0, np.arange(1, len(beside) + 1))
    return relative


def _one_of_each(slips: list[_Found], near: Ints, window: int) -> tuple[Slip, ...]:
    """Keep one of slips that happen together on neighbouring markers: one that distances show, else the farthest."""
    kept: list[Slip] = []
    for _, slip in sorted(slips, key=lambda found: (not found[1].mates, -found[0], found[1].frame, found[1].marker)):
        close = [one for one in kept if abs(one.frame - slip.frame) < window]
        if not any(one.marker == slip.marker or one.marker in near[slip.marker] for one in close):
            kept.append(slip)
    return tuple(sorted(kept, key=lambda slip: (slip.frame, slip.marker)))
