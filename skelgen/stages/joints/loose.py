"""Joints that hold nothing: where limbs of separate bodies were joined because a tree joins all."""

from __future__ import annotations

import numpy as np

from skelgen.model import Limbs, Topology, Trajectories
from skelgen.model.arrays import Floats, Ints

LOOSE_SHARE = 0.5
"""Of the usual radius of a limb: a joint that wobbles by more lies nowhere in particular."""


def loose_joints(trajectories: Trajectories, limbs: Limbs, topology: Topology) -> Ints:
    """Joints that the motion contradicts.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers.
    limbs : Limbs
        Their limbs.
    topology : Topology
        The tree.

    Returns
    -------
    ndarray of intp
        Indices of the joints, in the order of `Topology.children`.
    """
    radius = np.array([_radius(trajectories.positions[:, limbs.markers_of(limb)]) for limb in range(limbs.n_limbs)])
    extended = radius[radius > 0]  # limbs of one marker have none
    if not len(extended):
        return np.empty(0, dtype=np.intp)
    with np.errstate(invalid="ignore"):
        return np.flatnonzero(np.sqrt(topology.values) > LOOSE_SHARE * np.median(extended))


def _radius(positions: Floats) -> float:
    """Root mean square distance [mm] of a limb's markers from their middle, over frames that show all of them."""
    whole = positions[~np.isnan(positions).any(axis=(1, 2))]
    if not len(whole):
        return float("nan")
    return float(np.sqrt(((whole - whole.mean(axis=1, keepdims=True)) ** 2).sum(axis=2).mean()))


def loose_sentences(trajectories: Trajectories, limbs: Limbs, topology: Topology) -> tuple[str, ...]:
    """Say which joints are loose, and what that means."""
    loose = loose_joints(trajectories, limbs, topology)
    return tuple(
        f"the joint between limb {parent} and limb {child} wobbles by {np.sqrt(value):.0f} mm, more than half the "
        "usual radius of a limb: nothing holds them together, and they may be separate bodies"
        for (parent, child), value in zip(topology.edges[loose].tolist(), topology.values[loose], strict=True)
    )
