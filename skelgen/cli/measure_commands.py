"""The command `benchmark`: accuracy, speed and memory on this machine, as one page."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from skelgen.cli.options import AsJson, Quiet
from skelgen.cli.screen import Screen

if TYPE_CHECKING:
    from skelgen.capture.errors_by_distance import ErrorCurve, RigErrors

PageFile = Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="The page to write, HTML.")]
Suites = Annotated[
    list[str] | None,
    typer.Option(
        "--suite",
        metavar="NAME",
        help="labels, exact, joints, tissue, people, stereo, exports or speed; may be repeated.",
        show_default="all",
    ),
]
Quick = Annotated[bool, typer.Option("--quick", help="Fewer seeds and frames: two to three minutes.")]


Resume = Annotated[
    bool, typer.Option("--resume", help="Go on with a benchmark that was interrupted: finished suites are kept.")
]


def benchmark(
    output: PageFile = Path("benchmark.html"),
    suites: Suites = None,
    quick: Quick = False,
    resume: Resume = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Measure accuracy, speed and memory on this machine, beside what is wanted, and write a page."""
    from skelgen.benchmark import measure_page
    from skelgen.benchmark.machine import machine_line
    from skelgen.benchmark.page import counts_sentence

    screen = Screen(quiet, as_json)
    with screen.watching(counted=True) as monitor:
        sections, measured = measure_page(output, suites or (), quick=quick, resume=resume, monitor=monitor)
    for section in sections:
        for table in section.tables:
            names = [*table.columns[:-1], "verdict"]
            rows = [dict(zip(names, row, strict=True)) for row in table.rows]
            screen.table(f"{section.title}: {table.title}", rows)
    screen.say(f"{counts_sentence(sections)}; written: {output}")
    tables = {section.name: [vars(table) for table in section.tables] for section in sections}
    screen.json({"machine": machine_line(), "measured": measured, "sections": tables, "file": str(output)})


RIG = "rig"
"""What stands in the place of a result when a rig is to be evaluated; a project of this name is ``./rig``."""


def evaluate_rig(settings: Path, plot: Path | None, screen: Screen) -> None:
    """Print the standard deviations of points, bodies and joint angles; draw them if a file is named.

    Parameters
    ----------
    settings : Path
        Settings of the capture.
    plot : Path or None
        SVG file that shows the errors.
    screen : Screen
        Shows the tables.
    """
    from skelgen_formats.capture_settings import read_settings

    from skelgen.app.outputs import check_outputs
    from skelgen.capture.errors_by_distance import errors_by_distance

    check_outputs(() if plot is None else (plot,), (settings,), () if plot is None else (plot,))
    errors = errors_by_distance(read_settings(settings))
    screen.say(
        f"standard deviations for {errors.noise:g} px of noise in the images; distances from the cameras' middle"
    )
    for curve in errors.curves:
        screen.table(f"{curve.what.capitalize()} [{curve.unit}]", _rows(errors, curve))
    if plot is not None:
        from skelgen.app.report.curves import write_rig_errors

        write_rig_errors(errors, plot)
        screen.say(f"written: {plot}")
    curves = [{"what": curve.what, "unit": curve.unit, "rows": _rows(errors, curve)} for curve in errors.curves]
    screen.json({"noise_px": errors.noise, "distances_mm": errors.distances.tolist(), "curves": curves})


def _rows(errors: RigErrors, curve: ErrorCurve) -> list[dict[str, object]]:
    rows: list[dict[str, object]] = []
    for distance, row in zip(errors.distances, curve.std, strict=True):
        numbers = [round(float(value), 4) if math.isfinite(value) else None for value in row]
        rows.append({"distance [mm]": f"{distance:g}", **dict(zip(curve.columns, numbers, strict=True))})
    return rows
