"""Which of several known bodies a take shows: bodies that are alike would share the points of one.

A body without which the others explain as much of the take is absent. Of several such bodies the one is left out
without which the others fit best. Where bodies that are alike come and go, frames remain that show parts of several:
the take is then labelled by one body after the other, too, and what leaves fewer parts is kept. Of bodies that are
alike and there, a sentence says that they may be exchanged.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from skelgen.model import PointCloud, Skeleton
from skelgen.model.arrays import Bools, Ints
from skelgen.model.limbs import names_of_bodies
from skelgen.progress import listed
from skelgen.stages.labels import FollowedPoints, SkeletonPoses, pose_skeleton
from skelgen.stages.subject.points import LEAST_FRAMES

PRESENT_SHARE = 0.5
"""A body is there in a frame if it adds this part of its markers to what the other bodies explain."""

ALIKE = 1.25
"""Bodies are alike if markers of one are no farther from their places by the other's skeleton than so many times."""

EXPLAINED_SHARE = 0.95
"""... and if that skeleton explains this part of the points that its own explains."""

TRIED_FRAMES = 200
"""Frames in which the skeleton of one body is tried on the markers of another one."""

MOST_LISTED = 5
"""Frames that a sentence lists."""


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
    poses : SkeletonPoses
        Of the skeleton, by the points at their places.
    by_name : bool
        Whether the names of the take decided.
    """

    skeleton: Skeleton
    points: FollowedPoints
    marker_of_point: Ints
    poses: SkeletonPoses
    by_name: bool

    @property
    def explained(self) -> Ints:
        """Number of points with a marker, shape (n_frames,)."""
        return np.bincount(self.points.frames[self.marker_of_point >= 0], minlength=self.points.cloud.n_frames)

    @cached_property
    def _shown(self) -> tuple[Ints, Ints]:
        """Number of points of each body in each frame, shape (n_frames, n_bodies), and of markers that each carries."""
        skeleton, owned = self.skeleton, self.marker_of_point >= 0
        frames, marker = self.points.frames[owned], self.marker_of_point[owned]
        own = [np.isin(skeleton.limb_of_marker, limbs) for limbs in skeleton.bodies]
        shown = [np.bincount(frames[is_own[marker]], minlength=self.points.cloud.n_frames) for is_own in own]
        return np.column_stack(shown), np.sum(own, axis=1)

    @property
    def shown(self) -> Bools:
        """Whether a frame shows at least `PRESENT_SHARE` of the markers of each body, shape (n_frames, n_bodies)."""
        n_points, n_markers = self._shown
        return np.asarray(n_points >= np.maximum(PRESENT_SHARE * n_markers, 1))

    @property
    def _in_parts(self) -> Ints:
        """Number of points of bodies that a frame shows by less than `PRESENT_SHARE` of their markers, (n_frames,)."""
        n_points, n_markers = self._shown
        return np.asarray(np.where(n_points < PRESENT_SHARE * n_markers, n_points, 0).sum(axis=1))

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


def label_present_bodies(
    points: FollowedPoints, skeleton: Skeleton, label: Label
) -> tuple[BodyLabels, tuple[str, ...]]:
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
    sentences : tuple of str
        Which bodies are alike, so that another one may be absent, or two of them be exchanged, and how well they fit.
    """
    best, absent = _whole(label(skeleton, points), label), []
    names = names_of_bodies(skeleton.bodies, skeleton.limb_names)
    rivals: dict[int, BodyLabels] = {}
    while candidates := _without_absent(best, label):
        left_out, best = min(reversed(candidates), key=lambda one: one[1].deviation)
        rivals = dict(candidates) | rivals if len(candidates) > 1 else rivals
        absent.append(left_out)
    choice = _choice(rivals, [body for body in absent if body in rivals], names)
    return best, (*choice, *_exchangeable(best, label, names))


def _whole(labels: BodyLabels, label: Label) -> BodyLabels:
    """The labels, or those by one body after the other where many frames show parts of bodies and fewer do then."""
    if len(_carried(labels.skeleton)) < 2 or labels.n_parts < LEAST_FRAMES:  # one body has no rival
        return labels
    in_turn = _one_after_the_other(labels, label)
    return in_turn if in_turn.worth > labels.worth else labels


def _carried(skeleton: Skeleton) -> list[Ints]:
    """Limbs of each body that carries markers."""
    return [limbs for limbs in skeleton.bodies if np.isin(skeleton.limb_of_marker, limbs).any()]


