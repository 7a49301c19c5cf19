"""Two virtual FireWire cameras, read for a minute: is a frame lost, are pairs of one moment, does memory grow?

    python tests/benchmarks/capture_firewire.py [seconds]

The virtual bus (tests/capture/virtual_bus/fakefw.c) stands in for the kernel; libdc1394 and everything above it are as
on real hardware. The bus counts what it sent and what it lost, and writes each frame's number into the images, so that
nothing is believed that the driver says of itself.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
SHIM = ROOT / "tests" / "capture" / "virtual_bus" / "fakefw.c"
RATE = 60
STATE = np.dtype([("head", "<u4", 8), ("sent", "<u4", 4), ("lost", "<u4", 4)])
MAGIC = 0x31535746
BUFFERS = 60  # a second: a computer that others use as well may be away for longer than a frame
FLAT = 1.0  # MB: three images are one


def main() -> None:
    """Build the bus and start over on it."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    with tempfile.TemporaryDirectory() as folder:
        shim, state = Path(folder) / "fakefw.so", Path(folder) / "bus.bin"
        subprocess.run(["gcc", "-O1", "-shared", "-fPIC", SHIM, "-o", shim, "-ldl", "-lpthread"], check=True)
        head = np.zeros(1, STATE)
        head["head"][0, 0] = MAGIC
        state.write_bytes(head.tobytes())
        paths = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
        bus = {"LD_PRELOAD": str(shim), "FAKEFW_STATE": str(state), "FAKEFW_NODES": "2", "PYTHONPATH": paths}
        program = [sys.executable, __file__, "--on-the-bus", str(round(seconds * RATE))]
        subprocess.run(program, env={**os.environ, **bus}, check=True)


def measure(n_pairs: int) -> None:
    """Read pairs and print wanted and reached."""
    from skelgen.capture.sources import open_source

    state = np.memmap(os.environ["FAKEFW_STATE"], STATE, "r", shape=(1,))[0]
    pairs, resident = np.zeros((n_pairs, 2), np.int64), np.zeros(n_pairs)  # made before: they are no leak
    used = time.process_time()
    with open_source(f"firewire:?rate={RATE}&order=every&buffers={BUFFERS}&frames={n_pairs}") as source:
        for at, pair in enumerate(source):
            pairs[at] = [image[0, :4].copy().view("<u4")[0] for image in (pair.left, pair.right)]
            resident[at] = resident_megabytes()
        n_lost = int(state["lost"][:2].sum())
    used = time.process_time() - used
    missing = int((np.diff(pairs[:, 0]) - 1).sum()) + source.n_dropped + n_lost
    torn = int((pairs[:, 0] != pairs[:, 1]).sum())
    tenth = n_pairs // 10
    grown = resident[-tenth:].max() - resident[tenth : 2 * tenth].max()  # each pair's images come and go
    print(f"two virtual FireWire cameras, 640 x 480 at {RATE} fps for {n_pairs / RATE:g} s, {len(pairs)} pairs")
    print(f"  {'':28s}{'wanted':>12s}{'reached':>12s}")
    print(f"  {'frames lost':28s}{'0':>12s}{missing:12d}")
    print(f"  {'pairs of two moments':28s}{'0':>12s}{torn:12d}")
    print(f"  {'worst skew of a pair':28s}{'< 1 ms':>12s}{source.worst_skew * 1e3:9.3f} ms")
    print(f"  {'growth of memory':28s}{f'< {FLAT:g} MB':>12s}{grown:9.2f} MB")
    print(f"  {'processor time a pair':28s}{'':12s}{used / len(pairs) * 1e3:9.2f} ms (the bus included)")


def resident_megabytes() -> float:
    """Return what of this process is in memory."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


if __name__ == "__main__":
    if sys.argv[1:2] == ["--on-the-bus"]:
        measure(int(sys.argv[2]))
    else:
        main()
