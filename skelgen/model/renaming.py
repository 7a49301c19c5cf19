"""Sentences that were written before markers and limbs got other names."""

import re
from collections.abc import Iterable, Mapping, Sequence

_ORDINARY = re.compile(r"[^\W\d_]?[a-z]*")
_BEFORE = re.compile(r"(?:^|[:;,)] |\bmarkers? )$")
_BEFORE_MARKERS = re.compile(r"\b(?:of|fit|beside|where) $")
_AFTER = re.compile(r"$|[,.:;]| \(| (?:is|are|was|were|has|and|or|by|in|to others|at least|lies|belongs)\b")
_BETWEEN = r"(?:, and |, or |, | and | or )"


def with_other_names(sentences: Sequence[str], renamed: Mapping[str, str], kept: Iterable[str]) -> tuple[str, ...]:
    """Return sentences in which some names are replaced where they stand as whole words.

    Parameters
    ----------
    sentences : sequence of str
        They speak of markers and limbs.
    renamed : mapping of str to str
        Names, and what takes their places.
    kept : iterable of str
        Names that stay, also where another name is a part of them.

    Examples
    --------
    >>> with_other_names(["head 1 is on head, head 2 is on chest"], {"head": "skull"}, ["head 1", "head 2"])
    ('head 1 is on skull, head 2 is on chest',)
    """
    names = {**renamed, **{name: name for name in kept}}
    pattern = re.compile(_any_of(names))
    return tuple(pattern.sub(lambda found: names[found[0]], sentence) for sentence in sentences)


def with_renamed_markers(sentences: Sequence[str], renamed: Mapping[str, str], limbs: Iterable[str]) -> tuple[str, ...]:
    """Return sentences in which markers have other names.

    A name that may be another word of the sentence, as it is that of a limb or has small letters only, is replaced in a
    list with another marker's name and where a sentence names markers, as at its beginning before a verb.

    Parameters
    ----------
    sentences : sequence of str
        They speak of markers and limbs.
    renamed : mapping of str to str
        Names of all markers, and what takes their places.
    limbs : iterable of str
        Names of limbs, which stay.

    Examples
    --------
    >>> with_renamed_markers(["M1 is seen on head", "head and M1 are one"], {"M1": "LFHD", "head": "C7"}, ["head"])
    ('LFHD is seen on head', 'C7 and LFHD are one')
    """
    others = set(limbs)
    name = _any_of({*renamed, *others})
    one, many = re.compile(name), re.compile(f"{name}(?:{_BETWEEN}{name})*")

    def is_sure(found: str) -> bool:
        return found in renamed and found not in others and not _ORDINARY.fullmatch(found)

    def replaced(found: re.Match[str]) -> str:
        before, after = found.string[: found.start()], found.string[found.end() :]
        names_it = _BEFORE.search(before) or (found[0] not in others and _BEFORE_MARKERS.search(before))
        if any(map(is_sure, one.findall(found[0]))) or (names_it and _AFTER.match(after)):
            return one.sub(lambda each: renamed.get(each[0], each[0]), found[0])
        return found[0]

    return tuple(many.sub(replaced, sentence) for sentence in sentences)


def _any_of(names: Iterable[str]) -> str:
    """A pattern of any of these names as a whole word, the longest that fits."""
    longest_first = sorted(names, key=len, reverse=True)
    return rf"(?<!\w)(?:{'|'.join(map(re.escape, longest_first))})(?!\w)"
