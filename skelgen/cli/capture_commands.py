"""`motion-capture`, and the calibrations that use its settings: `calibrate body`, `calibrate joints`."""

from __future__ import annotations

import contextlib
import importlib
import os
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Protocol

import typer

from skelgen.cli.options import AsJson, Quiet, option
from skelgen.cli.screen import Screen, can_open_windows
from skelgen.errors import InputError, ReaderGoneError

if TYPE_CHECKING:
    from skelgen.capture.live import Captured
    from skelgen.capture.values import JointRequest

SettingsFile = Annotated[Path, typer.Argument(metavar="SETTINGS", help="Settings of the capture: an XML file.")]
Source = Annotated[str | None, option("--source", "TEXT", "Where images come from.", "that of the settings")]
Frames = Annotated[
    int | None, typer.Option("--frames", min=1, help="Pairs at most, or sets in a room.", show_default="all")
]
Output = Annotated[Path | None, option("--output -o", "FILE", "Settings to write.", "those that were read")]


def motion_capture(
    settings: SettingsFile,
    interactive: Annotated[bool, typer.Option("-i", help="Write a line only when a key is hit.")] = False,
    silent: Annotated[bool, typer.Option("-s", help="Write no residuals to the error output.")] = False,
    no_graphics: Annotated[bool, typer.Option("-n", help="Show no pictures.")] = False,
    no_labels: Annotated[bool, typer.Option("-l", help="Write no labels into the first line.")] = False,
    no_poses: Annotated[bool, typer.Option("-r", help="Write no poses of rigid bodies.")] = False,
    no_angles: Annotated[bool, typer.Option("-a", help="Write no joint angles.")] = False,
    errors: Annotated[bool, typer.Option("--errors", help="Write standard deviations behind all values.")] = False,
    predict: Annotated[bool, typer.Option("--predict", help="Predict and smooth poses (Kalman filter).")] = False,
    predict_joints: Annotated[
        bool, typer.Option("--predict-joints", help="The same for all joint angles together (extended Kalman filter).")
    ] = False,
    record: Annotated[
        list[Path] | None, option("--record", "FILE", "Record into a new .mfml or .c3d file; may be repeated.")
    ] = None,
    source: Source = None,
    frames: Frames = None,
) -> None:
    """Capture live, with two cameras or a room's: write poses and joint angles of every moment, tab-separated."""
    from skelgen.app.capture import capture, source_of
    from skelgen.app.room import read_capture_settings
    from skelgen.capture.bodies.prediction import PredictionParameters
    from skelgen.cli.capture_terminal import CaptureColumns, watched_interrupt, watched_keys
    from skelgen.model.rig import RoomSettings

    rig = read_capture_settings(settings)
    columns = CaptureColumns(rig, poses=not no_poses, angles=not no_angles, errors=errors)
    prediction = PredictionParameters(joints=predict_joints) if predict or predict_joints else None
    stream = capture(rig, source_of(rig, source), record or (), prediction, frames)
    word, cameras = ("sets of images", rig.rig.names) if isinstance(rig, RoomSettings) else ("pairs", ())
    counts = _Counts(record or [], [body.name for body in rig.bodies], word)
    try:
        with contextlib.ExitStack() as stack:
            stack.enter_context(contextlib.closing(stream))
            pictures = None if no_graphics else _pictures([body.name for body in rig.bodies], cameras, stack)
            keys = stack.enter_context(watched_keys()) if interactive else None
            interrupted = stack.enter_context(watched_interrupt())
            for captured in stream:
                if not counts.n_pairs and not no_labels:
                    _write(columns.labels())
                counts.add(captured)
                _report(captured, "" if silent else columns.residuals(captured))
                if pictures is not None:
                    pictures.show(captured)
                if keys is None or keys.was_hit():
                    _write(columns.line(captured))
                if interrupted.is_set():
                    break
    except (KeyboardInterrupt, BrokenPipeError, ReaderGoneError):
        if not counts.n_pairs:
            raise  # else it is the usual end of a live capture: what was recorded is closed
    finally:
        counts.say(silent)


def _report(captured: Captured, residuals: str) -> None:
    """Say on stderr what was noticed of a moment, and its residuals unless they are empty."""
    for line in (*(f"note: {notice}" for notice in captured.notices), *([residuals] if residuals else [])):
        print(line, file=sys.stderr)


class _Pictures(Protocol):
    """A window with pictures."""

    def show(self, captured: Captured) -> None:
        """Show the pictures of one moment."""


_PICTURES = "skelgen_gui.capture.pictures"  # found by name: the command line does not depend on the window


def _pictures(targets: Sequence[str], cameras: Sequence[str], stack: contextlib.ExitStack) -> _Pictures | None:
    """Open the window with pictures, which the stack closes; None with a note where that cannot be."""
    reason = "there is no display, so that no pictures are shown (-n says so)"
    if can_open_windows():
        try:
            window = importlib.import_module(_PICTURES)
        except ImportError:
            reason = "pictures need PySide6: pip install 'skelgen-mocap[gui]' (-n captures without them)"
        else:
            opened: _Pictures = stack.enter_context(window.LivePictures(targets, cameras))
            return opened
    print(f"note: {reason}", file=sys.stderr)
    return None


