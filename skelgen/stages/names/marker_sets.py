"""The marker sets that people wear, and which of them a take has by the names of its markers."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any

from skelgen.errors import InputError, ParameterError
from skelgen.files import read_table as read_beside
from skelgen.marker_sets import MARKER_SETS, read_table, worn_markers

OTHER_SETS = ("cleveland-clinic", "cgm2-5", "human-body-model", "optitrack-biomech-57", "nokov-53", "opencap")
"""Marker sets that the simulation does not wear."""

MARKER_SET_CHOICES = ("auto", "none", *MARKER_SETS, *OTHER_SETS)
"""What a user may say of the marker set: find it by the names, give the limbs no names, or this one."""

PARENTS: Mapping[str, str] = {
    "chest": "pelvis",
    "head": "chest",
    **{f"{side} upper arm": "chest" for side in ("left", "right")},
    **{f"{side} forearm": f"{side} upper arm" for side in ("left", "right")},
    **{f"{side} hand": f"{side} forearm" for side in ("left", "right")},
    **{f"{side} thigh": "pelvis" for side in ("left", "right")},
    **{f"{side} shank": f"{side} thigh" for side in ("left", "right")},
    **{f"{side} foot": f"{side} shank" for side in ("left", "right")},
    **{f"{side} toes": f"{side} foot" for side in ("left", "right")},
}
"""What each segment of a person hangs on; the pelvis is the root."""

_LEAST_HITS = 8
_LEAST_PART = 0.75
"""Of the take's markers that are those of a set; fewer are no reason to say that it is worn."""

_MOST_OF_SET = 0.75
"""Of the markers of a set; so many make it likely that it is worn among others."""


@dataclass(frozen=True)
class MarkerSet:
    """A marker set, as far as a take has its markers.

    Attributes
    ----------
    name, title : str
        One of `MARKER_SET_CHOICES`, and what it is called in full.
    segments : mapping of str to str
        The segment of each of the take's markers that belong to the set.
    n_markers : int
        Markers of the whole set.
    n_taken : int
        Markers of the take.
    """

    name: str
    title: str
    segments: Mapping[str, str]
    n_markers: int
    n_taken: int

    @property
    def wearers(self) -> Mapping[str, str]:
        """Who wears each marker: what stands before the last colon of its name, if the set is worn more than once.

        One wearer, called by the empty name, if no marker of the set is there twice.
        """
        names = list(map(plain_name, self.segments))
        if len(set(names)) == len(names):
            return dict.fromkeys(self.segments, "")
        return {name: name.rpartition(":")[0].strip() for name in self.segments}

    def check_wearers(self) -> None:
        """Refuse a set that is worn more than once where names do not say by whom.

        Raises
        ------
        InputError
            If one wearer has half of the set twice.
        """
        worn: dict[tuple[str, str], list[str]] = {}
        for name, wearer in self.wearers.items():
            worn.setdefault((wearer, plain_name(name)), []).append(name)
        alike = [names for names in worn.values() if len(names) > 1]
        if 2 * len(alike) >= self.n_markers:
            raise InputError(
                f"markers of {self.title} are there twice, as {' and '.join(alike[0])}, but their names do not "
                "say who wears them; begin names with that of the person, as in anna:LFHD and bob:LFHD"
            )

    @property
    def sentence(self) -> str:
        """What is recognised, e.g. ``marker set: Plug-in Gait full body (39 of 39 markers are of it)``."""
        n_wearers = len(set(self.wearers.values()))
        whole = "" if len(self.segments) == self.n_markers else f"; it has {self.n_markers}"
        worn = f", worn by {n_wearers}" if n_wearers > 1 else whole
        return f"marker set: {self.title} ({len(self.segments)} of {self.n_taken} markers are of it{worn})"

    @property
    def hint(self) -> str:
        """What the user may know of a set that is worn among other markers, and what to do then."""
        others = self.n_taken - len(self.segments)
        return (
            f"{len(self.segments)} of the {self.n_markers} markers of {self.title} are there, but {others} others, "
            f"too: too many to believe that it is worn. If it is, `--marker-set {self.name}` makes use of it"
        )


