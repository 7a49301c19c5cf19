"""What the user sets and states about joints: declared parameters, and constraints on the tree."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from skelgen.errors import InputError
from skelgen.model import Limbs
from skelgen.model.arrays import Floats, Ints
from skelgen.parameters import declare
from skelgen.progress import SILENT, Monitor, counted
from skelgen.stages.classic.conjugate_gradients import DescentParameters

PAIR_SEPARATOR, NAME_SEPARATOR = ";", ","

Pair = tuple[int, int]
"""Two limbs, the lower index first."""


@dataclass(frozen=True)
class JointParameters(DescentParameters):
    """How joints and the tree of limbs are found (Schönauer 2007, tables 4.15 and 4.16)."""

    stage: ClassVar[str] = "joints"
    config_section: ClassVar[str] = "JointFinder/JC"
    acts_with: ClassVar[str] = ""
    classic: ClassVar[Mapping[str, str]] = {"solver": "conjugate-gradient"}

    solver: str = declare(
        "closed-form",
        "closed-form solves limbs with poses directly and leaves the rest to conjugate gradients; "
        "conjugate-gradient minimises the joint cost of every pair, the classic method",
        choices=("closed-form", "conjugate-gradient"),
    )
    alpha: float = declare(
        0.1,
        "weight of the mean distance from joint to markers in the cost that decides the tree",
        unit="mm",
        within=(0.0, 1e3),
        config_name="ALPHA",
    )
    alpha_final: float = declare(
        0.0,
        "the same weight when the joints that are kept are placed: 0 does not pull them out of place",
        unit="mm",
        within=(0.0, 1e3),
        config_name="ALPHAWEIGHT",
    )
    sampling: int = declare(
        -1,
        "all pairs of limbs are tried on every so many frames; 0 tries them on all, -1 spreads at most `samples` over "
        "the take",
        unit="frames",
        within=(-1, 1e6),
        config_name="SAMPLING",
    )
    samples: int = declare(
        300, "sampled frames when `sampling` is -1", unit="frames", within=(5, 1e6), acts_with="sampling=-1"
    )
    n_nearest: int = declare(
        0,
        "two limbs are tried if one is among so many nearest of the other; 0 tries all pairs",
        unit="limbs",
        within=(0, 1000),
    )
    max_residual: float = declare(
        25.0,
        "classic method: local optimisation that ends above this cost is tried again from earlier frames",
        unit="mm^2",
        within=(0.0, 1e6),
        config_name="MAXFRET",
        acts_with=DescentParameters.acts_with,
    )
    max_fallback: int = declare(
        5,
        "classic method: how many frames back such a start may come from",
        unit="frames",
        within=(0, 1000),
        config_name="MAXFALLBACK",
        acts_with=DescentParameters.acts_with,
    )
    joined: str = declare(
        "", "joints that are there, as pairs of limbs or of one marker of each: 'limb0, limb3; LKNE, LANK'", basic=True
    )
    parted: str = declare("", "joints that are not there, in the same form", basic=True)
    separate: bool = declare(
        True,
        "whether edges of the tree that are no joints are cut, so that separate bodies are separate trees",
        basic=True,
    )
    known_neighbours: bool = declare(
        True,
        "weigh joints by which segments of a person limbs are, where the distances of their markers tell what is worn; "
        "never with marker_set=none",
    )


@dataclass(frozen=True, eq=False)
class JointConstraints:
    """What the user states of the tree.

    Attributes
    ----------
    joined, parted : sequence of pairs of int
        Limbs between which there is a joint, and limbs between which there is none, the lower index first.
    parents : ndarray of intp, shape (n_limbs,), optional
        The whole tree, -1 for roots; found if not given.
    roots : sequence of int
        Limbs that are the roots of their trees, the first of several in one tree; others `spanning_forest` finds.
    of_person : sequence of pairs of int
        Those of `joined` that a marker set adds: they are left out where too few frames show both limbs.
    """

    joined: Sequence[Pair] = ()
    parted: Sequence[Pair] = ()
    parents: Ints | None = None
    roots: Sequence[int] = ()
    of_person: Sequence[Pair] = ()

    def edges(self, n_limbs: int) -> list[Pair]:
        """Return the pairs of limbs whose joint is stated, by itself or by the whole tree, the lower index first.

        Parameters
        ----------
        n_limbs : int
            How many limbs there are.

        Raises
        ------
        InputError
            If the tree is one of more or fewer limbs.
        """
        parents = [] if self.parents is None else self.parents.tolist()
        if self.parents is not None and len(parents) != n_limbs:
            raise InputError(f"the hierarchy has {counted(len(parents), 'limb')}, the take {n_limbs}")
        of_tree = [(min(limb, parent), max(limb, parent)) for limb, parent in enumerate(parents) if parent >= 0]
        return [*self.joined, *of_tree]

    def seen(self, costs: Floats, monitor: Monitor = SILENT) -> JointConstraints:
        """Return these constraints without the joints that a marker set adds but too few frames show.

        Parameters
        ----------
        costs : ndarray, shape (n_limbs, n_limbs), mm^2
            Joint costs; infinite where two limbs cannot be joined.
        monitor : Monitor
            Receives a notice of each of these joints.
        """
        unseen = [pair for pair in self.of_person if not np.isfinite(costs[pair])]
        for first, second in unseen:
            monitor.notice(
                f"limb {first} and limb {second} are not joined as in a person: too few frames show both of them"
            )
        return replace(self, joined=tuple(pair for pair in self.joined if pair not in unseen))

    def with_parameters(self, parameters: JointParameters, names: Sequence[str], limbs: Limbs) -> JointConstraints:
        """Return these constraints and those that the parameters hold as text.

        Parameters
        ----------
        parameters : JointParameters
            Their `joined` and `parted`.
        names : sequence of str
            All markers.
        limbs : Limbs
            Which marker is on which limb.
        """
        joined = (*self.joined, *limb_pairs(parameters.joined, names, limbs))
        return replace(self, joined=joined, parted=(*self.parted, *limb_pairs(parameters.parted, names, limbs)))

    def bodies(self, body_of_limb: Ints) -> Ints:
        """Return the body of each limb, shape (n_limbs,), where what the user states joins bodies to one.

        Parameters
        ----------
        body_of_limb : ndarray of intp, shape (n_limbs,)
            As markers tell.
        """
        if self.parents is not None:
            return np.zeros_like(body_of_limb)
        joined = body_of_limb.copy()
        for first, second in self.joined:
            joined[joined == joined[second]] = joined[first]
        return joined

    def applied(self, costs: Floats) -> Floats:
        """Return costs whose minimum spanning tree obeys: negative for stated joints, infinite for refused ones.

        Parameters
        ----------
        costs : ndarray, shape (n_limbs, n_limbs), mm^2
            Symmetric joint costs; infinite where two limbs cannot be joined.

        Raises
        ------
        InputError
            If a joint is stated and refused, stated joints form a loop, or their limbs are never seen together.
        """
        constrained = costs.copy()
        tree_of_limb = list(range(len(costs)))
        for first, second in self.parted:
            constrained[first, second] = constrained[second, first] = np.inf
        for first, second in self.joined:
            if (first, second) in self.parted:
                raise InputError(f"limbs {first} and {second} are to be joined and not to be; take one of both back")
            if not np.isfinite(costs[first, second]):
                raise InputError(f"limbs {first} and {second} are to be joined, but too few frames show both of them")
            if tree_of_limb[first] == tree_of_limb[second]:
                raise InputError(f"the joint between limbs {first} and {second} closes a loop of stated joints")
            one, other = tree_of_limb[first], tree_of_limb[second]
            tree_of_limb = [one if tree == other else tree for tree in tree_of_limb]
            constrained[first, second] = constrained[second, first] = -1.0
        return constrained


def limb_pairs(text: str, names: Sequence[str], limbs: Limbs) -> tuple[Pair, ...]:
    """Read pairs of limbs, e.g. ``"limb0, limb3; LKNE, LANK"``: limbs by number, or by any of their markers.

    Parameters
    ----------
    text : str
        The pairs.
    names : sequence of str
        All markers.
    limbs : Limbs
        Which marker is on which limb.

    Raises
    ------
    InputError
        If an entry is no pair, names nothing that is on a limb, or names one limb twice.
    """
    pairs = []
    for entry in filter(None, (part.strip() for part in text.split(PAIR_SEPARATOR))):
        both = [name.strip() for name in entry.split(NAME_SEPARATOR)]
        if len(both) != 2:
            raise InputError(f"{entry!r} where two limbs belong, e.g. 'limb0, limb3' or one marker of each")
        first, second = sorted(_limb_called(name, names, limbs) for name in both)
        if first == second:
            raise InputError(f"{entry!r} names limb {first} twice; a joint connects two limbs")
        pairs.append((first, second))
    return tuple(dict.fromkeys(pairs))


def _limb_called(name: str, names: Sequence[str], limbs: Limbs) -> int:
    """Return the limb that is called ``limb3``, or carries a marker of that name, or is a body of that name."""
    number = name.removeprefix("limb")
    if name.startswith("limb") and number.isdecimal() and int(number) < limbs.n_limbs:
        return int(number)
    for marker in (name, f"{name}:o"):  # the origin of a body with orientation
        if marker in names:
            limb = int(limbs.limb_of_marker[list(names).index(marker)])
            if limb < 0:
                raise InputError(f"marker {name!r} is on no limb; name a marker that is, or limb0, limb1, ...")
            return limb
    raise InputError(
        f"there is no limb or marker {name!r}; limbs are limb0 to limb{limbs.n_limbs - 1}, markers {', '.join(names)}"
    )
