"""Commands around accuracy: `simulate` makes takes with known truth, `benchmark` measures by it.

Simulated bodies move at random or as somebody did. The benchmark measures accuracy, speed and memory on this machine,
as one page; the errors of a rig, which `evaluate` shows, are here as well.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from skelgen.cli.options import AsJson, Overwrite, Quiet, given, option, parameter_options
from skelgen.cli.screen import Screen, show_files
from skelgen.errors import ParameterError
from skelgen.parameters import ParameterValue

if TYPE_CHECKING:
    from skelgen.capture.errors_by_distance import ErrorCurve, RigErrors
    from skelgen.model.takes import BoneMotion
    from skelgen.simulation import RecordedBody

PageFile = Annotated[Path, option("--output -o", "FILE", "The page to write, HTML.")]
Suites = Annotated[
    list[str] | None,
    option(
        "--suite", "NAME", "labels, exact, joints, tissue, people, stereo, exports or speed; may be repeated.", "all"
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
    from skelgen.benchmark.page import counts_sentence, machine_line

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


def _motion_option(flag: str, metavar: str, text: str, default: str | bool) -> Any:
    return typer.Option(flag, metavar=metavar, help=text, show_default=default, rich_help_panel="Recorded motion")


MotionFile = Annotated[
    Path | None,
    option(
        "--motion",
        "walk|run|squat|reach|jump|FILE",
        "How a human moves; or, instead of a STRUCTURE, a file of bones and how they moved (BVH, AMC).",
        "at random",
    ),
]
MotionSkeleton = Annotated[
    Path | None, _motion_option("--motion-skeleton", "FILE", "The ASF that belongs to an AMC.", "found beside it")
]
MotionUnit = Annotated[
    str | None,
    _motion_option("--motion-unit", "UNIT", "Unit of a BVH: mm, cm, m, in, or a number of mm.", "by the body's size"),
]
MotionRate = Annotated[
    float | None, _motion_option("--motion-rate", "HZ", "Frame rate of the motion.", "as stated; 120 for AMC")
]


def simulate(
    output: Annotated[Path, option("--output -o", "FILE", "Take to write, in any format.")],
    structure: Annotated[
        str | None, typer.Argument(metavar="[STRUCTURE]", help="What moves: rods, human, quadruped, tree:8.")
    ] = None,
    motion: MotionFile = None,
    motion_skeleton: MotionSkeleton = None,
    motion_unit: MotionUnit = None,
    motion_rate: MotionRate = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the motion and of all faults.")] = 0,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    **values: ParameterValue | None,
) -> None:
    """Simulate a take of a given skeleton; the truth goes beside it as <name>.truth.npz."""
    from skelgen_formats.options import AUTO
    from skelgen_formats.registry import format_for_writing, read_motion

    from skelgen.app.files import write_any
    from skelgen.app.outputs import check_outputs
    from skelgen.simulation import TRUTH_SUFFIX, BoneParameters, write_truth
    from skelgen.simulation import simulate as simulated_take
    from skelgen.simulation.people import MOTIONS

    screen = Screen(quiet)
    options: dict[str, ParameterValue] = given(values)
    if motion is not None and str(motion) in MOTIONS:
        motion, options["motion"] = None, str(motion)
    elif motion is not None and not motion.suffix and not motion.exists():
        raise ParameterError(f"--motion {motion} is neither a file nor one of {', '.join(MOTIONS)}")
    if motion is None and options.keys() & {"motion", "marker_set", "height"}:
        structure = structure or "human"
    if (structure is None) == (motion is None):
        raise ParameterError("give either a STRUCTURE, which moves at random or by --motion walk, or --motion FILE")
    truth_file = output.parent / (output.stem + TRUTH_SUFFIX)
    check_outputs((output, truth_file), (motion, motion_skeleton), (output,), overwrite=overwrite)
    stated = {"motion_skeleton": motion_skeleton, "motion_unit": motion_unit, "motion_rate": motion_rate}
    of_bones = [entry.name for entry in BoneParameters.declarations() if entry.name in options]
    bone_options = {name: options.pop(name) for name in of_bones}
    moved: RecordedBody | str
    if motion is None:
        unused = [*given(stated), *bone_options]
        if unused:
            raise ParameterError(f"--{unused[0].replace('_', '-')} belongs to a recorded motion: --motion FILE")
        moved = str(structure)
    else:
        bones = read_motion(motion, motion_skeleton, motion_unit or AUTO, motion_rate)
        moved = _recorded(bones, bone_options, options.get("rate"))
        screen.note(moved.notices)
    kept = format_for_writing(output).keeps
    if "points" in kept and "names" not in kept and options.setdefault("labelled", False):
        raise ParameterError(f"{output.name} holds points without labels: leave --labelled out, or choose .c3d")
    simulated = simulated_take(moved, seed=seed, parameters=None, **options)
    files = write_any(simulated.take, output)
    show_files(screen, [*files, write_truth(simulated.truth, truth_file)])


def simulation_options() -> list[inspect.Parameter]:
    """Return the options that the simulation declares."""
    from skelgen.simulation import BoneParameters, SimulationParameters

    return [*parameter_options(SimulationParameters), *parameter_options(BoneParameters)]


def _recorded(bones: BoneMotion, options: Mapping[str, ParameterValue], rate: ParameterValue | None) -> RecordedBody:
    from skelgen.simulation import BoneParameters, SimulationParameters, recorded_body

    wanted = None if rate is None else SimulationParameters().replace(rate=rate).rate
    return recorded_body(bones, BoneParameters.from_mapping(options), wanted)
