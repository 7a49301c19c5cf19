"""The camera of the 3-D view: its target, its viewpoint, and the floor beneath."""

import math
from dataclasses import dataclass, replace

import numpy as np

from skelgen.model import Project
from skelgen.model.arrays import Floats, Ints
from skelgen_gui.model.picture import Canvas
from skelgen_gui.model.scene import Scene
from skelgen_gui.model.viewpoint import Viewpoint, sign_of

_HOME = (math.radians(32), math.radians(14))  # azimuth from the front, and elevation, of the first look at a take


class ViewCamera:
    """Where the viewer stands before a scene, and the floor beneath it.

    Attributes
    ----------
    scene : Scene or None
        What is open.
    floor : Floor or None
        Its floor; None if nothing is ever seen.
    canvas : Canvas
        The viewer, and the size of the picture.
    is_home : bool
        Whether the viewer stands where the first look put him: then a picture of another size is fitted again.
    """

    def __init__(self) -> None:
        self.scene: Scene | None = None
        self.floor: Floor | None = None
        self.canvas = Canvas(Viewpoint(), 1, 1)
        self.is_home = True
        self._cameras = np.zeros((0, 3))
        self._up_of_cameras: int | None = None
        self._stated_up: int | None = None
        self._anchor: Floats | None = None

    @property
    def up(self) -> int:
        """The coordinate axis that points up, or with `DOWN` added down."""
        if self._stated_up is not None:
            return self._stated_up
        if self._up_of_cameras is not None:
            return self._up_of_cameras
        return self.scene.up if self.scene is not None else 2

    def open(self, project: Project | None) -> None:
        """Look at another project; the viewer stays if it is another result of the same take."""
        is_same = self.scene is not None and project is not None and self.scene.project.take is project.take
        self.scene = None if project is None else Scene(project)
        if not is_same:
            self.follow(None if self._anchor is None else 0)
            self.look_home()

    def point_up(self, axis: int | None) -> None:
        """State which coordinate axis points up; None leaves it to the data."""
        self._stated_up = axis
        self.look_home()

    def show_cameras(self, points: Floats, up: int | None) -> None:
        """Show cameras with the take; they may determine which axis points up.

        Parameters
        ----------
        points : ndarray, shape (n, 3), mm
            Points of the cameras' frustums.
        up : int or None
            The coordinate axis that points up, or with `DOWN` added down, if the cameras determine it.
        """
        is_without = not len(points) and not len(self._cameras) and up == self._up_of_cameras
        self._cameras, self._up_of_cameras = points, up
        if not is_without:
            self.look_home()

    def resize(self, width: int, height: int) -> None:
        """Use a picture of another size [px].

        Parameters
        ----------
        width, height : int, px
            Size of the picture.
        """
        self.canvas = replace(self.canvas, width=width, height=height)
        if self.is_home:
            self.look_home()

    def move(self, viewpoint: Viewpoint) -> None:
        """Put the viewer elsewhere."""
        self.canvas = replace(self.canvas, viewpoint=viewpoint)
        self.is_home = False

    def follow(self, frame: int | None) -> None:
        """Follow the subject from a frame on; None stays."""
        self._anchor = None
        if frame is not None and self.scene is not None and frame < self.scene.n_frames:
            self._anchor = self.scene.middle(frame)

    def canvas_at(self, frame: int) -> Canvas:
        """Return the viewpoint in a frame, and the size of the picture; it follows the subject horizontally."""
        if self._anchor is None or self.scene is None or frame >= self.scene.n_frames:
            return self.canvas
        step = np.nan_to_num(self.scene.middle(frame) - self._anchor)
        step[self.up % 3] = 0.0
        viewpoint = self.canvas.viewpoint
        return replace(self.canvas, viewpoint=viewpoint.looking_at(np.array(viewpoint.target) + step))

    def look_home(self) -> None:
        """Place the floor, and look at the whole take obliquely from the front."""
        scene = self.scene
        is_seen = scene is not None and len(scene.inliers) > 0
        self.floor = find_floor(scene.sample, scene.inliers, scene.size, self.up) if scene and is_seen else None
        self.move(Viewpoint(azimuth=self._front + _HOME[0], elevation=_HOME[1], up=self.up))
        self.fit_take()
        self.is_home = True

    def look(self, right_of_front: float, elevation: float) -> None:
        """Look from a direction.

        Parameters
        ----------
        right_of_front : float, rad
            How far to the right of the front the viewer stands.
        elevation : float, rad
            How far above.
        """
        self.move(replace(self.canvas.viewpoint, azimuth=self._front + right_of_front, elevation=elevation))

    def fit_take(self) -> None:
        """Fit the whole take, with the cameras that see it."""
        if self.scene is not None:
            self._fit(np.concatenate([self.scene.inliers, self.scene.skeleton_sample, self._cameras]))

    def fit_frame(self, frame: int, markers: set[int]) -> None:
        """Fit some markers in a frame, or all that is there.

        Parameters
        ----------
        frame : int
            The frame.
        markers : set of int
            Markers that are fitted, where they are next in time if they are unseen; all that is there if it is empty,
            and the whole take if nothing is.
        """
        if self.scene is None or frame >= self.scene.n_frames:
            return
        self.follow(None if self._anchor is None else frame)
        snapshot = self.scene.at(frame)
        points = np.concatenate([snapshot.markers, snapshot.unlabelled, snapshot.joints, snapshot.bones.reshape(-1, 3)])
        if markers:
            points = np.array([self.scene.nearest_place(marker, frame) for marker in sorted(markers)])
        if np.isnan(points[:, 0]).all():
            self.fit_take()
        else:
            self._fit(points)

    @property
    def _front(self) -> float:
        return 0.0 if self.scene is None else self.scene.front(self.up)

    def _fit(self, points: Floats) -> None:
        self.move(self.canvas.viewpoint.fitted(points, self.canvas.width, self.canvas.height))


