"""Markers in every format that is written, read back and compared.

    python examples/03_formats.py [FOLDER]

Lengths are in mm and unseen markers are NaN inside, whatever unit and sign for "unseen" the file has.
"""

import sys
from pathlib import Path

import numpy as np

import skelgen


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")
    take = skelgen.simulate("rods", n_frames=200, noise=0.5, dropouts=0.05).take

    for suffix in ("c3d", "trc", "csm"):
        (path,) = skelgen.write(take, folder / f"rods.{suffix}")
        back = skelgen.read(path)
        same_gaps = np.array_equal(np.isnan(back.positions), np.isnan(take.positions))
        largest = np.nanmax(np.abs(back.positions - take.positions))
        gaps = "the same gaps" if same_gaps else "other gaps"
        print(f"{path.name}: {path.stat().st_size} bytes, {gaps}, largest difference {largest:.2g} mm")

    # Points without labels have a format of their own; each frame holds its own number of them.
    cloud = skelgen.simulate("rods", n_frames=200, dropouts=0.05, ghosts=0.5, labelled=False).take
    (path,) = skelgen.write(cloud, folder / "rods.mfml")
    back = skelgen.read(path)
    print(f"{path.name}: {back.n_points} points in {back.n_frames} frames at {back.rate:.0f} Hz")


if __name__ == "__main__":
    main()
