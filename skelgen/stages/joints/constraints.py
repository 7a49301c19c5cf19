"""What the user knows of the tree: joints that are there, and joints that are not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skelgen.errors import InputError
from skelgen.model import Limbs
from skelgen.model.arrays import Floats

PAIR_SEPARATOR, NAME_SEPARATOR = ";", ","

Pair = tuple[int, int]
"""Two limbs, the lower index first."""


def limb_pairs(text: str, names: Sequence[str], limbs: Limbs) -> tuple[Pair, ...]:
    """Read pairs of limbs, e.g. ``"limb0, limb3; LKNE, LANK"``: limbs by number, or by any of their markers.

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
        first, second = sorted(limb_called(name, names, limbs) for name in both)
        if first == second:
            raise InputError(f"{entry!r} names limb {first} twice; a joint connects two limbs")
        pairs.append((first, second))
    return tuple(dict.fromkeys(pairs))


def limb_called(name: str, names: Sequence[str], limbs: Limbs) -> int:
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


def obeyed_costs(costs: Floats, wanted: Sequence[Pair], refused: Sequence[Pair]) -> Floats:
    """Return costs whose minimum spanning tree obeys: wanted joints cost less than nothing, refused ones are none.

    Parameters
    ----------
    costs : ndarray, shape (n_limbs, n_limbs), mm^2
        Symmetric costs of joints.
    wanted, refused : sequence of pairs of int
        Joints that are there, and that are not.

    Raises
    ------
    InputError
        If a joint is both, the wanted ones go round in a circle, or their limbs are never seen together.
    """
    obeyed = costs.copy()
    reached = list(range(len(costs)))
    for first, second in refused:
        obeyed[first, second] = obeyed[second, first] = np.inf
    for first, second in wanted:
        if (first, second) in refused:
            raise InputError(f"a joint between limbs {first} and {second} is wanted and refused; take one wish back")
        if not np.isfinite(costs[first, second]):
            raise InputError(f"limbs {first} and {second} are to be joined, but too few frames show both of them")
        if reached[first] == reached[second]:
            raise InputError(f"the joint between limbs {first} and {second} closes a circle of wanted joints")
        reached = [reached[first] if group == reached[second] else group for group in reached]
        obeyed[first, second] = obeyed[second, first] = -1.0
    return obeyed
