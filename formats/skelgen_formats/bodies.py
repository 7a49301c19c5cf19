"""What all formats of bodies share: places and rotations as files have them become poses, or are refused."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from skelgen.errors import FormatError
from skelgen.geometry.rotations import (
    matrix_from_euler,
    matrix_from_quaternion,
    matrix_from_vector,
    nearest_rotation,
    quaternion_from_matrix,
)
from skelgen.model import Poses
from skelgen.model.arrays import Bools, Floats
from skelgen_formats.markers import FARTHEST, distinct_names, noted
from skelgen_formats.options import ANGLE_ORDER, AUTO, ROTATION_VECTOR, Options
from skelgen_formats.turn_titles import AXES

_LENGTH_TOLERANCE = 1e-3  # quaternions printed with four digits are off by less
_POSE = 7  # numbers of a place and a quaternion
_LARGEST_ANGLE = 1e6  # rad; nothing turns so often
_LEAST_TURN = 1.0  # rad, of an angle from one frame to the next, beyond which orders differ in how bodies turn
_SMOOTHER = 0.25  # of the turns of another order: poses that are smooth beside ones that jump
BY_ROWS = "matrices, whose nine cells are numbered, are taken row by row"
"""A notice where titles do not say which cell is which."""

_MATRIX_TOLERANCE = 0.01  # of R R^T = 1: matrices printed with three digits are off by less


def take_from_bodies(
    path: Path, numbers: Floats, factor: float, names: Sequence[str], rate: float, notices: Sequence[str] = ()
) -> Poses:
    """Make the value that a file of bodies holds: bodies that are never seen are dropped with a notice.

    Parameters
    ----------
    path : Path
        The file.
    numbers : ndarray, shape (n_frames, n_bodies, 7 or 12)
        Places in the file's unit, and unit quaternions, scalar first, or the cells of matrices row by row, as files
        print them; all NaN where a body is unseen, matrices also 0.
    factor : float
        mm per unit.
    names : sequence of str, length n_bodies
        Of the bodies; those that stand twice get numbers.
    rate : float, Hz
        Frames a second.
    notices : sequence of str
        What the reader noticed.

    Raises
    ------
    FormatError
        If there is no frame, no body is ever seen, or one has no finite place or no rotation.
    """
    if not len(numbers):
        raise FormatError(path, "", "holds no frame: nothing can be read from it")
    transforms = _transforms(path, _with_quaternions(path, numbers) if numbers.shape[2] > _POSE else numbers, factor)
    ever: Bools = np.asarray((~np.isnan(transforms[:, :, 0, 0])).any(axis=0))
    if not ever.any():
        raise FormatError(path, "", "no body is seen in any frame: there is nothing to reconstruct from")
    notes = list(notices)
    noted(notes, names, ~ever, "dropped because never seen", ("body", "bodies"))
    kept = distinct_names([name for name, seen in zip(names, ever, strict=True) if seen], "_", notes)
    return Poses(transforms[:, ever], kept, rate, path.name, tuple(notes))


def _transforms(path: Path, numbers: Floats, factor: float) -> Floats:
    """Return poses, shape (n_frames, n_bodies, 4, 4), translations in mm, of places and unit quaternions."""
    empty = np.isnan(numbers)
    seen = ~empty.all(axis=2)
    with np.errstate(over="ignore", invalid="ignore"):
        lengths = np.linalg.norm(numbers[:, :, 3:], axis=2)
        wrong = seen & (empty.any(axis=2) | ~(np.abs(lengths - 1.0) <= _LENGTH_TOLERANCE))
        wrong |= seen & ~(np.abs(numbers[:, :, :3] * factor) <= FARTHEST).all(axis=2)
    if wrong.any():
        frame, body = np.argwhere(wrong)[0]
        raise FormatError(path, f"frame {frame + 1}", f"body {body + 1} has no unit quaternion or no finite position")
    transforms = np.full((*numbers.shape[:2], 4, 4), np.nan)
    transforms[seen] = np.eye(4)
    transforms[seen, :3, :3] = matrix_from_quaternion(numbers[seen, 3:] / lengths[seen, np.newaxis])
    transforms[seen, :3, 3] = numbers[seen, :3] * factor
    return transforms


def _with_quaternions(path: Path, numbers: Floats) -> Floats:
    """Return places and unit quaternions, shape (n_frames, n_bodies, 7), of the rotations nearest to matrices."""
    numbers = np.array(numbers)
    numbers[(numbers[:, :, len(AXES) :] == 0.0).all(axis=2)] = np.nan
    matrices = blank_unseen(numbers)[:, :, len(AXES) :].reshape(*numbers.shape[:2], 3, 3)
    seen: Bools = np.asarray(np.isfinite(matrices).all(axis=(2, 3)))
    with np.errstate(over="ignore", invalid="ignore"):
        products = matrices @ matrices.swapaxes(2, 3)
        off = seen & ~(np.abs(products - np.eye(3)).max(axis=(2, 3)) <= _MATRIX_TOLERANCE)
    if off.any():
        frame, body = np.argwhere(off)[0]
        raise FormatError(path, f"frame {frame + 1}", f"the matrix of body {body + 1} is not that of a rotation")
    quaternions = np.full((*numbers.shape[:2], 4), np.nan)
    quaternions[seen] = quaternion_from_matrix(nearest_rotation(matrices[seen]))
    return np.concatenate([numbers[:, :, : len(AXES)], quaternions], axis=2)


def with_quaternions(numbers: Floats, usual: str, unit: str, options: Options, notices: list[str]) -> Floats:
    """Return places and unit quaternions, shape (n_frames, n_bodies, 7), of bodies with angles; says what is assumed.

    Parameters
    ----------
    numbers : ndarray, shape (n_frames, n_bodies, 6)
        Places, and angles about x, y and z.
    usual : str
        How such angles turn a body where the user does not state another order.
    unit : str
        Of the angles, empty if the file names none.
    options : Options
        `angle_order` counts.
    notices : list of str
        Gets sentences.
    """
    order = usual if options.angle_order == AUTO else options.angle_order
    turned = "rotation vectors" if order == ROTATION_VECTOR else "R = " + " ".join(f"R{axis}" for axis in order)
    stated = (
        "" if options.angle_order != AUTO else "; `--angle-order` states another, `--points markers` leaves them out"
    )
    notices.append(f"angles of bodies are taken as {turned}{stated}")
    return turned_by_angles(numbers, order, unit, notices, is_sure=options.angle_order != AUTO)


def turned_by_angles(numbers: Floats, order: str, unit: str, notices: list[str], *, is_sure: bool) -> Floats:
    """Return places and unit quaternions, shape (n_frames, n_bodies, 7), of bodies with angles.

    Parameters
    ----------
    numbers : ndarray, shape (n_frames, n_bodies, 6)
        Places and angles about x, y and z; NaN where a body is unseen.
    order : str
        Axes about which one turns after the other, such as ``xyz``, or `ROTATION_VECTOR`.
    unit : str
        Of the angles, in small letters; empty if it is not named.
    notices : list of str
        Gets what is assumed.
    is_sure : bool
        Whether the order is stated; else poses that jump are told.
    """
    angles = _angles_in_rad(numbers[:, :, len(AXES) :], unit, notices)
    if not is_sure:
        _notice_jumps(angles, order, notices)
    return np.concatenate([numbers[:, :, : len(AXES)], _quaternions_from_angles(angles, order)], axis=2)


def _quaternions_from_angles(angles: Floats, order: str) -> Floats:
    """Return unit quaternions, scalar first, shape (n_frames, n_bodies, 4), of angles about x, y and z [rad]."""
    seen: Bools = np.asarray((np.abs(angles) < _LARGEST_ANGLE).all(axis=2))
    quaternions = np.full((*angles.shape[:2], 4), np.nan)
    turned = angles[seen]
    if order == ROTATION_VECTOR:
        matrices = matrix_from_vector(turned)
    else:
        matrices = matrix_from_euler(order.upper(), turned[:, [AXES.index(axis) for axis in order]])
    quaternions[seen] = quaternion_from_matrix(matrices)
    return quaternions


def _notice_jumps(angles: Floats, order: str, notices: list[str]) -> None:
    """Say in which orders bodies go on smoothly where they jump in the assumed one."""
    with np.errstate(invalid="ignore"):
        sound = np.where(np.abs(angles) < _LARGEST_ANGLE, angles, np.nan)
        changes = np.abs(np.remainder(np.diff(sound, axis=0) + np.pi, 2 * np.pi) - np.pi)
        frames, bodies = np.nonzero((changes > _LEAST_TURN).any(axis=2) & np.isfinite(changes).all(axis=2))
    if not len(frames):
        return
    pairs = np.stack([sound[frames, bodies], sound[frames + 1, bodies]], axis=1)
    choices = [choice for choice in ANGLE_ORDER.choices if choice != AUTO]
    turns = {choice: _median_turn(_quaternions_from_angles(pairs, choice)) for choice in choices}
    smooth = [f"`--angle-order {choice}`" for choice, turn in turns.items() if turn < _SMOOTHER * turns[order]]
    if smooth:
        turned = f"{np.rad2deg(turns[order]):.0f} degrees"
        notices.append(f"bodies jump by {turned} where their angles do; they move smoothly with {' or '.join(smooth)}")


def _median_turn(pairs: Floats) -> float:
    """Return the median angle [rad] between pairs of unit quaternions, shape (n, 2, 4)."""
    cosines = np.abs((pairs[:, 0] * pairs[:, 1]).sum(axis=1))
    return float(np.median(2 * np.arccos(np.minimum(cosines, 1.0))))


def _angles_in_rad(angles: Floats, unit: str, notices: list[str]) -> Floats:
    """Return angles in rad; where no unit is named, those beyond a full turn show that they are degrees."""
    if not unit:
        with np.errstate(invalid="ignore"):
            unit = "deg" if (np.abs(angles) > 2 * np.pi).any() else "rad"
        notices.append(f"the file names no unit of angles; {unit} are assumed by their size")
    return np.deg2rad(angles) if unit.startswith("deg") else angles


def row_by_row(places: Floats, matrices: Floats) -> Floats:
    """Return places and matrices row by row, shape (n_frames, n_bodies, 12), of matrices printed column by column.

    Parameters
    ----------
    places : ndarray, shape (n_frames, n_bodies, 3)
        In the file's unit; NaN where a body is unseen.
    matrices : ndarray, shape (n_frames, n_bodies, 9)
        As ART and Qualisys write them.
    """
    turns = matrices.reshape(*matrices.shape[:2], 3, 3).swapaxes(2, 3).reshape(matrices.shape)
    return np.concatenate([places, turns], axis=2)


def blank_unseen(numbers: Floats) -> Floats:
    """Make a body NaN where all its numbers are 0, or any is NaN; shape (n_frames, n_bodies, n); the same array."""
    unseen = (numbers == 0.0).all(axis=2) | np.isnan(numbers).any(axis=2)
    numbers[unseen] = np.nan
    return numbers
