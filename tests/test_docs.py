"""What the documentation says is there: generated pages, links, commands, options, the commands of the README."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer

from docs.generated import parameters_markdown
from skelgen.cli.application import build_app

ROOT = Path(__file__).parent.parent
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
LINK = re.compile(r"\]\((?!https?:)([^)#]+)")


def calls(page: Path) -> list[str]:
    """What follows `skelgen` in code: fenced blocks, indented blocks and inline code."""
    text = page.read_text(encoding="utf-8")
    fenced = re.findall(r"^```[a-z]*\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)
    inline = re.findall(r"`([^`\n]+)`", re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE))
    lines = [line for block in fenced for line in block.splitlines()] + inline
    commands = (re.match(r"(?:\$ )?(?:\.venv/bin/)?skelgen ([a-z]+.*)", line.strip()) for line in lines)
    return [found.group(1) for found in commands if found]


@pytest.fixture(scope="module")
def known_options():
    """The options of every command."""

    def options_of(name: str) -> set[str]:
        command = typer.main.get_command(build_app(called=name)).commands[name]
        inside = getattr(command, "commands", {}).values()  # of a group, such as `calibrate`
        entries = [*command.params, *(entry for member in inside for entry in member.params)]
        return {option for entry in entries for option in (*entry.opts, *entry.secondary_opts)} | {"--help"}

    names = typer.main.get_command(build_app()).commands
    return {name: options_of(name) for name in names}


def test_parameters_page_is_generated_from_the_declarations():
    page = ROOT / "docs" / "parameters.md"
    assert page.read_text(encoding="utf-8") == parameters_markdown(), "run python docs/generated.py"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_to_files(page):
    missing = [link for link in LINK.findall(page.read_text(encoding="utf-8")) if not (page.parent / link).exists()]
    assert missing == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_and_options_in_the_text_exist(page, known_options):
    for call in calls(page):
        name, *words = call.partition(" #")[0].split()
        assert name in known_options, f"skelgen {call}"
        options = {word.partition("=")[0] for word in words if re.match(r"--?[a-z]", word)}
        assert options <= known_options[name], f"skelgen {call}"


def test_every_command_has_its_place_in_the_reference(known_options):
    text = (ROOT / "docs" / "cli.md").read_text(encoding="utf-8")
    assert [name for name in known_options if f"skelgen {name}" not in text] == []


def test_every_page_is_reached_from_the_index():
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    pages = {str(page.relative_to(ROOT / "docs")) for page in PAGES[1:]} - {"index.md"}
    assert pages - set(LINK.findall(index)) == set()


def test_continuous_integration_runs_the_test_command_of_the_readme():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    commands = re.findall(r"^    (bash \.ci/\w+)$", text, flags=re.MULTILINE)
    assert commands == ["bash .ci/demo", "bash .ci/test"]
    assert commands[1] in (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()


def test_notes_quoted_by_symptom_are_those_of_the_program():
    """Quotations of `…`-separated pieces: every piece stands in a text of the sources, whatever its line breaks."""
    page = (ROOT / "docs" / "how-to" / "wrong-skeleton.md").read_text(encoding="utf-8")
    files = [file for folder in ("skelgen", "formats") for file in (ROOT / folder).rglob("*.py")]
    texts = "\n".join(re.sub(r'"\s*\n\s*f?"', "", file.read_text(encoding="utf-8")) for file in files)
    quoted = re.findall(r"^> (.*)$", page, flags=re.MULTILINE)
    pieces = [piece.strip(" ,()") for line in quoted for piece in re.split("…", line)]
    assert len(quoted) > 15
    assert [piece for piece in pieces if piece and piece not in texts] == []


def test_public_functions_of_several_arguments_describe_them():
    # Docstrings of commands are left out: they are their help, and options are declared with a help of their own.
    files = [path for name in ("skelgen", "formats") for path in sorted((ROOT / name).rglob("*.py"))]
    without = [
        f"{path.relative_to(ROOT)}: {function.name}"
        for path in files
        if "cli" not in path.parts
        for function in _public_functions(ast.parse(path.read_text(encoding="utf-8")))
        if _n_arguments(function) > 1 and "Parameters" not in (ast.get_docstring(function) or "")
    ]
    assert without == []


def _public_functions(node: ast.AST) -> Iterator[ast.FunctionDef]:
    """Functions of a module and methods of its classes whose names begin with a letter."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef) and not child.name.startswith("_"):
            yield child
        elif isinstance(child, ast.ClassDef) and not child.name.startswith("_"):
            yield from _public_functions(child)


def _n_arguments(function: ast.FunctionDef) -> int:
    arguments = function.args.posonlyargs + function.args.args + function.args.kwonlyargs
    return sum(argument.arg not in {"self", "cls"} for argument in arguments)
