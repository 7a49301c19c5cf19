"""Every example runs from start to end, as a user starts it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).parent.parent / "examples").glob("*.py"))
LIMIT = 120  # s; each takes 1 to 3 s alone on a core, and must not hang where many tests share it


def run_example(script: Path, folder: Path) -> str:
    command = [sys.executable, str(script), str(folder)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=LIMIT, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("script", EXAMPLES, ids=lambda script: script.stem)
def test_example_runs_and_says_something(script, tmp_path):
    assert run_example(script, tmp_path).strip()


def test_every_example_says_how_to_start_it():
    for script in EXAMPLES:
        assert f"    python examples/{script.name}" in script.read_text(encoding="utf-8")
