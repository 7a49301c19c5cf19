"""What of a capture goes into a file, moment by moment: all points, or the balls of the targets with their names."""

from collections.abc import Sequence
from pathlib import Path
from typing import Self

import numpy as np
from skelgen_formats.recording import C3dRecorder, MfmlRecorder

from skelgen.capture.bodies import resolved_points
from skelgen.capture.live import Captured
from skelgen.capture.markers import misfit_in_space
from skelgen.errors import InputError
from skelgen.model.arrays import Floats
from skelgen.model.rig import AnySettings, BodyTarget

RECORDINGS = (".mfml", ".c3d")
"""Suffixes of recordings: all points without names, and the balls of the targets with theirs."""


def check_recording(path: Path, settings: AnySettings) -> None:
    """Check that a capture can be recorded into a file of this name, or raise `InputError`.

    Parameters
    ----------
    path : Path
        The file.
    settings : CaptureSettings or RoomSettings
        What is captured.
    """
    suffix = path.suffix.lower()
    if suffix not in RECORDINGS:
        raise InputError(f"{path} cannot be recorded: its suffix must be one of {', '.join(RECORDINGS)}")
    if suffix == ".c3d" and not settings.bodies:
        raise InputError(f"{path}: there are no targets whose balls could be named; record .mfml, or calibrate them")


class Recording:
    """What of a capture goes into one file, whose suffix is one of `RECORDINGS`; a context manager.

    Parameters
    ----------
    path : Path
        The file; it must not be there.
    settings : CaptureSettings or RoomSettings
        What is captured.
    rate : float or None, Hz
        Pairs a second, if the source knows.

    Raises
    ------
    SkelgenError
        If it cannot be recorded.
    """

    def __init__(self, path: Path, settings: AnySettings, rate: float | None) -> None:
        check_recording(path, settings)
        self.path, self._settings = path, settings
        rig = settings.rig
        self._camera = rig.cameras[0]
        self._recorder: MfmlRecorder | C3dRecorder
        if path.suffix.lower() == ".mfml":
            self._recorder = MfmlRecorder(path)
        else:
            self._recorder = C3dRecorder(path, _ball_names(settings.bodies), rate)

    def __enter__(self) -> Self:
        """Return itself: the file is open."""
        return self

    def __exit__(self, *exception: object) -> None:
        """Close the file, whatever happened."""
        self.close()

    def close(self) -> None:
        """Make the file whole and close it; one without frames is removed."""
        self._recorder.close()

    def add(self, captured: Captured) -> None:
        """Append what was found at one moment."""
        if isinstance(self._recorder, C3dRecorder):
            positions = ball_positions(self._settings.bodies, captured)
            self._recorder.add(captured.pair.time, positions, captured.pair.dropped)
            return
        kept = resolved_points(captured.points, captured.bodies.values())
        places = captured.points.points[kept]
        errors = misfit_in_space(places, captured.points.epipolar_distance[kept], self._camera)
        self._recorder.add(captured.pair.time, places, errors)


def _ball_names(bodies: Sequence[BodyTarget]) -> list[str]:
    """Return the names of all balls of all targets: ``upper:1``, ``upper:2`` and so on."""
    return [f"{body.name}:{ball + 1}" for body in bodies for ball in range(len(body.points))]


def ball_positions(bodies: Sequence[BodyTarget], captured: Captured) -> Floats:
    """Return where all balls of all targets were seen [mm], shape (n_balls, 3); NaN where one was not.

    Parameters
    ----------
    bodies : sequence of BodyTarget
        The targets.
    captured : Captured
        One moment with what was found.
    """
    parts = []
    for body in bodies:
        places = np.full(body.points.shape, np.nan)
        if body.name in captured.bodies:
            matched = captured.bodies[body.name].points
            places[matched >= 0] = captured.points.points[matched[matched >= 0]]
        parts.append(places)
    return np.concatenate(parts) if parts else np.zeros((0, 3))
