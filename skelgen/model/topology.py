"""How the limbs are connected, and where the joints were found before any rigid skeleton is fitted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from skelgen.errors import InputError
from skelgen.model.arrays import Floats, Ints, check_floats, check_ints


@dataclass(frozen=True, eq=False)
class Topology:
    """The spanning tree over limbs.

    Attributes
    ----------
    parents : ndarray of intp, shape (n_limbs,)
        Parent limb of each limb, -1 for a root.
    joint_costs : ndarray, shape (n_limbs, n_limbs), mm^2
        Symmetric cost of a joint between each two limbs; infinite costs are NaN (never seen together), the diagonal
        is 0.
    raw_joint_positions : ndarray, shape (n_frames, n_joints, 3), mm
        World positions of the joints before the fit of rigid limbs; NaN where not to be told. Joints are in the order
        of `children`.
    n_iterations : ndarray of intp, shape (n_joints,)
        Iterations that the minimisation of each joint took.
    values : ndarray, shape (n_joints,), mm^2
        Joint cost at each solution over all frames, with the weight that places joints (0 by default) for `alpha`.
    alpha : float
        Weight of the mean marker-joint distance in `joint_costs`.
    """

    parents: Ints
    joint_costs: Floats
    raw_joint_positions: Floats
    n_iterations: Ints
    values: Floats
    alpha: float

    def __post_init__(self) -> None:
        parents = check_ints(self.parents, (None,), "parents")
        n_limbs = len(parents)
        _check_forest(parents)
        n_joints = int((parents >= 0).sum())
        costs = check_floats(self.joint_costs, (n_limbs, n_limbs), "joint_costs")
        raw = check_floats(self.raw_joint_positions, (None, n_joints, 3), "raw_joint_positions")
        object.__setattr__(self, "parents", parents)
        object.__setattr__(self, "joint_costs", costs)
        object.__setattr__(self, "raw_joint_positions", raw)
        object.__setattr__(self, "n_iterations", check_ints(self.n_iterations, (n_joints,), "n_iterations"))
        object.__setattr__(self, "values", check_floats(self.values, (n_joints,), "values"))
        object.__setattr__(self, "alpha", float(self.alpha))

    @property
    def n_limbs(self) -> int:
        """Number of limbs."""
        return len(self.parents)

    @property
    def n_joints(self) -> int:
        """Number of joints: one per limb that is not a root."""
        return len(self.children)

    @property
    def roots(self) -> Ints:
        """Limbs without a parent."""
        return np.flatnonzero(self.parents < 0)

    @property
    def children(self) -> Ints:
        """The child limb of each joint, from the roots outward (breadth first), shape (n_joints,)."""
        return outward_order(self.parents)[len(self.roots) :]

    @property
    def edges(self) -> Ints:
        """Parent and child limb of each joint, shape (n_joints, 2)."""
        children = self.children
        return np.stack([self.parents[children], children], axis=1)


def outward_order(parents: Ints) -> Ints:
    """Limbs sorted from the roots outward, breadth first and by index within a level.

    Parameters
    ----------
    parents : ndarray of intp, shape (n_limbs,)
        Parent of each limb, -1 for a root; without cycles.
    """
    order: list[int] = [int(root) for root in np.flatnonzero(parents < 0)]
    for limb in order:  # the list grows while it is walked: that is the breadth-first search
        order.extend(int(child) for child in np.flatnonzero(parents == limb))
    return np.array(order, dtype=np.intp)


def parents_from_names(names: tuple[str, ...], parents: Mapping[str, str | None]) -> Ints:
    """Return the parents of bodies by index, -1 for roots; bodies that are not mentioned are roots.

    Raises
    ------
    InputError
        If a name is unknown, or the parents form a cycle.
    """
    for child, parent in parents.items():
        for name in (child, parent):
            if name and name not in names:
                raise InputError(
                    f"the hierarchy names {name!r}, which is not in the take; there are {', '.join(names)}"
                )
    index = np.array([names.index(parent) if (parent := parents.get(name)) else -1 for name in names], dtype=np.intp)
    if len(outward_order(index)) != len(names):
        raise InputError("the hierarchy goes round in a circle: following the parents must end at a root")
    return index


def _check_forest(parents: Ints) -> None:
    if ((parents < -1) | (parents >= len(parents))).any():
        raise InputError("a parent index names no limb")
    if len(outward_order(parents)) != len(parents):
        raise InputError("the parents form a cycle")
