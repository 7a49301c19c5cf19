"""How residuals pull at the constants of a chain: at offsets by forces, at joints by the force of all that lies beyond.

Axes are pulled at by the torque of all that turns with them. Forces and torques are summed from the leaves to the root.
"""

from __future__ import annotations

import numpy as np

from skelgen.geometry.frames_last import cross
from skelgen.kinematics.articulation import FREEDOMS, Articulation
from skelgen.kinematics.chain import Chain, ChainPoses
from skelgen.kinematics.posing import CHUNK_FRAMES
from skelgen.kinematics.tree import Tree, View, frames_last, torque_of
from skelgen.model.arrays import Floats


def constant_pull(
    chain: Chain, articulation: Articulation, poses: ChainPoses, positions: Floats, weights: Floats
) -> Floats:
    """Return how the residuals of settled poses pull at the constants, summed over frames, shape (n_constants,).

    Parameters
    ----------
    chain, articulation, poses
        Where to linearise.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    weights : ndarray, shape (n_frames, n_markers)
        Of the squared distances, 0 where unseen.
    """
    offsets, joints = np.zeros((chain.n_markers, 3)), np.zeros((chain.n_limbs, 3))
    axes = np.zeros(articulation.n_constants)
    for first in range(0, len(positions), CHUNK_FRAMES):
        part = slice(first, first + CHUNK_FRAMES)
        tree = Tree(chain, articulation, positions[part], weights[part])
        view = tree.view(*frames_last(poses[part]))
        _pull_at_places(chain, view, offsets, joints)
        if articulation.n_constants:
            _pull_at_axes(chain, articulation, poses.rotations[part], view, axes)
    return np.concatenate([offsets.ravel(), joints[1:].ravel(), axes])


def _pull_at_places(chain: Chain, view: View, offsets: Floats, joints: Floats) -> None:
    """Add to the pull at offsets and joints."""
    forces = [own.sum(axis=0) for own in view.forces]
    for limb, own in enumerate(view.forces):
        offsets[chain.limb_of_marker == limb] += np.einsum("ijf,mif->mj", view.rotations[limb], own)
    for limb in range(chain.n_limbs - 1, 0, -1):
        parent = int(chain.parents[limb])
        joints[limb] += np.einsum("ijf,if->j", view.rotations[parent], forces[limb])
        forces[parent] += forces[limb]


def _pull_at_axes(chain: Chain, articulation: Articulation, rotations: Floats, view: View, axes: Floats) -> None:
    """Add to the pull at the constants of axes."""
    forces = [own.sum(axis=0) for own in view.forces]
    torques = [torque_of(arms, own) for arms, own in zip(view.arms, view.forces, strict=True)]
    columns = articulation.constant_columns
    for limb in range(chain.n_limbs - 1, 0, -1):
        parent = int(chain.parents[limb])
        torques[parent] += cross(view.links[limb], forces[limb])
        forces[parent] += forces[limb]
        if FREEDOMS[articulation.kinds[limb]] == 3:
            continue
        torques[parent] += torques[limb]
        _, change = articulation.axes_of(limb, rotations[:, parent], rotations[:, limb])
        axes[columns[limb]] += np.einsum("fin,if->n", change, torques[limb])
