"""What is set of the stage that finds limbs: its parameters, and which markers are stated to share a limb or not."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from skelgen.errors import InputError
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.parameters import StageParameters, declare
from skelgen.stages.classic.spectral import SpectralMethod
from skelgen.stages.limbs.relative_motion import Group

_CLUSTERS = (
    "method=spectral",
    "method=greedy and n_limbs=found and count=rising/rotation/eigengap",
    "method=rigidity/distances and n_limbs=given",
)
"""When eigenvectors are clustered: by the methods of the thesis, and for limbs that rigidity does not find."""


def _clusters(scaling: str = "") -> str:
    return " or ".join(f"{one} and local_scaling={scaling}" if scaling else one for one in _CLUSTERS)


@dataclass(frozen=True)
class LimbParameters(StageParameters):
    """How markers are grouped into limbs."""

    stage: ClassVar[str] = "limbs"
    config_section: ClassVar[str] = "SpectralClustering"
    retired: ClassVar[Mapping[str, str]] = {"zero": "SpectralClustering/SPECCLUEPS"}
    classic: ClassVar[Mapping[str, str]] = {"method": "spectral"}

    method: str = declare(
        "rigidity",
        "rigidity fits rigid bodies to groups of markers and merges those that move as one (a given number of limbs "
        "that is more than it finds is left to spectral); distances does the same by the variances of distances alone; "
        "spectral is the clustering of the thesis, greedy its simple one",
        choices=("rigidity", "distances", "spectral", "greedy"),
    )
    count: str = declare(
        "rigidity",
        "how the number of limbs is found for the methods spectral and greedy when the user does not give it: by "
        "rigidity as the method distances does, by rotation of the eigenvectors, by the eigengap of their values, or "
        "rising until all limbs are rigid",
        choices=("rigidity", "rotation", "eigengap", "rising"),
        acts_with="method=spectral/greedy and n_limbs=found",
    )
    together: str = declare("", "names of markers that share a limb, as in 'a, b; c, d, e'", basic=True)
    apart: str = declare("", "names of markers no two of which share a limb, as in 'a, b; c, d, e'", basic=True)
    n_bodies: int = declare(
        0,
        "number of bodies that nothing joins, each of which gets a tree of its own; 0 finds it",
        unit="bodies",
        within=(0, 100),
        basic=True,
    )
    marker_set: str = declare(
        "auto",
        "auto names limbs by their markers or shape, and takes a recognised marker set for a prior; none gives them "
        "numbers; the name of a marker set puts its markers on its limbs, and these into its tree",
        basic=True,
    )
    samplings: int = declare(
        3,
        "rigidity: jittered samplings that vote on which markers share a limb; most takes are decided after two",
        within=(1, 99),
        acts_with="method=rigidity",
    )
    sampling: int = declare(
        -1,
        "a distance is sampled every so many frames, with jitter; 0 takes all frames, -1 spreads at most `samples` "
        "over the take",
        unit="frames",
        within=(-1, 1e6),
        config_name="SAMPLING",
        config_section="TemporalCorrespondence",
    )
    samples: int = declare(
        600, "sampled frames when `sampling` is -1", unit="frames", within=(3, 1e6), acts_with="sampling=-1"
    )
    jitter: float = declare(0.5, "each sample is displaced by up to this part of a sampling interval", within=(0, 1))
    motion_factor: float = declare(
        1.5,
        "two groups are separate limbs when describing their relative motion, of this many times its observed size, "
        "costs less than the deviations it explains",
        within=(1.0, 20.0),
    )
    pair_limit: float = declare(
        4.0,
        "markers are not paired up when their distance varies more than this many times the take's noise",
        within=(1.0, 1000.0),
    )
    flexibility: float = declare(
        0.02,
        "rigidity: a limb may bend by this part of its size; groups that move less against each other are one limb; "
        "0: no limb bends, and what is known of soft bodies is not used",
        within=(0.0, 1.0),
        acts_with="method=rigidity",
        basic=True,
    )
    nearness: float = declare(
        0.01,
        "rigidity: nats a frame by which markers e times as near are likelier to share a limb, where motion explains "
        "both alike: pairs of markers on either side of an axis; 0: motion decides alone",
        within=(0.0, 1.0),
        acts_with="method=rigidity",
    )
    local_scaling: bool = declare(
        True,
        "classic method: scale each marker by its M-th neighbour instead of one sigma",
        config_name="LOCALSIGMA",
        acts_with=_clusters(),
    )
    neighbour: int = declare(
        3,
        "classic method: neighbour that sets the local scale",
        within=(1, 100),
        config_name="M",
        acts_with=_clusters("yes"),
    )
    sigma_squared: float = declare(
        0.0,
        "classic method: square of the global sigma; 0 scans for the best one",
        unit="mm^2",
        within=(0.0, 1e6),
        config_name="SIGMAQUAD",
        acts_with=_clusters("no"),
    )
    measure: str = declare(
        "deviation",
        "classic method: cluster the standard deviation of distances, or their variance",
        choices=("deviation", "variance"),
        acts_with=_clusters(),
    )
    kmeans: str = declare(
        "k-means++",
        "classic method: k-means by Lloyd's steps from k-means++ or random starts; by swaps of centres for markers; or "
        "by swaps and Lloyd's steps, where hybrid accepts worse ones at first",
        choices=("random", "swap", "hybrid", "local-hybrid", "k-means++"),
        config_name="ALG",
        acts_with=_clusters(),
        config_codes=("random", "swap", "hybrid", "local-hybrid"),
    )
    rigid_limit: float = declare(
        0.0,
        "rising count: limbs are added until no distance within one varies more; 0 takes 8 times the take's noise",
        unit="mm",
        within=(0.0, 1e6),
        acts_with="method=spectral/greedy and n_limbs=found and count=rising",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.marker_set not in {"auto", "none"}:
            from skelgen.stages.names import find_marker_set  # noqa: PLC0415 - reads tables

            find_marker_set(self.marker_set, ())  # raises if there is no such set

    @property
    def spectral(self) -> SpectralMethod:
        """How the methods that cluster eigenvectors do it."""
        return SpectralMethod(self.measure, self.local_scaling, self.neighbour, self.sigma_squared, self.kmeans)


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
    bodies : iterable of sequence of str
        Names of markers; each group is on a body of its own.
    body_probability : float
        That these are bodies.
    """

    together: NameGroups = ()
    apart: NameGroups = ()
    bodies: NameGroups = ()
    body_probability: float = 1.0

    def with_parameters(self, parameters: LimbParameters) -> LimbConstraints:
        """Return these constraints and those that the parameters hold as text, e.g. ``"LKNE, LANK; RKNE, RANK"``."""
        together = (*self.together, *_name_groups(parameters.together))
        return replace(self, together=together, apart=(*self.apart, *_name_groups(parameters.apart)))

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
        bodies = tuple(_indices(group, index_of) for group in self.bodies)
        apart = np.asarray(of_block @ forbidden @ of_block, dtype=np.bool_)
        return MarkerConstraints(blocks, apart, bodies, self.body_probability)


@dataclass(frozen=True, eq=False)
class MarkerConstraints:
    """What every grouping of markers must obey.

    Attributes
    ----------
    blocks : list of tuple of int
        Markers that share a limb; those of which nothing is stated are blocks of one.
    apart : ndarray of bool, shape (n_markers, n_markers)
        Markers that may not share a limb.
    bodies : tuple of ndarray of intp
        Markers of each body that is stated; none once markers are parted into bodies.
    body_probability : float
        That these are bodies.
    """

    blocks: list[Group]
    apart: Bools
    bodies: tuple[Ints, ...] = ()
    body_probability: float = 1.0

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
