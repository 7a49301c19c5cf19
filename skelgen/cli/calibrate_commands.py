"""`skelgen calibrate`: cameras, targets and joints for captures, and one skeleton from several takes of a body."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from skelgen.cli.options import AsJson, Calibrated, Config, FormatName, Methods, Overwrite, Quiet, Seed, Square, option
from skelgen.cli.screen import Screen, show_results
from skelgen.errors import InputError

if TYPE_CHECKING:
    from skelgen.capture.calibration.stereo import StereoCalibration
    from skelgen.capture.room.calibrate import WandCalibration
    from skelgen.model.rig import BodyTarget

SETTINGS = Path("rig.xml")
STRUCTURE = "arm"


def stereo(
    images: Annotated[
        list[Path], typer.Argument(metavar="LEFT... RIGHT...", help="All left images, then all right ones.")
    ],
    board: Annotated[str, option("--board", "9x6", "Inner corners of the chessboard.")] = "9x6",
    square: Square = 25.0,
    lens: Annotated[str, typer.Option("--lens", help="Lens model: auto, radial, tangential or full.")] = "auto",
    output: Calibrated = SETTINGS,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Calibrate two cameras from pairs of images of a chessboard."""
    from skelgen_formats.capture_settings import read_settings, write_settings

    from skelgen.app.outputs import check_outputs
    from skelgen.capture.calibration.chessboard import board_from_text
    from skelgen.capture.calibration.stereo import calibrate_stereo, camera_rows
    from skelgen.model.rig import CaptureSettings

    screen = Screen(quiet, as_json)
    what = board_from_text(board, square)
    left, right = split_pairs(images)
    check_outputs((output,), images, (output,))
    before = read_settings(output) if output.exists() else None  # whose targets, joints and source stay
    with screen.watching() as monitor:
        found = calibrate_stereo(left, right, (what.columns, what.rows), square, lens, monitor)
    write_settings(CaptureSettings(found.rig) if before is None else replace(before, rig=found.rig), output)
    screen.table("Cameras", [dict(zip(("", "left", "right"), row, strict=True)) for row in camera_rows(found)])
    screen.table("Pairs", _pair_rows(found))
    for sentence in found.verdict.sentences:
        screen.say(sentence)
    screen.say(f"written: {output}")
    screen.json(_mapping(found, output))


