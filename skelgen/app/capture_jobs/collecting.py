"""Jobs that collect images for a calibration: of a chessboard, one target, targets joined by joints, a waved wand."""

import time
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace
from functools import partial
from os import cpu_count
from typing import Generic, Protocol, TypeVar

from skelgen.app.capture_jobs import images
from skelgen.app.capture_jobs.live import open_stream, warm_up
from skelgen.app.capture_jobs.messages import CaptureControl, CaptureOptions, Feed, FoundInSpace, TargetShot, WandShot
from skelgen.capture.calibration.body import BodyCalibration, calibrate_body
from skelgen.capture.calibration.chessboard import Board, BoardView, find_board
from skelgen.capture.calibration.joints import JointCalibration, calibrate_joints
from skelgen.capture.calibration.stereo import absence
from skelgen.capture.calibration.taking import BodyProgress, BodyTaking, JointProgress, JointTaking
from skelgen.capture.images import opencv
from skelgen.capture.live import search_parameters
from skelgen.capture.room.calibrate import WandCalibration
from skelgen.capture.room.points import detected_balls
from skelgen.capture.room.sources import open_room_source
from skelgen.capture.room.taking import WandTaking
from skelgen.capture.sources import open_source
from skelgen.capture.values import FoundBody, Image, JointRequest, StereoPoints
from skelgen.errors import InputError
from skelgen.model.rig import AnySettings, BodyTarget
from skelgen.progress import Monitor

_T = TypeVar("_T")
_Shot = TypeVar("_Shot")
_Seen_co = TypeVar("_Seen_co", covariant=True)
_Progress = TypeVar("_Progress", bound=BodyProgress | JointProgress)

_PROGRESS_INTERVAL = 0.25
"""s between two looks at all motion so far, which take 10 ms with many targets."""


class _Collector(Generic[_Shot]):
    """Takes images until it is told to stop; what was taken stays, whatever ends it.

    Parameters
    ----------
    control : CaptureControl
        Tells it to stop.
    feed : Feed
        Where pictures and progress go.
    """

    def __init__(self, control: CaptureControl, feed: Feed[_Shot]) -> None:
        self._control, self._feed = control, feed

    def _until_stopped(
        self, frames: Iterable[tuple[int, _T]], n_frames: int | None, title: str, monitor: Monitor
    ) -> Iterator[_T]:
        """What an open source delivers with its numbers, while progress is reported."""
        monitor.begin(title)
        for number, frame in frames:
            yield frame
            monitor.advance(number + 1 if n_frames else 0, n_frames or 1)
            if self._control.stop.is_set():
                return


class BoardCollector(_Collector[tuple[images.CameraImage, ...]]):
    """Looks for a board in all pairs of a source, and keeps the views that are worth it.

    Pictures that were taken one by one (whose rate nobody knows) are all kept, so that the verdict can name those that
    show no board; of a stream, those on which the board is held still, and elsewhere than before.

    Parameters
    ----------
    source : str
        Text that names the source.
    board : Board
        What is looked for.
    views : ViewCollection
        Where views are kept.
    control : CaptureControl
        Tells it to stop, and to keep a view.
    feed : Feed
        Where pictures go.
    """

    def __init__(
        self,
        source: str,
        board: Board,
        views: images.ViewCollection,
        control: CaptureControl,
        feed: Feed[tuple[images.CameraImage, ...]],
    ) -> None:
        super().__init__(control, feed)
        self._source, self._board, self._views = source, board, views

    def run(self, title: str, monitor: Monitor) -> None:
        """Look until it is told to stop, or the source ends.

        Parameters
        ----------
        title : str
            Progress is reported under this name.
        monitor : Monitor
            Receives the progress.

        Raises
        ------
        SkelgenError
            If OpenCV is missing, or the source fails, or it shows no board at all; the views before are kept.
        """
        opencv()
        with ThreadPoolExecutor(2, "board") as threads, open_source(self._source) as source:
            names: tuple[str, ...] = getattr(source, "names", ())  # of image files; others are counted
            before: images.CollectedView | None = None
            n_seen = 0
            numbered = ((pair.index, pair) for pair in source)
            for number, pair in enumerate(self._until_stopped(numbered, source.n_frames, title, monitor)):
                size = pair.left.shape[1], pair.left.shape[0]
                if any(view.size != size for view in self._views.views):
                    raise InputError(
                        "these images have another size than those of the views before: clear the views first"
                    )
                left, right = threads.map(partial(find_board, board=self._board), (pair.left, pair.right))
                name = names[number] if number < len(names) else self._views.next_name
                now = images.CollectedView(name, left, right, size)
                if source.rate is None or self._is_kept(now, before):
                    self._views.add(now)
                before = now
                n_seen += left is not None or right is not None
                self._feed.put((_copied(pair.left, left), _copied(pair.right, right)))
            if before is not None and not n_seen and not self._control.stop.is_set():
                raise InputError(absence((pair.left, pair.right), self._board))

    def _is_kept(self, now: images.CollectedView, before: images.CollectedView | None) -> bool:
        """Whether a view of a stream is kept."""
        if not now.is_whole:
            return False
        if self._control.keep_next.is_set():
            self._control.keep_next.clear()
            return True
        return images.is_steady(before, now) and images.is_new(now, self._views.views)


