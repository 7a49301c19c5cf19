"""The table of formats, for the command line's help and for docs/formats.md."""

from __future__ import annotations

from skelgen_formats.registry import Format, Option, known_formats

COLUMNS = ("name", "title", "suffixes", "holds", "read", "write", "options", "note")
"""Titles of the table's columns."""

_HEAD = """# File formats

Generated from the formats' declarations by `skelgen_formats.table.formats_markdown`; do not edit by hand.

A file is recognised by its content first and by its suffix second; `--format NAME` skips that. Inside skelgen
everything is in mm, s and rad; a reader converts from the unit that the file names. Unseen markers are NaN inside.
"""


def formats_table() -> list[tuple[str, ...]]:
    """Return one row of texts per format, in the order of `COLUMNS`."""
    return [_row(entry) for entry in known_formats()]


def formats_markdown() -> str:
    """Return the text of docs/formats.md."""
    rows = [COLUMNS, tuple("---" for _ in COLUMNS), *formats_table()]
    table = "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows)
    options = "\n".join(
        f"- **{entry.name}** {_described(option)}" for entry in known_formats() for option in entry.options
    )
    return f"{_HEAD}\n{table}\n\n## Options\n\n{options}\n"


def _row(entry: Format) -> tuple[str, ...]:
    return (
        entry.name,
        entry.title,
        " ".join(entry.suffixes),
        entry.holds,
        "yes" if entry.read else "",
        "yes" if entry.write else "",
        ", ".join(option.name for option in entry.options),
        entry.note,
    )


def _described(option: Option) -> str:
    choices = f" ({' | '.join(option.choices)})" if option.choices else ""
    return f"`{option.name}`, default `{option.default}`{choices}: {option.help}"
