"""Which of several named arrays holds the positions, and which of its axes are frames, points and coordinates.

Positions are an array with an axis of three (or of four, the last all ones, as ezc3d has them), an array for each
point, or for each of x, y and z, or rows of all coordinates beside the points' names. Frames are along the axis that
has not as many entries as there are names; without names they are first, unless these are fewer than the points and
positions change far less from point to point. Bodies are poses of four rows, in one array, or in one for each. A
fourth number between 0 and 1 is a confidence, 0 where a point is unseen; an axis more is of people.
"""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skelgen.errors import FormatError
from skelgen.geometry.frame_rate import AS_RECORDED_RATE
from skelgen.model import PointCloud, Poses, Trajectories
from skelgen.model.arrays import Floats
from skelgen_formats.clock_titles import clock_of
from skelgen_formats.flagged_arrays import without_unseen
from skelgen_formats.flags import flag_of_key
from skelgen_formats.options import Options
from skelgen_formats.table_heads import CAMEL
from skelgen_formats.text import is_number, seconds_of
from skelgen_formats.time_stamps import Stamps, since_first
from skelgen_formats.titles import UNIT_WORDS, bodies_of, with_axes
from skelgen_formats.turn_titles import AXES, COMPONENTS
from skelgen_formats.untitled_points import positions_of_columns
from skelgen_formats.wide import take_from_table

_POSITIONS = (
    *("positions", "position", "markers", "points", "xyz", "keypoints", "joints", "data", "pos"),
    *("keypoint", "marker"),
)
_NAMES = (
    *("names", "labels", "label", "markernames", "markername", "markerlabels", "labelsmarker", "pointnames"),
    *("keypointnames", "bodynames", "jointnames", "bonenames", "markers", "joints", "keypoints", "points"),
    *("bodyname", "rigidbodyname", "jointname", "bonename", "name"),
)
_RATES = (
    *("rate", "fps", "framerate", "samplingrate", "samplerate", "mocapframerate", "freq", "frequency", "fs"),
    *("videoframerate", "markerrate", "pointrate", "camerarate"),
)
_OF_LENGTH = UNIT_WORDS | {"length", "distance", "position", "positions", "spatial", "coordinate", "coordinates", "xyz"}
_TITLES = ("columns", "colheaders", "headers", "header", "titles", "variables", "varnames", *_NAMES)
_BODY_MODEL = {"poses", "trans"}  # of AMASS: angles of SMPL and where its root is
_SLOWEST, _FASTEST = 1e-6, 1e6  # Hz; beyond, a rate is a damaged number
_SMOOTHER = 0.25  # of the changes along the other axis: frames follow each other, points need not
_LOOKED_AT = 256  # frames and points whose changes are compared
_POSE, _UNIT_TOLERANCE = 7, 1e-3  # numbers of a place and a quaternion; of the length of these
_FEWEST = 2  # points in arrays of their own
_POSITION_WORDS = {"pos", "position", "positions", "xyz"}  # in names of arrays
_ROOM_WORDS = {"world", "global", "3d"}  # not of images
_MOST_PEOPLE, _FEWEST_JOINTS = 16, 4  # in a frame; arrays of one shape that are points of theirs
_FLAT = re.compile(r"(?:.*[_.])?(?:\w+_)?(?:joints?|keypoints?|landmarks?|pose)[_\d]*(3d)?", re.IGNORECASE)
_POSE_ROWS = (16, 17)  # numbers of a matrix of four rows, and of one with a residual

Arrays = Mapping[str, NDArray[Any]]
"""Arrays of numbers and texts by name."""


NO_POINTS = "no array of the shape (frames, points, 3); reshape the positions, and save them"
"""What an error says of arrays that hold no points, if the format has no other words."""


def take_from_arrays(
    path: Path, arrays: Arrays, options: Options, otherwise: str = NO_POINTS
) -> Trajectories | PointCloud | Poses:
    """Return the take that arrays hold.

    Parameters
    ----------
    path : Path
        The file, for errors.
    arrays : mapping of str to ndarray
        What is in it; an array without a name has the empty one.
    options : Options
        `points`, `recorded_rate`, `recorded_unit` and `sample` count.
    otherwise : str
        What an error says if there are no points.

    Raises
    ------
    FormatError
        If none of them, or several, may be positions.
    """
    notices: list[str] = []
    are_flags = {key for key in arrays if flag_of_key(key.rpartition(".")[2])}  # of four points, too
    arrays = {k: one if k in are_flags else _without_grades(_unflattened(k, one)) for k, one in arrays.items()}
    numbers, names = _bodies(arrays) or _positions(path, arrays, notices, otherwise)
    numbers = without_unseen(numbers, names, arrays, notices)
    if options.sample:
        numbers = numbers[options.sample.of(np.arange(len(numbers)))]
    rate = _number(arrays, _RATES)
    stamps = next(_stamps(arrays, len(numbers)), None)
    if rate is not None and _SLOWEST < rate < _FASTEST and options.recorded_rate == AS_RECORDED_RATE:
        stamps = since_first(np.arange(len(numbers)) / rate, 1.0)
    take = take_from_table(path, numbers, names, stamps, options, _unit(arrays))
    return replace(take, notices=(*notices, *take.notices))


