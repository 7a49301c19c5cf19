"""How sure it is that two limbs of the tree are neighbours: probabilities from the costs of all joints.

An edge is as sure as the best other edge between the same two parts of the tree is dearer, and as its limbs turn
against each other: those that hardly turn show little of their joint. How often such an edge is right is learned from
takes whose truth is known.
"""

from dataclasses import replace

import numpy as np

from skelgen.model import Topology
from skelgen.model.arrays import Floats
from skelgen.stages.joints.parameters import JointConstraints

MOST_DEARER = 4.0
"""Logarithm of how many times dearer the next edge is: more says nothing more."""

LEAST_TURN = 0.05
"""rad, each axis; what turns less is noise."""

TIE = 0.05
"""Logarithm of how many times dearer an edge is that could as well be there: costs differ by so much by chance."""

# Learned by tests/benchmarks/doubt.py
BIAS, OF_LEAD, OF_TURN = 3.63, 0.62, 0.61
RIVAL_SHARE = 0.26
"""Of edges that are wrong, those whose rival is right; otherwise it is another edge, or limbs are wrong."""


def with_certainty(topology: Topology, turns: Floats, constraints: JointConstraints) -> Topology:
    """Return a tree with the probability of each of its edges, and of the best other edge instead.

    Parameters
    ----------
    topology : Topology
        The tree.
    turns : ndarray, shape (n_limbs, n_limbs), rad
        How far limbs turn against each other, each axis; NaN if unknown.
    constraints : JointConstraints
        What the user states of the tree.
    """
    leads = edge_leads(topology)
    sure = edge_probability(leads, edge_turns(topology, turns))
    found = sure / (1 + np.exp(-leads / TIE))
    rivals = RIVAL_SHARE * (1 - sure) + sure - found
    has_rival = topology.rivals[:, 0] >= 0
    stated = [(min(edge), max(edge)) in constraints.joined for edge in topology.edges.tolist()]
    is_stated = np.array(stated, dtype=np.bool_) | (constraints.parents is not None)
    return replace(
        topology,
        edge_probability=np.where(is_stated, 1.0, found),
        rival_probability=np.where(is_stated | ~has_rival, 0.0, rivals),
    )


def edge_leads(topology: Topology) -> Floats:
    """Return the logarithm of how many times dearer the best other edge is, for each joint, shape (n_joints,)."""
    parents, children = topology.edges.T
    costs = np.maximum(topology.joint_costs[parents, children], np.finfo(np.float64).tiny)
    dearer = np.log1p(np.maximum(topology.margins, 0.0) / costs)
    return np.asarray(np.minimum(np.nan_to_num(dearer, nan=MOST_DEARER), MOST_DEARER))


def edge_turns(topology: Topology, turns: Floats) -> Floats:
    """Return the logarithm of how far the limbs of each joint turn against each other [rad], shape (n_joints,).

    Parameters
    ----------
    topology : Topology
        The tree.
    turns : ndarray, shape (n_limbs, n_limbs), rad
        How far limbs turn against each other, each axis; NaN if unknown, which counts as usual.
    """
    parents, children = topology.edges.T
    own = turns[parents, children]
    usual = float(np.nanmedian(own)) if np.isfinite(own).any() else 1.0
    return np.asarray(np.log(np.maximum(np.nan_to_num(own, nan=usual), LEAST_TURN)))


def edge_probability(leads: Floats, turns: Floats) -> Floats:
    """Return how often edges of such leads, whose limbs turn so far, are right, shape (n_joints,).

    Parameters
    ----------
    leads : ndarray, shape (n_joints,)
        What `edge_leads` gives.
    turns : ndarray, shape (n_joints,)
        What `edge_turns` gives.
    """
    return np.asarray(1 / (1 + np.exp(-(BIAS + OF_LEAD * leads + OF_TURN * turns))))