N_FADES = 4
"""Steps in which the grid fades toward its edge."""

_CELLS = 8  # across what is seen in a frame
_MOST_CELLS = 36  # across the take: more would be a haze
_LEAST_CELL = 1.0  # mm, beneath a single point
_BEYOND = 0.25  # of the take's extent, by which the grid exceeds it
_SOLE = 0.12  # of the height: so far may the lowest marker hang above a floor at zero


@dataclass(frozen=True, eq=False)
class Floor:
    """A grid on the floor.

    Attributes
    ----------
    up : int
        The vertical axis, 0 .. 2.
    height : float, mm
        Where the floor lies along it.
    spacing : float, mm
        Size of a cell.
    lines : ndarray, shape (n_lines, 2, 3), mm
        The sides of the cells.
    fade : ndarray of intp, shape (n_lines,)
        0 in the middle .. `N_FADES` - 1 at the edge.
    origin : ndarray, shape (3,), mm
        The world's origin, on the floor.
    """

    up: int
    height: float
    spacing: float
    lines: Floats
    fade: Ints
    origin: Floats

    def below(self, points: Floats) -> Floats:
        """Return points [mm], shape (..., 3), dropped onto the floor."""
        dropped = np.array(points)
        dropped[..., self.up] = np.where(np.isnan(dropped[..., self.up]), np.nan, self.height)
        return dropped


def find_floor(sample: Floats, inliers: Floats, size: float, up: int) -> Floor:
    """Place a floor beneath a take.

    Parameters
    ----------
    sample : ndarray, shape (n_frames, n, 3), mm
        Positions in some frames, NaN where unseen; at least one is seen.
    inliers : ndarray, shape (n, 3), mm
        The same without outliers; at least one.
    size : float, mm
        Extent of what is seen in a frame.
    up : int
        The axis that points up, or with `DOWN` added down.
    """
    level = [axis for axis in range(3) if axis != up % 3]
    box = np.stack([inliers.min(axis=0), inliers.max(axis=0)])
    axis = up % 3
    height = sign_of(up) * _height(sign_of(up) * sample[..., axis])
    extent = float((box[1] - box[0])[level].max())
    spacing = round_step(max(size / _CELLS, (1 + 2 * _BEYOND) * extent / _MOST_CELLS, _LEAST_CELL))
    margin = _BEYOND * max(extent, size) + spacing
    low = np.floor((box[0] - margin)[level] / spacing).astype(np.intp)
    high = np.ceil((box[1] + margin)[level] / spacing).astype(np.intp)
    lines = spacing * _cells(low, high)
    world = np.insert(lines, axis, height, axis=2)
    origin = np.zeros(3)
    origin[axis] = height
    middle, half = spacing * (low + high) / 2, spacing * (high - low) / 2
    far = np.linalg.norm((lines.mean(axis=1) - middle) / half, axis=1)
    fade = np.clip(far * N_FADES, 0, N_FADES - 1).astype(np.intp)
    return Floor(axis, height, spacing, world, fade, origin)


def round_step(value: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten that does not exceed a positive value."""
    power = 10.0 ** math.floor(math.log10(value))
    return max(step * power for step in (1, 2, 5) if step * power <= value * (1 + 1e-9))


def _height(heights: Floats) -> float:
    """The lowest height without outliers; 0 if that is little above 0, as markers sit above the sole."""
    lowest, highest = np.fmin.reduce(heights, axis=1), np.fmax.reduce(heights, axis=1)
    bottom, top = float(np.nanpercentile(lowest, 1)), float(np.nanpercentile(highest, 99))
    return 0.0 if 0.0 <= bottom <= _SOLE * (top - bottom) else bottom


def _cells(low: Ints, high: Ints) -> Floats:
    """Sides of unit cells between two corners, shape (n, 2, 2)."""
    x, y = np.arange(low[0], high[0] + 1), np.arange(low[1], high[1] + 1)
    along_x = np.stack(np.broadcast_arrays(x[:-1, None], y, x[1:, None], y), axis=-1)
    along_y = np.stack(np.broadcast_arrays(x, y[:-1, None], x, y[1:, None]), axis=-1)
    return np.concatenate([along_x.reshape(-1, 2, 2), along_y.reshape(-1, 2, 2)]).astype(np.float64)
