"""Sensors that slipped are moved back: where their joints are in the sensor's frame must be the same before and after.

Of each joint of the limb there is one place in the neighbour's frame, and one in the sensor's frame before and after
the slip, by linear least squares. The motion that brings those after onto those before is the slip; what they leave
open, as the turn about a single joint, is taken as none.
"""

import numpy as np

from skelgen.geometry.rotations import cross_matrix, matrix_from_vector, transform_from
from skelgen.kinematics.hierarchy import joint_gaps
from skelgen.model import Poses
from skelgen.model.arrays import Floats, Ints
from skelgen.model.topology import spanning_forest
from skelgen.stages.joints.sensor_slips import SensorSlip, find_sensor_slips

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
    """Whether a slip was moved back already; what is left of it is no other one."""
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
    """A joint in a body's frame before and after a frame [mm], the same in its neighbour's all the time."""
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
        slopes = np.concatenate([-cross_matrix(arms - centre), np.broadcast_to(np.eye(3), (len(arms), 3, 3))], axis=2)
        slopes, errors = slopes.reshape(-1, 6), (wanted - arms - motion[:3, 3]).ravel()
        normal = slopes.T @ slopes / PLACE_STD**2 + np.diag([TURN_STD**-2] * 3 + [0.0] * 3)
        step = np.linalg.solve(normal, slopes.T @ errors / PLACE_STD**2)
        turn = matrix_from_vector(step[:3])
        shift = motion[:3, 3] + step[3:] + centre - turn @ centre
        motion = transform_from(turn @ motion[:3, :3], shift)
    return motion
