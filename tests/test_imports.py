"""Imports point down only, as the contracts in pyproject.toml say; names are words of the field."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

PYPROJECT = Path(__file__).parent.parent / "pyproject.toml"
BENCHMARKS = Path(__file__).with_name("benchmarks")
STAGES = PYPROJECT.parent / "skelgen" / "stages"


def test_imports_keep_the_contracts(monkeypatch, capsys):
    pytest.importorskip("importlinter", reason="import-linter is not installed: pip install 'skelgen-mocap[dev]'")
    from importlinter.cli import EXIT_STATUS_SUCCESS, lint_imports

    monkeypatch.chdir(PYPROJECT.parent)
    status = lint_imports(config_filename=str(PYPROJECT), no_cache=True)
    assert status == EXIT_STATUS_SUCCESS, capsys.readouterr().out


def _modules_of_stages(path: Path) -> list[tuple[str, ...]]:
    """Imported modules below `skelgen.stages`, as ``(stage, submodule, ...)``."""
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        found += [tuple(name.split(".")[2:]) for name in names if name.startswith("skelgen.stages.")]
    return found


def test_a_stage_uses_another_by_its_public_functions_only():
    # The classic methods are modules of their own: a stage calls the one that the user chooses.
    private = [
        f"{path.relative_to(STAGES)}: skelgen.stages.{'.'.join(module)}"
        for path in sorted(STAGES.rglob("*.py"))
        for module in _modules_of_stages(path)
        if len(module) > 1 and module[0] not in {path.relative_to(STAGES).parts[0], "classic"}
    ]
    assert not private


def test_benchmarks_import_what_stands_in_the_scripts_beside_them():
    scripts = {path.stem: ast.parse(path.read_text()) for path in BENCHMARKS.glob("*.py")}
    imports = [
        (name, node.module, one.name)
        for name, tree in scripts.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module in scripts
        for one in node.names
    ]
    assert imports
    assert [one for one in imports if one[2] not in _names_in(scripts[one[1]])] == []


def _names_in(tree):
    """What a script assigns, defines or imports."""
    names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.ImportFrom):
            names |= {one.asname or one.name for one in node.names}
    return names


NO_NAMES = {"told", "said", "heard", "wishes", "likeness", "weighing", "judged", "oddities", "obedience", "by_hand"}
NO_NAMES |= {"easel", "warming", "outlook", "second_look", "trusted", "stray", "sliding", "arrow", "pull", "dilution"}


def _given_names(path: Path) -> set[str]:
    """Every name that a file gives: of functions, classes, arguments and variables, without underscores around it."""
    nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
    names = [node.name for node in nodes if isinstance(node, ast.FunctionDef | ast.ClassDef)]
    names += [node.arg for node in nodes if isinstance(node, ast.arg)]
    names += [node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)]
    return {name.strip("_").lower() for name in names}


@pytest.mark.parametrize(
    "room", ["app", "cli", "model", "kinematics", "capture", "simulation", "stages/limbs", "stages/joints"]
)
def test_names_are_words_of_the_field(room):
    found = {path.name: _given_names(path) & NO_NAMES for path in (PYPROJECT.parent / "skelgen" / room).rglob("*.py")}
    assert {name: words for name, words in found.items() if words} == {}


UNCHECKED = {"read_json": "what another program may have written", "table": "a readable table of a motion"}
"""What holds values of any type across a boundary, and why."""


def _bundles_in(path: Path) -> set[str]:
    """Public functions, fields and constants of a file whose annotations are a dict, mapping or tuple of anything."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    scopes = [tree, *(node for node in ast.walk(tree) if isinstance(node, ast.ClassDef))]
    stated = {(node, node.annotation) for scope in scopes for node in scope.body if isinstance(node, ast.AnnAssign)}
    for node in (node for scope in scopes for node in scope.body if isinstance(node, ast.FunctionDef)):
        arguments = [*node.args.args, *node.args.kwonlyargs, *filter(None, (node.args.vararg, node.args.kwarg))]
        stated |= {(node, part) for part in (node.returns, *(one.annotation for one in arguments)) if part}
    bundles = [node for node, part in stated if ast.unparse(part).endswith(("[str, Any]", "[Any, ...]"))]
    bundles += [node for node, part in stated if isinstance(node, ast.FunctionDef) and node.args.kwarg is not None
                and node.args.kwarg.annotation is part and ast.unparse(part) == "Any"]  # fmt: skip
    return {node.name if isinstance(node, ast.FunctionDef) else ast.unparse(node.target) for node in bundles}


@pytest.mark.parametrize("room", ["app", "benchmark", "evaluation", "kinematics", "simulation"])
def test_no_bundle_of_anything_crosses_a_boundary(room):
    found = {name for path in (PYPROJECT.parent / "skelgen" / room).rglob("*.py") for name in _bundles_in(path)}
    assert {name for name in found if not name.startswith("_")} - UNCHECKED.keys() == set()
