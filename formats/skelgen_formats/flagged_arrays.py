"""Flags, states and confidences in arrays beside those of points, of all points, or of one each."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skelgen.progress import counted
from skelgen_formats.flags import FLAG_OF_ALL, Flag, are_unseen, flag_of_key, numbers_of

_OF_PEOPLE = 3  # axes of flags: frames, people, points


def without_unseen(
    numbers: NDArray[Any], names: Sequence[str], arrays: Mapping[str, NDArray[Any]], notices: list[str]
) -> NDArray[Any]:
    """Return positions or bodies, NaN where flags of all, or of one, say that they are not seen, or nothing is sure.

    Parameters
    ----------
    numbers : ndarray, shape (n_frames, n_points, n_numbers)
        In any unit of length.
    names : sequence of str
        Of the points.
    arrays : mapping of str to ndarray
        All of the file by name; flags have the shape (n_frames, n_points) or its reverse, those of a point (n_frames,),
        states of people (n_frames, n_people), or (n_frames,) of all points.
    notices : list of str
        Gets how many positions are unseen by flags.
    """
    shape, are_seen = numbers.shape[:2], np.ones(numbers.shape[:2], dtype=np.bool_)
    of_points: dict[tuple[str, Flag], dict[int, NDArray[Any]]] = {}
    for key, array in arrays.items():
        owner, _, word = key.rpartition(".")
        flag = flag_of_key(word)
        are_codes = array.dtype.kind in "bfiu" and (flag is None or flag.in_words)
        told = array if flag is None or array.dtype.kind in "bfiu" else numbers_of(array, flag)
        if flag is None or are_codes or told is None:
            continue
        if told.ndim == _OF_PEOPLE and told.shape[0] > 1:  # as positions of several people are told apart
            told = told.swapaxes(0, 1) if told.shape[0] < told.shape[1] else told
            told = told.reshape(len(told), -1)
        if told.shape in (shape, shape[::-1]):
            are_seen &= ~are_unseen(told if told.shape == shape else told.T, flag)
        elif owner in names and told.shape == shape[:1]:
            of_points.setdefault((word, flag), {})[names.index(owner)] = told
        elif re.fullmatch(FLAG_OF_ALL, key, re.IGNORECASE) and (each := _of_people(told, shape[0], names)) is not None:
            are_seen &= ~are_unseen(each, flag)
    for (_, flag), columns in of_points.items():
        are_seen &= ~_unseen_of_points(columns, shape, flag)
    if hidden := int((~are_seen & ~np.isnan(numbers).any(axis=tuple(range(2, numbers.ndim)))).sum()):
        notices.append(f"{counted(hidden, 'position is', 'positions are')} unseen, as flags or confidences say")
    return np.where(are_seen[..., np.newaxis], numbers, np.nan)


def _of_people(states: NDArray[Any], n_frames: int, names: Sequence[str]) -> NDArray[Any] | None:
    """Return states of people, or of all, for each of their points, which stand behind each other; None of others."""
    people = {name.partition(":")[0] for name in names if ":" in name}
    n_people = len(people) if all(map(str.isdecimal, people)) else 0
    is_of_all = states.ndim == 1 and n_frames != len(names)  # else they may be of points
    columns = states[:, np.newaxis] if is_of_all else states
    if columns.shape not in ((n_frames, 1), (n_frames, n_people or 1)) or len(names) % columns.shape[1]:
        return None
    return columns.repeat(len(names) // columns.shape[1], axis=1)


def _unseen_of_points(columns: Mapping[int, NDArray[Any]], shape: tuple[int, ...], flag: Flag) -> NDArray[np.bool_]:
    """Return where points are unseen by flags of some; one that alone is called hidden is, throughout, too."""
    told = np.full(shape, np.nan)
    for at, values in columns.items():
        told[:, at] = values
    judged = [*range(shape[1])] if flag.hides else [*columns]
    unseen = np.zeros(shape, dtype=np.bool_)
    unseen[:, judged] = are_unseen(told[:, judged], flag)
    return unseen
