"""Imports point down only: the contracts in pyproject.toml, checked by import-linter."""

from __future__ import annotations

from pathlib import Path

import pytest

PYPROJECT = Path(__file__).parent.parent / "pyproject.toml"


def test_imports_keep_the_contracts(monkeypatch, capsys):
    pytest.importorskip("importlinter", reason="import-linter is not installed: pip install 'skelgen[dev]'")
    from importlinter.cli import EXIT_STATUS_SUCCESS, lint_imports

    monkeypatch.chdir(PYPROJECT.parent)
    status = lint_imports(config_filename=str(PYPROJECT), no_cache=True)
    assert status == EXIT_STATUS_SUCCESS, capsys.readouterr().out
