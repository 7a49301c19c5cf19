"""How residuals pull at the constants of a chain, for many frames at once: the meaning of its twin `compiled_pull`."""

from __future__ import annotations

import numpy as np

from skelgen.geometry.frames_last import cross
from skelgen.kinematics.chain.articulation import FREEDOMS, Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses
from skelgen.kinematics.chain.elimination import Tree, View, frames_last, torque_of
from skelgen.model.arrays import Floats


def summed(chain: Chain, articulation: Articulation, poses: ChainPoses, positions: Floats, weights: Floats) -> Floats:
    """Return the pull of some frames, shape (n_constants,); parameters are those of `pull.constant_gradient`."""
    offsets, joints = np.zeros((chain.n_markers, 3)), np.zeros((chain.n_limbs, 3))
    axes = np.zeros(articulation.n_constants)
    view = Tree(chain, articulation, positions, weights).view(*frames_last(poses))
    _pull_at_places(chain, view, offsets, joints)
    if articulation.n_constants:
        _pull_at_axes(chain, articulation, poses.rotations, view, axes)
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
