"""Which marker sits on which rigid limb, and how sure that is."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import chain, count

import numpy as np

from skelgen.errors import InputError
from skelgen.model.arrays import Floats, Ints, check_floats, check_ints, check_names, check_probabilities, set_fields

BODY_END = ": "
"""Stands between the name of a body and that of its limb, where limbs of several bodies are called alike."""

DOUBTFUL = 0.8
"""Probability of a marker's limb, or of an edge of the tree, below which it is called doubtful."""


@dataclass(frozen=True, eq=False)
class Limbs:
    """The result of clustering markers into rigid limbs.

    Attributes
    ----------
    limb_of_marker : ndarray of intp, shape (n_markers,)
        Limb index of each marker, -1 = left out. Limbs are numbered 0 .. n_limbs - 1 without holes.
    distance_deviation : ndarray, shape (n_markers, n_markers), mm
        Standard deviation over the sampled frames of the distance between each two markers, which the clustering
        rests on; NaN where two markers are never seen together.
    membership : ndarray, shape (n_markers, n_limbs), or None
        Probability that each marker is on each limb; what lacks to 1 is that it is on none of them. 1 and 0 where the
        user states it; NaN for markers that are left out. None where it was not estimated.
    names : tuple of str, length n_limbs
        What the limbs are called, each otherwise; ``limb0``, ``limb1`` and so on if nobody says.
    body_of_limb : ndarray of intp, shape (n_limbs,)
        The body that each limb is part of, as far as markers tell: no joint is sought between two bodies. All 0 if
        left out.
    body_probability : ndarray, shape (n_bodies,)
        That each is a body of its own and no part of another one; 1 if left out.
    """

    limb_of_marker: Ints
    distance_deviation: Floats
    names: tuple[str, ...] = ()
    membership: Floats | None = None
    body_of_limb: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    body_probability: Floats = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        limb_of_marker = check_ints(self.limb_of_marker, (None,), "limb_of_marker")
        n_markers = len(limb_of_marker)
        used = np.unique(limb_of_marker[limb_of_marker >= 0])
        if (limb_of_marker < -1).any() or not np.array_equal(used, np.arange(len(used))):
            raise InputError("limbs must be numbered from 0 without holes; -1 marks what is left out")
        deviation = check_floats(self.distance_deviation, (n_markers, n_markers), "distance_deviation")
        set_fields(self, limb_of_marker=limb_of_marker, distance_deviation=deviation)
        set_fields(self, names=check_limb_names(self.names, self.n_limbs))
        if self.membership is not None:
            membership = check_probabilities(self.membership, (n_markers, len(used)), "membership")
            set_fields(self, membership=membership)
        body = self.body_of_limb if len(self.body_of_limb) else np.zeros(len(used), dtype=np.intp)
        set_fields(self, body_of_limb=check_ints(body, (len(used),), "body_of_limb"))
        sure = self.body_probability if len(self.body_probability) else np.ones(self.n_bodies)
        set_fields(self, body_probability=check_probabilities(sure, (self.n_bodies,), "body_probability"))

    @property
    def n_bodies(self) -> int:
        """Number of bodies that markers tell; the joints may tell more."""
        return int(self.body_of_limb.max(initial=0)) + 1

    @property
    def bodies(self) -> tuple[Ints, ...]:
        """The limbs of each body that markers tell, rising; the body with most limbs first."""
        bodies = [np.flatnonzero(self.body_of_limb == body) for body in np.unique(self.body_of_limb)]
        return tuple(sorted(bodies, key=lambda limbs: (-len(limbs), int(limbs[0]))))

    @property
    def n_limbs(self) -> int:
        """Number of limbs."""
        return int(self.limb_of_marker.max(initial=-1)) + 1

    @property
    def n_markers(self) -> int:
        """Number of markers, those left out included."""
        return len(self.limb_of_marker)

    @property
    def left_out(self) -> Ints:
        """Indices of the markers that belong to no limb."""
        return np.flatnonzero(self.limb_of_marker < 0)

    @property
    def probability(self) -> Floats:
        """Probability that each marker is on its limb, shape (n_markers,); NaN where it was not estimated."""
        if self.membership is None or not self.n_limbs:
            return np.full(self.n_markers, np.nan)
        own = self.membership[np.arange(self.n_markers), self.limb_of_marker]
        return np.where(self.limb_of_marker < 0, np.nan, own)

    @property
    def rivals(self) -> tuple[Ints, Floats]:
        """The limb on which each marker is otherwise most likely and its probability, shapes (n_markers,); -1 = none.

        None is a limb of the marker's own, or where nothing was estimated.
        """
        nothing = np.full(self.n_markers, -1, dtype=np.intp), np.full(self.n_markers, np.nan)
        if self.membership is None or not self.n_limbs:
            return nothing
        others, every = np.nan_to_num(self.membership), np.arange(self.n_markers)
        others[every, self.limb_of_marker] = -1.0
        rival, alone = others.argmax(axis=1), 1.0 - np.nansum(self.membership, axis=1)
        found = others[every, rival]
        is_limb = found >= np.maximum(alone, np.finfo(np.float64).tiny)
        rival, found = np.where(is_limb, rival, -1), np.where(is_limb, found, np.maximum(alone, 0.0))
        is_known = ~np.isnan(self.probability)
        return np.where(is_known, rival, -1), np.where(is_known, found, np.nan)

    @property
    def doubtful(self) -> Ints:
        """Indices of the markers whose limb is doubtful, the least sure first."""
        order = np.argsort(self.probability, kind="stable")
        return order[self.probability[order] < DOUBTFUL]

    def markers_of(self, limb: int) -> Ints:
        """Indices of the markers on one limb, rising."""
        return np.flatnonzero(self.limb_of_marker == limb)

    def limbs_called(self, name: str) -> list[int]:
        """Return the limbs of that name, in a take of several bodies perhaps one of each."""
        return [limb for limb, called in enumerate(self.names) if name in {called, body_and_limb(called)[1]}]

    def called(self, limb: int) -> str:
        """Return what sentences call a limb: its name, or ``limb 7`` if it has none."""
        return f"limb {limb}" if self.names[limb] == f"limb{limb}" else self.names[limb]


