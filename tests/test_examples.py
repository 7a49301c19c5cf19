"""Every example runs from start to end, as a user starts it."""

from __future__ import annotations

import ast
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


def test_examples_need_the_face_alone():
    for script in EXAMPLES:
        nodes = list(ast.walk(ast.parse(script.read_text(encoding="utf-8"))))
        names = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
        sources = {str(node.module) for node in nodes if isinstance(node, ast.ImportFrom)}
        assert {name for name in names | sources if name.startswith("skelgen")} == {"skelgen"}, script
