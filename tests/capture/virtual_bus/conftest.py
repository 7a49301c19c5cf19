"""A virtual IEEE 1394 bus: libdc1394 as it is, with tests/capture/virtual_bus/fakefw.c preloaded, each in a process."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

HERE = Path(__file__).parent
ROOT = HERE.parents[2]
MAGIC = 0x31535746
HEAD = np.dtype(
    [(name, "<u4") for name in ("magic", "n_frames", "width", "height", "unplugged", "silent", "lose", "reserved")]
    + [("sent", "<u4", 4), ("lost", "<u4", 4)]
)
"""As struct state in fakefw.c."""


@pytest.fixture(scope="session")
def preload(tmp_path_factory) -> Path:
    """Compile the virtual bus."""
    compiler = shutil.which("gcc") or pytest.skip("no gcc to compile the virtual bus with")
    from skelgen.capture.sources.firewire.library import dc1394
    from skelgen.errors import CaptureError

    try:
        dc1394()
    except CaptureError as error:
        pytest.skip(str(error))
    target = tmp_path_factory.mktemp("bus") / "fakefw.so"
    flags = ["-O1", "-Wall", "-Werror", "-shared", "-fPIC"]
    made = subprocess.run(
        [compiler, *flags, str(HERE / "fakefw.c"), "-o", str(target), "-ldl", "-lpthread"],
        capture_output=True,
        text=True,
        check=False,
    )
    if "linux/firewire-cdev.h" in made.stderr:
        pytest.skip("no linux/firewire-cdev.h (package linux-libc-dev)")
    assert made.returncode == 0, made.stderr
    return target


class Bus:
    """A virtual bus: a file that the preloaded library shares with the test, and the programs that run on it."""

    def __init__(self, preload: Path, folder: Path) -> None:
        self._preload = preload
        self._folder = folder
        self.path = folder / "bus.bin"
        self.show(np.zeros((0, 2, 0, 0), np.uint8))

    def show(self, scene: np.ndarray) -> None:
        """Let the cameras send images, shape (n_frames, n_cameras, height, width), over and over."""
        head = np.zeros(1, HEAD)
        head[["magic", "n_frames", "width", "height"]] = (MAGIC, len(scene), scene.shape[3], scene.shape[2])
        self.path.write_bytes(head.tobytes() + scene.tobytes())
        self.state = np.memmap(self.path, HEAD, "r+", shape=(1,))

    def run(self, program: str, **settings: object) -> dict:
        """Run Python with `bus` (an open map of the state) and `found` (a dict that is handed back) on this bus."""
        before = (
            "import json, time, numpy as np\n"
            "from skelgen.capture.sources import open_source\n"
            "from skelgen.errors import SkelgenError\n"
            f"HEAD = np.dtype({HEAD.descr!r})\n"
            f"bus = np.memmap({str(self.path)!r}, HEAD, 'r+', shape=(1,))[0]\n"
            "found = {}\n"
        )
        environment = {
            **os.environ,
            "PYTHONPATH": os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]),
            "LD_PRELOAD": str(self._preload),
            "FAKEFW_STATE": str(self.path),
            **{f"FAKEFW_{name.upper()}": str(value) for name, value in ({"nodes": 2} | settings).items()},
        }
        ran = subprocess.run(
            [sys.executable, "-c", before + program + "\nprint(json.dumps(found))"],
            env=environment,
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        assert ran.returncode == 0, ran.stderr
        return {"stderr": ran.stderr, **json.loads(ran.stdout.splitlines()[-1])}

    def error(self, text: str, **settings: object) -> str:
        """Return what a source says that cannot be opened."""
        program = f"try:\n    with open_source({text!r}) as source:\n        next(iter(source))\n"
        program += "except SkelgenError as error:\n    found['error'] = str(error)"
        return self.run(program, **settings).get("error", "no error")


@pytest.fixture
def bus(preload, tmp_path) -> Bus:
    """A virtual bus with two cameras that send moving balls, and the frame's number in the first four bytes."""
    return Bus(preload, tmp_path)