def body_and_limb(name: str) -> tuple[str, str]:
    """Return the body that the name of a limb begins with, empty if none, and what the limb is called in its body.

    Parameters
    ----------
    name : str
        Of a limb, in a take of several bodies perhaps with the name of its body before it.

    Examples
    --------
    >>> body_and_limb("body2: left thigh"), body_and_limb("left thigh")
    (('body2', 'left thigh'), ('', 'left thigh'))
    """
    body, _, limb = name.rpartition(BODY_END)
    return body, limb


def names_of_bodies(bodies: Sequence[Ints], names: Sequence[str]) -> tuple[str, ...]:
    """Return what bodies are called: as most names of their limbs begin, else ``body1``, ``body2`` and so on.

    Parameters
    ----------
    bodies : sequence of ndarray of intp
        The limbs of each body, the body with most limbs first.
    names : sequence of str, length n_limbs
        What the limbs are called.
    """
    called: list[str] = []
    for number, limbs in enumerate(bodies, start=1):
        begun = Counter(body_and_limb(names[limb])[0] for limb in limbs.tolist() if names[limb] != f"limb{limb}")
        name, n_alike = begun.most_common(1)[0] if begun else ("", 0)
        numbered = (f"body{one}" for one in count(number))
        ways = numbered if 2 * n_alike <= begun.total() or not name else chain([name], numbered)
        called.append(next(one for one in ways if one not in called))
    return tuple(called)


def check_limb_names(names: Sequence[str], n_limbs: int) -> tuple[str, ...]:
    """Return what limbs are called, ``limb0``, ``limb1`` and so on if `names` is empty.

    Parameters
    ----------
    names : sequence of str
        One for each limb, or none.
    n_limbs : int
        Number of limbs.

    Raises
    ------
    InputError
        If a name is missing, empty or used twice.
    """
    return check_names(names or tuple(f"limb{limb}" for limb in range(n_limbs)), n_limbs, "limb")


def with_names_of_limbs(sentence: str, limbs: Limbs) -> str:
    """Return a sentence of a stage with the names of limbs in the place of their numbers.

    Parameters
    ----------
    sentence : str
        It speaks of ``limb 3``, ``limbs 3 and 4``, ``limb 3 and 4`` or ``limbs 3, 4 and 5``.
    limbs : Limbs
        What they are called; limbs without a name keep their numbers.
    """

    def named(match: re.Match[str]) -> str:
        numbers = [int(number) for number in re.findall(r"[0-9]+", match[0])]
        if any(number >= limbs.n_limbs for number in numbers):
            return match[0]
        if all(limbs.called(number) == f"limb {number}" for number in numbers):
            return match[0]
        return re.sub(r"(?:limbs? )?([0-9]+)", lambda number: limbs.called(int(number[1])), match[0])

    return re.sub(r"\blimbs? [0-9]+(?:(?:, | and (?:limb )?)[0-9]+\b)*(?![.,]?[0-9])", named, sentence)