def _unit(arrays: Arrays) -> str:
    """Return the unit of length, by names such as units, length_unit or xyzUnits; empty if there is none."""
    words = {key: {*re.split(r"[_.]", CAMEL.sub("_", key).lower())} for key, one in arrays.items() if one.ndim == 0}
    units = [key for key, of_key in words.items() if of_key & UNIT_WORDS and of_key <= _OF_LENGTH]
    return next((str(arrays[key]) for key in sorted(units, key=len) if arrays[key].dtype.kind == "U"), "")


def _stamps(arrays: Arrays, n_frames: int) -> Iterator[Stamps]:
    """Yield the times of frames, by the names of arrays; each point may have them anew."""
    numbers = {key: array.squeeze().astype(np.float64) for key, array in arrays.items() if array.dtype.kind in "fiu"}
    texts = {
        key: [*map(seconds_of, map(str, one))] for key, one in arrays.items() if one.dtype.kind == "U" and one.ndim == 1
    }
    dates = {key: np.array(one, dtype=np.float64) for key, one in texts.items() if one and all(map(is_number, one))}
    numbers |= dates
    filled = {key: array for key, array in numbers.items() if array.ndim > 1 and len(array)}
    same = {key: array[0] for key, array in filled.items() if (array == array[:1]).all()}
    fitting = {key: array for key, array in (numbers | same).items() if array.shape == (n_frames,)}
    columns = [*fitting.values()]
    if clock := clock_of([key.rpartition(".")[2] for key in fitting]):
        seconds = columns[clock.column]
        second = 1.0 if [*fitting][clock.column] in dates else clock.second
        yield since_first(seconds + clock.added(seconds, [columns[column] for column, _ in clock.others]), second)


def _unflattened(key: str, array: NDArray[Any]) -> NDArray[Any]:
    """Return joints that stand behind each other in rows, x, y, z and how sure each is, or called 3D, apart."""
    match = _FLAT.fullmatch(key)
    if match is None or array.dtype.kind != "f" or array.ndim not in (2, 3) or array.shape[-1] < _FEWEST_JOINTS**2:
        return array
    graded = array.reshape(*array.shape[:-1], -1, 4) if array.shape[-1] % 4 == 0 else array[..., None]
    if _are_grades(graded) or (match[1] and array.shape[-1] % len(AXES)):
        return graded
    return array.reshape(*array.shape[:-1], -1, len(AXES)) if match[1] else array


def _are_grades(array: NDArray[Any]) -> bool:
    """Whether the fourth numbers lie between 0 and 1 and are no part of a quaternion or of a position."""
    if array.dtype.kind != "f" or array.ndim not in (3, 4) or array.shape[-2] == 4 or array.shape[-1] != 4:
        return False
    seen = array[np.isfinite(array).all(axis=-1)].astype(np.float64)
    with np.errstate(over="ignore"):
        lengths = np.linalg.norm(seen, axis=-1)
    grades = seen[:, 3]
    return len(seen) > 0 and bool(((grades >= 0) & (grades <= 1)).all()) and np.abs(lengths - 1).max() > _UNIT_TOLERANCE


def _without_grades(array: NDArray[Any]) -> NDArray[Any]:
    """Return places without how sure each is, NaN where not at all."""
    if not _are_grades(array):
        return array
    return np.where((array[..., 3:] == 0) & array[..., 3:].any(), np.nan, array[..., : len(AXES)])


