"""Jobs that collect images for a calibration: of a chessboard, of one target, of targets joined by joints."""

import time
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace
from functools import partial
from typing import Generic, TypeVar

import numpy as np

from skelgen.app.capture_jobs.board_views import CollectedView, ViewCollection, is_new, is_steady
from skelgen.app.capture_jobs.camera_images import CameraImage, camera_images_of
from skelgen.app.capture_jobs.live import open_stream, source_of_text, warm_up
from skelgen.app.capture_jobs.messages import (
    BoardShot,
    CaptureOptions,
    CollectingControl,
    Feed,
    FoundInSpace,
    JointProgress,
    TargetShot,
)
from skelgen.capture.calibration.body import BodyCalibration, calibrate_body
from skelgen.capture.calibration.chessboard import Board, BoardView, find_board
from skelgen.capture.calibration.joints import JointCalibration, calibrate_joints
from skelgen.capture.calibration.stereo import absence
from skelgen.capture.calibration.taking import BodyProgress, BodyTaking, JointTaking
from skelgen.capture.calibration.verdict import PairSeen
from skelgen.capture.images import opencv
from skelgen.capture.live import search_parameters
from skelgen.capture.optics import triangulate
from skelgen.capture.values import FoundBody, FramePair, FrameSource, Image, JointRequest, StereoPoints
from skelgen.errors import InputError
from skelgen.model.arrays import Floats
from skelgen.model.rig import AnySettings, BodyTarget, StereoRig
from skelgen.progress import Monitor

_Progress = TypeVar("_Progress")

_MOTION_INTERVAL = 0.25
"""s between two looks at all motion so far, which take 10 ms with many targets."""


class _Collector:
    """Takes pairs of images from a source until it is told to stop."""

    def __init__(self, control: CollectingControl) -> None:
        self._control = control

    def _pairs(self, source: FrameSource, monitor: Monitor) -> Iterator[FramePair]:
        """Pairs of an open source, with their progress."""
        total = source.n_frames or 0
        for pair in source:
            yield pair
            monitor.advance(pair.index + 1 if total else 0, total or 1)
            if self._control.stop.is_set():
                return