def calibrate_body(
    settings: SettingsFile,
    name: Annotated[str, typer.Option("--name", help="What the target is called.")],
    balls: Annotated[
        int | None, typer.Option("--balls", min=4, help="Its number of balls.", show_default="found")
    ] = None,
    source: Source = None,
    frames: Frames = None,
    output: Output = None,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Calibrate a target: turn it before the cameras, alone in at least one picture."""
    import numpy as np
    from skelgen_formats.capture_settings import write_settings

    from skelgen.app.capture import calibrate_body_of, source_of
    from skelgen.app.room import read_capture_settings
    from skelgen.capture.calibration.body import ball_rows

    screen = Screen(quiet, as_json)
    rig = read_capture_settings(settings)
    with screen.watching() as monitor:
        new, done = calibrate_body_of(rig, source_of(rig, source), name, balls, frames, monitor)
    write_settings(new, output or settings)
    screen.note(done.notices)
    screen.table(f"Target {name}", ball_rows(done.target))
    screen.say(done.verdict.sentences[0])
    if new.rig.noise != rig.rig.noise:
        screen.say(f"noise of the rig: {new.rig.noise:.3f} px, as seen in the images; it was {rig.rig.noise:.3f}")
    screen.say(f"written: {output or settings}")
    screen.json(
        {
            "file": str(output or settings),
            "name": name,
            "noise_px": new.rig.noise,
            "points_mm": done.target.points.tolist(),
            "std_mm": np.asarray(done.target.std).tolist(),
            "noise": done.noise,
            "n_frames": done.n_frames,
            "n_left_out": done.n_left_out,
            "notices": list(done.notices),
        }
    )


def calibrate_joints(
    settings: SettingsFile,
    joints: Annotated[
        list[str] | None,
        option(
            "--joint",
            "NAME=PARENT:CHILD[:KIND]",
            "A joint between two targets, a ball or a hinge; may be repeated.",
            "joints and types are found",
        ),
    ] = None,
    start: Annotated[
        list[str] | None,
        option(
            "--start",
            "NAME=X,Y,Z:X,Y,Z",
            "Where the search for a joint begins, in mm in its parent and its child; may be repeated.",
            "the closed form",
        ),
    ] = None,
    use_frames: Annotated[
        str | None, option("--use-frames", "N or I,J,...", "So many frames, evenly spaced, or these.", "all")
    ] = None,
    source: Source = None,
    frames: Frames = None,
    output: Output = None,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Calibrate joints: move all of them before the cameras, as far as they go."""
    from skelgen_formats.capture_settings import write_settings

    from skelgen.app.capture import calibrate_joints_of, source_of
    from skelgen.app.room import read_capture_settings
    from skelgen.capture.calibration.joints import joint_rows
    from skelgen.capture.values import frames_from_text

    screen = Screen(quiet, as_json)
    rig = read_capture_settings(settings)
    requests = _with_starts([_request(text) for text in joints or ()], start or ())
    try:
        used = frames_from_text(use_frames or "")
    except InputError as error:
        raise InputError(f"--use-frames {error}") from error
    with screen.watching() as monitor:
        new, done = calibrate_joints_of(rig, source_of(rig, source), requests, frames, monitor, used)
    write_settings(new, output or settings)
    screen.note(done.notices)
    screen.table("Joints", joint_rows(done))
    screen.say(done.verdict.sentences[0])
    screen.say(f"written: {output or settings}")
    screen.json({"file": str(output or settings), "joints": joint_rows(done), "notices": list(done.notices)})


def _request(text: str) -> JointRequest:
    from skelgen.capture.values import JointRequest

    name, _, bodies = text.partition("=")
    parts = bodies.split(":")
    if not name or len(parts) not in (2, 3) or not all(parts[:2]):
        raise InputError(f"--joint {text!r} is not understood; it must be NAME=PARENT:CHILD or NAME=PARENT:CHILD:KIND")
    return JointRequest(name, parts[0], parts[1], parts[2] if len(parts) == 3 else "")


def _with_starts(requests: list[JointRequest], starts: Sequence[str]) -> list[JointRequest]:
    """Joints with the places at which their search begins."""
    from skelgen.capture.values import start_from_text

    by_name = {request.name: request for request in requests}
    for text in starts:
        name, _, places = text.rpartition("=")
        try:
            start = start_from_text(places)
        except InputError as error:
            raise InputError(f"--start {text!r} is not understood; it must be NAME=X,Y,Z:X,Y,Z in mm") from error
        if name not in by_name:
            raise InputError(f"--start names joint {name!r}, which no --joint names")
        by_name[name] = replace(by_name[name], start=start)
    return list(by_name.values())


class _Counts:
    """How much was captured, for the last line."""

    def __init__(self, record: list[Path], targets: list[str], word: str) -> None:
        self._record, self._missed, self._word = record, dict.fromkeys(targets), word
        self.n_pairs, self._n_lost = 0, 0

    def add(self, captured: Captured) -> None:
        self.n_pairs += 1
        self._n_lost += captured.pair.dropped
        for name in captured.bodies:
            self._missed.pop(name, None)

    def say(self, silent: bool) -> None:
        if not self.n_pairs:  # it did not begin, and an error says why
            return
        if self._missed:
            print(f"note: never found: {', '.join(self._missed)}", file=sys.stderr)
        kept = [str(path) for path in self._record if path.exists()]
        if not silent or self._n_lost:
            written = f"; recorded: {', '.join(kept)}" if kept else ""
            print(f"{self.n_pairs} {self._word} captured, {self._n_lost} lost{written}", file=sys.stderr)


def _write(line: str) -> None:
    """Print a line at once; a reader that is gone ends the capture."""
    try:
        print(line, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # so that Python's last flush finds somebody
        raise