def simulated(
    structure: Annotated[
        str, typer.Argument(metavar="STRUCTURE", help="What moves: arm, or a structure of `simulate`.")
    ] = STRUCTURE,
    cameras_only: Annotated[
        bool, typer.Option("--cameras-only", help="Leave out targets and joints, so as to calibrate them.")
    ] = False,
    output: Calibrated = SETTINGS,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Write what a perfect calibration of the simulated rig would find: a capture to try without cameras."""
    from skelgen_formats.capture_settings import write_settings

    from skelgen.capture.simulated_rig import simulated_rig
    from skelgen.model.rig import CaptureSettings

    screen = Screen(quiet, as_json)
    if output.exists():
        raise InputError(f"{output} is there already, perhaps with a real calibration; choose another name with -o")
    known = simulated_rig(structure, n_frames=1).settings
    reason = "" if cameras_only else _reason_against(known.bodies)
    bodies, joints = ((), ()) if cameras_only or reason else (known.bodies, known.joints)
    write_settings(CaptureSettings(known.rig, bodies, joints, f"simulated:{structure}"), output)
    screen.note([f"targets and joints are left out: {reason}"] if reason else [])
    screen.say(f"the cameras, {len(bodies)} targets and {len(joints)} joints of the simulated rig before: {structure}")
    screen.say(f"written: {output}")
    named = [body.name for body in bodies], [joint.name for joint in joints]
    screen.json({"file": str(output), "targets": named[0], "joints": named[1]})


def _reason_against(bodies: Sequence[BodyTarget]) -> str:
    """Why bodies cannot be told from each other in a capture; empty if they can."""
    from skelgen.capture.bodies.design import check_targets

    try:
        check_targets(bodies)
    except InputError as error:
        return str(error)
    return ""


def split_pairs(images: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """Return the left and the right images: by ``left`` and ``right`` in their names, else the first and second half.

    Raises
    ------
    InputError
        If one side has more images than the other.
    """
    left = [path for path in images if "left" in path.name.lower()]
    right = [path for path in images if "right" in path.name.lower()]
    if len(left) + len(right) != len(images):
        left, right = list(images[: len(images) // 2]), list(images[len(images) // 2 :])
    if len(left) != len(right):
        raise InputError(
            f"{len(left)} left and {len(right)} right images; each left one needs the right one of its moment: give "
            "all left images, then all right ones, in one order"
        )
    return left, right


def _pair_rows(found: StereoCalibration) -> list[dict[str, object]]:
    return [
        {
            "pair": pair.name,
            "left [px]": _rounded(pair.left_rms),
            "right [px]": _rounded(pair.right_rms),
            "left edge [px]": round(pair.left.edge, 1) if pair.left is not None else None,
            "right edge [px]": round(pair.right.edge, 1) if pair.right is not None else None,
            "used": "yes" if pair.is_used else "no",
        }
        for pair in found.pairs
    ]


def _rounded(value: float) -> float | None:
    return round(value, 3) if math.isfinite(value) else None


def _mapping(found: StereoCalibration, output: Path) -> dict[str, object]:
    from skelgen.capture.calibration.stereo import INTRINSIC, intrinsic
    from skelgen.geometry.rotations import vector_from_matrix

    left, right = (intrinsic(camera) for camera in (found.rig.left, found.rig.right))
    return {
        "file": str(output),
        "grade": found.verdict.grade,
        "verdict": list(found.verdict.sentences),
        "rms_px": found.rms,
        "left": dict(zip(INTRINSIC, left, strict=True)),
        "left_std": dict(zip(INTRINSIC, found.left_std.tolist(), strict=True)),
        "right": dict(zip(INTRINSIC, right, strict=True)),
        "right_std": dict(zip(INTRINSIC, found.right_std.tolist(), strict=True)),
        "rotation_rad": vector_from_matrix(found.rig.right_from_left[:3, :3]).tolist(),
        "rotation_std_rad": found.rotation_std.tolist(),
        "angle_std_rad": found.turn_std,
        "translation_mm": found.rig.right_from_left[:3, 3].tolist(),
        "translation_std_mm": found.translation_std.tolist(),
        "baseline_mm": found.rig.baseline,
        "baseline_std_mm": found.baseline_std,
        "pairs": _pair_rows(found),
    }


STEM = "skeleton"
"""Name of the shared skeleton's files."""


def skeleton(
    takes: Annotated[list[Path], typer.Argument(metavar="TAKE...", help="Takes of one body, in any known format.")],
    output: Annotated[Path, option("--output -o", "FOLDER", "Folder: the skeleton, and a folder for each take.")],
    seed: Seed = None,
    config: Config = None,
    methods: Methods = None,
    format_name: FormatName = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Find one skeleton from several takes of a body, and the motion of each."""
    from skelgen.app.configuration import Settings
    from skelgen.app.files import NamedFile, open_input
    from skelgen.app.outputs import check_run, stem_of, write_outputs
    from skelgen.app.several_takes import calibrate_together

    screen = Screen(quiet, as_json)
    stems = [stem_of(take) for take in takes]
    twice = [stem for stem, count in Counter([*stems, STEM]).items() if count > 1]
    if twice:
        raise InputError(f"two results would be called {twice[0]!r}; rename one of the takes")
    check_run(output, (STEM, ""), [*takes, config], overwrite=overwrite)
    for stem in stems:
        check_run(output / stem, (stem, ""), [*takes, config], overwrite=overwrite)
    read = [open_input(NamedFile(take, format_name)).take for take in takes]
    for take in read:
        screen.note(take.notices)
    with screen.watching() as monitor:
        found = calibrate_together(read, settings=Settings(config, methods), seed=seed or 0, monitor=monitor)
        files = write_outputs(found.skeleton, output, STEM, monitor=monitor)
        for stem, project in zip(stems, found.takes, strict=True):
            files += write_outputs(project, output / stem, stem, monitor=monitor)
    show_results(screen, found.skeleton, files)


ROOM_SETTINGS = Path("room.xml")


def room(
    source: Annotated[str, typer.Argument(metavar="SOURCE", help="Where the images of the waved wand come from.")],
    wand: Annotated[
        str, option("--wand", "MM,MM,MM", "Where its two or three balls are along the wand.")
    ] = "0,180,500",
    ground: Annotated[str | None, option("--ground", "SOURCE", "Images of the L-frame on the floor.")] = None,
    arms: Annotated[
        str, option("--arms", "MM,MM", "Arms of the L-frame, and the third side of other triangles.")
    ] = "600,400",
    board: Annotated[
        str | None, option("--board", "9x6", "A chessboard instead of the wand, or charuco:10x7:4X4_50.")
    ] = None,
    square: Square = 25.0,
    marker: Annotated[float | None, option("--marker", "MM", "Side of a marker, else 3/4 of a square.")] = None,
    output: Calibrated = ROOM_SETTINGS,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Calibrate two to sixteen cameras around a room with a wand that is waved through it, or with a board."""
    from skelgen.app.capture import save_cameras
    from skelgen.app.room import Ground, calibrate_room, calibrate_room_by_boards
    from skelgen.capture.room.boards import room_board
    from skelgen.capture.values import numbers_from_text

    screen = Screen(quiet, as_json)
    distances, floor = numbers_from_text(wand, "--wand"), numbers_from_text(arms, "--arms")
    lying = Ground(ground, floor) if ground else None
    with screen.watching() as monitor:
        if board is None:
            found = calibrate_room(source, distances, lying, monitor)
        else:
            found = calibrate_room_by_boards(source, room_board(board, square, marker), lying, monitor)
    save_cameras(found.rig, output, output)
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
