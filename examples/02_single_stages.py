"""The stages one by one, with parameters: a project goes on where it ended, as often as you like.

    python examples/02_single_stages.py

Here two ways to find the limbs are compared, and two ways to fit the skeleton to the same limbs and joints.
"""

import numpy as np

import skelgen


def main() -> None:
    simulated = skelgen.simulate("human", seed=2, n_frames=300, noise=0.5)
    take, truth = simulated.take, simulated.truth

    by_rigidity = skelgen.reconstruct(take, until="limbs")
    n_limbs = by_rigidity.limbs.n_limbs
    spectral = {"limbs": {"method": "spectral"}}
    by_spectrum = skelgen.reconstruct(take, n_limbs=n_limbs, parameters=spectral, until="limbs")
    agree = np.array_equal(by_rigidity.limbs.limb_of_marker, by_spectrum.limbs.limb_of_marker)
    print(f"{n_limbs} limbs; spectral clustering finds {'the same' if agree else 'others'}")

    jointed = skelgen.reconstruct(by_rigidity, parameters={"joints": {"alpha": 0.05}}, until="joints")
    print(f"{jointed.topology.n_joints} joints; the root is limb {jointed.topology.roots[0]}")

    for fit in ("root-outward", "whole-chain"):
        motion = skelgen.reconstruct(jointed, parameters={"skeleton": {"fit": fit}}).motion
        from_truth = np.linalg.norm(motion.marker_positions - truth.marker_positions, axis=2).mean()
        print(f"{fit}: markers of the skeleton are {from_truth:.3f} mm from the truth on average")


if __name__ == "__main__":
    main()
