"""Two cameras: images to points, bodies, joint angles, on a simulated rig with known truth.

    python examples/09_two_cameras.py [FOLDER]

`simulated:` may be replaced by any other source of pairs of images: cameras, videos, folders. Needs OpenCV:
`pip install 'skelgen-mocap[capture]'`.
"""

import importlib.util
import sys
from pathlib import Path

import numpy as np

import skelgen

N_PAIRS = 60


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")
    if importlib.util.find_spec("cv2") is None:
        print("needs OpenCV: pip install 'skelgen-mocap[capture]'")
        return
    with skelgen.simulated_rig("arm", n_frames=N_PAIRS, seed=1) as source:
        settings = source.settings
        skelgen.write(settings, folder / "rig.xml")
        angles: dict[str, list[np.ndarray]] = {}
        seen = errors = 0.0
        with skelgen.MotionCapture(settings) as capture:
            for index in range(N_PAIRS):
                pair, truth = source.render(index)
                captured = capture.see(pair)
                for name, angle in captured.angles.items():
                    angles.setdefault(name, []).append(np.degrees(angle.angles))
                seen += len(captured.bodies)
                apart = np.linalg.norm(captured.points.points[:, np.newaxis] - truth.points, axis=2)
                errors += float(np.median(apart.min(axis=1)))
    print(f"{seen / N_PAIRS:.1f} of {len(settings.bodies)} targets found per pair")
    print(f"points lie {errors / N_PAIRS:.3f} mm from the truth in the middle")
    for name, values in angles.items():
        print(f"{name}: known in {len(values)} of {N_PAIRS} pairs, moves by {np.ptp(values, axis=0).max():.1f} degrees")
    print(f"written: {folder / 'rig.xml'}; the same live: skelgen motion-capture rig.xml --source simulated:arm")


if __name__ == "__main__":
    main()