def _copied(image: Image, view: BoardView | None) -> images.CameraImage:
    return images.CameraImage.of_board(image.copy(), view)  # sources write the next image over this one


class _Taking(Protocol[_Seen_co]):
    names: list[str]

    @property
    def progress(self) -> _Seen_co: ...

    def add(self, points: StereoPoints) -> list[FoundBody]: ...


class TargetCollector(_Collector[TargetShot[_Progress]], ABC, Generic[_Progress]):
    """Takes frames of targets.

    Parameters
    ----------
    options : CaptureOptions
        Settings and source.
    control, feed
        As of every collector.
    """

    def __init__(self, options: CaptureOptions, control: CaptureControl, feed: Feed[TargetShot[_Progress]]) -> None:
        super().__init__(control, feed)
        self._options = options
        self.settings: AnySettings | None = None
        self._rate: float | None = None

    def run(self, title: str, monitor: Monitor) -> None:
        """Take frames until it is told to stop, or the source ends.

        Parameters
        ----------
        title : str
            Progress is reported under this name.
        monitor : Monitor
            Receives the progress.

        Raises
        ------
        SkelgenError
            If settings or source cannot be used, or the source breaks off; frames before are kept.
        """
        opened = open_stream(self._options, only_points=True)
        self.settings = opened.settings if self._options.settings else self._without_file(opened.settings)
        self._rate, taking = opened.rate, self._begin(self.settings)
        warm_up(monitor)
        last: TargetShot[_Progress] | None = None
        looked_at = -_PROGRESS_INTERVAL
        with closing(opened.stream) as stream:
            numbered = ((captured.pair.index, captured) for captured in stream)
            for captured in self._until_stopped(numbered, opened.n_frames, title, monitor):
                for sentence in captured.notices[1 if captured.pair.dropped else 0 :]:
                    self._feed.notice(sentence)  # but not of lost pairs, which cost nothing here
                bodies = {taking.names.index(body.name): body for body in taking.add(captured.points)}
                if self._feed.is_waiting:
                    if time.monotonic() - looked_at >= _PROGRESS_INTERVAL:
                        progress, looked_at = taking.progress, time.monotonic()
                    seen, found = images.camera_images_of(captured, bodies), FoundInSpace.of(captured.points, bodies)
                    last = TargetShot(seen, found, opened.settings.rig, progress)
                    self._feed.put(last)
        if last is not None:
            self._feed.put(replace(last, progress=taking.progress))

    def _without_file(self, settings: AnySettings) -> AnySettings:
        """What is used of a simulated rig, which knows its settings by itself."""
        return settings

    @abstractmethod
    def _begin(self, settings: AnySettings) -> _Taking[_Progress]:
        """Return what takes frames of a capture by these settings."""


