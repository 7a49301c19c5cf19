"""The live tracker: points of a frame in, labels of physical markers out."""

from collections import deque
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from skelgen.errors import InputError
from skelgen.model import Project, Skeleton
from skelgen.model.arrays import Floats, Ints, check_coordinates, check_floats, check_rate
from skelgen.stages.labels.online.links import Links
from skelgen.stages.labels.online.rigid_labels import RigidLabels
from skelgen.stages.labels.online.skeleton_labels import SkeletonLabels
from skelgen.stages.labels.parameters import LabelParameters

MOST_MARKERS = 200
"""Markers that are remembered by default: four suits of fifty."""

WINDOW = 30.0
"""s over which distances are averaged: long enough to see joints move, short enough to follow a slipped marker."""

STEPS_REMEMBERED = 51
"""Time steps whose median is the frame period where no rate is given."""

LONG_JUMP = 1.0
"""s without frames after which the pose is searched anew."""


class Tracker:
    """Give each point of a live stream the identity of its physical marker.

    Without a skeleton it learns while it runs: points are followed, markers whose distances stay the same are rigid
    neighbours, and a marker that was lost is found again where its neighbours predict it. With a skeleton the pose of
    its limbs is followed, and labels are the indices of its markers from the first frame that shows the pose.

    Parameters
    ----------
    parameters : LabelParameters, optional
        How points are followed from frame to frame: `assignment`, `prediction`, `smoothing`, `max_jump`, `max_gap`.
    skeleton : Skeleton or Project, optional
        The known structure, e.g. the result of `skelgen.reconstruct` on an earlier take of the same markers, or what
        `skelgen.load` reads of a run; of several bodies, the result of `skelgen.apply_subject` on a take of all.
    rate : float, Hz, optional
        Frame rate; the usual time step if left out.
    max_markers : int
        Most markers that are remembered; beyond, the lost one that was seen least is forgotten.
    window : float, s
        Time over which distances are averaged.

    Raises
    ------
    InputError
        If the rate, the number of markers or the window is not above 0, or the skeleton is another value or carries
        no marker.

    Examples
    --------
    >>> tracker = Tracker(rate=100.0)
    >>> tracker.update([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0]], time=0.0)
    array([-1, -1])
    """

    def __init__(
        self,
        parameters: LabelParameters | None = None,
        skeleton: Skeleton | Project | None = None,
        rate: float | None = None,
        *,
        max_markers: int = MOST_MARKERS,
        window: float = WINDOW,
    ) -> None:
        if max_markers < 1 or not window > 0:
            raise InputError(f"a tracker of {max_markers} markers over {window:g} s; both must be above 0")
        if not isinstance(parameters, LabelParameters | None):
            raise InputError(f"parameters are {parameters!r:.60}; LabelParameters belong there, a skeleton behind them")
        self._rate = None if rate is None else check_rate(rate, "the tracker")
        self._links = Links(parameters or LabelParameters())
        self._model = None if skeleton is None else SkeletonLabels(_checked(skeleton))
        self._rigid = RigidLabels(int(max_markers), float(window))
        self._steps: deque[float] = deque(maxlen=STEPS_REMEMBERED)
        self._time: float | None = None

    @property
    def merged(self) -> Mapping[int, int]:
        """Labels that turned out to mean another marker, and its older label, which is given from then on."""
        return MappingProxyType(self._rigid.merged)

    @property
    def n_markers(self) -> int:
        """Number of markers known at present, seen or not."""
        return self._rigid.n_remembered if self._model is None else self._model.n_markers

    def update(self, points: ArrayLike, time: float) -> Ints:
        """Label the next frame.

        Parameters
        ----------
        points : array_like, shape (n, 3), mm
            Its points in any order; rows of NaN are points that were not seen.
        time : float, s
            Its time stamp, later than that of the frame before. After a jump, markers are found again by rigidity.

        Returns
        -------
        ndarray of intp, shape (n,)
            Label of each point: the same number for the same physical marker; -1 for points of no marker so far.

        Raises
        ------
        InputError
            If the points are not rows of three numbers, one is infinite or impossibly large, or the time stamp does
            not rise.
        """
        clean = check_floats(np.empty((0, 3)) if np.size(points) == 0 else points, (None, 3), "points of a frame")
        check_coordinates(clean, "points of a frame")
        n_steps = self._advance(time)
        labels = np.full(len(clean), -1, dtype=np.intp)
        seen = ~np.isnan(clean).any(axis=1)
        labels[seen] = self._labelled(clean[seen], n_steps)
        return labels

    def _advance(self, time: float) -> int:
        """Frame periods since the frame before; at least 1."""
        now = float(time)
        if not np.isfinite(now):
            raise InputError(f"a frame has the time stamp {now:g}; it must be a finite number of seconds")
        if self._time is None:
            self._time = now
            return 1
        step = now - self._time
        if step <= 0:
            was = "repeats" if step == 0 else "goes back after"
            raise InputError(
                f"the time stamp {now:.6g} s {was} {self._time:.6g} s; give each frame once, in order, or begin with a "
                "new Tracker"
            )
        self._time = now
        self._steps.append(step)
        return max(1, round(step * self._frame_rate))

    @property
    def _frame_rate(self) -> float:
        if self._rate is not None:
            return self._rate
        return 1.0 / float(np.median(self._steps)) if self._steps else 1.0

    def _labelled(self, points: Floats, n_steps: int) -> Ints:
        tracks = self._links.follow(points, n_steps)
        spacing = self._links.spacing
        if self._model is None:
            return self._rigid.update(points, tracks, n_steps, self._frame_rate, spacing)
        if n_steps > LONG_JUMP * self._frame_rate:
            self._model.forget_pose()
        return self._model.update(points, tracks, n_steps, spacing)


def _checked(skeleton: object) -> Skeleton:
    if isinstance(skeleton, str | Path):
        raise InputError(
            f"skeleton is the path {str(skeleton)!r}, which a tracker does not open; give skelgen.load of it"
        )
    if not isinstance(skeleton, Skeleton | Project):
        raise InputError(
            f"skeleton is {skeleton!r:.60}; a tracker takes a Skeleton or a Project: the result of "
            "skelgen.reconstruct, or for several bodies that of skelgen.apply_subject on a take of all"
        )
    skeleton = skeleton.skeleton if isinstance(skeleton, Project) else skeleton
    if not (skeleton.limb_of_marker >= 0).any():
        raise InputError("the skeleton carries no marker, so nothing can be labelled by it; reconstruct a longer take")
    return skeleton