def recognised_set(names: Sequence[str]) -> MarkerSet | None:
    """Return the marker set that a take wears, or None if its names belong to none that is known.

    That set is taken which shares most with the take: the harmonic mean of the parts of the take's and of the set's
    markers that both have. A part of a body is recognised as well, if nearly all of the take's markers are of the set.

    Parameters
    ----------
    names : sequence of str
        All markers of the take.
    """
    found = [find_marker_set(name, names) for name in (*MARKER_SETS, *OTHER_SETS)]
    best = max(found, key=lambda one: 2 * len(one.segments) / (one.n_markers + one.n_taken))
    enough = len(best.segments) >= max(_LEAST_HITS, _LEAST_PART * best.n_taken)
    return best if enough else None


def set_among_others(names: Sequence[str]) -> MarkerSet | None:
    """Return the marker set most of whose markers a take has, among others; None if it has most of no set.

    Such a set is not `recognised_set`, as too many markers are no part of it; the user may know that it is worn.

    Parameters
    ----------
    names : sequence of str
        All markers of the take.
    """
    found = [find_marker_set(name, names) for name in (*MARKER_SETS, *OTHER_SETS)]
    best = max(found, key=lambda one: (len(one.segments) / one.n_markers, len(one.segments)))
    return best if len(best.segments) >= max(_LEAST_HITS, _MOST_OF_SET * best.n_markers) else None


def find_marker_set(name: str, names: Sequence[str]) -> MarkerSet:
    """Return a marker set as far as a take has its markers.

    Parameters
    ----------
    name : str
        A set of `MARKER_SETS` or `OTHER_SETS`.
    names : sequence of str
        All markers of the take.

    Raises
    ------
    ParameterError
        If there is no such set.
    """
    if name not in (*MARKER_SETS, *OTHER_SETS):
        raise ParameterError(f"there is no marker set {name!r}; there are {', '.join(MARKER_SET_CHOICES)}")
    segments = _segments(name)
    taken = {one: segments[plain_name(one)] for one in names if plain_name(one) in segments}
    return MarkerSet(name, str(_table(name)["title"]), taken, len(segments), len(names))


def marker_names(name: str) -> tuple[str, ...]:
    """Return the names of all markers of a set of `MARKER_SETS` or `OTHER_SETS`, in its order."""
    markers = _table(name)["markers"]
    if name in MARKER_SETS:
        return tuple(markers)
    found = (one for of_segment in markers.values() for one in of_segment)
    return tuple(dict.fromkeys(one.replace("@", letter) for one in found for letter in "LR"))


@lru_cache(maxsize=1000)
def plain_name(name: str) -> str:
    """Return a marker's name without its subject, in small letters, letters and digits only."""
    return re.sub(r"[\W_]", "", name.rpartition(":")[2]).lower()


@cache
def _table(name: str) -> Mapping[str, Any]:
    if name in MARKER_SETS:
        return read_table("marker_sets")[name]  # type: ignore[no-any-return]
    return read_beside(__file__, "other_sets")[name]  # type: ignore[no-any-return]


@cache
def _segments(name: str) -> Mapping[str, str]:
    if name in MARKER_SETS:
        markers = {plain_name(marker.name): marker.limb for marker in worn_markers(name)}
    else:
        rows = [(segment, marker) for segment, found in _table(name)["markers"].items() for marker in found]
        markers = {
            plain_name(marker.replace("@", letter)): segment.replace("@", side)
            for letter, side in (("L", "left"), ("R", "right"))
            for segment, marker in rows
        }
    others = _table(name).get("also", {})
    return markers | {plain_name(other): markers[plain_name(one)] for other, one in others.items()}
