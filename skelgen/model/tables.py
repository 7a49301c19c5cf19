"""Results of a project as pandas tables, one row per frame and item; every column names its unit.

pandas is imported when the first table is made.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from skelgen.errors import MissingPackageError
from skelgen.model.arrays import Floats, Ints
from skelgen.model.skeleton import Motion, Skeleton

if TYPE_CHECKING:
    from pandas import DataFrame

Column = NDArray[Any]
"""Numbers or texts, one a row."""


def angles_table(skeleton: Skeleton, motion: Motion) -> DataFrame:
    """Return the joint angles, one row per frame, joint and angle.

    Parameters
    ----------
    skeleton : Skeleton
        Names the joints.
    motion : Motion
        With joint angles.

    Returns
    -------
    DataFrame
        Columns ``frame``, ``time_s``, ``joint``, ``angle``, ``value_deg`` and ``std_deg``. `JointAngles` explains the
        names of angles.
    """
    pairs = list(zip(skeleton.joint_names, motion.joint_angles, strict=True))
    joints = [name for name, angles in pairs for _ in angles.names]
    nothing = np.zeros((motion.n_frames, 0))
    values = np.rad2deg(np.concatenate([nothing, *(angles.values for _, angles in pairs)], axis=1))
    std = np.rad2deg(np.concatenate([nothing, *(angles.std for _, angles in pairs)], axis=1))
    items = {"joint": joints, "angle": [name for _, angles in pairs for name in angles.names]}
    return _table(motion, items, {"value_deg": values, "std_deg": std})


def joints_table(skeleton: Skeleton, motion: Motion) -> DataFrame:
    """Return the joint positions, one row per frame and joint.

    Parameters
    ----------
    skeleton : Skeleton
        Names the joints.
    motion : Motion
        Its motion.

    Returns
    -------
    DataFrame
        Columns ``frame``, ``time_s``, ``joint``, ``x_mm``, ``y_mm``, ``z_mm`` in the world, and the standard deviations
        ``std_x_mm``, ``std_y_mm``, ``std_z_mm``, NaN where none were estimated; ``determined``: whether the motion
        determines where the joint is, but for a hinge's place along its axis.
    """
    std = np.full(motion.joint_positions.shape, np.nan) if motion.joint_std is None else motion.joint_std
    columns: dict[str, Column] = axis_columns("{}_mm", motion.joint_positions) | axis_columns("std_{}_mm", std)
    determined = np.array([joint.is_determined for joint in skeleton.joints], dtype=np.bool_)
    columns["determined"] = np.tile(determined, motion.n_frames)
    return _table(motion, {"joint": skeleton.joint_names}, columns)


def limb_poses(skeleton: Skeleton, motion: Motion) -> DataFrame:
    """Return the poses of the limbs in the world, one row per frame and limb.

    Parameters
    ----------
    skeleton : Skeleton
        What the limbs are called.
    motion : Motion
        Where they are.

    Returns
    -------
    DataFrame
        Columns ``frame``, ``time_s``, ``limb``, ``seen`` (whether markers of the frame fix the rotation), ``x_mm``,
        ``y_mm``, ``z_mm`` of the limb's origin, and the unit quaternion ``qw``, ``qx``, ``qy``, ``qz`` world from limb,
        with ``qw`` not negative.
    """
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - slow to load

    xyzw = Rotation.from_matrix(motion.rotations.reshape(-1, 3, 3)).as_quat(canonical=True)
    quaternions = dict(zip(("qw", "qx", "qy", "qz"), xyzw[:, [3, 0, 1, 2]].T, strict=True))
    columns = {"seen": motion.limb_seen} | axis_columns("{}_mm", motion.world_from_limb[..., :3, 3]) | quaternions
    return _table(motion, {"limb": skeleton.limb_names}, columns)


def axis_columns(pattern: str, vectors: Floats) -> dict[str, Floats]:
    """Return the coordinates of vectors as columns.

    Parameters
    ----------
    pattern : str
        Name of a column with ``{}`` for the axis, such as ``{}_mm``.
    vectors : ndarray, shape (n_frames, n_items, 3)
        In any unit.
    """
    return {pattern.format(axis): vectors[..., index].ravel() for index, axis in enumerate("xyz")}


def head_columns(times: Floats, frames: Ints, items: Mapping[str, Sequence[str]]) -> dict[str, Column]:
    """Return frame and time of every row, and what it is about.

    Parameters
    ----------
    times : ndarray, shape (n_frames,), s
        Of all frames.
    frames : ndarray of intp, shape (n,)
        Frames of the rows.
    items : mapping of str to sequence of str
        Names of the items of a frame, by title of their column.
    """
    n_items = len(next(iter(items.values())))
    texts = {name: np.tile(np.array(values, dtype=np.str_), len(frames)) for name, values in items.items()}
    return {"frame": np.repeat(frames, n_items), "time_s": np.repeat(times[frames], n_items), **texts}


def _table(motion: Motion, items: Mapping[str, Sequence[str]], columns: Mapping[str, Column]) -> DataFrame:
    """Gather columns of shape (n_frames, n_items), with frame, time and names of the items."""
    try:
        import pandas as pd  # noqa: PLC0415 - slow to load, and of the extra `tables`
    except ImportError as error:
        raise MissingPackageError("tables need pandas: pip install 'skelgen-mocap[tables]'") from error
    head = head_columns(motion.times, np.arange(motion.n_frames), items)
    return pd.DataFrame(head | {name: np.ravel(values) for name, values in columns.items()})
