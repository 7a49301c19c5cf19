"""A live capture as a job: it runs until it is told to stop, and records when it is told to."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Generator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from threading import Event
from typing import NamedTuple

import numpy as np

from skelgen.app.capture import capture, source_of
from skelgen.app.capture_jobs.images import camera_images_of
from skelgen.app.capture_jobs.messages import (
    ROOM,
    CaptureControl,
    CaptureEnd,
    CaptureOptions,
    Feed,
    FoundInSpace,
    LiveShot,
    Recorded,
)
from skelgen.app.recording import Recording
from skelgen.app.room import read_capture_settings
from skelgen.capture.bodies.prediction import PredictionParameters
from skelgen.capture.live import Captured, MotionCapture, PointFinder
from skelgen.capture.room.sources import open_room_source
from skelgen.capture.sources import open_source
from skelgen.capture.values import FrameSource
from skelgen.errors import Cancelled, InputError, SkelgenError
from skelgen.model.rig import AnySettings
from skelgen.progress import Monitor

_SPEED_FRAMES = 60
"""Pairs over which their number a second and their latency are averaged."""

_IS_WARM = Event()


class LiveCapture:
    """One capture, from its start to its end.

    Parameters
    ----------
    options : CaptureOptions
        What is captured.
    control : CaptureControl
        Tells it to stop and to record.
    feed : Feed
        Where results go.
    title : str
        Progress is reported under this name.
    """

    def __init__(
        self, options: CaptureOptions, control: CaptureControl, feed: Feed[LiveShot], title: str = "capturing"
    ) -> None:
        self._options, self._control, self._feed, self._title = options, control, feed, title
        self._times: deque[float] = deque(maxlen=_SPEED_FRAMES)
        self._latencies: deque[float] = deque(maxlen=_SPEED_FRAMES)
        self._settings: AnySettings | None = None
        self._recorder: _Recorder | None = None
        self._n_frames = self._n_dropped = 0

    def run(self, monitor: Monitor) -> CaptureEnd:
        """Capture until it is told to stop, the source ends, or something breaks."""
        error: SkelgenError | None = None
        try:
            self._run(monitor)
        except Cancelled:
            pass
        except SkelgenError as broken:
            error = broken
        recorded: tuple[Recorded, ...] = ()
        if self._recorder is not None:
            self._recorder.close()
            recorded = tuple(self._recorder.ended)
        return CaptureEnd(self._n_frames, self._n_dropped, recorded, error, self._settings)

    def _run(self, monitor: Monitor) -> None:
        opened = open_stream(self._options)
        warm_up(monitor)
        self._settings, self._recorder = opened.settings, _Recorder(opened.settings, opened.rate, self._feed)
        total = opened.n_frames or 0
        with closing(opened.stream) as stream:
            for captured in stream:
                if self._n_frames == 0:
                    monitor.begin(self._title)
                self._take(captured, opened.settings, self._recorder)
                monitor.advance(captured.pair.index if total else 0, total or 1)
                if self._control.stop.is_set():
                    return

    def _take(self, captured: Captured, settings: AnySettings, recorder: _Recorder) -> None:
        recorder.record_into(self._control.record)
        recorder.add(captured)
        self._n_frames += 1
        self._n_dropped += captured.pair.dropped
        self._times.append(time.monotonic())
        self._latencies.append(captured.latency)
        n_counted = 1 if captured.pair.dropped else 0  # the first notice is of lost pairs: the window counts them
        for sentence in captured.notices[n_counted:]:
            self._feed.notice(sentence)
        if self._feed.is_waiting:
            self._feed.put(self._shot(captured, settings, recorder.running))

    def _shot(self, captured: Captured, settings: AnySettings, recorded: Recorded | None) -> LiveShot:
        names, found = [body.name for body in settings.bodies], captured.bodies
        bodies = {group: found[name] for group, name in enumerate(names) if name in found}
        return LiveShot(
            camera_images_of(captured, bodies),
            FoundInSpace.of(captured.points, bodies),
            captured.angles,
            settings,
            captured.pair.index,
            self._rate(),
            float(np.mean(self._latencies)),
            self._n_dropped,
            recorded,
        )

    def _rate(self) -> float:
        span = self._times[-1] - self._times[0]
        return (len(self._times) - 1) / span if span > 0 else 0.0


class _Recorder:
    """Begins and ends recordings while pairs go by; one that fails ends itself, and never the capture."""

    def __init__(self, settings: AnySettings, rate: float | None, feed: Feed[LiveShot]) -> None:
        self._settings, self._rate, self._feed = settings, rate, feed
        self._path: Path | None = None
        self._recording: Recording | None = None
        self._n_frames = 0
        self.ended: list[Recorded] = []

    @property
    def running(self) -> Recorded | None:
        """What is being recorded."""
        return None if self._recording is None else Recorded(self._recording.path, self._n_frames)

    def record_into(self, path: Path | None) -> None:
        """Record into another file, or into none."""
        if path == self._path:
            return
        self.close()
        self._path = path
        if path is not None:
            try:
                self._recording = Recording(path, self._settings, self._rate)
            except SkelgenError as error:
                self._feed.notice(str(error))

    def add(self, captured: Captured) -> None:
        """Append a pair, if something is recorded."""
        if self._recording is None:
            return
        try:
            self._recording.add(captured)
            self._n_frames += 1
        except SkelgenError as error:
            self._feed.notice(str(error))
            self.close()

    def close(self) -> None:
        """End what is being recorded."""
        recording, self._recording = self._recording, None
        if recording is None:
            return
        try:
            recording.close()
        except SkelgenError as error:
            self._feed.notice(str(error))
        if self._n_frames and recording.path.exists():
            self.ended.append(Recorded(recording.path, self._n_frames))
        self._n_frames = 0


def warm_up(monitor: Monitor) -> None:
    """Capture one simulated pair, so that no kernel is compiled, and no pair is lost, when the first pairs come."""
    if _IS_WARM.is_set():
        return
    from skelgen.capture.simulated_rig import simulated_rig  # noqa: PLC0415 - loads kernels

    rig = simulated_rig("arm", n_frames=1)
    monitor.advance(1, 4)
    pair, _ = rig.render(0)
    monitor.advance(2, 4)
    PointFinder(rig.settings).find(pair)
    monitor.advance(3, 4)
    with MotionCapture(rig.settings) as capturing:
        capturing.see(pair)
    _IS_WARM.set()


class Opened(NamedTuple):
    """A capture that is about to run: of two cameras or of a room."""

    settings: AnySettings
    rate: float | None
    n_frames: int | None
    stream: Generator[Captured, None, None]


def open_stream(options: CaptureOptions, *, only_points: bool = False) -> Opened:
    """Return the capture that options name.

    Parameters
    ----------
    options : CaptureOptions
        What is captured.
    only_points : bool
        Whether neither targets nor joints are looked for.

    Raises
    ------
    SkelgenError
        If settings or source cannot be read or opened, or if the options name cameras that are not calibrated.
    """
    is_wanted = options.predicts or options.predicts_joints
    prediction = PredictionParameters(joints=options.predicts_joints) if is_wanted else None
    settings = read_capture_settings(Path(options.settings)) if options.settings else None
    source: FrameSource
    if settings is not None:
        source = source_of(settings, options.source)
    elif options.source.startswith(ROOM):
        source = open_room_source(options.source)
    elif options.source:
        source = open_source(options.source)
    else:
        raise InputError("choose a settings file, or the simulated rig, which needs none")
    known = settings or getattr(source, "settings", None)
    if known is None:
        raise InputError(
            "of these cameras nothing is known: choose the settings file that their calibration wrote, or calibrate "
            "them on the tab Cameras"
        )
    looked_for = replace(known, bodies=(), joints=()) if only_points else known
    return Opened(known, source.rate, source.n_frames, capture(looked_for, source, prediction=prediction))