def _with_people_apart(arrays: Arrays, notices: list[str]) -> tuple[dict[str, NDArray[Any]], dict[str, list[str]]]:
    """Return arrays with those of several people as ones of their points, and the names of these, or parts of them."""
    found, names = dict(arrays), dict[str, list[str]]()
    alike = {key: one[0] if one.ndim == 4 else one for key, one in arrays.items() if _is_of_points(one)}
    if len(alike) >= _FEWEST_JOINTS and len({one.shape for one in alike.values()}) == 1:
        stacked = np.stack([*alike.values()], axis=2)
        if stacked.shape[-1] == len(AXES) and min(stacked.shape[:2]) <= _MOST_PEOPLE:
            found = {"positions": stacked} | {key: one for key, one in arrays.items() if key not in alike}
            names["positions"] = [*alike]
    for key, array in found.items():
        if array.ndim != 4 or array.dtype.kind not in "fi" or _are_poses(array):
            continue
        if 1 in array.shape:
            found[key] = array.squeeze(axis=array.shape.index(1))
            continue
        whole = np.moveaxis(array, 2, 3) if array.shape[2] == len(AXES) else array
        whole = whole.swapaxes(0, 1) if whole.shape[0] < whole.shape[1] else whole
        n_frames, n_people, n_points, width = whole.shape
        if width != len(AXES) or n_people > _MOST_PEOPLE:
            continue
        texts = _filled(names.get(key) or _texts(arrays, key), n_points, "point")
        names[key] = [f"{person + 1}:{text}" for person in range(n_people) for text in texts]
        notices.append(
            f"{key or 'the array'} is taken as {n_frames} frames of {n_people} people with {n_points} points each"
        )
        found[key] = whole.reshape(n_frames, n_people * n_points, len(AXES))
    return found, names


def _positions(path: Path, arrays: Arrays, notices: list[str], otherwise: str) -> tuple[NDArray[Any], list[str]]:
    """Return positions, shape (n_frames, n_points, 3), and the names of points."""
    arrays, names_of_people = _with_people_apart(arrays, notices)
    fitting = {key: array for key, array in arrays.items() if _is_of_points(array)}
    fitting = {k: one for k, one in fitting.items() if 1 not in one.shape and "local" not in k.lower()} or fitting
    fitting = {k: one for k, one in fitting.items() if np.nan_to_num(one).any()} or fitting
    named = [key for known in _POSITIONS for key in fitting if _plain(key) == known]
    if len(fitting) > 1 and not named:  # body_pos_w beside body_lin_vel_w
        words = {key: {*re.split(r"[_.]", CAMEL.sub("_", key).lower())} for key in fitting}
        by_words = [[key for key in fitting if words[key] & told] for told in (_POSITION_WORDS, _ROOM_WORDS)]
        named = next((keys for keys in by_words if len(keys) == 1), [])
    if fitting and not named and len(fitting) > 1:
        several = f"several arrays of points: {', '.join(fitting)[:100]}"
        raise FormatError(path, "", f"{several}; call the right one positions")
    if not fitting:
        return _joined(path, arrays, notices, otherwise)
    key = (named or [*fitting])[0]
    numbers = [other for other, array in arrays.items() if array.ndim >= len(AXES) and array.dtype.kind in "fiu"]
    _notice_others([other for other in numbers if other != key and not flag_of_key(other.rpartition(".")[2])], notices)
    names = names_of_people.get(key) or _texts(arrays, key)
    positions = _with_frames_first(_with_xyz_last(fitting[key]), len(names))
    if names and len(names) != positions.shape[1] and fitting[key].shape[-1] != len(AXES):
        what = f"{len(names)} names, and an array {key} of the shape {fitting[key].shape}; (frames, points, 3) belongs"
        raise FormatError(path, "", what)
    if positions.shape[:2] != fitting[key].shape[:2]:
        taken = "{} frames of {} points".format(*positions.shape[:2])
        notices.append(f"the array of the shape {fitting[key].shape} is taken as {taken}")
    return positions, _filled(names, positions.shape[1], "point")


def _is_of_points(array: NDArray[Any]) -> bool:
    shape = array.shape[1:] if array.ndim == 4 and len(array) == 1 else array.shape
    if len(shape) != len(AXES) or array.dtype.kind not in "fiu" or _are_poses(array):
        return False
    return 3 in shape or _of_ones(array.reshape(shape)) is not None


