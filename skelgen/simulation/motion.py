"""Smooth random motion: every joint angle is a sum of a few sinusoids, and the root walks about."""

import numpy as np
from scipy.spatial.transform import Rotation

from skelgen.model.arrays import Floats
from skelgen.simulation.articulated import LimbModel, Structure

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
    for index, (limb, parent) in enumerate(zip(structure.limbs, structure.parents, strict=True)):
        turn = _rotations(limb, angles[index])
        if parent < 0:
            poses[:, index, :3, :3] = turn
            poses[:, index, :3, 3] = root_positions
        else:
            poses[:, index, :3, :3] = poses[:, parent, :3, :3] @ turn
            poses[:, index, :3, 3] = poses[:, parent, :3, :3] @ limb.joint + poses[:, parent, :3, 3]
    return poses


def _rotations(limb: LimbModel, angles: Floats) -> Floats:
    axes = np.asarray(limb.axes)
    if limb.kind == "ball":
        return np.asarray(Rotation.from_rotvec(angles @ axes).as_matrix())
    turn = Rotation.from_rotvec(angles[:, :1] * axes[0])
    for column in range(1, angles.shape[1]):
        turn = turn * Rotation.from_rotvec(angles[:, column : column + 1] * axes[column])
    return np.asarray(turn.as_matrix())
