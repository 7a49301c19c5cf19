"""Sensors that slip on their limb within a take: steps in the gaps of their joints, and the sensors moved back.

A joint is at one place, whether one limb's sensor carries it or the other's. A sensor that slips carries it elsewhere
from then on: in its own frame the gap between both places makes a step, which stays, whatever the limbs do. The frame
is where a step explains most of the gap (the cumulative sum of its deviations from the mean is largest).

Of each joint of the limb there is one place in the neighbour's frame, and one in the sensor's frame before and after
the slip, by linear least squares. The motion that brings those after onto those before is the slip; what they leave
open, as the turn about a single joint, is taken as none.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from skelgen.geometry.rotations import matrix_from_vector, slopes_by_motion, transform_from
from skelgen.kinematics.hierarchy import joint_gaps
from skelgen.kinematics.joints.closed_form import fit_fixed_point
from skelgen.model import Poses
from skelgen.model.arrays import Floats, Ints
from skelgen.model.topology import spanning_forest

LEAST_STEP = 5.0
"""mm; joints of limbs move by some millimetres on their own."""

LEAST_RATIO = 4.0
"""How many times the deviation of the gap beside it a step must be."""

LEAST_FRAMES = 20
"""Frames that a gap must be known in on both sides of a step."""

SHARP_FRAMES = 8
"""Frames next to a step on each side, between which most of it must lie: postures change more slowly."""

SHARP_PART = 0.6
"""The part of a step that must lie between these frames."""

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


N_SPANS = 4
"""Spans of a take whose median gap tells which bodies are joined: a slip spoils one of them."""

ROUNDS = 4
"""Of a sensor that slips several times the largest slip is found first, then those that are left."""

PLACE_STD, TURN_STD = 1.0, 0.3
"""mm and rad: errors of the joints' places, and how far a sensor may turn when it slips."""

STEPS = 10


def slips_moved_back(poses: Poses) -> tuple[Poses, tuple[SensorSlip, ...]]:
    """Return bodies whose sensors that slipped are moved back, and the slips; those given where there is none.

    Parameters
    ----------
    poses : Poses
        Bodies with orientation.
    """
    edges = _edges(poses)
    found: list[SensorSlip] = []
    world: Floats = poses.world_from_body
    for _ in range(ROUNDS):
        slips = [slip for slip in find_sensor_slips(world, edges) if not _is_known(slip, found)]
        if not slips:
            break
        world = world.copy()
        for slip in slips:
            world[slip.frame :, slip.limb] = world[slip.frame :, slip.limb] @ np.linalg.inv(_motion(world, edges, slip))
        found += slips
    if not found:
        return poses, ()
    moved = Poses(world, poses.names, poses.rate, poses.name, poses.notices)
    return moved, tuple(sorted(found, key=lambda slip: slip.frame))


def _is_known(slip: SensorSlip, found: list[SensorSlip]) -> bool:
    """Whether a slip was moved back already: what remains of it does not count as another slip."""
    return any(slip.limb == one.limb and abs(slip.frame - one.frame) <= 2 for one in found)


def _edges(poses: Poses) -> Ints:
    """The joints of the tree by the median gaps of some spans, shape (n_joints, 2)."""
    spans = np.array_split(np.arange(poses.n_frames), N_SPANS)
    gaps = [joint_gaps(Poses(poses.world_from_body[span], poses.names, poses.rate)) for span in spans if len(span)]
    known = np.isfinite(gaps).any(axis=0)
    middle = np.full(known.shape, np.nan)
    middle[known] = np.nanmedian(np.array(gaps)[:, known], axis=0)
    parents = spanning_forest(middle)
    children = np.flatnonzero(parents >= 0)
    return np.column_stack([parents[children], children])


def _motion(world: Floats, edges: Ints, slip: SensorSlip) -> Floats:
    """How points of the sensor's frame after the slip are to be moved into the one before, shape (4, 4)."""
    before, after = [], []
    for first, second in edges.tolist():
        if slip.limb in (first, second):
            places = _places(world[:, slip.limb], world[:, second if first == slip.limb else first], slip.frame)
            if places is not None:
                before.append(places[0])
                after.append(places[1])
    return _small_motion(np.array(after), np.array(before)) if before else np.eye(4)


def _places(body: Floats, neighbour: Floats, frame: int) -> tuple[Floats, Floats] | None:
    """A joint in a body's frame, before and after some frame of the take [mm]; it is fixed in the neighbour's frame."""
    known = ~np.isnan(body[:, 0, 3] + neighbour[:, 0, 3])
    is_after = np.arange(len(body)) >= frame
    if (known & is_after).sum() < 2 or (known & ~is_after).sum() < 2:
        return None
    rows = np.zeros((len(body), 3, 9))
    rows[..., :3] = -neighbour[:, :3, :3]
    rows[~is_after, :, 3:6], rows[is_after, :, 6:] = body[~is_after, :3, :3], body[is_after, :3, :3]
    right = neighbour[:, :3, 3] - body[:, :3, 3]
    solution, *_ = np.linalg.lstsq(rows[known].reshape(-1, 9), right[known].ravel(), rcond=1e-9)
    found = np.asarray(solution, dtype=np.float64)
    return found[3:6], found[6:]


def _small_motion(points: Floats, wanted: Floats) -> Floats:
    """The motion that brings points [mm], shape (n, 3), onto others; what they do not tell is left as it is."""
    motion = np.eye(4)
    for _ in range(STEPS):
        arms = points @ motion[:3, :3].T
        centre = arms.mean(axis=0)
        slopes = slopes_by_motion(arms - centre).reshape(-1, 6)
        errors = (wanted - arms - motion[:3, 3]).ravel()
        normal = slopes.T @ slopes / PLACE_STD**2 + np.diag([TURN_STD**-2] * 3 + [0.0] * 3)
        step = np.asarray(np.linalg.solve(normal, slopes.T @ errors / PLACE_STD**2), dtype=np.float64)
        turn = matrix_from_vector(step[:3])
        shift = motion[:3, 3] + step[3:] + centre - turn @ centre
        motion = transform_from(turn @ motion[:3, :3], shift)
    return motion
