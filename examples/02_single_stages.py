"""The stages one by one, with parameters: what `skelgen.reconstruct` does in one call.

    python examples/02_single_stages.py

A stage is a pure function of the results of the stages before it, so that one of them can be replaced or compared with
another: here two ways to find the limbs, and two ways to fit the skeleton.
"""

from __future__ import annotations

import numpy as np

from skelgen.simulation import simulate
from skelgen.stages.joints import JointParameters, find_joints
from skelgen.stages.limbs import LimbParameters, find_limbs
from skelgen.stages.skeleton import SkeletonParameters, fit_skeleton


def main() -> None:
    simulated = simulate("human", seed=2, n_frames=300, noise=0.5)
    take, truth = simulated.take, simulated.truth

    by_rigidity = find_limbs(take)
    by_spectrum = find_limbs(take, LimbParameters(method="spectral"), n_limbs=by_rigidity.n_limbs)
    agree = np.array_equal(by_rigidity.limb_of_marker, by_spectrum.limb_of_marker)
    print(f"{by_rigidity.n_limbs} limbs; spectral clustering finds {'the same' if agree else 'others'}")

    topology = find_joints(take, by_rigidity, JointParameters(alpha=0.05))
    print(f"{topology.n_joints} joints; the root is limb {topology.roots[0]}")

    for fit in ("root-outward", "whole-chain"):
        _, motion = fit_skeleton(take, by_rigidity, topology, SkeletonParameters(fit=fit))
        from_truth = np.linalg.norm(motion.marker_positions - truth.marker_positions, axis=2).mean()
        print(f"{fit}: markers of the skeleton are {from_truth:.3f} mm from the truth on average")


if __name__ == "__main__":
    main()
