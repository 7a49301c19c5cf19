"""Bodies that hold on to each other for a part of a take, and sensors instead of markers."""

from dataclasses import dataclass

import numpy as np

from skelgen.geometry.rotations import matrix_from_vector, transform_from
from skelgen.model.arrays import Floats
from skelgen.simulation.articulated import Attachment, Capsule, Structure, limb

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
