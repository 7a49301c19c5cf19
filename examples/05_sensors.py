"""Bodies with orientation, such as magnetic sensors: their hierarchy, joints with deviations, limb lengths, angles.

    python examples/05_sensors.py [FOLDER]

Sensors sit anywhere on the limbs of a simulated human, off by 2 mm and half a degree. Nothing else is known.
"""

import sys
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import skelgen

SHIFT, TURN = 2.0, 0.01  # mm, rad: errors of a sensor


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")
    take = sensors()
    project = skelgen.reconstruct(take, root="pelvis")
    skeleton, motion = project.skeleton, project.motion
    for joint in skeleton.joints:
        print(f"{take.names[joint.parent]} - {take.names[joint.child]}: {joint.kind}")
    for (joints, length), std in zip(skeleton.lengths.items(), skeleton.length_std, strict=True):
        limb = take.names[skeleton.limb_of_length(joints)]
        print(f"{limb}, from joint to joint: {length:.1f} +- {std:.1f} mm")

    knee = next(index for index, joint in enumerate(skeleton.joints) if names_of(take, joint) == KNEE)
    angles = motion.joint_angles[knee]
    bend, std = np.rad2deg(np.ptp(angles.values[:, 0])), np.rad2deg(angles.std[:, 0].mean())
    print(f"left knee: {bend:.1f} deg of bending, each angle +-{std:.2f} deg")
    (path,) = skelgen.write(project, folder / "sensors.bvh", axes="z-to-y")
    print(f"written with its joints held together: {path}")


KNEE = {"left thigh", "left shank"}


def names_of(take: skelgen.Poses, joint: skelgen.Joint) -> set[str]:
    return {take.names[joint.parent], take.names[joint.child]}


def sensors() -> skelgen.Poses:
    """A human of 15 limbs, a sensor on each."""
    truth, random = skelgen.simulate("human", seed=1, n_frames=500).truth, np.random.default_rng(0)
    mount = np.tile(np.eye(4), (truth.n_limbs, 1, 1))
    mount[:, :3, :3] = Rotation.from_rotvec(random.normal(size=(truth.n_limbs, 3))).as_matrix()
    mount[:, :3, 3] = 60 * random.normal(size=(truth.n_limbs, 3))
    world = truth.world_from_limb @ mount
    errors = TURN * random.normal(size=(*world.shape[:2], 3))
    world[..., :3, :3] @= Rotation.from_rotvec(errors.reshape(-1, 3)).as_matrix().reshape(*world.shape[:2], 3, 3)
    world[..., :3, 3] += SHIFT * random.normal(size=(*world.shape[:2], 3))
    return skelgen.Poses(world, truth.limb_names, truth.rate)


if __name__ == "__main__":
    main()
