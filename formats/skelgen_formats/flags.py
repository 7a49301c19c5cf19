"""Words that say of points whether they are seen, in titles of columns, keys of arrays, and cells."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from skelgen.model.arrays import Floats
from skelgen_formats.body_columns import Body
from skelgen_formats.text import is_number

FLAG_WORD = (
    r"(?:v|(?:is_?)?(?:valid|visible|tracked|seen|(occluded|hidden|lost|missing))"
    r"|(conf|confidences?|likelihoods?|scores?|visibility))"
)
"""What says whether a point is seen, is not, or how sure it is, each a group but the first; to be read in any case."""

STATES = ("status", "state", "tracking_state")
"""Keys of what says in words whether a point is seen; their numbers are codes."""

_TRUTH = dict.fromkeys(("true", "t", "yes", "y", "1", "1.0"), True)
_TRUTH |= dict.fromkeys(("false", "f", "no", "n", "0", "0.0"), False)
_OF_STATE = dict.fromkeys(("ok", "good", "valid", "visible", "seen", "measured", "tracked", "inferred"), True)
_OF_STATE |= dict.fromkeys(("bad", "invalid", "unseen", "hidden", "occluded", "lost", "missing", "untracked"), False)
_OF_STATE |= dict.fromkeys(("nottracked", "not_tracked", "not tracked"), False)


def is_seen(cell: str, *, hides: bool = False, in_words: bool = False) -> bool | None:
    """Return whether a point is seen by what a cell says; None if it says neither.

    Parameters
    ----------
    cell : str
        Yes or no, 1 or 0, or a state such as lost, which means the same under any title.
    hides : bool
        Whether the title asks if the point is hidden.
    in_words : bool
        Whether numbers say nothing.
    """
    word = cell.strip().lower()
    if word in _OF_STATE:
        return _OF_STATE[word]
    return None if word not in _TRUTH or (in_words and is_number(word)) else _TRUTH[word] != hides


def all_seen(values: Any, *, hides: bool = False, in_words: bool = False) -> Floats | None:
    """Return 0 for what is missing and for each text by which a point is not seen, else 1; None if some are no texts.

    Parameters
    ----------
    values : array_like of str or None
        Of any shape.
    hides, in_words
        As for `is_seen`.
    """
    try:
        texts = np.asarray(values, dtype=object)
    except ValueError:  # lists of unlike lengths
        return None
    if not texts.size or not all(one is None or isinstance(one, str) for one in texts.flat):
        return None
    told = {one: one is not None and is_seen(one, hides=hides, in_words=in_words) for one in set(texts.flat)}
    return np.array([float(told[one] is not False) for one in texts.flat]).reshape(texts.shape)


def with_flags(line: str, flags: Mapping[int, Body], delimiter: str | None) -> str:
    """Return a line of a table with numbers for words in the columns of flags; a word that says nothing is left out.

    Parameters
    ----------
    line : str
        The line.
    flags : mapping of int to Body
        Whose flag each column is.
    delimiter : str or None
        What separates cells, None for blanks.
    """
    cells = line.split(delimiter)
    for column, body in flags.items():
        if column < len(cells) and not is_number(cells[column].strip()):
            seen = is_seen(cells[column], hides=bool(body.flag_of_unseen))
            cells[column] = "nan" if seen is None else f"{int(seen != bool(body.flag_of_unseen))}"
    return (delimiter or " ").join(cells)
