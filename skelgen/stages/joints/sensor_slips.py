"""Sensors that slip on their limb within a take: steps in the gaps of their joints.

A joint is at one place, whether one limb's sensor carries it or the other's. A sensor that slips carries it elsewhere
from then on: in its own frame the gap between both places makes a step, which stays, whatever the limbs do. The frame
is where a step explains most of the gap (the cumulative sum of its deviations from the mean is largest).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from skelgen.kinematics.joints.closed_form import fit_fixed_point
from skelgen.model.arrays import Floats, Ints

LEAST_STEP = 5.0
"""mm; joints of limbs move by some millimetres on their own."""

LEAST_RATIO = 4.0
"""How many times the deviation of the gap beside it a step must be."""

LEAST_FRAMES = 20
"""Frames that a gap must be known in on both sides of a step."""

SHARP_FRAMES = 8
"""Frames next to a step on each side, between which most of it must lie: postures change more slowly."""

SHARP_PART = 0.6
"""That part of it."""

SAME_FRAMES = 3
"""Steps of several joints that are so near to each other in time are one."""


@dataclass(frozen=True)
class SensorSlip:
    """A sensor that sits elsewhere from some frame on.

    Attributes
    ----------
    limb : int
        The limb whose sensor it is.
    frame : int
        First frame after it.
    size : float, mm
        By how far the joints moved in the sensor's frame.
    """

    limb: int
    frame: int
    size: float

    def sentence(self, name: str) -> str:
        """Return what a notice says of the body of this name."""
        return (
            f"the sensor of {name} slips at frame {self.frame}: its joints jump by {self.size:.1f} mm in its frame; "
            "from there on it is moved back to where it was"
        )


@dataclass(frozen=True)
class _Step:
    """A step in the gap of a joint, as the sensors of both limbs see it."""

    limbs: tuple[int, int]
    frame: int
    explained: tuple[float, float]
    sizes: tuple[float, float]


def find_sensor_slips(poses: Floats, edges: Ints) -> tuple[SensorSlip, ...]:
    """Find sensors that slip within a take, of each joint the largest step.

    Parameters
    ----------
    poses : ndarray, shape (n_frames, n_limbs, 4, 4), translations in mm
        world_from_body of the sensors; NaN where unseen.
    edges : ndarray of intp, shape (n_joints, 2)
        Limbs of each joint.

    Returns
    -------
    tuple of SensorSlip
        In the order of time.
    """
    every = [_step(poses, pair) for pair in edges.tolist()]
    steps = sorted((step for step in every if step is not None), key=lambda step: step.frame)
    slips: list[SensorSlip] = []
    while steps:
        together = [step for step in steps if step.frame - steps[0].frame <= SAME_FRAMES]
        steps = steps[len(together) :]
        slips += _slips(together)
    return tuple(slips)


def _slips(steps: list[_Step]) -> Iterator[SensorSlip]:
    """Name the sensors that explain steps at one time: those with most of them first."""
    frame = int(np.median([step.frame for step in steps]))
    while steps:
        shares = {
            limb: sum(step.explained[step.limbs.index(limb)] for step in steps if limb in step.limbs)
            for limb in {limb for step in steps for limb in step.limbs}
        }
        slipped = max(shares, key=lambda limb: shares[limb])
        own = [step for step in steps if slipped in step.limbs]
        steps = [step for step in steps if slipped not in step.limbs]
        sizes = [step.sizes[step.limbs.index(slipped)] for step in own]
        yield SensorSlip(slipped, frame, float(np.median(sizes)))


def _step(poses: Floats, pair: list[int]) -> _Step | None:
    """The step in the gap of a joint, where there is a sharp one."""
    first, second = poses[:, pair[0]], poses[:, pair[1]]
    fit = fit_fixed_point(first, second, np.zeros(3), np.zeros(3))
    known = np.flatnonzero(~np.isnan(first[:, 0, 3] + second[:, 0, 3]))
    if fit is None or len(known) < 2 * LEAST_FRAMES:
        return None
    first, second = first[known], second[known]
    gap = first[:, :3, :3] @ fit.in_first + first[:, :3, 3] - second[:, :3, :3] @ fit.in_second - second[:, :3, 3]
    found = [_largest_step(np.einsum("fji,fj->fi", body[:, :3, :3], gap)) for body in (first, second)]
    (place, *_), best = max(found, key=lambda one: one[1]), max(one[1] for one in found)
    if not best or not any(one[3] for one in found):
        return None
    return _Step((pair[0], pair[1]), int(known[place]), (found[0][1], found[1][1]), (found[0][2], found[1][2]))


def _largest_step(gap: Floats) -> tuple[int, float, float, bool]:
    """Where a gap [mm], shape (n_frames, 3), steps most; the part that this explains, its size, whether it is one."""
    n_frames = len(gap)
    counts = np.arange(LEAST_FRAMES, n_frames - LEAST_FRAMES + 1)
    sums = np.cumsum(gap - gap.mean(axis=0), axis=0)[counts - 1]
    squares = (sums**2).sum(axis=1) * n_frames / (counts * (n_frames - counts))
    place = int(counts[np.argmax(squares)])
    before, after = gap[:place], gap[place:]
    step = after.mean(axis=0) - before.mean(axis=0)
    size, total = float(np.linalg.norm(step)), float(((gap - gap.mean(axis=0)) ** 2).sum())
    beside = float(np.sqrt(max(total - squares.max(), 0.0) / (3 * n_frames)))
    jump = np.median(after[:SHARP_FRAMES], axis=0) - np.median(before[-SHARP_FRAMES:], axis=0)
    is_sharp = float(jump @ step) >= SHARP_PART * size**2
    is_one = size >= max(LEAST_STEP, LEAST_RATIO * beside) and is_sharp
    return place, float(squares.max()) / max(total, 1e-12), size, is_one