def _are_poses(array: NDArray[Any]) -> bool:
    """Whether there are matrices of poses or rotations, or places with quaternions, which have unit length."""
    if array.dtype.kind != "f" or not array.size:
        return False
    with np.errstate(over="ignore", invalid="ignore"):
        if array.shape[-2:] == (3, 3):
            first = array.reshape(-1, 3, 3)[0].astype(np.float64)
            return bool(np.abs(first @ first.T - np.eye(3)).max() < _UNIT_TOLERANCE)
        if array.shape[-1] not in (_POSE, len(COMPONENTS)) or array.shape[-2:] == (4, 4):
            return array.shape[-2:] == (4, 4)
        lengths = np.linalg.norm(array[..., -len(COMPONENTS) :].astype(np.float64), axis=-1)
    return bool(np.abs(np.nanmedian(lengths) - 1.0) < _UNIT_TOLERANCE) if np.isfinite(lengths).any() else False


def _of_ones(array: NDArray[Any]) -> int | None:
    """Return the axis of four, of which the last number is 1 throughout, or unseen; None if there is none."""
    for axis in (2, 0, 1):
        if array.shape[axis] == len(AXES) + 1 and array.size:
            last = array.take(len(AXES), axis=axis)
            if array.take(range(len(AXES)), axis=axis).any() and ((last == 1) | (last != last)).all():  # noqa: PLR0124 - NaN
                return axis
    return None


def _with_xyz_last(array: NDArray[Any]) -> NDArray[Any]:
    array = array[0] if array.ndim == 4 else array
    if 3 not in array.shape:
        return np.moveaxis(array, _of_ones(array) or 0, 2)[:, :, : len(AXES)]
    return np.moveaxis(array, next(axis for axis in (2, 0, 1) if array.shape[axis] == len(AXES)), 2)


def _with_frames_first(positions: NDArray[Any], n_names: int) -> NDArray[Any]:
    """Return positions with frames along their first axis, by the number of names, else by how they change."""
    first, second = positions.shape[:2]
    if n_names in (first, second) and first != second:
        return positions if n_names == second else positions.swapaxes(0, 1)
    few = positions[:_LOOKED_AT, :_LOOKED_AT].astype(np.float64)
    with np.errstate(invalid="ignore", over="ignore"):
        along = [np.abs(np.diff(few, axis=axis)) for axis in (0, 1)]
    changes = [float(np.median(one[np.isfinite(one)])) if np.isfinite(one).any() else 0.0 for one in along]
    return positions.swapaxes(0, 1) if first < second and changes[1] < _SMOOTHER * changes[0] else positions


def _notice_others(names: Sequence[str], notices: list[str]) -> None:
    if names:
        notices.append(f"arrays left out: {', '.join(names[:8])}")


def _joined(path: Path, arrays: Arrays, notices: list[str], otherwise: str) -> tuple[NDArray[Any], list[str]]:
    """Return positions that stand in several arrays, or in rows beside the names of their points."""
    numbers = {key: array for key, array in arrays.items() if array.dtype.kind in "fiu" and array.ndim == 2}
    axes = [next((array for key, array in numbers.items() if key.lower() == axis), None) for axis in AXES]
    x, y, z = axes
    if x is not None and y is not None and z is not None and x.shape == y.shape == z.shape:
        return np.stack([x, y, z], axis=2), _filled(_texts(arrays, ""), x.shape[1], "point")
    if titled := _titled(arrays):
        return titled
    names = _texts(arrays, "")
    for array in numbers.values():
        if len(names) >= _FEWEST and array.shape[1] == len(names) * len(AXES):
            return array.reshape(len(array), len(names), len(AXES)), names
    upright = {key: one.T if len(one) in (3, 4) and one.shape[1] not in (3, 4) else one for key, one in numbers.items()}
    widths = [
        w for w in (len(AXES), len(AXES) + 1) if sum(array.shape[1] == w for array in upright.values()) >= _FEWEST
    ]
    points = {key: array for key, array in upright.items() if array.shape[1] in widths[:1]}
    if set(arrays) >= _BODY_MODEL:
        what = "holds angles of a body model (AMASS, SMPL), no points; write the joints or some vertices that the model"
        raise FormatError(path, "", f"{what} gives for them as .npy, (frames, points, 3), or take the markers' C3D")
    if points:  # beside them there may be forces, at another rate; behind x, y and z a residual
        (shape, count), *_ = Counter(array.shape for array in points.values()).most_common(1)
        _notice_others([key for key, array in points.items() if array.shape != shape], notices)
        points = {key: array[:, : len(AXES)] for key, array in points.items() if array.shape == shape}
        if count >= _FEWEST:
            return np.stack([*points.values()], axis=1), [*points]
    if len(numbers) == 1 and (found := positions_of_columns(next(iter(numbers.values())).astype(np.float64))):
        notices.append(f"columns are taken as {found[2]}, as points then keep their distances")
        return found[0], _filled(_texts(arrays, ""), found[0].shape[1], "point")
    held = ", ".join(f"{key} {array.shape}".strip() for key, array in list(arrays.items())[:6]) or "none"
    raise FormatError(path, "", f"{otherwise}; arrays are {held}"[:280])


