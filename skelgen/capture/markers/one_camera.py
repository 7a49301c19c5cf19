"""Markers of which one camera loses sight for a while: where they are on the other camera's line of sight.

A ball that both cameras saw is followed on in one image. Its depth follows from the known distances to markers that are
rigid with it (`rigid_edges`) and from how fast depths change in this recording. All depths of a run are solved together
by Gauss-Newton, with weights of Student's t, so that single wrong neighbours do little harm. Only depths that are as
certain as those of two cameras are kept.
"""

from __future__ import annotations

from array import array
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skelgen.capture.markers.candidates import Candidates
from skelgen.capture.markers.correspondences import TrackPairs, markers_of_pairs
from skelgen.capture.markers.rigidity import rigid_edges
from skelgen.capture.optics import undistort
from skelgen.geometry.statistics import SIGMA_OF_MEDIAN
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.rig import Camera, StereoRig

MAX_FRAMES = 120
"""Longest run of frames with one camera; it bounds the work."""

ANCHORS = 4
"""Frames of both cameras before and after a run, which give depth and speed."""

LAG = 5
"""Frames between two depths whose difference measures the typical change: over fewer it is mostly noise."""

FASTER = 2.0
"""Factor on the typical change of depth, which a run may exceed."""

MAX_STD = 2.0
"""Largest standard deviation of a depth that is kept, as a multiple of that of points of both cameras."""

MIN_NEIGHBOURS = 1
"""Rigid neighbours that must be seen in a frame: motion alone predicts a depth too badly."""

GATE = 3.0
"""Largest misfit of a run to the distances from its rigid neighbours, root mean square in standard deviations."""

FREEDOM = 4.0
"""Degrees of freedom of Student's t."""

MAX_STEPS, CONVERGED, MAX_STEP = 15, 1e-3, 100.0  # Gauss-Newton: iterations, and mm


@dataclass(frozen=True, eq=False)
class ImageBalls:
    """All balls of one camera's images.

    Attributes
    ----------
    centres : ndarray of float32, shape (n, 2), px
        Where they are.
    tracks : ndarray of int32, shape (n,)
        The track of each.
    per_frame : ndarray of intp, shape (n_frames,)
        How many there are in each frame.
    """

    centres: NDArray[np.float32]
    tracks: NDArray[np.int32]
    per_frame: Ints


class BallStore:
    """Collects the balls of one camera image by image; each takes 12 bytes."""

    def __init__(self) -> None:
        self._centres, self._tracks, self._per_frame = array("f"), array("i"), array("i")

    def add(self, centres: Floats, tracks: Ints) -> None:
        """Append an image.

        Parameters
        ----------
        centres : ndarray, shape (n_balls, 2), px
            Its balls.
        tracks : ndarray of intp, shape (n_balls,)
            The track of each.
        """
        self._centres.frombytes(np.ascontiguousarray(centres, dtype=np.float32).tobytes())
        self._tracks.frombytes(tracks.astype(np.int32).tobytes())
        self._per_frame.append(len(centres))

    def all(self) -> ImageBalls:
        """Return what was added; nothing more can be added while it is in use."""
        return ImageBalls(
            np.frombuffer(self._centres, np.float32).reshape(-1, 2),
            np.frombuffer(self._tracks, np.int32),
            np.frombuffer(self._per_frame, np.int32).astype(np.intp),
        )


class OneCameraPoints(NamedTuple):
    """Points of one camera: frames (n,), places [mm] (n, 3), standard deviations of depth [mm] (n,)."""

    frames: Ints
    points: Floats
    std: Floats


