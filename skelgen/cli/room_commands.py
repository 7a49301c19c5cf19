"""`skelgen calibrate room`: the cameras of a room, calibrated with a wand or a board."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from skelgen.cli.options import AsJson, Calibrated, Quiet, Square
from skelgen.cli.screen import Screen
from skelgen.errors import InputError

if TYPE_CHECKING:
    from skelgen.capture.room.calibrate import WandCalibration

SETTINGS = Path("room.xml")


def room(
    source: Annotated[str, typer.Argument(metavar="SOURCE", help="Where the images of the waved wand come from.")],
    wand: Annotated[
        str, typer.Option("--wand", metavar="MM,MM,MM", help="Where its two or three balls are along the wand.")
    ] = "0,180,500",
    ground: Annotated[
        str | None, typer.Option("--ground", metavar="SOURCE", help="Images of the L-frame on the floor.")
    ] = None,
    arms: Annotated[
        str,
        typer.Option("--arms", metavar="MM,MM", help="Arms of the L-frame, and the third side of other triangles."),
    ] = "600,400",
    board: Annotated[
        str | None,
        typer.Option("--board", metavar="9x6", help="A chessboard instead of the wand, or charuco:10x7:4X4_50."),
    ] = None,
    square: Square = 25.0,
    marker: Annotated[
        float | None, typer.Option("--marker", metavar="MM", help="Side of a marker, else 3/4 of a square.")
    ] = None,
    output: Calibrated = SETTINGS,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Calibrate two to sixteen cameras around a room with a wand that is waved through it, or with a board."""
    from skelgen.app.room import Ground, calibrate_room, calibrate_room_by_boards, save_room
    from skelgen.capture.room.boards import room_board

    screen = Screen(quiet, as_json)
    distances, floor = _numbers(wand, "--wand"), _numbers(arms, "--arms")
    lying = Ground(ground, floor) if ground else None
    with screen.watching() as monitor:
        if board is None:
            settings, found = calibrate_room(source, distances, lying, monitor)
        else:
            settings, found = calibrate_room_by_boards(source, room_board(board, square, marker), lying, monitor)
    save_room(settings, output)
    rows = _camera_rows(found)
    screen.table("Cameras", rows)
    for sentence in found.verdict.sentences:
        screen.say(sentence)
    if not ground:
        screen.note(
            ["the world is the first camera's frame: lay an L-frame on the floor and give its images: --ground"]
        )
    screen.say(f"written: {output}")
    screen.json(
        {
            "file": str(output),
            "grade": found.verdict.grade,
            "verdict": list(found.verdict.sentences),
            "noise_px": found.rig.noise,
            "point_std_mm": found.point_std,
            "scale_std": found.scale_std,
            "cameras": rows,
        }
    )


def _camera_rows(found: WandCalibration) -> list[dict[str, str | int | float]]:
    """Each camera with the deviations of its numbers, as the table and JSON show it."""
    import numpy as np

    rig = found.rig
    return [
        {
            "camera": camera.name,
            "views": int(views),
            "fx [px]": f"{camera.matrix[0, 0]:.2f} +- {std[0]:.2f}",
            "fy [px]": f"{camera.matrix[1, 1]:.2f} +- {std[1]:.2f}",
            "place [mm]": ", ".join(f"{value:.1f}" for value in place),
            "+- [mm]": round(float((std[12:] ** 2).sum() ** 0.5), 3),
        }
        for camera, views, std, place in zip(rig.cameras, found.n_views, np.asarray(rig.std), rig.places, strict=True)
    ]


def _numbers(text: str, option: str) -> list[float]:
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) not in {2, 3}:
        raise InputError(f"{option} is {text!r}; two or three numbers in mm belong there, with commas between them")
    return values
