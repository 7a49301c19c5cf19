"""The tables of parameters, for docs/parameters.md."""

from __future__ import annotations

from typing import Any

from skelgen.app.configuration import all_parameter_classes
from skelgen.parameters import Declaration, StageParameters

COLUMNS = ("name", "type", "default", "allowed", "in config.xml", "what it does")
"""Titles of the tables' columns."""

_HEAD = """# Parameters

Generated from the stages' declarations by `skelgen.app.parameter_table.parameters_markdown`; do not edit by hand.

Every parameter has a default that suits most takes. It can be changed in three ways, each of which checks it before
any stage starts:

- an option of the stage's own command: `skelgen joints limbs.skelgen --alpha 0.2`;
- `--set stage.name=value` of `skelgen run`, as often as needed: `skelgen run take.c3d --set joints.alpha=0.2`;
- a file: `skelgen config --write config.xml` writes all defaults with their help as comments, and
  `skelgen run take.c3d --config config.xml` reads them. Unknown names, wrong types and values out of bounds are errors
  that name the line.

From Python: `skelgen.reconstruct(take, parameters={"joints": {"alpha": 0.2}})`.

"The seed" is the thesis of Schönauer (2007), from whose tables 4.13-4.16 the names in config.xml come where it has one.
"""


_CAPTURE = """They belong to a stereo capture and are set in its [settings](capture/settings.md):
`<detection><parameter name="min_area" value="25"/></detection>`."""


def parameters_markdown() -> str:
    """Return the text of docs/parameters.md."""
    from skelgen.capture.detection import DetectionParameters  # noqa: PLC0415 - a second, and few ask for it

    sections = [_section(declared) for declared in all_parameter_classes()]
    return "\n".join([_HEAD, *sections, _section(DetectionParameters, _CAPTURE)])


def _section(declared: type[StageParameters], set_by: str = "") -> str:
    """One table; parameters that are set elsewhere than in config.xml have no place there."""
    summary = (declared.__doc__ or "").partition("\n")[0]
    rows = [COLUMNS, tuple("---" for _ in COLUMNS), *(_row(entry, declared) for entry in declared.declarations())]
    if set_by:
        summary, place = f"{summary}\n{set_by}", COLUMNS.index("in config.xml")
        rows = [row[:place] + row[place + 1 :] for row in rows]
    table = "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows)
    return f"## {declared.stage}\n\n{summary}\n\n{table}\n"


def _row(entry: Declaration, declared: type[StageParameters]) -> tuple[str, ...]:
    place = "/".join((entry.config_section or declared.config_section, entry.config_name or entry.name.upper()))
    allowed = entry.bounds.replace(" .. inf", " or more")
    default = f"{_text(entry.default)} {entry.unit}".strip()
    return (f"`{entry.name}`", entry.kind.__name__, default, allowed, f"`{place}`", entry.help.rstrip("."))


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:g}" if isinstance(value, float) else str(value)
