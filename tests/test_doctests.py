"""Every example in a docstring runs: those that need a file write it first."""

from __future__ import annotations

import doctest
import importlib
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
SOURCES = {"skelgen": ROOT, "skelgen_formats": ROOT / "formats", "skelgen_gui": ROOT / "gui"}
FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


def modules_with_examples() -> list[str]:
    files = [(path, root) for package, root in SOURCES.items() for path in sorted((root / package).rglob("*.py"))]
    found = [path.relative_to(root) for path, root in files if ">>> " in path.read_text(encoding="utf-8")]
    return [".".join(path.with_suffix("").parts).removesuffix(".__init__") for path in found]


@pytest.mark.parametrize("name", modules_with_examples())
def test_examples_give_what_they_show(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    outcome = doctest.testmod(importlib.import_module(name), optionflags=FLAGS)
    assert outcome.attempted > 0
    assert outcome.failed == 0


def test_no_example_is_skipped():
    files = [path for package, root in SOURCES.items() for path in (root / package).rglob("*.py")]
    assert [path for path in files if "doctest: +SKIP" in path.read_text(encoding="utf-8")] == []
