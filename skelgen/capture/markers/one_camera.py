"""Markers of which one camera loses sight for a while: where they are on the other camera's line of sight.

A ball that both cameras saw is followed on in one image. Its depth is what the distances to markers that are rigid with
it say (`rigid_edges`), held together over time by how fast depths change in this recording: a chain of unknown depths,
solved by Gauss-Newton with weights of Student's t, which single wrong witnesses do not spoil. Only depths that come out
as certain as those of two cameras are kept.
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
from skelgen.capture.markers.correspondences import TrackPairs, makers_of
from skelgen.capture.markers.rigidity import rigid_edges
from skelgen.capture.optics.projection import undistort
from skelgen.geometry.robust import SIGMA_OF_MEDIAN
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.rig import Camera, StereoRig

LONGEST = 120
"""Frames over which a ball is followed by one camera at most; it bounds the work."""

ANCHORS = 4
"""Frames of both cameras before and after, which tell depth and speed."""

LAG = 5
"""Frames between depths of which the usual change is taken: over fewer it is mostly noise."""

FASTER = 2.0
"""How much faster than usual a depth may change, in standard deviations."""

MOST_STD = 2.0
"""Largest deviation of a depth that is kept, in usual ones that the settings predict for points of both cameras."""

LEAST_WITNESSES = 1
"""Rigid mates that must be seen in a frame: how a ball moves on by itself is known too badly."""

GATE = 3.0
"""Largest misfit of a run to its witnesses, root mean square in standard deviations."""

FREEDOM = 4.0
"""Degrees of freedom of Student's t."""

STEPS, CONVERGED, LONGEST_STEP = 15, 1e-3, 100.0  # Gauss-Newton: iterations, and mm


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
    """Balls of one camera as its images come: 12 bytes each."""

    def __init__(self) -> None:
        self._centres, self._tracks, self._per_frame = array("f"), array("i"), array("i")

    def add(self, centres: Floats, tracks: Ints) -> None:
        """Append an image."""
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


class OnePoints(NamedTuple):
    """Points of one camera: frames (n,), places [mm] (n, 3), standard deviations of depth [mm] (n,)."""

    frames: Ints
    points: Floats
    std: Floats


def seen_by_one(
    candidates: Candidates,
    kept: Bools,
    pairs: TrackPairs,
    balls: tuple[ImageBalls, ImageBalls],
    rig: StereoRig,
    scale: float = 1.0,
) -> OnePoints:
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
        Deviations of points by what their covariances say.

    Returns
    -------
    OnePoints
        In the rig's world; of each marker at most one in a frame, and none where both cameras see it.
    """
    known = _Known(candidates, kept, pairs, rig, scale)
    found = (
        []
        if known.motion is None
        else [
            known.placed(camera, run)
            for side, camera in enumerate((rig.left, rig.right))
            for run in known.runs(balls, side, camera)
        ]
    )
    frames = np.concatenate([np.empty(0, dtype=np.intp), *(one.frames for one in found)])
    points = np.concatenate([np.empty((0, 3)), *(one.points for one in found)])
    return OnePoints(frames, points, np.concatenate([np.empty(0), *(one.std for one in found)]))


@dataclass(frozen=True, eq=False)
class _Run:
    """A ball followed through one camera's images, with frames of both cameras before or after."""

    marker: int
    frames: Ints
    rays: Floats  # x / z and y / z in the camera's frame
    both: Ints  # the candidate of each frame, -1 while the other camera does not see the marker