def _titled(arrays: Arrays) -> tuple[NDArray[Any], list[str]] | None:
    """Return the points whose coordinates are arrays, or columns of one, with titles such as ``knee_x``."""
    flat = {key: array.ravel() for key, array in arrays.items() if array.dtype.kind in "fiu" and array.size}
    tables = [array for array in arrays.values() if array.dtype.kind in "fiu" and array.ndim == 2]
    beside = (arrays[other] for other in arrays for key in arrays if other.startswith(f"{key}_") and key)
    every_text = (
        texts for texts in (*_called(arrays, _TITLES), *beside) if texts.dtype.kind == "U" and texts.ndim == 1
    )
    texts = [with_axes(texts.tolist()) or texts.tolist() for texts in every_text]
    every = [
        dict(zip(titles, table.T, strict=True)) for titles in texts for table in tables if table.shape[1] == len(titles)
    ]
    for columns in (*every, flat):
        titles = [*columns]
        bodies = [body for body in bodies_of(titles) if body.is_placed]
        places = [[columns[titles[body.place[axis]]] for axis in AXES] for body in bodies]
        if len(bodies) >= _FEWEST and len({len(one) for place in places for one in place}) == 1:
            return np.array(places).transpose(2, 0, 1), [body.name for body in bodies]
    return None


def _bodies(arrays: Arrays) -> tuple[Floats, list[str]] | None:
    """Return places and matrices of the only array of poses, shape (n_frames, n_bodies, 4, 4), and names, if any."""
    fitting = [
        one for one in arrays.values() if one.dtype.kind == "f" and one.ndim in (3, 4) and one.shape[-2:] == (4, 4)
    ]
    apart = {key: array[:, :16].reshape(-1, 4, 4) for key, array in arrays.items() if _are_rows_of_poses(array)}
    if len({len(one) for one in apart.values()}) == 1:
        fitting = [np.stack([*apart.values()], axis=1)]
    if len(fitting) != 1 or any(map(_is_of_points, arrays.values())):
        return None
    poses = fitting[0].astype(np.float64).reshape(len(fitting[0]), -1, 4, 4)
    turns = poses[..., :3, :3].reshape(*poses.shape[:2], 9)
    numbers = np.concatenate([poses[..., :3, 3], turns], axis=2)
    names = [key.removesuffix("_4X4") for key in apart]
    return numbers, names or _filled(_texts(arrays, ""), poses.shape[1], "body")


def _are_rows_of_poses(array: NDArray[Any]) -> bool:
    """Whether there is a pose per frame, as Visual3D and Theia export a body: its matrix row by row, and a residual."""
    if array.ndim != 2 or array.shape[1] not in _POSE_ROWS or array.dtype.kind != "f":
        return False
    seen = array[np.isfinite(array).all(axis=1), :16]
    return len(seen) > 0 and bool((seen[:, 12:] == (0, 0, 0, 1)).all())


def _plain(key: str) -> str:
    return key.lower().replace("_", "")


def _called(arrays: Arrays, names: Sequence[str]) -> Iterator[NDArray[Any]]:
    """Yield the arrays of these names, in their order."""
    return (array for name in names for key, array in arrays.items() if _plain(key) == name)


def _texts(arrays: Arrays, key: str) -> list[str]:
    """Return the names of points, empty if there are none."""
    others = {name: array for name, array in arrays.items() if name != key}
    every = [*(array for name, array in others.items() if name == f"{key}.names"), *_called(others, _NAMES)]
    found = (one for one in every if one.dtype.kind in "US" and one.ndim == 1)
    texts = next(found, np.array([], dtype=np.str_)).tolist()
    return [text.decode("latin-1") if isinstance(text, bytes) else str(text) for text in texts]


def _filled(names: Sequence[str], count: int, kind: str) -> list[str]:
    """Return names for all, numbered ones where there are none."""
    fitting = names if len(names) == count else [""] * count
    return [name.strip() or f"{kind} {number}" for number, name in enumerate(fitting, start=1)]


def _number(arrays: Arrays, names: Sequence[str]) -> float | None:
    found = (one for one in _called(arrays, names) if one.size == 1 and one.dtype.kind in "fiu")
    return next((float(one.reshape(())) for one in found), None)
