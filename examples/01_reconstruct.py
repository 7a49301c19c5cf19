"""From labelled markers to a skeleton: read a take, find the skeleton, look at it, write it.

    python examples/01_reconstruct.py [FOLDER]

The take is simulated; any recording in a known format can stand in its place. Files go to FOLDER (default:
out/examples).
"""

import sys
from pathlib import Path

import skelgen

STRUCTURE = "quadruped"  # 17 limbs, three markers each


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")
    simulated = skelgen.simulate(STRUCTURE, seed=1, n_frames=400, noise=0.3)
    skelgen.write(simulated.take, folder / "walk.c3d")

    take = skelgen.read(folder / "walk.c3d")
    project = skelgen.reconstruct(take)
    skeleton, motion = project.skeleton, project.motion

    print(f"{take.n_markers} markers on {skeleton.n_limbs} limbs; {motion.n_frames} frames")
    for joint in skeleton.joints:
        print(f"limb {joint.parent:2d} - limb {joint.child:2d}: {joint.kind}")
    for (first, second), length in skeleton.lengths.items():
        print(f"joint {first:2d} to joint {second:2d}: {length:.1f} mm")

    for name in ("walk.xml", "walk.xsf", "walk.joints.csv", "walk.skelgen"):
        for path in skelgen.write(project, folder / name):
            print(f"written: {path}")


if __name__ == "__main__":
    main()
