"""What the user states of limbs: markers that share one, and markers that do not."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from skelgen.errors import InputError
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.limbs.parameters import LimbParameters
from skelgen.stages.limbs.relative_motion import Group

GROUP_SEPARATOR, NAME_SEPARATOR = ";", ","

NameGroups = Iterable[Sequence[str]]
"""Groups of marker names."""


@dataclass(frozen=True)
class LimbConstraints:
    """What the user states of limbs.

    Attributes
    ----------
    together : iterable of sequence of str
        Names of markers; each group shares a limb, groups with a common marker are one.
    apart : iterable of sequence of str
        Names of markers; no two of a group share a limb.
    """

    together: NameGroups = ()
    apart: NameGroups = ()

    def with_parameters(self, parameters: LimbParameters) -> LimbConstraints:
        """Return these constraints and those that the parameters hold as text, e.g. ``"LKNE, LANK; RKNE, RANK"``."""
        together = (*self.together, *_name_groups(parameters.together))
        return LimbConstraints(together, (*self.apart, *_name_groups(parameters.apart)))

    def of_markers(self, names: Sequence[str]) -> MarkerConstraints:
        """Return the constraints on markers by index.

        Parameters
        ----------
        names : sequence of str
            All markers.

        Raises
        ------
        InputError
            If a name is unknown, or the constraints contradict each other.
        """
        index_of = {name: index for index, name in enumerate(names)}
        block_of = np.arange(len(names))
        for group in self.together:
            members = _indices(group, index_of)
            block_of[np.isin(block_of, block_of[members])] = block_of[members].min(initial=len(names))
        forbidden = np.zeros((len(names), len(names)), dtype=np.bool_)
        for group in self.apart:
            members = _indices(group, index_of)
            forbidden[np.ix_(members, members)] |= ~np.eye(len(members), dtype=np.bool_)
        both = np.argwhere(forbidden & (block_of[:, np.newaxis] == block_of))
        if len(both):
            first, second = (names[index] for index in both[0])
            raise InputError(f"{first!r} and {second!r} are asked to share a limb and not to; take one of both back")
        blocks = [tuple(np.flatnonzero(block_of == block).tolist()) for block in np.unique(block_of)]
        of_block = np.array([block_of == block for block in block_of])
        return MarkerConstraints(blocks, np.asarray(of_block @ forbidden @ of_block, dtype=np.bool_))


@dataclass(frozen=True, eq=False)
class MarkerConstraints:
    """What every grouping of markers must obey.

    Attributes
    ----------
    blocks : list of tuple of int
        Markers that share a limb; those of which nothing is stated are blocks of one.
    apart : ndarray of bool, shape (n_markers, n_markers)
        Markers that may not share a limb.
    """

    blocks: list[Group]
    apart: Bools

    @property
    def is_empty(self) -> bool:
        """Whether nothing is stated."""
        return len(self.blocks) == len(self.apart) and not bool(self.apart.any())

    @property
    def is_named(self) -> Bools:
        """Which markers the user names, shape (n_markers,)."""
        named: Bools = np.asarray(self.apart.any(axis=1))
        for block in self.blocks:
            named[list(block)] |= len(block) > 1
        return named

    def of(self, markers: Ints) -> MarkerConstraints:
        """Return the constraints on some of the markers, numbered as they are listed."""
        place = {marker: index for index, marker in enumerate(markers.tolist())}
        kept = [tuple(place[marker] for marker in block if marker in place) for block in self.blocks]
        return MarkerConstraints([block for block in kept if block], self.apart[np.ix_(markers, markers)])

    def applied(self, groups: Ints, deviation: Floats) -> Ints:
        """Change a grouping as little as it takes to obey.

        Parameters
        ----------
        groups : ndarray of intp, shape (n_markers,)
            Group of each marker.
        deviation : ndarray, shape (n_markers, n_markers), mm
            Complete standard deviations of distances: a block that must leave goes where they are small.
        """
        groups = groups.copy()
        for block in self.blocks:
            groups[list(block)] = np.bincount(groups[list(block)]).argmax()
        for block in self.blocks:
            rejected = np.unique(groups[self.apart[list(block)].any(axis=0)])
            if groups[block[0]] in rejected:
                free = np.setdiff1d(groups, rejected)
                means = [deviation[list(block)][:, groups == group].mean() for group in free]
                groups[list(block)] = free[int(np.argmin(means))] if len(free) else groups.max() + 1
        return groups

    def parted(self, groups: Ints, deviation: Floats, n_groups: int) -> Ints:
        """Let the loosest blocks leave their groups until there are `n_groups`, or nothing is left to part.

        Parameters
        ----------
        groups : ndarray of intp, shape (n_markers,)
            Group of each marker.
        deviation : ndarray, shape (n_markers, n_markers), mm
            Complete standard deviations of distances.
        n_groups : int
            Number of groups that is wanted.
        """
        groups = groups.copy()
        for _ in range(len(np.unique(groups)), n_groups):
            loose = [block for block in self.blocks if (groups == groups[block[0]]).sum() > len(block)]
            if not loose:
                break
            means = [deviation[list(block)][:, groups == groups[block[0]]].mean() for block in loose]
            groups[list(loose[int(np.argmax(means))])] = groups.max() + 1
        return groups


def _name_groups(text: str) -> tuple[tuple[str, ...], ...]:
    """Read groups of names, e.g. ``"LKNE, LANK; RKNE, RANK"``."""
    groups = (group.split(NAME_SEPARATOR) for group in text.split(GROUP_SEPARATOR))
    clean = (tuple(name.strip() for name in group if name.strip()) for group in groups)
    return tuple(group for group in clean if group)


def _indices(group: Sequence[str], index_of: dict[str, int]) -> Ints:
    for name in group:
        if name not in index_of:
            raise InputError(f"there is no marker {name!r}; the markers are {', '.join(index_of)}")
    return np.array([index_of[name] for name in dict.fromkeys(group)], dtype=np.intp)
