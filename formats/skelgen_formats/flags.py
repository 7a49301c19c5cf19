"""What says of points whether they are seen: titles of columns, keys of arrays, and their cells and numbers.

A flag that is empty says no: what nothing calls visible, or how sure, is unseen; what nothing calls hidden is seen. A
status that is empty or unknown says nothing, nor does a flag or confidence that a point has in less than half of its
frames, nor numbers by which nothing at all is seen; in tidy tables flags by which nothing is seen count, but no
confidences.
"""

import contextlib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skelgen.model.arrays import Floats
from skelgen_formats.text import is_number, is_unseen

FLAG_WORD = (
    r"(?:(?P<may_be_speed>v)"
    r"|(?:is_?)?(?:(?:tracking_?)?valid|visible|tracked|seen|(?P<hides>occluded|hidden|lost|missing))|tracking_?state"
    r"|(?P<graded>cond|conf|confidences?|likelihoods?|scores?|visibility)|(?P<in_words>status|state)"
    r"|(?P<deviates>residuals?))"
)
"""What says whether a point is seen, is not, how sure it is, in words, or how far off; to be read in any case."""

FLAG_OF_ALL = r"(?:is_?)?(?:(?:tracking_?)?valid|visible|tracked)|tracking_?state"
"""What says without a name whether all points of a row are seen."""

_OF_POINTS = re.compile(r"^(?i:joint|keypoint|marker|point|landmark)s?(?:_|(?=[A-Z]))")
_TRUTH = dict.fromkeys(("true", "t", "yes", "y", "1", "1.0"), True)
_TRUTH |= dict.fromkeys(("false", "f", "no", "n", "0", "0.0"), False)
_OF_STATE = dict.fromkeys(("ok", "good", "valid", "visible", "seen", "measured", "tracked", "inferred"), True)
_OF_STATE |= dict.fromkeys(("bad", "invalid", "unseen", "hidden", "occluded", "lost", "missing", "untracked"), False)
_OF_STATE |= dict.fromkeys(("nottracked", "not_tracked", "not tracked", "searching"), False)
_KNOWN = {word for word in _TRUTH | _OF_STATE if word.isalpha()} | {"none"}
RESIDUAL_OF_UNSEEN = -1.0
"""As in C3D files."""

FEWEST_TOLD = 0.5
"""Share of the frames of a point in which its flag must stand, if it says no where it is empty."""

_OF_COCO = (0.0, 1.0, 2.0)  # not labelled, hidden, visible


@dataclass(frozen=True)
class Flag:
    """What a column or array of flags says of a point.

    Attributes
    ----------
    hides : bool
        Whether its title asks if the point is hidden.
    is_graded : bool
        Whether its numbers say how surely the point is seen.
    in_words : bool
        Whether its numbers say nothing, as they are codes.
    deviates : bool
        Whether its numbers are residuals, of which -1 alone says that the point is not seen, as in C3D files.
    may_be_speed : bool
        Whether its title is v, and its numbers are flags only if all are 0, 1 or 2.
    """

    hides: bool = False
    is_graded: bool = False
    in_words: bool = False
    deviates: bool = False
    may_be_speed: bool = False


def flag_of(title: str) -> Flag | None:
    """Return what flags of this title say; None if these are no flags.

    Parameters
    ----------
    title : str
        A word in any case.
    """
    match = re.fullmatch(FLAG_WORD, title, re.IGNORECASE)
    kinds = ("hides", "graded", "in_words", "deviates", "may_be_speed")
    return Flag(*(match[kind] is not None for kind in kinds)) if match else None


def flag_of_key(key: str) -> Flag | None:
    """Return what flags of this key of an array or object say, also of ``joint_valid``; None if these are no flags.

    Parameters
    ----------
    key : str
        In any case.
    """
    return flag_of(_OF_POINTS.sub("", key))


def is_seen(cell: str, flag: Flag) -> bool | None:
    """Return whether a point is seen by what a cell says; None if it says neither.

    Parameters
    ----------
    cell : str
        Yes or no, 1 or 0, or a state such as lost, which means the same under any title.
    flag : Flag
        What the title says of it.
    """
    word = _word_of(cell)
    if word in _OF_STATE:
        return _OF_STATE[word]
    return None if word not in _TRUTH or (flag.in_words and is_number(word)) else _TRUTH[word] != flag.hides