class BoardCollector(_Collector):
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
    control : CollectingControl
        Tells it to stop, and to keep a view.
    feed : Feed
        Where pictures go.
    """

    def __init__(
        self, source: str, board: Board, views: ViewCollection, control: CollectingControl, feed: Feed[BoardShot]
    ) -> None:
        super().__init__(control)
        self._source, self._board, self._views, self._feed = source, board, views, feed

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
        with ThreadPoolExecutor(2, "board") as threads, source_of_text(self._source) as source:
            monitor.begin(title)
            if any(view.size != source.size for view in self._views.views):
                raise InputError("these images have another size than those of the views before: clear the views first")
            names: tuple[str, ...] = getattr(source, "names", ())  # of image files; others are counted
            before: CollectedView | None = None
            n_seen = 0
            for number, pair in enumerate(self._pairs(source, monitor)):
                left, right = threads.map(partial(find_board, board=self._board), (pair.left, pair.right))
                name = names[number] if number < len(names) else self._views.next_name
                now = CollectedView(name, left, right, source.size)
                if source.rate is None or self._is_kept(now, before):
                    self._views.add(now)
                before = now
                n_seen += left is not None or right is not None
                self._feed.put(BoardShot(_copied(pair.left, left), _copied(pair.right, right)))
            if before is not None and not n_seen and not self._control.stop.is_set():
                raise InputError(absence((pair.left, pair.right), self._board))

    def _is_kept(self, now: CollectedView, before: CollectedView | None) -> bool:
        """Whether a view of a stream is kept."""
        if not now.is_whole:
            return False
        if self._control.keep_next.is_set():
            self._control.keep_next.clear()
            return True
        return is_steady(before, now) and is_new(now, self._views.views)


def _copied(image: Image, view: BoardView | None) -> CameraImage:
    return CameraImage.of_board(image.copy(), view)  # sources write the next image over this one


class TargetCollector(_Collector, ABC, Generic[_Progress]):
    """Takes frames of targets; what was taken stays, whatever ends it.

    Parameters
    ----------
    options : CaptureOptions
        Settings and source.
    control : CollectingControl
        Tells it to stop.
    feed : Feed
        Where pictures and progress go.
    """

    def __init__(self, options: CaptureOptions, control: CollectingControl, feed: Feed[TargetShot[_Progress]]) -> None:
        super().__init__(control)
        self._options, self._feed = options, feed
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
        self._begin(self.settings)
        self._rate = opened.rate
        warm_up(monitor)
        monitor.begin(title)
        last: TargetShot[_Progress] | None = None
        total = opened.n_frames or 0
        with closing(opened.stream) as stream:
            for captured in stream:
                for sentence in captured.notices[1 if captured.pair.dropped else 0 :]:
                    self._feed.notice(sentence)  # but not of lost pairs, which cost nothing here
                bodies = self._take(captured.points)
                if self._feed.is_waiting:
                    images, found = camera_images_of(captured, bodies), FoundInSpace.of(captured.points, bodies)
                    last = TargetShot(images, found, opened.settings.rig, self._recent_progress)
                    self._feed.put(last)
                monitor.advance(captured.pair.index + 1 if total else 0, total or 1)
                if self._control.stop.is_set():
                    break
        if last is not None:
            self._feed.put(replace(last, progress=self._progress))

    def _without_file(self, settings: AnySettings) -> AnySettings:
        """What is used of a simulated rig, which knows its settings by itself."""
        return settings

    @abstractmethod
    def _begin(self, settings: AnySettings) -> None:
        """Get ready for a capture by these settings."""

    @abstractmethod
    def _take(self, points: StereoPoints) -> Mapping[int, FoundBody]:
        """Take the points of a pair; return the targets in it by their groups."""

    @property
    @abstractmethod
    def _progress(self) -> _Progress:
        """How far it is."""

    @property
    def _recent_progress(self) -> _Progress:
        """How far it is, or was a moment ago."""
        return self._progress


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
        control: CollectingControl,
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

    def _begin(self, settings: AnySettings) -> None:
        others = _others(settings, self._name)
        self._taking = BodyTaking(self._name, self._n_balls, others, search_parameters(settings))

    def _take(self, points: StereoPoints) -> Mapping[int, FoundBody]:
        found = self._taking.add(points)
        return {} if found is None else {0: found}

    @property
    def _progress(self) -> BodyProgress:
        return self._taking.progress


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
        control: CollectingControl,
        feed: Feed[TargetShot[JointProgress]],
        requests: Sequence[JointRequest],
    ) -> None:
        super().__init__(options, control, feed)
        self._pairs_of_targets = [(request.parent, request.child) for request in requests]
        self._taking: JointTaking | None = None
        self._last_progress, self._looked_at = JointProgress(), 0.0

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

    def _begin(self, settings: AnySettings) -> None:
        self._taking = JointTaking(settings.bodies, search_parameters(settings))

    def _take(self, points: StereoPoints) -> Mapping[int, FoundBody]:
        if self._taking is None:
            return {}
        names = self._taking.names
        return {names.index(body.name): body for body in self._taking.add(points)}

    @property
    def _progress(self) -> JointProgress:
        if self._taking is None:
            return JointProgress()
        motions = self._taking.motions(self._pairs_of_targets)
        return JointProgress(self._taking.n_frames, self._taking.n_found, tuple(motions))

    @property
    def _recent_progress(self) -> JointProgress:
        now = time.monotonic()
        if self._taking is not None and now - self._looked_at >= _MOTION_INTERVAL:
            self._last_progress, self._looked_at = self._progress, now
        return self._last_progress


def _others(settings: AnySettings, name: str) -> list[BodyTarget]:
    """The targets beside one of this name."""
    return [body for body in settings.bodies if body.name != name]


def boards_in_space(rig: StereoRig, pairs: Sequence[PairSeen], board: Board) -> FoundInSpace:
    """Return the corners of the boards that a calibration rests on, each board a group of its own.

    Parameters
    ----------
    rig : StereoRig
        The calibrated cameras.
    pairs : sequence of PairSeen
        Views of the board; those that were not used are passed over.
    board : Board
        The board.
    """
    corners = [
        _corners_in_space(rig, pair.left.corners, pair.right.corners, board)
        for pair in pairs
        if pair.is_used and pair.left is not None and pair.right is not None
    ]
    points = np.concatenate([np.zeros((0, 3)), *corners])
    groups = np.repeat(np.arange(len(corners), dtype=np.intp), board.columns * board.rows)
    is_known = np.isfinite(points).all(axis=1)
    return FoundInSpace(points[is_known], groups[is_known])


def _corners_in_space(rig: StereoRig, left: Floats, right: Floats, board: Board) -> Floats:
    """Corners in space; the detector may have begun at another end of the board in one of the images."""
    tried = [triangulate(rig, left, right[order]).points for order in board.orders]
    steps = [np.linalg.norm(np.diff(points.reshape(board.rows, -1, 3), axis=1), axis=-1) for points in tried]
    errors = [float(np.abs(np.nan_to_num(step, nan=np.inf) - board.square).mean()) for step in steps]
    return tried[int(np.argmin(errors))]
