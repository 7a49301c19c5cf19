"""The table of formats, for the command line's help and for docs/formats.md."""

from __future__ import annotations

from skelgen_formats.parts import PARTS
from skelgen_formats.registry import Format, Option, known_formats

COLUMNS = ("name", "title", "suffixes", "holds", "read", "write", "options", "note")
"""Titles of the table's columns."""

_HEAD = """# File formats

Generated from the formats' declarations by `skelgen_formats.table.formats_markdown`; do not edit by hand.

A file is recognised by its content first and by its suffix second; `--format NAME` skips that. Inside skelgen
everything is in mm, s and rad; a reader converts from the unit that the file names. Unseen markers are NaN inside.
Beside these formats `skelgen` reads its own [project file](project-file.md), and settings of a stereo capture, whose
images become points ([from images to a skeleton](capture/pipeline.md)).
What is read "as motion" holds bones without markers: `skelgen simulate --motion` [puts markers on
them](how-to/motions.md).
"""

_KEPT_HEAD = """## What a written file keeps

All else that a project holds is lost; the project file `.skelgen` keeps everything.
"""


def formats_table() -> list[tuple[str, ...]]:
    """Return one row of texts per format, in the order of `COLUMNS`."""
    return [format_row(entry) for entry in known_formats()]


def formats_markdown() -> str:
    """Return the text of docs/formats.md."""
    rows = [COLUMNS, tuple("---" for _ in COLUMNS), *formats_table()]
    table = "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows)
    options = "\n".join(
        f"- **{entry.name}** {_described(option)}" for entry in known_formats() for option in entry.options
    )
    return f"{_HEAD}\n{table}\n\n## Options\n\n{options}\n\n{_KEPT_HEAD}\n{_kept_table()}\n"


def _kept_table() -> str:
    written = [entry for entry in known_formats() if entry.write is not None]
    rows = [("", *(entry.name for entry in written)), ("---",) * (len(written) + 1)]
    rows += [(part.title, *("yes" if part.name in entry.keeps else "" for entry in written)) for part in PARTS]
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def format_row(entry: Format) -> tuple[str, ...]:
    """Return the texts of one format, in the order of `COLUMNS`."""
    return (
        entry.name,
        entry.title,
        " ".join(entry.suffixes),
        entry.holds,
        "yes" if entry.read else "as motion" if entry.read_motion else "",
        "yes" if entry.write else "",
        ", ".join(option.name for option in entry.options),
        entry.note,
    )


def _described(option: Option) -> str:
    choices = f" ({' | '.join(option.choices)})" if option.choices else ""
    return f"`{option.name}`, default `{option.default}`{choices}: {option.help}"
