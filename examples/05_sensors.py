"""Bodies with orientation, such as magnetic sensors: their hierarchy, joints with deviations, limb lengths.

    python examples/05_sensors.py

Sensors sit anywhere on the limbs of a simulated human, off by 2 mm and half a degree. Nothing else is known.
"""

from __future__ import annotations

import numpy as np

from skelgen.geometry.rotations import matrix_from_vector
from skelgen.kinematics import find_hierarchy, fit_hinge, without_residual
from skelgen.model import Poses
from skelgen.simulation import simulate

SHIFT, TURN = 2.0, 0.01  # mm, rad: errors of a sensor


def main() -> None:
    take = sensors()
    found = find_hierarchy(take, root="pelvis")
    for child, joint in found.joints.items():
        parent = take.names[found.parents[child]]
        print(f"{parent} - {take.names[child]}: {joint.kind}, +-{np.linalg.norm(joint.fit.std[0]):.2f} mm")
    for length in found.lengths:
        if length.is_determined:
            print(f"{length.body}, {length.first} to {length.second}: {length.length:.1f} +- {length.std:.1f} mm")

    knee = fit_hinge(take, "left thigh", "left shank")
    bend, std = np.rad2deg(np.ptp(knee.angles[:, 0])), np.rad2deg(knee.angle_std[:, 0].mean())
    print(f"left knee: {bend:.1f} deg of bending, each angle +-{std:.2f} deg")

    played = without_residual(take, found)
    moved = np.linalg.norm((played.world_from_body - take.world_from_body)[..., :3, 3], axis=2)
    print(f"played back with its joints held together, bodies move by {moved.mean():.1f} mm on average")


def sensors() -> Poses:
    """A human of 15 limbs, a sensor on each."""
    truth, random = simulate("human", seed=1, n_frames=500).truth, np.random.default_rng(0)
    mount = np.tile(np.eye(4), (truth.n_limbs, 1, 1))
    mount[:, :3, :3] = matrix_from_vector(random.normal(size=(truth.n_limbs, 3)))
    mount[:, :3, 3] = 60 * random.normal(size=(truth.n_limbs, 3))
    world = truth.world_from_limb @ mount
    world[..., :3, :3] @= matrix_from_vector(TURN * random.normal(size=(*world.shape[:2], 3)))
    world[..., :3, 3] += SHIFT * random.normal(size=(*world.shape[:2], 3))
    return Poses(world, truth.limb_names, truth.rate)


if __name__ == "__main__":
    main()
