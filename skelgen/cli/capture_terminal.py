"""A running capture at the terminal: the table that it prints, and the keys that are hit while it runs.

The table is tab-separated, one line per pair (Gaschler 2011, 7.2). No key is waited for.
"""

import contextlib
import signal
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from types import FrameType

import numpy as np

from skelgen.capture.live import Captured
from skelgen.capture.target_joints import angle_names
from skelgen.geometry.rotations import vector_from_matrix
from skelgen.kinematics.joints.angles import rotation_vector_deviations
from skelgen.model.rig import AnySettings, TargetJoint

_PLACE = ("x", "y", "z")
_TURN = ("rx", "ry", "rz")


@dataclass(frozen=True)
class CaptureColumns:
    """What is printed.

    Attributes
    ----------
    settings : CaptureSettings or RoomSettings
        Targets and joints, in the order of the columns.
    poses, angles, errors : bool
        Whether poses of targets, angles of joints, and standard deviations behind each of them are wanted.
    """

    settings: AnySettings
    poses: bool = True
    angles: bool = True
    errors: bool = False

    def labels(self) -> str:
        """The first line: what each column holds, and its unit."""
        labels = ["frame", "time [s]"]
        for body in self.settings.bodies if self.poses else ():
            names = [f"{body.name}.{axis} [mm]" for axis in _PLACE] + [f"{body.name}.{axis} [rad]" for axis in _TURN]
            labels += self._with_errors(names)
        for joint in self.settings.joints if self.angles else ():
            labels += self._with_errors([f"{name} [rad]" for name in angle_names(joint)])
        return "\t".join(labels)

    def line(self, captured: Captured) -> str:
        """The line of one pair; what was not found is nan."""
        values: list[float] = []
        for body in self.settings.bodies if self.poses else ():
            values += self._pose(captured, body.name)
        for joint in self.settings.joints if self.angles else ():
            values += self._angles(captured, joint)
        cells = [f"{value:.6g}" for value in values]
        return "\t".join([str(captured.pair.index), f"{captured.pair.time:.6f}", *cells])

    def residuals(self, captured: Captured) -> str:
        """Residuals of one pair in words: of targets the distance of the balls, of joints that of its frames."""
        parts = []
        for body in self.settings.bodies if self.poses else ():
            found = captured.bodies.get(body.name)
            parts.append(f"{body.name} not found" if found is None else f"{body.name} {found.rms:.2f} mm")
        for joint in self.settings.joints if self.angles else ():
            angle = captured.angles.get(joint.name)
            parts.append(f"{joint.name} (joint) " + ("unknown" if angle is None else f"{angle.residual:.2f} mm"))
        return f"{captured.pair.index}: " + (", ".join(parts) or f"{len(captured.points)} points")

    def _with_errors(self, names: list[str]) -> list[str]:
        return [*names, *(f"{name} std" for name in names)] if self.errors else names

    def _pose(self, captured: Captured, name: str) -> list[float]:
        found = captured.bodies.get(name)
        if found is None:
            return [np.nan] * (12 if self.errors else 6)
        turn = found.world_from_body[:3, :3]
        values = [*found.world_from_body[:3, 3].tolist(), *vector_from_matrix(turn).tolist()]
        if self.errors:
            values += np.sqrt(np.diag(found.covariance)[3:]).tolist()
            # of a rotation vector, from the covariance of small turns about the world's axes
            values += rotation_vector_deviations(turn[np.newaxis], found.covariance[np.newaxis, :3, :3])[0].tolist()
        return values

    def _angles(self, captured: Captured, joint: TargetJoint) -> list[float]:
        angle = captured.angles.get(joint.name)
        if angle is None:
            return [np.nan] * (len(angle_names(joint)) * (2 if self.errors else 1))
        return [*angle.angles.tolist(), *(angle.std.tolist() if self.errors else ())]


class Keys:
    """Counts the keys that were hit; each is reported once."""

    def __init__(self) -> None:
        self._hits = threading.Semaphore(0)

    def was_hit(self) -> bool:
        """Whether a key was hit that was not reported yet."""
        return self._hits.acquire(blocking=False)

    def listen(self) -> None:
        """Count keys until the input ends; runs in a thread of its own."""
        with contextlib.suppress(OSError, ValueError):  # the input was closed: there are no more keys
            while sys.stdin.read(1):
                self._hits.release()


@contextlib.contextmanager
def watched_keys() -> Iterator[Keys]:
    """Yield keys as they are hit: at once on a terminal that can do so, else with each character of a line."""
    keys = Keys()
    with _single_keys():
        threading.Thread(target=keys.listen, daemon=True).start()
        yield keys


@contextlib.contextmanager
def watched_interrupt() -> Iterator[threading.Event]:
    """Yield an event that Ctrl-C sets when it raises `KeyboardInterrupt`, as Python drops errors in finalizers."""
    interrupted = threading.Event()

    def stop(number: int, frame: FrameType | None) -> None:
        if not interrupted.is_set():  # a second one shall not disturb the end that the first one brings about
            interrupted.set()
            raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():  # where signals never arrive
        yield interrupted
        return
    before = signal.signal(signal.SIGINT, stop)
    try:
        yield interrupted
    finally:
        signal.signal(signal.SIGINT, before)


@contextlib.contextmanager
def _single_keys() -> Iterator[None]:
    """Let the terminal hand on each key without waiting for the end of the line."""
    try:
        import termios
        import tty

        before = termios.tcgetattr(sys.stdin)
    except (ImportError, OSError, ValueError, termios.error):  # no such terminal: a pipe, or another system
        yield
        return
    try:
        tty.setcbreak(sys.stdin)
        yield
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)
