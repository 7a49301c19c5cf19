"""Which of several known bodies a take shows: bodies that are alike would share the points of one.

A body without which the others explain as much of the take is absent. Of several such bodies the one is left out
without which the others fit best. Where bodies that are alike come and go, frames remain that show parts of several:
the take is then labelled by one body after the other, too, and what leaves fewer parts is kept.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from skelgen.model import PointCloud, Skeleton
from skelgen.model.arrays import Ints
from skelgen.model.limbs import names_of_bodies
from skelgen.progress import listed
from skelgen.stages.subject.points import LEAST_FRAMES, FollowedPoints
from skelgen.stages.subject.posing import SubjectPoses, pose_subject

PRESENT_SHARE = 0.5
"""A body is there in a frame if it adds this part of its markers to what the other bodies explain."""


@dataclass(frozen=True, eq=False)
class BodyLabels:
    """Points labelled by a skeleton of one or several bodies.

    Attributes
    ----------
    skeleton : Skeleton
        It carries the markers of those bodies only that were sought.
    points : FollowedPoints
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    poses : SubjectPoses
        Of the skeleton, by the points at their places.
    by_name : bool
        Whether the names of the take decided.
    """

    skeleton: Skeleton
    points: FollowedPoints
    marker_of_point: Ints
    poses: SubjectPoses
    by_name: bool

    @property
    def explained(self) -> Ints:
        """Number of points with a marker, shape (n_frames,)."""
        return np.bincount(self.points.frames[self.marker_of_point >= 0], minlength=self.points.cloud.n_frames)

    @cached_property
    def _in_parts(self) -> Ints:
        """Number of points of bodies that a frame shows by less than `PRESENT_SHARE` of their markers, (n_frames,)."""
        frames, owned = self.points.frames, self.marker_of_point >= 0
        found = np.zeros(self.points.cloud.n_frames, dtype=np.intp)
        for limbs in self.skeleton.bodies:
            is_own = np.isin(self.skeleton.limb_of_marker, limbs)
            shown = np.bincount(frames[owned & is_own[self.marker_of_point]], minlength=len(found))
            found += np.where(shown < PRESENT_SHARE * is_own.sum(), shown, 0)
        return found

    @property
    def n_parts(self) -> int:
        """Number of frames that show a part of a body only."""
        return int((self._in_parts > 0).sum())

    @property
    def worth(self) -> int:
        """Number of points with a marker, without those of bodies of which a frame shows a part only."""
        return int((self.explained - self._in_parts).sum())

    @property
    def deviation(self) -> float:
        """Median distance [mm] of the points from their markers' places; infinite if none has a marker."""
        if (self.marker_of_point < 0).all():
            return np.inf
        positions = self.points.positions(self.marker_of_point, len(self.skeleton.limb_of_marker))
        off = positions - self.poses.markers(self.skeleton)
        return float(np.nanmedian(np.linalg.norm(off, axis=2)))


Label = Callable[[Skeleton, FollowedPoints], BodyLabels]
"""Labels points by a skeleton."""


def label_present_bodies(points: FollowedPoints, skeleton: Skeleton, label: Label) -> tuple[BodyLabels, str]:
    """Label a take by those of several bodies that it shows.

    Parameters
    ----------
    points : FollowedPoints
        The take.
    skeleton : Skeleton
        Of all bodies.
    label : callable
        Labels points by a skeleton.

    Returns
    -------
    labels : BodyLabels
        By the bodies that are there.
    sentence : str
        How well each body fits where one of several fits as the only one; empty if no two compete.
    """
    best, sentence = label(skeleton, points), ""
    names = names_of_bodies(skeleton.bodies, skeleton.limb_names)
    while candidates := _without_absent(best, label):
        left_out, best = min(reversed(candidates), key=lambda one: one[1].deviation)
        sentence = _choice(candidates, left_out, names) if len(candidates) > 1 else ""
    if len(skeleton.bodies) > 1 and best.n_parts >= LEAST_FRAMES:
        in_turn = _one_after_the_other(best, label)
        best = in_turn if in_turn.worth > best.worth else best
    return best, sentence


def _one_after_the_other(labels: BodyLabels, label: Label) -> BodyLabels:
    """Label by the body that explains most by itself, what is left by the next one, and so on."""
    skeleton, points = labels.skeleton, labels.points
    marker_of_point = np.full_like(labels.marker_of_point, -1)
    bodies = [limbs for limbs in skeleton.bodies if np.isin(skeleton.limb_of_marker, limbs).any()]
    while bodies:
        left = np.flatnonzero(marker_of_point < 0)
        found = [label(_with_bodies(skeleton, limbs), _some_of(points, left)) for limbs in bodies]
        best = max(range(len(found)), key=lambda body: (found[body].worth, -found[body].deviation))
        marker_of_point[left] = found[best].marker_of_point
        del bodies[best]
    poses = pose_subject(skeleton, points.positions(marker_of_point, len(skeleton.limb_of_marker)))
    return BodyLabels(skeleton, points, marker_of_point, poses, labels.by_name)


def _with_bodies(skeleton: Skeleton, limbs: Ints) -> Skeleton:
    """A skeleton that carries the markers of some limbs only."""
    limb_of_marker = skeleton.limb_of_marker
    return replace(skeleton, limb_of_marker=np.where(np.isin(limb_of_marker, limbs), limb_of_marker, -1))


def _some_of(points: FollowedPoints, kept: Ints) -> FollowedPoints:
    """Some of the points of a take, in all of its frames."""
    cloud, frames = points.cloud, points.frames[kept]
    starts = np.searchsorted(frames, np.arange(cloud.n_frames + 1))
    some = PointCloud(cloud.points[kept], starts, cloud.times, name=cloud.name)
    return FollowedPoints(some, frames, points.tracks[kept], points.names)


def _choice(candidates: list[tuple[int, BodyLabels]], left_out: int, names: tuple[str, ...]) -> str:
    """Say why one of several bodies is taken as absent."""
    fits = ", ".join(f"{fewer.deviation:.2f} mm without {names[body]}" for body, fewer in candidates)
    return (
        f"not all of {listed(names[body] for body, _ in candidates)} are there; {names[left_out]} is taken as absent, "
        f"by how far markers are from their places in the median: {fits}; if another one is absent, leave its skeleton "
        "out"
    )


def _without_absent(labels: BodyLabels, label: Label) -> list[tuple[int, BodyLabels]]:
    """Bodies that may be absent, by their number, each with the labels by all others."""
    limb_of_marker, n_frames, found = labels.skeleton.limb_of_marker, len(labels.explained), []
    for body, limbs in enumerate(labels.skeleton.bodies):
        is_own = np.isin(limb_of_marker, limbs)
        others = np.where(is_own, -1, limb_of_marker)
        n_others = int((others >= 0).sum())
        if not is_own.any() or n_others == 0 or labels.explained.sum() > n_others * n_frames:
            continue
        fewer = label(replace(labels.skeleton, limb_of_marker=others), labels.points)
        is_there = labels.explained - fewer.explained >= PRESENT_SHARE * is_own.sum()
        if is_there.sum() < min(LEAST_FRAMES, n_frames):
            found.append((body, fewer))
    return found
