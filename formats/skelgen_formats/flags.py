"""Words that say of points whether they are seen, in titles of columns, keys of arrays, and cells."""

import re
from typing import Any

import numpy as np

from skelgen.model.arrays import Floats

FLAG_WORD = (
    r"(?:v|(?:is_?)?(?:valid|visible|tracked|seen|(occluded|hidden|lost|missing))"
    r"|(conf|confidences?|likelihoods?|scores?|visibility))"
)
"""What says whether a point is seen, is not, or how sure it is, each a group but the first; to be read in any case."""

STATES = ("status", "state", "tracking_state")
"""Keys of what says in words whether a point is seen; their numbers are codes."""

_SAYS_YES = {"true", "t", "yes", "y", "ok", "good", "valid", "visible", "seen", "measured", "tracked", "inferred"}
_SAYS_NO = {"false", "f", "no", "n", "bad", "invalid", "unseen", "hidden", "occluded", "lost", "missing"} | {
    *("nottracked", "not_tracked", "not tracked", "untracked"),
}
_TOLD = dict.fromkeys(_SAYS_YES, True) | dict.fromkeys(_SAYS_NO, False)
_WORD = re.compile(rf"\b(?:{'|'.join(_TOLD)})\b", re.IGNORECASE)


def said(cell: str, *, in_words: bool = False) -> bool | None:
    """Return what a cell says, yes or no; None if it says neither.

    Parameters
    ----------
    cell : str
        A word, or 1 or 0.
    in_words : bool
        Whether numbers say nothing.
    """
    word = cell.strip().lower()
    return _TOLD.get(word) if in_words or word not in {"1", "0", "1.0", "0.0"} else word[0] == "1"


def in_numbers(line: str) -> str:
    """Return a line of a table with 1 for each word that says yes, and 0 for each that says no.

    Parameters
    ----------
    line : str
        Of a table with columns of flags.
    """
    return _WORD.sub(lambda word: str(int(_TOLD[word[0].lower()])), line)


def all_said(values: Any, *, in_words: bool = False) -> Floats | None:
    """Return 1 for each text that says yes, 0 for no and for what is missing; None if any says neither, or is no text.

    Parameters
    ----------
    values : array_like of str or None
        Of any shape.
    in_words : bool
        Whether numbers say nothing.
    """
    try:
        texts = np.asarray(values, dtype=object)
    except ValueError:  # lists of unlike lengths
        return None
    every = {one for one in texts.flat if one is not None} if all(map(_is_text, texts.flat)) else {None}
    told = {one: None if one is None else said(one, in_words=in_words) for one in every}
    if not told or None in told.values():
        return None
    return np.array([float(one is not None and bool(told[one])) for one in texts.flat]).reshape(texts.shape)


def _is_text(value: Any) -> bool:
    return value is None or isinstance(value, str)