def is_answer(cell: str, flag: Flag) -> bool:
    """Whether a cell says in a word of its own whether a point is seen, and is no title such as valid or knee_lost.

    Parameters
    ----------
    cell, flag
        As for `is_seen`.
    """
    word = cell.strip().lower()
    is_title = word not in _TRUTH | _OF_STATE or re.fullmatch(FLAG_OF_ALL, word)
    return not is_title and is_seen(word, flag) is not None


def is_of_flag(cell: str, flag: Flag) -> bool:
    """Whether a cell may stand under a title of flags: empty, a word that is known, a count, or any grade.

    Parameters
    ----------
    cell, flag
        As for `is_seen`.
    """
    word = _word_of(cell)
    is_known = is_unseen(word) or flag.is_graded or flag.deviates or is_seen(word, flag) is not None
    return is_known or (word.isdecimal() and not flag.in_words)


def number_of(cell: str, flag: Flag) -> float:
    """Return what a word or number says of a point as a number under the same title; NaN if it is empty.

    Parameters
    ----------
    cell, flag
        As for `is_seen`.
    """
    if not flag.in_words:
        with contextlib.suppress(ValueError):
            return float(cell.replace(",", "."))
    word = _word_of(cell)
    if not flag.in_words and is_unseen(word) and word not in _OF_STATE:
        return np.nan
    return float((is_seen(word, flag) is not False) != flag.hides)


def _word_of(cell: str) -> str:
    """Return what a cell says in small letters, without the name of what it is one of: TrackingState.Tracked."""
    word = cell.strip().lower()
    ends = (end for mark in "._" if (end := word.rpartition(mark)[2]) in _KNOWN)
    return word if word in _OF_STATE else next(ends, word)


def numbers_of(values: Any, flag: Flag) -> NDArray[np.float64] | None:
    """Return the numbers of words, NaN for what is missing; None if some are no texts.

    Parameters
    ----------
    values : array_like of str or None
        Of any shape.
    flag : Flag
        What the title says of them.
    """
    try:
        texts = np.asarray(values, dtype=object)
    except ValueError:  # lists of unlike lengths
        return None
    if not texts.size or not all(one is None or isinstance(one, str) for one in texts.flat):
        return None
    told = {one: number_of(one or "", flag) for one in set(texts.flat)}
    return np.array([told[one] for one in texts.flat]).reshape(texts.shape)


def are_unseen(numbers: NDArray[Any], flag: Flag) -> NDArray[np.bool_]:
    """Return where points are unseen by the numbers of their flags, shape (n_frames, n_points); nowhere if everywhere.

    Parameters
    ----------
    numbers : ndarray, shape (n_frames, n_points)
        Of each point ones that are at most 0 where it is not seen, grades, or residuals; NaN where nothing stands.
    flag : Flag
        What the title says of them.
    """
    values = numbers.astype(np.float64)
    is_empty = np.isnan(values)
    if flag.deviates:
        unseen: NDArray[np.bool_] = values == RESIDUAL_OF_UNSEEN
    elif flag.hides:
        unseen = values > 0.0
    else:
        is_told = (~is_empty).mean(axis=0) >= FEWEST_TOLD if len(values) else is_empty.any(axis=0)
        unseen = (are_unsure(values) if flag.is_graded else values <= 0.0) | (is_empty & is_told)
        unseen &= not flag.may_be_speed or np.isin(values[~is_empty], _OF_COCO).all()
    return np.zeros_like(unseen) if unseen.all() else unseen


def are_unsure(grades: Floats) -> NDArray[np.bool_]:
    """Return where grades, of any shape, say that a point is unseen: at most 0, or 0 if some have no lower bound.

    Parameters
    ----------
    grades : ndarray
        From 0, with -1 for what is unseen, or logits; NaN where there is none.
    """
    are_logits = ((grades < 0.0) & (grades != RESIDUAL_OF_UNSEEN)).any()
    unsure: NDArray[np.bool_] = grades == 0.0 if are_logits else grades <= 0.0
    return unsure


def with_flags(line: str, flags: Mapping[int, Flag], delimiter: str | None) -> str:
    """Return a line of a table with numbers for words in the columns of flags.

    Parameters
    ----------
    line : str
        The line.
    flags : mapping of int to Flag
        What each column says.
    delimiter : str or None
        What separates cells, None for blanks.
    """
    cells = line.split(delimiter)
    for column, flag in flags.items():
        if column < len(cells) and (flag.in_words or not cells[column].replace(".", "", 1).isdecimal()):
            cells[column] = f"{number_of(cells[column], flag):g}"
    return (delimiter or " ").join(cells)
