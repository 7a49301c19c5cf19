"""`skelgen simulate`: takes with known truth, of bodies that move at random or as somebody did."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from skelgen.cli.options import Quiet, given, parameter_options
from skelgen.cli.screen import Screen, show_files
from skelgen.errors import ParameterError

if TYPE_CHECKING:
    from skelgen.simulation import RecordedBody

_PANEL = "Recorded motion"

MotionFile = Annotated[
    Path | None,
    typer.Option(
        "--motion",
        metavar="FILE",
        help="Instead of a STRUCTURE: bones and how they moved (BVH, AMC).",
        show_default=False,
        rich_help_panel=_PANEL,
    ),
]
MotionSkeleton = Annotated[
    Path | None,
    typer.Option(
        "--motion-skeleton",
        metavar="FILE",
        help="The ASF that belongs to an AMC.",
        show_default="found beside it",
        rich_help_panel=_PANEL,
    ),
]
MotionUnit = Annotated[
    str | None,
    typer.Option(
        "--motion-unit",
        metavar="UNIT",
        help="Unit of a BVH: mm, cm, m, in, or a number of mm.",
        show_default="by the body's size",
        rich_help_panel=_PANEL,
    ),
]
MotionRate = Annotated[
    float | None,
    typer.Option(
        "--motion-rate",
        metavar="HZ",
        help="Frame rate of the motion.",
        show_default="as stated; 120 for AMC",
        rich_help_panel=_PANEL,
    ),
]


def simulate(
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="Take to write, in any format.")],
    structure: Annotated[
        str | None, typer.Argument(metavar="[STRUCTURE]", help="What moves: rods, human, quadruped, tree:8.")
    ] = None,
    motion: MotionFile = None,
    motion_skeleton: MotionSkeleton = None,
    motion_unit: MotionUnit = None,
    motion_rate: MotionRate = None,
    seed: Annotated[int, typer.Option("--seed", help="Seed of the motion and of all faults.")] = 0,
    quiet: Quiet = False,
    **values: Any,
) -> None:
    """Simulate a take of a given skeleton; the truth goes beside it as <name>.truth.npz."""
    from skelgen.app.face import write
    from skelgen.simulation import TRUTH_SUFFIX, BoneParameters, write_truth
    from skelgen.simulation import simulate as simulated_take

    if (structure is None) == (motion is None):
        raise ParameterError("give either a STRUCTURE, which moves at random, or --motion FILE")
    options, screen = given(values), Screen(quiet)
    stated = {"motion_skeleton": motion_skeleton, "motion_unit": motion_unit, "motion_rate": motion_rate}
    of_bones = [entry.name for entry in BoneParameters.declarations() if entry.name in options]
    bone_options = {name: options.pop(name) for name in of_bones}
    moved: RecordedBody | str
    if motion is None:
        _refuse(given(stated) | bone_options)
        moved = str(structure)
    else:
        moved = _recorded(motion, given(stated), bone_options, options.get("rate"))
        screen.note(moved.notices)
    simulated = simulated_take(moved, seed=seed, **options)
    files = write(simulated.take, output)
    files.append(write_truth(simulated.truth, output.with_name(output.stem + TRUTH_SUFFIX)))
    show_files(screen, files)


def simulation_options() -> list[inspect.Parameter]:
    """Return the options that the simulation declares."""
    from skelgen.simulation import BoneParameters, SimulationParameters

    return [*parameter_options(SimulationParameters), *parameter_options(BoneParameters)]


def _refuse(bone_options: dict[str, Any]) -> None:
    if bone_options:
        flag = "--" + next(iter(bone_options)).replace("_", "-")
        raise ParameterError(f"{flag} belongs to a recorded motion: --motion FILE")


def _recorded(motion: Path, stated: dict[str, Any], bone_options: dict[str, Any], rate: float | None) -> RecordedBody:
    from skelgen_formats.registry import read_motion

    from skelgen.simulation import BoneParameters, SimulationParameters, recorded_body

    if rate is not None:
        rate = SimulationParameters(rate=rate).rate
    bones = read_motion(motion, **{name.removeprefix("motion_"): value for name, value in stated.items()})
    return recorded_body(bones, BoneParameters.from_mapping(bone_options), rate)
