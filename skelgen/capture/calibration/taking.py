"""Frames that are taken to calibrate a target or joints, and meanwhile how many are still needed.

Calibrations themselves look at all frames once more: what is found here is to be shown while the cameras run.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Generic, TypeVar

import numpy as np

from skelgen.capture.bodies import BodyFinder
from skelgen.capture.bodies.design import check_targets
from skelgen.capture.calibration.body import ENOUGH_FRAMES, first_shape, sure_points
from skelgen.capture.calibration.joints import LEAST_TURN, JointMotion, joint_motion
from skelgen.capture.parameters import BodyParameters
from skelgen.capture.values import FoundBody, StereoPoints
from skelgen.errors import InputError
from skelgen.geometry.rotations import vector_from_matrix
from skelgen.model.arrays import Floats
from skelgen.model.rig import BodyTarget

MAX_KEPT = 4000
"""Frames that are kept: a calibration uses 400 at most, and cameras may run for hours."""

MAX_MISSED = 10
"""Frames that show a target alone in which it may be missed, before its first shape is taken anew."""

_T = TypeVar("_T")


class EvenFrames(Generic[_T]):
    """At most `MAX_KEPT` frames, evenly spread over all that came, the first one among them."""

    def __init__(self, most: int = MAX_KEPT) -> None:
        self._most, self._every, self._n_seen = most, 1, 0
        self._kept: list[_T] = []

    def add(self, frame: _T) -> None:
        """Take one more."""
        if self._n_seen % self._every == 0:
            self._kept.append(frame)
        self._n_seen += 1
        if len(self._kept) > self._most:
            self._kept, self._every = self._kept[::2], 2 * self._every

    @property
    def frames(self) -> list[_T]:
        """Those that are kept."""
        return list(self._kept)


@dataclass(frozen=True)
class BodyProgress:
    """How far the taking of a target is.

    Attributes
    ----------
    n_frames : int
        Frames that came.
    n_balls : int
        Balls that the target seems to have; 0 before any frame could show one.
    n_alone : int
        Frames that show so many points and nothing else.
    n_found : int
        Frames in which the target was found.
    turn : float, degrees
        How far it turned from where it was first seen.
    problem : str
        Why its design cannot be found for sure; empty if it can.
    """

    n_frames: int = 0
    n_balls: int = 0
    n_alone: int = 0
    n_found: int = 0
    turn: float = 0.0
    problem: str = ""

    @property
    def is_enough(self) -> bool:
        """Whether a good calibration can be made of it."""
        return self.n_found >= ENOUGH_FRAMES and self.turn >= LEAST_TURN


@dataclass(frozen=True)
class JointProgress:
    """How far the taking of joints is.

    Attributes
    ----------
    n_frames : int
        Frames that came.
    n_found : mapping of str to int
        In how many of them each target was found, in the order of the settings.
    motions : tuple of JointMotion
        How far targets have moved against each other.
    """

    n_frames: int
    n_found: Mapping[str, int]
    motions: tuple[JointMotion, ...]


class BodyTaking:
    """Takes the frames of a target, and follows it with a shape from one of them.

    Parameters
    ----------
    name : str
        What the target is called.
    n_balls : int, optional
        Its number of balls; by default the most frequent number of points in a frame.
    beside : sequence of BodyTarget
        Other targets, which it must not be taken for.
    search : BodyParameters, optional
        Limits of the search for it.
    """

    def __init__(
        self,
        name: str,
        n_balls: int | None = None,
        beside: Sequence[BodyTarget] = (),
        search: BodyParameters | None = None,
    ) -> None:
        self.names, self._n_balls, self._beside, self._search = [name], n_balls, tuple(beside), search
        self._kept: EvenFrames[StereoPoints] = EvenFrames()
        self._counts: Counter[int] = Counter()
        self._finder: BodyFinder | None = None
        self._n_tried = self._n_missed = 0
        self._first: Floats | None = None
        self._n_frames = self._n_found = 0
        self._turn, self._problem = 0.0, ""

    @property
    def frames(self) -> list[StereoPoints]:
        """The frames, for the calibration."""
        return self._kept.frames

    @property
    def progress(self) -> BodyProgress:
        """How far it is."""
        n_balls = self._typical
        n_alone = self._counts[n_balls] if n_balls else 0
        return BodyProgress(self._n_frames, n_balls, n_alone, self._n_found, self._turn, self._problem)

    def add(self, points: StereoPoints) -> list[FoundBody]:
        """Take a frame; return the target if it is found in it."""
        self._kept.add(points)
        self._n_frames += 1
        n_sure = len(sure_points(points))
        is_alone = n_sure == len(points) >= BodyParameters().min_points
        if is_alone:
            self._counts[n_sure] += 1
        is_whole = is_alone and n_sure == self._typical
        if is_whole and (self._n_tried != n_sure or self._n_missed >= MAX_MISSED):
            self._begin_with(points)
        found = [] if self._finder is None else self._finder.find(points)
        if found:
            pose = found[0].world_from_body[:3, :3]
            self._n_missed = 0
            self._n_found += 1
            if self._first is None:
                self._first = pose
            self._turn = max(self._turn, float(np.rad2deg(np.linalg.norm(vector_from_matrix(pose @ self._first.T)))))
        elif is_whole:
            self._n_missed += 1
        return found

    @property
    def _typical(self) -> int:
        """Balls that the target seems to have."""
        if self._n_balls:
            return self._n_balls
        return max(self._counts, key=lambda count: (self._counts[count], count)) if self._counts else 0

    def _begin_with(self, points: StereoPoints) -> None:
        """Take the shape from a frame that shows the target whole and alone."""
        self._n_tried, self._n_missed, self._n_found = len(points), 0, 0
        self._first, self._turn, self._problem = None, 0.0, ""
        try:
            shape = first_shape(points, *self.names)
            check_targets([*self._beside, shape], self._search)
            self._finder = BodyFinder([shape], self._search)
        except InputError as error:
            self._finder, self._problem = None, str(error)


class JointTaking:
    """Takes frames of targets that move against each other.

    Attributes
    ----------
    names : list of str
        The targets.

    Parameters
    ----------
    targets : sequence of BodyTarget
        All that are looked for.
    search : BodyParameters, optional
        Limits of the search for them.
    pairs : sequence of tuple of str
        Pairs of targets whose motion is looked at; all pairs if none is named.

    Raises
    ------
    InputError
        If a target can be taken for another one, or there is only one.
    """

    def __init__(
        self, targets: Sequence[BodyTarget], search: BodyParameters | None = None, pairs: Sequence[tuple[str, str]] = ()
    ) -> None:
        if len(targets) < 2:
            raise InputError("joints are between two targets; calibrate these first")
        self.names = [target.name for target in targets]
        self._pairs = tuple(pairs) or tuple(combinations(self.names, 2))
        self._n_frames, self._n_found = 0, Counter(dict.fromkeys(self.names, 0))
        self._finder = BodyFinder(targets, search)
        self._kept: EvenFrames[list[FoundBody]] = EvenFrames()

    @property
    def frames(self) -> list[list[FoundBody]]:
        """What was found in each frame, for the calibration."""
        return self._kept.frames

    @property
    def progress(self) -> JointProgress:
        """How far it is."""
        motions = tuple(joint_motion(self.frames, *pair) for pair in self._pairs)
        return JointProgress(self._n_frames, dict(self._n_found), motions)

    def add(self, points: StereoPoints) -> list[FoundBody]:
        """Take a frame; return the targets that are found in it."""
        found = self._finder.find(points)
        self._n_frames += 1
        self._n_found.update(body.name for body in found)
        self._kept.add(found)
        return found
