"""GigE Vision cameras of the package aravis-tools, on the loopback of a network namespace of their own."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
CAMERA = "arv-fake-gv-camera-0.8"
BEFORE = """
import json, subprocess, time
from skelgen.capture.sources import open_source
from skelgen.errors import SkelgenError
subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
cameras = []
for address in {addresses}:
    if address != "127.0.0.1":
        subprocess.run(["ip", "addr", "add", address + "/8", "dev", "lo"], check=True)
    cameras.append(subprocess.Popen([{camera!r}, "-i", address, "-s", address]))
time.sleep(0.5)
found = {{}}
try:
{program}
finally:
    for camera in cameras:
        camera.kill()
print(json.dumps(found))
"""


@pytest.fixture
def network():
    """Run Python with `found` beside cameras at the given addresses."""
    pytest.importorskip("viva_genicam", reason="the extra gige is not installed")
    for tool, package in ((CAMERA, "aravis-tools"), ("unshare", "util-linux"), ("ip", "iproute2")):
        if shutil.which(tool) is None:
            pytest.skip(f"no {tool} (package {package})")
    if subprocess.run(["unshare", "-n", "ip", "link", "set", "lo", "up"], capture_output=True, check=False).returncode:
        pytest.skip("this machine allows no network namespace (unshare -n), which two cameras on loopback need")

    def run(program, addresses=("127.0.0.1", "127.0.0.2")):
        body = "".join(f"    {line}\n" for line in program.strip().splitlines())
        ran = subprocess.run(
            ["unshare", "-n", sys.executable, "-c", BEFORE.format(addresses=addresses, camera=CAMERA, program=body)],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))},
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        assert ran.returncode == 0, ran.stderr
        return json.loads(ran.stdout.splitlines()[-1])

    return run