def points_of_one_camera(
    candidates: Candidates,
    kept: Bools,
    pairs: TrackPairs,
    balls: tuple[ImageBalls, ImageBalls],
    rig: StereoRig,
    scale: float = 1.0,
) -> OneCameraPoints:
    """Return the places of markers while only one camera sees them.

    Parameters
    ----------
    candidates : Candidates
        All pairs of balls of a recording.
    kept : ndarray of bool, shape (n,)
        Which of them are markers.
    pairs : TrackPairs
        Their pairs of tracks.
    balls : tuple of ImageBalls
        All balls of the left and of the right images.
    rig : StereoRig
        The cameras.
    scale : float
        Noise of the recording as a part of the stated one; see `noise_scale`.

    Returns
    -------
    OneCameraPoints
        In the rig's world; of each marker at most one in a frame, and none where both cameras see it.
    """
    known = _TwoCameraMarkers(candidates, kept, pairs, rig, scale)
    sides = [] if known.motion is None else enumerate((rig.left, rig.right))
    found = [known.locate(camera, run) for side, camera in sides for run in known.runs(balls, side, camera)]
    frames = np.concatenate([np.empty(0, dtype=np.intp), *(one.frames for one in found)])
    points = np.concatenate([np.empty((0, 3)), *(one.points for one in found)])
    return OneCameraPoints(frames, points, np.concatenate([np.empty(0), *(one.std for one in found)]))


@dataclass(frozen=True, eq=False)
class _OneCameraRun:
    """A ball followed through one camera's images, with some frames of both cameras before or after."""

    marker: int
    frames: Ints
    rays: Floats  # x / z and y / z in the camera's frame
    both: Ints  # the candidate of each frame, -1 while the other camera does not see the marker