class _Known:
    """What both cameras saw."""

    def __init__(self, candidates: Candidates, kept: Bools, pairs: TrackPairs, rig: StereoRig, scale: float) -> None:
        believed = np.zeros(len(pairs), dtype=np.bool_)
        believed[pairs.of_candidate[kept]] = True
        marker = makers_of(pairs, believed).marker
        self._candidates, self._scale, self._noise = candidates, scale, rig.noise * scale
        self._n_markers = int(marker.max(initial=-1)) + 1
        self._marker_of_track = [
            dict(zip(pairs.tracks[believed, side].tolist(), marker[believed].tolist(), strict=True)) for side in (0, 1)
        ]
        names = marker[pairs.of_candidate]
        index = np.flatnonzero(kept)
        keys = candidates.frames[index] * self._n_markers + names[index]
        order = np.argsort(keys, kind="stable")
        self._index, self._keys = index[order], keys[order]
        edges = rigid_edges(candidates, kept, names, scale)
        self._mates: dict[int, list[tuple[int, float, float]]] = defaultdict(list)
        for (one, other), length, std in zip(edges.ends.tolist(), edges.lengths, edges.std, strict=True):
            self._mates[one].append((other, float(length), float(std)))
            self._mates[other].append((one, float(length), float(std)))
        self.motion = self._usual_motion(names[index], rig.left)
        spread = candidates.covariance(index)
        usual = float(np.median(np.sqrt(np.trace(spread, axis1=1, axis2=2)))) if len(index) else 0.0
        self._most_std = MOST_STD * usual

    def runs(self, balls: tuple[ImageBalls, ImageBalls], side: int, camera: Camera) -> Iterator[_Run]:
        """Yield where only one camera sees a marker."""
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
                yield _Run(int(seen.markers[order[begin]]), seen.frames[chosen], rays, both[first:last])

    def placed(self, camera: Camera, run: _Run) -> OnePoints:
        """Return the points of a run that are certain enough."""
        pose = camera.camera_from_world
        eye = -pose[:3, :3].T @ pose[:3, 3]
        slopes = np.column_stack([run.rays, np.ones(len(run.rays))]) @ pose[:3, :3]
        anchors = np.flatnonzero(run.both >= 0)
        chain = self._chain(len(run.frames))
        depths_known = self._candidates.points[run.both[anchors]] @ pose[2, :3] + pose[2, 3]
        spread = self._candidates.covariance(run.both[anchors])
        weights = 1 / (self._scale**2 * np.einsum("i,nij,j->n", pose[2, :3], spread, pose[2, :3]))
        witnesses = self._witnesses(run)
        depths = np.interp(np.arange(len(run.frames)), anchors, depths_known)
        for _ in range(STEPS):
            normal, slope = chain.copy(), chain @ depths
            normal[anchors, anchors] += weights
            slope[anchors] += weights * (depths[anchors] - depths_known)
            residuals, along, precision = witnesses.misfits(eye, slopes, depths, self._noise / camera.matrix[0, 0])
            robust = precision / (1 + residuals**2 * precision / FREEDOM)
            np.add.at(normal, (witnesses.at, witnesses.at), along**2 * robust)
            np.add.at(slope, witnesses.at, along * residuals * robust)
            step = np.clip(np.linalg.solve(normal, slope), -LONGEST_STEP, LONGEST_STEP)
            depths = depths - step
            if np.abs(step).max() < CONVERGED:
                break
        std = np.sqrt(np.diag(np.linalg.inv(normal))) * np.linalg.norm(slopes, axis=1)
        fits = not len(residuals) or float((residuals**2 * precision).mean()) <= GATE**2
        n_witnesses = np.bincount(witnesses.at, minlength=len(depths))
        is_known = (n_witnesses >= LEAST_WITNESSES) & (std <= self._most_std) & (depths > 0)
        good = np.flatnonzero((run.both < 0) & is_known & fits)
        return OnePoints(run.frames[good], eye + slopes[good] * depths[good, np.newaxis], std[good] / self._scale)

    def _seen(self, balls: ImageBalls, side: int) -> _Balls:
        names = self._marker_of_track[side]
        tracks, of_ball = np.unique(balls.tracks, return_inverse=True)
        markers = np.array([names.get(track, -1) for track in tracks.tolist()], dtype=np.intp)
        frames = np.repeat(np.arange(len(balls.per_frame)), balls.per_frame)
        return _Balls(frames, balls.tracks.astype(np.intp), markers[of_ball] if len(of_ball) else markers)

    def _candidate(self, keys: Ints) -> Ints:
        """The kept candidate of each frame and marker, -1 where there is none."""
        if not len(self._keys):
            return np.full(keys.shape, -1, dtype=np.intp)
        place = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
        return np.where(self._keys[place] == keys, self._index[place], -1)

    def _witnesses(self, run: _Run) -> _Witnesses:
        """What is rigid with a marker and seen by both cameras while the marker is not."""
        mates = self._mates.get(run.marker, [])
        lost = np.flatnonzero(run.both < 0)
        names = np.array([mate[0] for mate in mates], dtype=np.intp)
        found = self._candidate(run.frames[lost, np.newaxis] * self._n_markers + names)
        at, mate = np.nonzero(found >= 0)
        chosen = found[at, mate]
        lengths, std = (np.array([one[part] for one in mates])[mate] for part in (1, 2))
        spread = self._scale**2 * self._candidates.covariance(chosen)
        return _Witnesses(lost[at], self._candidates.points[chosen], spread, lengths, std**2)

    def _usual_motion(self, names: Ints, camera: Camera) -> tuple[float, float] | None:
        """How much a depth changes from frame to frame, and how much that changes [mm]; None if nobody knows."""
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
        """Normal matrix of depths that change as usual, shape (n_frames, n_frames)."""
        assert self.motion is not None
        unit, normal = np.eye(n_frames), np.zeros((n_frames, n_frames))
        for order, std in enumerate(self.motion, 1):
            change = np.diff(unit, order, axis=0)
            normal += change.T @ change / std**2
        return normal


class _Balls(NamedTuple):
    """Frames, tracks and markers of balls, shape (n,) each; -1 for balls of no marker."""

    frames: Ints
    tracks: Ints
    markers: Ints


class _Witnesses(NamedTuple):
    """Markers at known distances: of which frame of the run, where, covariances, distances and their variances."""

    at: Ints
    places: Floats
    spread: Floats
    lengths: Floats
    variances: Floats

    def misfits(self, eye: Floats, slopes: Floats, depths: Floats, blur: float) -> tuple[Floats, Floats, Floats]:
        """Distances minus known ones [mm], their slopes along the depth, and their precisions [1 / mm^2]."""
        away = eye + slopes[self.at] * depths[self.at, np.newaxis] - self.places
        lengths = np.linalg.norm(away, axis=1)
        along = away / lengths[:, np.newaxis]
        variances = np.einsum("ni,nij,nj->n", along, self.spread, along) + self.variances
        variances += (blur * depths[self.at]) ** 2
        return lengths - self.lengths, (along * slopes[self.at]).sum(axis=1), 1 / variances


def _anchored(both: Ints, begin: int, end: int, low: int, high: int) -> tuple[int, int]:
    """A run with the frames of both cameras next to it, cut to what is followed for so long."""
    before, after = begin, end
    while before > max(low, begin - ANCHORS) and both[before - 1] >= 0:
        before -= 1
    while after < min(high, end + ANCHORS) and both[after] >= 0:
        after += 1
    if after - before <= LONGEST:
        return before, after
    return (before, before + LONGEST) if before < begin else (after - LONGEST, after)
