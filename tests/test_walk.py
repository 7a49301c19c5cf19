"""The walk through the code in docs/architecture.md names the files through which a take goes, and no others."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
FEW_LINES = 30
WAIT = 300  # s, of which most is compiling where nothing is compiled yet
FOLLOW = """
    import sys
    import threading
    from pathlib import Path
    import skelgen

    called = set()

    def watch(frame, event, argument):
        if event == "call" and frame.f_code.co_name != "<module>":
            called.add(frame.f_code.co_filename)

    faults = {"soft_tissue": "realistic", "noise": 0.3, "dropouts": 0.05}
    cloud = skelgen.simulate("human", n_frames=300, **faults, labelled=False).take
    skelgen.write(cloud, "walk.mfml")
    skelgen.write(skelgen.reconstruct(cloud), "walk.bvh")  # importing modules calls the bodies of their classes
    threading.setprofile(watch)
    sys.setprofile(watch)
    project = skelgen.reconstruct(skelgen.read("walk.mfml"))
    skelgen.write(project, "walk.bvh")
    sys.setprofile(None)
    for name in sorted(called):
        print(name)
"""


@pytest.fixture(scope="module")
def walked(tmp_path_factory) -> set[str]:
    """Files of the project in which a function was called, from reading an unlabelled take to writing its animation."""
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(FOLLOW)],
        cwd=tmp_path_factory.mktemp("walk"),
        env={"PYTHONPATH": ":".join(str(ROOT / name) for name in (".", "formats")), "PATH": ""},
        capture_output=True,
        text=True,
        timeout=WAIT,
        check=True,
    )
    paths = [Path(line) for line in done.stdout.splitlines()]
    return {
        path.relative_to(ROOT).as_posix() for path in paths if path.is_relative_to(ROOT) and ".venv" not in path.parts
    }


@pytest.fixture(scope="module")
def page() -> str:
    return (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")


def test_every_file_on_the_way_is_named(walked, page):
    named = set(re.findall(r"\*\*((?:skelgen|formats)/[\w/]+\.py)\*\*", page))
    assert len(walked) > 50
    assert sorted(walked - named) == []
    assert sorted(named - walked - {"skelgen/__init__.py"}) == []


def test_every_path_on_the_page_exists(page):
    paths = re.findall(r"`((?:skelgen|formats|gui|tests|docs)/[\w/.]+)`", page)
    assert [path for path in paths if not (ROOT / path).exists()] == []


def test_every_room_is_on_the_page(page):
    rooms = {path.parent for root in ("skelgen", "formats", "gui") for path in (ROOT / root).rglob("__init__.py")}
    told = {parent for place in _places(page) for parent in (place, *place.parents)}
    assert sorted(str(room.relative_to(ROOT)) for room in rooms if room.relative_to(ROOT) not in told) == []


def _places(page: str) -> set[Path]:
    """Paths in the first column of the table of rooms, those that follow beside them, and what is named within."""
    found = set()
    for row in page.partition("\n## Rooms\n")[2].partition("\n## ")[0].splitlines():
        if not row.startswith("| `"):
            continue
        place, holds = (re.findall(r"`([\w/.]+)`", cell) for cell in row.strip("| ").split(" | ", 1))
        beside = [Path(place[0]), *(Path(place[0]).parent / name for name in place[1:])]
        found |= {*beside, *(folder / name for folder in beside for name in holds)}
    return found


def test_every_file_of_few_lines_has_its_reason_on_the_page(page):
    reasons = page.partition("A file is a subject;")[2].partition("\n\n")[0]
    files = [path for root in ("skelgen", "formats", "gui") for path in (ROOT / root).rglob("*.py")]
    short = {path for path in files if path.name != "__init__.py" and _code_lines(path.read_text()) < FEW_LINES}
    assert sorted(path.relative_to(ROOT).as_posix() for path in short) == sorted(re.findall(r"`([\w/]+\.py)`", reasons))


def _code_lines(text: str) -> int:
    """Lines that are neither empty nor comments nor docstrings."""
    alone = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Expr)]
    texts = [node for node in alone if isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)]
    left_out = {line for node in texts for line in range(node.lineno, node.end_lineno + 1)}
    lines = enumerate(text.splitlines(), 1)
    return sum(bool(line.strip()) and not line.strip().startswith("#") and n not in left_out for n, line in lines)