class _TwoCameraMarkers:
    """The markers that both cameras saw, how they move, and which of them are rigid with each other."""

    def __init__(self, candidates: Candidates, kept: Bools, pairs: TrackPairs, rig: StereoRig, scale: float) -> None:
        accepted = np.zeros(len(pairs), dtype=np.bool_)
        accepted[pairs.of_candidate[kept]] = True
        marker = markers_of_pairs(pairs, accepted).marker
        self._candidates, self._scale, self._noise = candidates, scale, rig.noise * scale
        self._n_markers = int(marker.max(initial=-1)) + 1
        self._marker_of_track = [
            dict(zip(pairs.tracks[accepted, side].tolist(), marker[accepted].tolist(), strict=True)) for side in (0, 1)
        ]
        names = marker[pairs.of_candidate]
        index = np.flatnonzero(kept)
        keys = candidates.frames[index] * self._n_markers + names[index]
        order = np.argsort(keys, kind="stable")
        self._index, self._keys = index[order], keys[order]
        edges = rigid_edges(candidates, kept, names, scale)
        self._neighbours: dict[int, list[tuple[int, float, float]]] = defaultdict(list)
        for (one, other), length, std in zip(edges.ends.tolist(), edges.lengths, edges.std, strict=True):
            self._neighbours[one].append((other, float(length), float(std)))
            self._neighbours[other].append((one, float(length), float(std)))
        self.motion = self._typical_motion(names[index], rig.left)
        spread = candidates.covariance(index)
        usual = float(np.median(np.sqrt(np.trace(spread, axis1=1, axis2=2)))) if len(index) else 0.0
        self._max_std = MAX_STD * usual

    def runs(self, balls: tuple[ImageBalls, ImageBalls], side: int, camera: Camera) -> Iterator[_OneCameraRun]:
        """Yield the runs of frames in which only one camera sees a marker."""
        seen, others = self._seen(balls[side], side), self._seen(balls[1 - side], 1 - side)
        order = np.lexsort((seen.frames, seen.tracks))
        order = order[seen.markers[order] >= 0]
        keys = seen.frames[order] * self._n_markers + seen.markers[order]
        both = self._candidate(keys)
        is_lost = (both < 0) & ~np.isin(keys, others.frames * self._n_markers + others.markers)
        new_track = np.diff(seen.tracks[order], prepend=-1) != 0
        begins = np.flatnonzero(is_lost & (new_track | ~np.concatenate([[False], is_lost[:-1]])))
        bounds = np.append(np.flatnonzero(new_track), len(order))
        ends_of_runs = np.append(np.flatnonzero(~is_lost), len(order))
        for begin in begins.tolist():
            low, high = bounds[np.searchsorted(bounds, begin, "right") - 1 :][:2]
            end = min(int(ends_of_runs[np.searchsorted(ends_of_runs, begin)]), int(high))
            first, last = _anchored(both, begin, end, int(low), int(high))
            if last - first > end - begin:
                chosen = order[first:last]
                rays = undistort(camera, balls[side].centres[chosen].astype(np.float64))
                yield _OneCameraRun(int(seen.markers[order[begin]]), seen.frames[chosen], rays, both[first:last])

    def locate(self, camera: Camera, run: _OneCameraRun) -> OneCameraPoints:
        """Return the points of a run that are certain enough: the depths are solved for along the lines of sight."""
        pose = camera.camera_from_world
        centre = -pose[:3, :3].T @ pose[:3, 3]
        directions = np.column_stack([run.rays, np.ones(len(run.rays))]) @ pose[:3, :3]
        anchors = np.flatnonzero(run.both >= 0)
        chain = self._chain(len(run.frames))
        depths_known = self._candidates.points[run.both[anchors]] @ pose[2, :3] + pose[2, 3]
        spread = self._candidates.covariance(run.both[anchors])
        weights = 1 / (self._scale**2 * np.einsum("i,nij,j->n", pose[2, :3], spread, pose[2, :3]))
        neighbours = self._rigid_neighbours(run)
        depths = np.interp(np.arange(len(run.frames)), anchors, depths_known)
        for _ in range(MAX_STEPS):
            normal, gradient = chain.copy(), chain @ depths
            normal[anchors, anchors] += weights
            gradient[anchors] += weights * (depths[anchors] - depths_known)
            blur = self._noise / camera.matrix[0, 0]
            residuals, along, precision = neighbours.misfits(centre, directions, depths, blur)
            robust = precision / (1 + residuals**2 * precision / FREEDOM)
            np.add.at(normal, (neighbours.at, neighbours.at), along**2 * robust)
            np.add.at(gradient, neighbours.at, along * residuals * robust)
            step = np.clip(np.linalg.solve(normal, gradient), -MAX_STEP, MAX_STEP)
            depths = depths - step
            if np.abs(step).max() < CONVERGED:
                break
        std = np.sqrt(np.diag(np.linalg.inv(normal))) * np.linalg.norm(directions, axis=1)
        fits = not len(residuals) or float((residuals**2 * precision).mean()) <= GATE**2
        n_neighbours = np.bincount(neighbours.at, minlength=len(depths))
        is_known = (n_neighbours >= MIN_NEIGHBOURS) & (std <= self._max_std) & (depths > 0)
        good = np.flatnonzero((run.both < 0) & is_known & fits)
        return OneCameraPoints(
            run.frames[good], centre + directions[good] * depths[good, np.newaxis], std[good] / self._scale
        )

    def _seen(self, balls: ImageBalls, side: int) -> _MarkerBalls:
        names = self._marker_of_track[side]
        tracks, of_ball = np.unique(balls.tracks, return_inverse=True)
        markers = np.array([names.get(track, -1) for track in tracks.tolist()], dtype=np.intp)
        frames = np.repeat(np.arange(len(balls.per_frame)), balls.per_frame)
        return _MarkerBalls(frames, balls.tracks.astype(np.intp), markers[of_ball] if len(of_ball) else markers)

    def _candidate(self, keys: Ints) -> Ints:
        """The kept candidate of each frame and marker, -1 where there is none."""
        if not len(self._keys):
            return np.full(keys.shape, -1, dtype=np.intp)
        place = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
        return np.where(self._keys[place] == keys, self._index[place], -1)

    def _rigid_neighbours(self, run: _OneCameraRun) -> _RigidNeighbours:
        """Markers that are rigid with that of a run and seen by both cameras while it is not."""
        neighbours = self._neighbours.get(run.marker, [])
        lost = np.flatnonzero(run.both < 0)
        names = np.array([neighbour[0] for neighbour in neighbours], dtype=np.intp)
        found = self._candidate(run.frames[lost, np.newaxis] * self._n_markers + names)
        at, neighbour = np.nonzero(found >= 0)
        chosen = found[at, neighbour]
        lengths, std = (np.array([one[part] for one in neighbours])[neighbour] for part in (1, 2))
        spread = self._scale**2 * self._candidates.covariance(chosen)
        return _RigidNeighbours(lost[at], self._candidates.points[chosen], spread, lengths, std**2)

    def _typical_motion(self, names: Ints, camera: Camera) -> tuple[float, float] | None:
        """Typical first and second differences of depths from frame to frame [mm]; None without enough frames."""
        index = self._index[np.argsort(self._keys % self._n_markers, kind="stable")]
        names, frames = np.sort(names, kind="stable"), self._candidates.frames[index]
        depths = self._candidates.points[index] @ camera.camera_from_world[2, :3]
        follows = (names[LAG:] == names[:-LAG]) & (frames[LAG:] - frames[:-LAG] == LAG)
        steps = depths[LAG:] - depths[:-LAG]
        bends = (steps[LAG:] - steps[:-LAG])[follows[LAG:] & follows[:-LAG]]
        if not len(bends):
            return None
        speed = FASTER * SIGMA_OF_MEDIAN * float(np.median(np.abs(steps[follows]))) / LAG
        bend = FASTER * SIGMA_OF_MEDIAN * float(np.median(np.abs(bends))) / LAG**2
        return (speed, bend) if min(speed, bend) > 0 else None

    def _chain(self, n_frames: int) -> Floats:
        """Normal matrix of depths that change by the typical amounts, shape (n_frames, n_frames)."""
        assert self.motion is not None
        unit, normal = np.eye(n_frames), np.zeros((n_frames, n_frames))
        for order, std in enumerate(self.motion, 1):
            change = np.diff(unit, order, axis=0)
            normal += change.T @ change / std**2
        return normal


