"""Balls followed through the images of each camera, and all pairs of balls that may be one marker.

Whether a left and a right ball are one is decided for their whole tracks (`correspondences`). So tracks must be pure
and need not be long: where a second ball is nearly as near, a track ends and another one begins. Pairs are kept in
little memory until the recording ends.
"""

from array import array
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from skelgen.capture.values import StereoPoints
from skelgen.model.arrays import Bools, Floats, Ints

_UPPER = np.triu_indices(3)  # xx, xy, xz, yy, yz, zz of a symmetric matrix
_SQUARE = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])  # and where each entry of the matrix is among them


@dataclass(frozen=True, eq=False)
class Candidates:
    """Pairs of balls, frame after frame.

    Attributes
    ----------
    points : ndarray, shape (n, 3), mm
        In the rig's world.
    misfit : ndarray of float32, shape (n,), px
        How far the balls were from seeing one point.
    spread : ndarray of float32, shape (n, 6), mm^2
        Covariance of the point: xx, xy, xz, yy, yz, zz.
    left, right : ndarray of int32, shape (n,)
        Tracks of the two balls.
    per_frame : ndarray of intp, shape (n_frames,)
        How many there are in each frame.
    """

    points: Floats
    misfit: NDArray[np.float32]
    spread: NDArray[np.float32]
    left: NDArray[np.int32]
    right: NDArray[np.int32]
    per_frame: Ints

    @property
    def frames(self) -> Ints:
        """The frame of each candidate, shape (n,)."""
        return np.repeat(np.arange(len(self.per_frame)), self.per_frame)

    def covariance(self, indices: Ints) -> Floats:
        """Covariances [mm^2] of some candidates, shape (n_indices, 3, 3)."""
        return self.spread[indices][:, _SQUARE].astype(np.float64)


class CandidateStore:
    """Collects candidates frame by frame; each takes 60 bytes."""

    def __init__(self) -> None:
        self._points, self._misfit, self._spread = array("d"), array("f"), array("f")
        self._left, self._right, self._per_frame = array("i"), array("i"), array("i")

    def add(self, points: StereoPoints, left: Ints, right: Ints) -> None:
        """Append a frame.

        Parameters
        ----------
        points : StereoPoints
            Its candidates.
        left, right : ndarray of intp, shape (n_balls,)
            The track of each ball of the left and of the right image.
        """
        self._points.frombytes(np.ascontiguousarray(points.points, dtype=np.float64).tobytes())
        self._misfit.frombytes(points.epipolar_distance.astype(np.float32).tobytes())
        self._spread.frombytes(points.covariance[:, *_UPPER].astype(np.float32).tobytes())
        self._left.frombytes(left[points.left].astype(np.int32).tobytes())
        self._right.frombytes(right[points.right].astype(np.int32).tobytes())
        self._per_frame.append(len(points))

    def all(self) -> Candidates:
        """Return what was added; nothing more can be added while it is in use."""
        return Candidates(
            np.frombuffer(self._points, np.float64).reshape(-1, 3),
            np.frombuffer(self._misfit, np.float32),
            np.frombuffer(self._spread, np.float32).reshape(-1, 6),
            np.frombuffer(self._left, np.int32),
            np.frombuffer(self._right, np.int32),
            np.frombuffer(self._per_frame, np.int32).astype(np.intp),
        )


@dataclass(frozen=True, eq=False)
class FrameCandidates:
    """Candidates of one frame.

    Attributes
    ----------
    points, covariance : ndarray, shape (n, 3) and (n, 3, 3), mm and mm^2
        In the rig's world.
    left, right : ndarray of intp, shape (n,)
        Tracks of the two balls.
    pairs : ndarray of intp, shape (n,)
        The pair of tracks or the marker that each is.
    """

    points: Floats
    covariance: Floats
    left: Ints
    right: Ints
    pairs: Ints

    @classmethod
    def of(cls, candidates: Candidates, indices: Ints, pairs: Ints) -> Self:
        """Return some of all candidates.

        Parameters
        ----------
        candidates : Candidates
            All pairs of balls of a recording.
        indices : ndarray of intp, shape (n,)
            Which.
        pairs : ndarray of intp, shape (n_candidates,)
            The pair of tracks or the marker of each candidate.
        """
        left, right = (tracks[indices].astype(np.intp) for tracks in (candidates.left, candidates.right))
        return cls(candidates.points[indices], candidates.covariance(indices), left, right, pairs[indices])

    def distances_to(self, other: Self) -> tuple[Floats, Floats]:
        """Return distances [mm] to others, shape (n, n_others), and variances; infinite where they share a ball."""
        between = self.points[:, np.newaxis] - other.points
        lengths = np.linalg.norm(between, axis=2)
        along = between / np.where(lengths > 0, lengths, 1.0)[..., np.newaxis]
        own = np.einsum("abi,aij,abj->ab", along, self.covariance, along)
        theirs = np.einsum("abi,bij,abj->ab", along, other.covariance, along)
        shared = (self.left[:, np.newaxis] == other.left) | (self.right[:, np.newaxis] == other.right)
        return np.where(shared | (lengths == 0), np.inf, lengths), own + theirs


def frames_of(candidates: Candidates, wanted: Bools) -> Iterator[tuple[int, int]]:
    """Yield the first candidate and the one after the last of each wanted frame that has any.

    Parameters
    ----------
    candidates : Candidates
        All pairs of balls of a recording.
    wanted : ndarray of bool, shape (n_frames,)
        Frames.
    """
    ends = np.cumsum(candidates.per_frame)
    for frame in np.flatnonzero(wanted & (candidates.per_frame > 0)).tolist():
        yield int(ends[frame] - candidates.per_frame[frame]), int(ends[frame])