class BodyCollector(TargetCollector[BodyProgress]):
    """Takes frames of one target.

    Parameters
    ----------
    options, control, feed
        As of `TargetCollector`.
    name : str
        What the target is called.
    n_balls : int or None
        Its number of balls, if it is known.
    """

    def __init__(
        self,
        options: CaptureOptions,
        control: CaptureControl,
        feed: Feed[TargetShot[BodyProgress]],
        name: str,
        n_balls: int | None,
    ) -> None:
        super().__init__(options, control, feed)
        self._name, self._n_balls = name, n_balls
        self._taking = BodyTaking(name, n_balls)

    def calibrate(self, name: str, n_balls: int | None, monitor: Monitor) -> BodyCalibration:
        """Calibrate the target from the frames that were taken; errors as `calibrate_body`.

        Parameters
        ----------
        name : str
            What the target is called.
        n_balls : int or None
            Its number of balls, if it is known.
        monitor : Monitor
            Receives the progress.
        """
        if self.settings is None:
            raise InputError("no frames of the target were taken yet")
        others, search = _others(self.settings, name), search_parameters(self.settings)
        return calibrate_body(self._taking.frames, name, n_balls, others, search, monitor)

    def _without_file(self, settings: AnySettings) -> AnySettings:
        """Leave out the targets: they are what is to be calibrated."""
        return replace(settings, bodies=(), joints=())

    def _begin(self, settings: AnySettings) -> BodyTaking:
        others = _others(settings, self._name)
        self._taking = BodyTaking(self._name, self._n_balls, others, search_parameters(settings))
        return self._taking


class JointCollector(TargetCollector[JointProgress]):
    """Takes frames of targets that move against each other.

    Parameters
    ----------
    options, control, feed
        As of `TargetCollector`.
    requests : sequence of JointRequest
        The joints that are looked at; all pairs of targets if there is none.
    """

    def __init__(
        self,
        options: CaptureOptions,
        control: CaptureControl,
        feed: Feed[TargetShot[JointProgress]],
        requests: Sequence[JointRequest],
    ) -> None:
        super().__init__(options, control, feed)
        self._pairs_of_targets = [(request.parent, request.child) for request in requests]
        self._taking: JointTaking | None = None

    def calibrate(
        self, requests: Sequence[JointRequest], use_frames: int | Sequence[int] | None = None
    ) -> JointCalibration:
        """Calibrate joints from the frames that were taken.

        Parameters
        ----------
        requests, use_frames
            As of `calibrate_joints`; errors are its errors, too.
        """
        if self._taking is None:
            raise InputError("no frames of the joints were taken yet")
        return calibrate_joints(self._taking.frames, self._taking.names, requests, self._rate, use_frames)

    def _begin(self, settings: AnySettings) -> JointTaking:
        self._taking = JointTaking(settings.bodies, search_parameters(settings), self._pairs_of_targets)
        return self._taking


class WandCollector(_Collector[WandShot]):
    """Takes a waved wand, and shows what it covers.

    Parameters
    ----------
    source : str
        Text that names the source.
    distances : sequence of float, mm
        Where the balls are along the wand.
    control, feed
        As of every collector.
    """

    def __init__(self, source: str, distances: Sequence[float], control: CaptureControl, feed: Feed[WandShot]) -> None:
        super().__init__(control, feed)
        self._source, self._distances = source, tuple(distances)
        self.taking: WandTaking | None = None

    def run(self, title: str, monitor: Monitor) -> None:
        """Take the wand until it is told to stop, or the source ends.

        Parameters
        ----------
        title : str
            Progress is reported under this name.
        monitor : Monitor
            Receives the progress.

        Raises
        ------
        SkelgenError
            If OpenCV is missing, or source or wand cannot be used; what was taken before is kept.
        """
        opencv()
        source = open_room_source(self._source)
        last: WandShot | None = None
        with ThreadPoolExecutor(cpu_count() or 1, "images") as threads, ThreadPoolExecutor(1, "room") as executor:
            taking = self.taking = WandTaking(source.cameras, self._distances, executor)
            with source as sets:
                for frame in self._until_stopped(enumerate(sets), source.n_frames, title, monitor):
                    views = list(threads.map(detected_balls, frame.images))
                    taking.add(views, [None if image is None else image.shape[::-1] for image in frame.images])
                    if self._feed.is_waiting:
                        last = WandShot(tuple(map(images.CameraImage.of_balls, frame.images, views)), taking.progress())
                        self._feed.put(last)
        if last is not None:
            self._feed.put(replace(last, progress=taking.progress()))

    def calibrate(self) -> WandCalibration:
        """Calibrate the cameras from the images taken so far.

        Raises
        ------
        InputError
            As `WandTaking.calibrate`, and if nothing was taken.
        """
        if self.taking is None or not self.taking.frames:
            raise InputError("no images were taken; wave the wand first")
        return self.taking.calibrate()


def _others(settings: AnySettings, name: str) -> list[BodyTarget]:
    """The targets beside one of this name."""
    return [body for body in settings.bodies if body.name != name]
