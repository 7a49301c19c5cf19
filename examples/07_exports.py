"""One result for many programs: axes, unit and frame rate are options of every format.

    python examples/07_exports.py [FOLDER]

`skelgen formats` lists all formats; `skelgen convert` does the same from the command line.
"""

import importlib.util
import sys
from pathlib import Path

import skelgen

EXPORTS = (
    ("walk.bvh", {"axes": "z-to-y", "unit": "cm", "rate": 30.0}),  # Blender, Unreal, MotionBuilder
    ("walk.glb", {}),  # game engines, browsers
    ("walk.usda", {}),  # film pipelines
    ("walk.osim", {"axes": "auto"}),  # OpenSim: model, motion, markers, setup
    ("walk.urdf", {}),  # robots
    ("walk.mjcf.xml", {}),  # MuJoCo
    ("walk.joints.c3d", {}),  # C3D with the joints as virtual points
    ("walk.table.csv", {}),  # pandas, R, a spreadsheet
)
NEEDS = {".usda": "pxr"}  # extra `usd`


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")
    project = skelgen.reconstruct(skelgen.simulate("quadruped", seed=1, n_frames=200, noise=0.3).take)
    for name, options in EXPORTS:
        module = NEEDS.get(Path(name).suffix)
        if module and importlib.util.find_spec(module) is None:
            print(f"{name}: not written, {module} is not installed")
            continue
        files = skelgen.write(project, folder / name, **options)
        print(f"{name}: {', '.join(path.name for path in files)}")


if __name__ == "__main__":
    main()
