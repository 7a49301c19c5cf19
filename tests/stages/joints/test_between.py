"""Limbs on either side of a third that swing alike are joined to it, not to each other."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.geometry.rotations import matrix_from_vector
from skelgen.model import Limbs, Trajectories
from skelgen.stages.joints import find_joints

TRUNK = np.array([[-200.0, 20.0, 200.0], [-60.0, -30.0, 240.0], [80.0, 40.0, 230.0], [220.0, -10.0, 210.0]])  # mm
LIMB = np.array([[40.0, 0.0, -60.0], [-40.0, 10.0, -160.0], [20.0, -15.0, -260.0]])
WHEEL = np.array([[110.0, 5.0, 0.0], [-50.0, 8.0, 90.0], [-60.0, 6.0, -90.0]])
TIMES = np.arange(400) / 100


def swaying(turns, aside, markers):
    """Markers [mm] of a limb that turns [rad], (n_frames, 3), about a point on the axis y of the trunk."""
    rotations = matrix_from_vector(np.asarray(turns))
    return np.einsum("fij,mj->fmi", rotations, markers) + np.array([0.0, aside, 0.0])


def swing(size, phase):
    """A rotation about y, and a little about x, whose opposite has half a period's other phase."""
    return size * np.sin(4 * np.pi * TIMES + phase)[:, np.newaxis] * np.array([0.2, 1.0, 0.1])


def legs():
    """A trunk with two legs that mirror each other."""
    return [
        swaying(0 * swing(1, 0), 0, TRUNK),
        swaying(swing(0.25, 0), 140, LIMB),
        swaying(swing(0.25, np.pi), -140, LIMB),
    ]


def wheels():
    """A body and two wheels that roll about one axis, nearly as far."""
    rolled = np.outer(6 * TIMES, [0.0, 1.0, 0.0])
    other = rolled + np.outer(0.3 * np.sin(TIMES), [0.0, 1.0, 0.0])
    return [swaying(0 * rolled, 0, TRUNK[:3]), swaying(rolled, 120, WHEEL), swaying(other, -120, WHEEL)]


def hips():
    """A trunk with two hips that turn about axes side by side, one against the other, by little."""
    turned = np.outer(0.12 * np.sin(9 * TIMES), [1.0, 0.0, 0.0])
    hip = np.array([[160.0, 0, 20], [220, 35, -10], [190, -30, -5]])
    return [swaying(0 * turned, 0, TRUNK), swaying(turned, 50, hip), swaying(-turned, -50, hip * [1, -1, 1])]


@pytest.mark.parametrize("limbs", [legs(), wheels(), hips()], ids=["legs", "wheels", "hips"])
def test_limbs_on_either_side_of_a_third_are_joined_to_it(limbs):
    moved = np.stack([500 * np.sin(0.3 * TIMES), 300 * TIMES, 10 * np.cos(TIMES)], axis=1)
    positions = np.concatenate(limbs, axis=1) + moved[:, np.newaxis]
    positions += np.random.default_rng(0).normal(0, 0.5, positions.shape)
    limb_of_marker = np.repeat(np.arange(3), [limb.shape[1] for limb in limbs])
    take = Trajectories(positions, tuple(map(str, range(len(limb_of_marker)))), 100.0)
    topology = find_joints(take, Limbs(limb_of_marker, np.zeros((len(limb_of_marker),) * 2)))
    assert {frozenset(edge) for edge in topology.edges.tolist()} == {frozenset((0, 1)), frozenset((0, 2))}
    assert topology.loops == ()
