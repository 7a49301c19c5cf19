"""How bodies move: smoothly at random, and holding on to each other for a part of a take; and what sensors measure.

Every joint angle of a random motion is a sum of a few sinusoids, and the root walks about. Sensors, which stand in
place of markers, sit anywhere on their limbs.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from skelgen.geometry.rotations import matrix_from_vector, transform_from
from skelgen.model.arrays import Floats
from skelgen.simulation.articulated import Attachment, Capsule, LimbModel, Structure, limb

_WAVES = 3  # sinusoids per curve: more would only flatten the peaks
_WEIGHTS = (0.5, 1.0)  # range of their relative weights
_JOINT_FREQUENCIES = (0.2, 1.0)  # Hz: from slow reaching to brisk walking
_ROOT_FREQUENCIES = (0.05, 0.3)  # Hz: turning and walking about are slower
_BOB = 30.0  # mm: amplitude of the root's height, that of a walking pelvis
_BOB_FREQUENCIES = (0.5, 1.5)  # Hz


def smooth_curves(
    rng: np.random.Generator, n_frames: int, rate: float, n_curves: int, frequencies: tuple[float, float]
) -> Floats:
    """Return random smooth curves within -1 .. 1.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of frequencies, phases and weights.
    n_frames, n_curves : int
        Shape of the result.
    rate : float, Hz
        Frame rate.
    frequencies : tuple of float, Hz
        Lowest and highest frequency of the sinusoids.

    Returns
    -------
    ndarray, shape (n_frames, n_curves)
    """
    frequency = rng.uniform(*frequencies, size=(n_curves, _WAVES))
    phase = rng.uniform(0, 2 * np.pi, size=(n_curves, _WAVES))
    weight = rng.uniform(*_WEIGHTS, size=(n_curves, _WAVES))
    weight /= weight.sum(axis=1, keepdims=True)
    times = np.arange(n_frames) / rate
    curves = np.zeros((n_frames, n_curves))
    for wave in range(_WAVES):  # one wave at a time keeps the memory at the size of the result
        angle = 2 * np.pi * times[:, np.newaxis] * frequency[:, wave] + phase[:, wave]
        curves += weight[:, wave] * np.sin(angle)
    return curves


def random_angles(
    structure: Structure, n_frames: int, rate: float, rng: np.random.Generator, motion_range: float = 1.0
) -> list[Floats]:
    """Return the angles of every limb's joint.

    Parameters
    ----------
    structure : Structure
        What is moved.
    n_frames : int
        Number of frames.
    rate : float, Hz
        Frame rate.
    rng : numpy.random.Generator
        Source of the motion.
    motion_range : float
        Factor on all amplitudes of the joints; the root turns as it likes.

    Returns
    -------
    list of ndarray, shape (n_frames, n_angles), rad
        One array per limb, in the order of its axes.
    """
    return [_limb_angles(limb, n_frames, rate, rng, motion_range) for limb in structure.limbs]


def _limb_angles(limb: LimbModel, n_frames: int, rate: float, rng: np.random.Generator, motion_range: float) -> Floats:
    amplitudes, offsets = np.deg2rad(limb.amplitudes), np.deg2rad(limb.offsets)
    if limb.kind == "free":
        return np.asarray(offsets + amplitudes * smooth_curves(rng, n_frames, rate, len(offsets), _ROOT_FREQUENCIES))
    curves = smooth_curves(rng, n_frames, rate, len(offsets), _JOINT_FREQUENCIES)
    return np.asarray(offsets + motion_range * amplitudes * curves)


def random_walk(structure: Structure, n_frames: int, rate: float, rng: np.random.Generator, walk: float) -> Floats:
    """Return the world positions of the root's origin [mm], shape (n_frames, 3).

    Parameters
    ----------
    structure : Structure
        Its root's `joint` is the centre of the walk.
    n_frames : int
        Number of frames.
    rate : float, Hz
        Frame rate.
    rng : numpy.random.Generator
        Source of the path.
    walk : float, mm
        Farthest distance from the centre along x and y.
    """
    level = walk * smooth_curves(rng, n_frames, rate, 2, _ROOT_FREQUENCIES)
    height = _BOB * smooth_curves(rng, n_frames, rate, 1, _BOB_FREQUENCIES)
    return np.asarray(structure.limbs[0].joint + np.concatenate([level, height], axis=1))


def world_from_limbs(structure: Structure, angles: list[Floats], root_positions: Floats) -> Floats:
    """Return the pose of every limb's frame.

    Parameters
    ----------
    structure : Structure
        Joints and axes.
    angles : list of ndarray, shape (n_frames, n_angles), rad
        As from `random_angles`.
    root_positions : ndarray, shape (n_frames, 3), mm
        World positions of the root's origin.

    Returns
    -------
    ndarray, shape (n_frames, n_limbs, 4, 4), translations in mm
    """
    poses = np.zeros((len(root_positions), structure.n_limbs, 4, 4))
    poses[:, :, 3, 3] = 1.0
    for index, (model, parent) in enumerate(zip(structure.limbs, structure.parents, strict=True)):
        turn = _rotations(model, angles[index])
        if parent < 0:
            poses[:, index, :3, :3] = turn
            poses[:, index, :3, 3] = root_positions
        else:
            poses[:, index, :3, :3] = poses[:, parent, :3, :3] @ turn
            poses[:, index, :3, 3] = poses[:, parent, :3, :3] @ model.joint + poses[:, parent, :3, 3]
    return poses


def _rotations(limb: LimbModel, angles: Floats) -> Floats:
    axes = np.asarray(limb.axes)
    if limb.kind == "ball":
        return np.asarray(Rotation.from_rotvec(angles @ axes).as_matrix())
    turn = Rotation.from_rotvec(angles[:, :1] * axes[0])
    for column in range(1, angles.shape[1]):
        turn = turn * Rotation.from_rotvec(angles[:, column : column + 1] * axes[column])
    return np.asarray(turn.as_matrix())


TOOL = Structure("tool", (limb("tool", Attachment("", "free", (400, 0, 1000)), Capsule((0, 0, -350), 15), 3),))

_FIRST, _LENGTH = (0.2, 0.4), (0.3, 0.4)  # parts of the take: when a hold begins, how long it lasts
_APPROACH = 0.15  # part of the take in which partners come near each other, and part again
_ASIDE = 60.0  # mm: how far sensors sit from the joints of their limbs, each coordinate


@dataclass(frozen=True)
class Hold:
    """Two limbs that hold on to each other.

    Attributes
    ----------
    limbs : tuple of int
        Who holds, and who is held.
    first_frame, last_frame : int
        The span.
    """

    limbs: tuple[int, int]
    first_frame: int
    last_frame: int


def held(structure: Structure, poses: Floats, is_tool: bool, rng: np.random.Generator) -> tuple[Floats, Hold]:
    """Let a limb at the end of the first body hold one of the second for a span.

    A partner moves as before, but his whole body is shifted so that the ends of both limbs meet; a tool is carried
    along, and lies still before and afterwards.

    Parameters
    ----------
    structure : Structure
        Two bodies, each a tree.
    poses : ndarray, shape (n_frames, n_limbs, 4, 4), translations in mm
        How they would move by themselves.
    is_tool : bool
        Whether the second body is a tool.
    rng : numpy.random.Generator
        Source of limbs and span.

    Returns
    -------
    tuple of ndarray and Hold
        The poses, and what is held.
    """
    n_frames, second_root = len(poses), int(np.flatnonzero(structure.parents < 0)[1])
    ends = [limb for limb in range(structure.n_limbs) if limb not in structure.parents]
    one = int(rng.choice([limb for limb in ends if limb < second_root]))
    other = int(rng.choice([limb for limb in ends if limb >= second_root]))
    first = int(n_frames * rng.uniform(*_FIRST))
    last = min(first + int(n_frames * rng.uniform(*_LENGTH)), n_frames - 1)
    moved = poses.copy()
    if is_tool:
        in_hand = transform_from(matrix_from_vector(rng.normal(size=3)), structure.limbs[one].segment[1])
        moved[:, other] = poses[np.clip(np.arange(n_frames), first, last), one] @ in_hand
    else:
        places = [
            poses[:, limb, :3, :3] @ structure.limbs[limb].segment[1] + poses[:, limb, :3, 3] for limb in (one, other)
        ]
        frames = np.arange(n_frames)
        away = np.clip(np.maximum(first - frames, frames - last) / (_APPROACH * n_frames), 0.0, 1.0)
        moved[:, second_root:, :3, 3] += ((1 + np.cos(np.pi * away)) / 2 * (places[0] - places[1]).T).T[:, np.newaxis]
    return moved, Hold((one, other), first, last)


def sensed(poses: Floats, noise: float, turn_noise: float, rng: np.random.Generator) -> Floats:
    """Return what sensors measure that sit anywhere on their limbs, shape (n_frames, n_limbs, 4, 4), lengths in mm.

    Parameters
    ----------
    poses : ndarray, shape (n_frames, n_limbs, 4, 4), translations in mm
        Of the limbs.
    noise : float, mm
        Standard deviation of each coordinate.
    turn_noise : float, rad
        Standard deviation of the rotation about each axis.
    rng : numpy.random.Generator
        Source of places and errors.
    """
    n_limbs = poses.shape[1]
    mounts = transform_from(matrix_from_vector(rng.normal(size=(n_limbs, 3))), _ASIDE * rng.normal(size=(n_limbs, 3)))
    errors = rng.normal(size=(2, *poses.shape[:2], 3))
    measured = poses @ mounts
    measured[..., :3, :3] = measured[..., :3, :3] @ matrix_from_vector(turn_noise * errors[0])
    measured[..., :3, 3] += noise * errors[1]
    return measured
