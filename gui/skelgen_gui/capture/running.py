"""A capture as the window runs it, on a thread of its own: no Qt here but the feed that it fills."""

from __future__ import annotations

import time
from collections import deque
from contextlib import closing
from pathlib import Path
from threading import Event

import numpy as np

from skelgen.app.capture import Recording, capture, read_capture_settings, source_of
from skelgen.capture.live import Captured, MotionCapture, PointFinder
from skelgen.capture.prediction import PredictionParameters
from skelgen.capture.values import FrameSource
from skelgen.errors import Cancelled, InputError, SkelgenError
from skelgen.model.rig import CaptureSettings
from skelgen.progress import Monitor
from skelgen_gui.capture.feed import Feed
from skelgen_gui.capture.messages import Ended, LiveWish, Orders, Recorded, Shot
from skelgen_gui.capture.overlay import eye_with_balls, groups_of_points

SPEED_FRAMES = 60
"""Pairs over which their number a second and their latency are averaged."""

_IS_WARM = Event()


class LiveRun:
    """One capture, from its start to its end.

    Parameters
    ----------
    wish : LiveWish
        What is captured.
    orders : Orders
        What it is told while it runs.
    feed : Feed
        Where results go.
    title : str
        What the user is told while pairs come.
    """

    def __init__(self, wish: LiveWish, orders: Orders, feed: Feed[Shot], title: str = "capturing") -> None:
        self._title = title
        self._wish, self._orders, self._feed = wish, orders, feed
        self._times: deque[float] = deque(maxlen=SPEED_FRAMES)
        self._latencies: deque[float] = deque(maxlen=SPEED_FRAMES)
        self._settings: CaptureSettings | None = None
        self._tape: _Tape | None = None
        self._n_frames = self._n_dropped = 0

    def run(self, monitor: Monitor) -> Ended:
        """Capture until it is told to stop, the source ends, or something breaks."""
        error: SkelgenError | None = None
        try:
            self._run(monitor)
        except Cancelled:
            pass
        except SkelgenError as broken:
            error = broken
        kept: tuple[Recorded, ...] = ()
        if self._tape is not None:
            self._tape.close()
            kept = self._tape.kept
        return Ended(self._n_frames, self._n_dropped, kept, error, self._settings)

    def _run(self, monitor: Monitor) -> None:
        settings, source = opened(self._wish)
        warm_up(monitor)
        self._settings, self._tape = settings, _Tape(settings, source.rate, self._feed)
        prediction = PredictionParameters() if self._wish.predicts else None
        total = source.n_frames or 0
        with closing(capture(settings, source, prediction=prediction)) as stream:
            for captured in stream:
                if self._n_frames == 0:
                    monitor.begin(self._title)
                self._take(captured, settings, self._tape)
                monitor.advance(captured.pair.index if total else 0, total or 1)
                if self._orders.stop.is_set():
                    return

    def _take(self, captured: Captured, settings: CaptureSettings, tape: _Tape) -> None:
        tape.follow(self._orders.record)
        tape.add(captured)
        self._n_frames += 1
        self._n_dropped += captured.pair.dropped
        self._times.append(time.monotonic())
        self._latencies.append(captured.latency)
        told_by_count = 1 if captured.pair.dropped else 0  # the first notice is of lost pairs: the window counts them
        for sentence in captured.notices[told_by_count:]:
            self._feed.say(sentence)
        if self._feed.is_waited_for:
            self._feed.put(self._shot(captured, settings, tape.running))

    def _shot(self, captured: Captured, settings: CaptureSettings, recorded: Recorded | None) -> Shot:
        bodies = [
            (group, captured.bodies[b.name]) for group, b in enumerate(settings.bodies) if b.name in captured.bodies
        ]
        points, pair = captured.points, captured.pair
        return Shot(
            eye_with_balls(pair.left.copy(), captured.left, bodies, points.left),
            eye_with_balls(pair.right.copy(), captured.right, bodies, points.right),
            points.points,
            groups_of_points(points, bodies),
            captured.bodies,
            captured.angles,
            settings,
            pair.index,
            self._rate(),
            float(np.mean(self._latencies)),
            self._n_dropped,
            recorded,
        )

    def _rate(self) -> float:
        span = self._times[-1] - self._times[0]
        return (len(self._times) - 1) / span if span > 0 else 0.0


class _Tape:
    """Begins and ends recordings while pairs go by; one that fails ends itself, and never the capture."""

    def __init__(self, settings: CaptureSettings, rate: float | None, feed: Feed[Shot]) -> None:
        self._settings, self._rate, self._feed = settings, rate, feed
        self._wanted: Path | None = None
        self._recording: Recording | None = None
        self._n_frames = 0
        self._kept: list[Recorded] = []

    @property
    def running(self) -> Recorded | None:
        """What is being recorded."""
        return None if self._recording is None else Recorded(self._recording.path, self._n_frames)

    @property
    def kept(self) -> tuple[Recorded, ...]:
        """Recordings that ended."""
        return tuple(self._kept)

    def follow(self, wanted: Path | None) -> None:
        """Record into another file, or into none."""
        if wanted == self._wanted:
            return
        self.close()
        self._wanted = wanted
        if wanted is not None:
            try:
                self._recording = Recording(wanted, self._settings, self._rate)
            except SkelgenError as error:
                self._feed.say(str(error))

    def add(self, captured: Captured) -> None:
        """Append a pair, if something is recorded."""
        if self._recording is None:
            return
        try:
            self._recording.add(captured)
            self._n_frames += 1
        except SkelgenError as error:
            self._feed.say(str(error))
            self.close()

    def close(self) -> None:
        """End what is being recorded."""
        recording, self._recording = self._recording, None
        if recording is None:
            return
        try:
            recording.close()
        except SkelgenError as error:
            self._feed.say(str(error))
        if self._n_frames and recording.path.exists():
            self._kept.append(Recorded(recording.path, self._n_frames))
        self._n_frames = 0


def warm_up(monitor: Monitor) -> None:
    """Capture one simulated pair: what is compiled then is not compiled while the first pairs come, and are lost."""
    if _IS_WARM.is_set():
        return
    from skelgen.capture.simulated_rig import simulated_rig  # noqa: PLC0415 - loads compiled loops

    rig = simulated_rig("arm", n_frames=1)
    monitor.advance(1, 4)
    pair, _ = rig.render(0)
    monitor.advance(2, 4)
    PointFinder(rig.settings).find(pair)
    monitor.advance(3, 4)
    with MotionCapture(rig.settings) as capturing:
        capturing.see(pair)
    _IS_WARM.set()


def opened(wish: LiveWish) -> tuple[CaptureSettings, FrameSource]:
    """Return settings and source of a wish.

    Raises
    ------
    SkelgenError
        If they cannot be read or opened, or if cameras that are not calibrated are asked for.
    """
    if wish.settings:
        stated = read_capture_settings(Path(wish.settings))
        return stated, source_of(stated, wish.source)
    if not wish.source:
        raise InputError("choose a settings file, or the simulated rig, which needs none")
    source = source_of_text(wish.source)
    settings: object = getattr(source, "settings", None)
    if not isinstance(settings, CaptureSettings):
        raise InputError(
            "of these cameras nothing is known: choose the settings file that their calibration wrote, or calibrate "
            "them on the tab Cameras"
        )
    return settings, source


def source_of_text(text: str) -> FrameSource:
    """Return the source that a text names; errors as `open_source`."""
    from skelgen.capture.sources import open_source  # noqa: PLC0415 - drivers only where they are wanted

    return open_source(text)
