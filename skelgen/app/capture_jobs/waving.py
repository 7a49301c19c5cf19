"""The job that takes a waved wand by all cameras of a room, and shows what it covers."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from os import cpu_count

from skelgen.app.capture_jobs.camera_images import CameraImage
from skelgen.app.capture_jobs.messages import CollectingControl, Feed, WandShot
from skelgen.capture.images import opencv
from skelgen.capture.room.calibrate import WandCalibration
from skelgen.capture.room.recording import detected_balls
from skelgen.capture.room.sources import open_room_source
from skelgen.capture.room.taking import WandTaking
from skelgen.errors import InputError
from skelgen.progress import Monitor


class WandCollector:
    """Takes a waved wand until it is told to stop; what was taken stays, whatever ends it.

    Parameters
    ----------
    source : str
        Text that names the source.
    distances : sequence of float, mm
        Where the balls are along the wand.
    control : CollectingControl
        Tells it to stop.
    feed : Feed
        Where pictures and progress go.
    """

    def __init__(
        self, source: str, distances: Sequence[float], control: CollectingControl, feed: Feed[WandShot]
    ) -> None:
        self._source, self._distances, self._control, self._feed = source, tuple(distances), control, feed
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
        with ThreadPoolExecutor(cpu_count() or 1, "images") as threads, ThreadPoolExecutor(1, "room") as looker:
            taking = self.taking = WandTaking(source.cameras, self._distances, looker)
            monitor.begin(title)
            with source as sets:
                for number, frame in enumerate(sets, 1):
                    views = list(threads.map(detected_balls, frame.images))
                    taking.add(views, [None if image is None else image.shape[::-1] for image in frame.images])
                    if self._feed.is_waiting:
                        last = WandShot(tuple(map(CameraImage.of_balls, frame.images, views)), taking.progress())
                        self._feed.put(last)
                    monitor.advance(number if source.n_frames else 0, source.n_frames or 1)
                    if self._control.stop.is_set():
                        break
        if last is not None:
            self._feed.put(WandShot(last.images, taking.progress()))

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
