"""Takes what targets and joints are calibrated from, on a thread of its own: no Qt here but the feed that it fills."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from threading import Event

from skelgen.capture.calibration.body import BodyCalibration, calibrate_body
from skelgen.capture.calibration.joints import JointCalibration, JointWish, calibrate_joints
from skelgen.capture.calibration.taking import BodyProgress, BodyTaking, JointTaking
from skelgen.capture.health import RigWatch
from skelgen.capture.live import PointFinder
from skelgen.capture.values import Balls, FoundBody, FramePair, FrameSource, StereoPoints
from skelgen.errors import InputError
from skelgen.model.rig import BodyTarget, CaptureSettings
from skelgen.progress import Monitor
from skelgen_gui.capture.feed import Feed
from skelgen_gui.capture.messages import JointProgress, LiveWish, TakenShot
from skelgen_gui.capture.overlay import eye_with_balls, groups_of_points
from skelgen_gui.capture.running import opened, warm_up
from skelgen_gui.capture.space import Found

MOTION_INTERVAL = 0.25
"""s between two looks at all motion so far, which take 10 ms with many targets."""

_Seen = tuple[FramePair, Balls, Balls, StereoPoints]


class Taking:
    """One taking of frames; what was taken stays, whatever ends it.

    Parameters
    ----------
    wish : LiveWish
        Settings and source.
    stop : Event
        It shall end.
    feed : Feed
        Where pictures and progress go.
    """

    def __init__(self, wish: LiveWish, stop: Event, feed: Feed[TakenShot]) -> None:
        self._wish, self._stop, self._feed = wish, stop, feed
        self.settings: CaptureSettings | None = None
        self._rate: float | None = None

    def run(self, title: str, monitor: Monitor) -> None:
        """Take frames until it is told to stop, or the source ends.

        Parameters
        ----------
        title : str
            What the user is told meanwhile.
        monitor : Monitor
            Is told how far it is.

        Raises
        ------
        SkelgenError
            If settings or source cannot be used, or the source breaks off; frames before are kept.
        """
        settings, source = opened(self._wish)
        self.settings = settings if self._wish.settings else self.without_file(settings)
        self.begin(self.settings)
        self._rate = source.rate
        warm_up(monitor)
        monitor.begin(title)
        last: TakenShot | None = None
        for seen in self._seen(self.settings, source, monitor):
            bodies = self.take(seen[-1])
            if self._feed.is_waited_for:
                last = self._shot(self.settings, seen, bodies)
                self._feed.put(last)
        if last is not None:
            self._feed.put(replace(last, progress=self.look()))

    def without_file(self, settings: CaptureSettings) -> CaptureSettings:
        """Return what is used of a simulated rig that knows its settings by itself."""
        return settings

    def begin(self, settings: CaptureSettings) -> None:
        """Begin with settings."""
        raise NotImplementedError

    def take(self, points: StereoPoints) -> list[tuple[int, FoundBody]]:
        """Take the points of a pair; return the targets in it with their groups."""
        raise NotImplementedError

    def look(self) -> BodyProgress | JointProgress:
        """Return how far it is."""
        raise NotImplementedError

    @property
    def progress(self) -> BodyProgress | JointProgress:
        """How far it is, or was a moment ago."""
        return self.look()

    def _seen(self, settings: CaptureSettings, source: FrameSource, monitor: Monitor) -> Iterator[_Seen]:
        """Pairs with their balls and points."""
        watch = RigWatch(settings.rig)
        with ThreadPoolExecutor(2, "taking") as threads, source as pairs:
            finder, total = PointFinder(settings, threads), source.n_frames or 0
            for pair in pairs:
                left, right, points = finder.find(pair)
                for sentence in watch.notices(pair, left, right, points)[1 if pair.dropped else 0 :]:
                    self._feed.say(sentence)  # but not of lost pairs, which cost nothing here
                yield pair, left, right, points
                monitor.advance(pair.index + 1 if total else 0, total or 1)
                if self._stop.is_set():
                    return

    def _shot(self, settings: CaptureSettings, seen: _Seen, bodies: list[tuple[int, FoundBody]]) -> TakenShot:
        pair, left, right, points = seen
        return TakenShot(
            eye_with_balls(pair.left.copy(), left, bodies, points.left),
            eye_with_balls(pair.right.copy(), right, bodies, points.right),
            Found(points.points, groups_of_points(points, bodies), {body.name: body for _, body in bodies}),
            settings.rig,
            self.progress,
        )


class TargetTaking(Taking):
    """Takes frames of one target.

    Parameters
    ----------
    wish, stop, feed
        As of `Taking`.
    name : str
        What the target is called.
    n_balls : int or None
        Its number of balls, if it is known.
    """

    def __init__(self, wish: LiveWish, stop: Event, feed: Feed[TakenShot], name: str, n_balls: int | None) -> None:
        super().__init__(wish, stop, feed)
        self._name, self._n_balls = name, n_balls
        self._taking = BodyTaking(name, n_balls)

    def without_file(self, settings: CaptureSettings) -> CaptureSettings:
        """Leave out the targets: they are what is to be calibrated."""
        return replace(settings, bodies=(), joints=())

    def begin(self, settings: CaptureSettings) -> None:
        """Begin beside the other targets."""
        self._taking = BodyTaking(self._name, self._n_balls, _others(settings, self._name))

    def take(self, points: StereoPoints) -> list[tuple[int, FoundBody]]:
        """Take the points of a pair; return the target in it."""
        found = self._taking.add(points)
        return [] if found is None else [(0, found)]

    def look(self) -> BodyProgress:
        """Return how far it is."""
        return self._taking.progress

    def calibrate(self, name: str, n_balls: int | None, monitor: Monitor) -> BodyCalibration:
        """Calibrate the target from the frames that were taken; errors as `calibrate_body`."""
        if self.settings is None:
            raise InputError("no frames of the target were taken yet")
        frames, others = self._taking.frames, _others(self.settings, name)
        return calibrate_body(frames, name, n_balls, others, monitor=monitor)


class JointsTaking(Taking):
    """Takes frames of targets that move against each other.

    Parameters
    ----------
    wish, stop, feed
        As of `Taking`.
    wishes : sequence of JointWish
        The joints that are looked at; all pairs of targets if there is none.
    """

    def __init__(self, wish: LiveWish, stop: Event, feed: Feed[TakenShot], wishes: Sequence[JointWish]) -> None:
        super().__init__(wish, stop, feed)
        self._pairs = [(one.parent, one.child) for one in wishes]
        self._taking: JointTaking | None = None
        self._progress, self._looked = JointProgress(), 0.0

    def begin(self, settings: CaptureSettings) -> None:
        """Begin with the targets of the settings."""
        self._taking = JointTaking(settings.bodies)

    def take(self, points: StereoPoints) -> list[tuple[int, FoundBody]]:
        """Take the points of a pair; return the targets in it."""
        if self._taking is None:
            return []
        names = self._taking.names
        return [(names.index(body.name), body) for body in self._taking.add(points)]

    @property
    def progress(self) -> JointProgress:
        """How far it was a moment ago."""
        now = time.monotonic()
        if self._taking is not None and now - self._looked >= MOTION_INTERVAL:
            self._looked = now
            self._progress = self.look()
        return self._progress

    def look(self) -> JointProgress:
        """Return how far it is."""
        if self._taking is None:
            return JointProgress()
        return JointProgress(self._taking.n_frames, self._taking.n_found, tuple(self._taking.motions(self._pairs)))

    def calibrate(self, wishes: Sequence[JointWish]) -> JointCalibration:
        """Calibrate joints from the frames that were taken; errors as `calibrate_joints`."""
        if self._taking is None:
            raise InputError("no frames of the joints were taken yet")
        return calibrate_joints(self._taking.frames, self._taking.names, wishes, self._rate)


def _others(settings: CaptureSettings, name: str) -> list[BodyTarget]:
    """The targets beside one of this name."""
    return [body for body in settings.bodies if body.name != name]