def _one_after_the_other(labels: BodyLabels, label: Label) -> BodyLabels:
    """Label by the body that explains most by itself, what is left by the next one, and so on."""
    skeleton, points = labels.skeleton, labels.points
    marker_of_point = np.full_like(labels.marker_of_point, -1)
    bodies = _carried(skeleton)
    while bodies:
        left = np.flatnonzero(marker_of_point < 0)
        found = [label(_with_bodies(skeleton, limbs), _some_of(points, left)) for limbs in bodies]
        best = max(range(len(found)), key=lambda body: (found[body].worth, -found[body].deviation))
        marker_of_point[left] = found[best].marker_of_point
        del bodies[best]
    poses = pose_skeleton(skeleton, points.positions(marker_of_point, len(skeleton.limb_of_marker)))
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


def _choice(rivals: dict[int, BodyLabels], absent: list[int], names: tuple[str, ...]) -> Iterator[str]:
    """Say why some of several bodies are taken as absent."""
    if not absent:
        return
    fits = ", ".join(f"{fewer.deviation:.2f} mm without {names[body]}" for body, fewer in sorted(rivals.items()))
    left_out = listed(names[body] for body in sorted(absent))
    yield (
        f"not all of {listed(names[body] for body in sorted(rivals))} are there; {left_out} "
        f"{'is' if len(absent) == 1 else 'are'} taken as absent, by how far markers are from their places in the "
        f"median: {fits}; if another one is absent, leave its skeleton out"
    )


def _exchangeable(labels: BodyLabels, label: Label, names: tuple[str, ...]) -> Iterator[str]:
    """Say of which bodies that are there each fits the markers of another one as well: these may be exchanged."""
    shown = labels.shown
    there = [] if labels.by_name else np.flatnonzero(shown.sum(axis=0) >= LEAST_FRAMES).tolist()
    while there:
        first, fits = there[0], {}
        for other in there[1:]:
            both = [_fit_of_other(labels, label, *pair) for pair in ((first, other), (other, first))]
            if all(by_other <= ALIKE * own for own, by_other in both):
                fits[other] = np.mean(both, axis=0)
        alike = [first, *fits]
        there = [body for body in there if body not in alike]
        if fits:
            own, by_other = np.mean(list(fits.values()), axis=0)
            yield (
                f"{listed(names[body] for body in alike)} are alike, so that which is which is not known: markers are "
                f"{own:.2f} mm from their places in the median, {by_other:.2f} mm by the skeleton of another of them"
                f"{_changing_places(shown[:, alike])}"
            )


def _changing_places(shown: Bools) -> str:
    """From which frames on bodies may be exchanged: where one appears again or first, while two were away."""
    appears = (shown[1:] & ~shown[:-1]).any(axis=1) & ((~shown[:-1]).sum(axis=1) > 1)
    frames = (np.flatnonzero(appears & np.logical_or.accumulate(shown.any(axis=1))[:-1]) + 1).tolist()
    if not frames:
        return ""
    some, n_more = frames[:MOST_LISTED], len(frames) - MOST_LISTED
    words = listed([*map(str, some), *([f"{n_more} more"] if n_more > 0 else [])])
    at = "frames" if len(frames) > 1 else "frame"
    return f"; they may change places at {at} {words}, before which two of them are not seen"


def _fit_of_other(labels: BodyLabels, label: Label, body: int, other: int) -> tuple[float, float]:
    """Median distance [mm] of some points of a body from their places by its own skeleton, and by that of another one.

    The latter is infinite if the other skeleton explains fewer of them.
    """
    skeleton, points = labels.skeleton, labels.points
    own, limbs = skeleton.bodies[body], skeleton.bodies[other]
    limb_of_point = np.where(labels.marker_of_point >= 0, skeleton.limb_of_marker[labels.marker_of_point], -1)
    frames = np.flatnonzero(labels.shown[:, body])[:TRIED_FRAMES]
    kept = np.flatnonzero(np.isin(limb_of_point, own) & np.isin(points.frames, frames))
    some = _some_of(points, kept)
    by_own, by_other = (label(_with_bodies(skeleton, each), some) for each in (own, limbs))
    explains = by_other.explained.sum() >= EXPLAINED_SHARE * by_own.explained.sum()
    return by_own.deviation, by_other.deviation if explains else np.inf


def _without_absent(labels: BodyLabels, label: Label) -> list[tuple[int, BodyLabels]]:
    """Bodies that may be absent, by their number, each with the labels by all others."""
    limb_of_marker, n_frames, found = labels.skeleton.limb_of_marker, len(labels.explained), []
    for body, limbs in enumerate(labels.skeleton.bodies):
        is_own = np.isin(limb_of_marker, limbs)
        others = np.where(is_own, -1, limb_of_marker)
        n_others = int((others >= 0).sum())
        if not is_own.any() or n_others == 0 or labels.explained.sum() > n_others * n_frames:
            continue
        fewer = _whole(label(replace(labels.skeleton, limb_of_marker=others), labels.points), label)
        is_there = labels.explained - fewer.explained >= PRESENT_SHARE * is_own.sum()
        if is_there.sum() < min(LEAST_FRAMES, n_frames):
            found.append((body, fewer))
    return found