class _MarkerBalls(NamedTuple):
    """Frames, tracks and markers of balls, shape (n,) each; -1 for balls of no marker."""

    frames: Ints
    tracks: Ints
    markers: Ints


class _RigidNeighbours(NamedTuple):
    """Markers at known distances from the one that is located, shape (n, ...).

    Attributes
    ----------
    at : ndarray of intp, shape (n,)
        Frame of the run in which each is seen.
    places : ndarray, shape (n, 3), mm
        Where it is.
    spread : ndarray, shape (n, 3, 3), mm^2
        Covariance of that place.
    lengths, variances : ndarray, shape (n,), mm and mm^2
        Its known distance, and the variance of that.
    """

    at: Ints
    places: Floats
    spread: Floats
    lengths: Floats
    variances: Floats

    def misfits(self, centre: Floats, directions: Floats, depths: Floats, blur: float) -> tuple[Floats, Floats, Floats]:
        """Return distances minus known ones [mm], their derivatives by the depth, and their precisions [1 / mm^2]."""
        away = centre + directions[self.at] * depths[self.at, np.newaxis] - self.places
        lengths = np.linalg.norm(away, axis=1)
        along = away / lengths[:, np.newaxis]
        variances = np.einsum("ni,nij,nj->n", along, self.spread, along) + self.variances
        variances += (blur * depths[self.at]) ** 2
        return lengths - self.lengths, (along * directions[self.at]).sum(axis=1), 1 / variances


def _anchored(both: Ints, begin: int, end: int, low: int, high: int) -> tuple[int, int]:
    """First and last + 1 frame of a run with the frames of both cameras next to it, at most `MAX_FRAMES`."""
    before, after = begin, end
    while before > max(low, begin - ANCHORS) and both[before - 1] >= 0:
        before -= 1
    while after < min(high, end + ANCHORS) and both[after] >= 0:
        after += 1
    if after - before <= MAX_FRAMES:
        return before, after
    return (before, before + MAX_FRAMES) if before < begin else (after - MAX_FRAMES, after)
