"""Which of several known bodies a take shows: bodies that are alike would share the points of one.

A body without which the others explain as much of the take is absent. Of several such bodies the one is left out
without which the others fit best.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from skelgen.model import Skeleton
from skelgen.model.arrays import Ints
from skelgen.model.limbs import names_of_bodies
from skelgen.progress import listed
from skelgen.stages.subject.points import LEAST_FRAMES, FollowedPoints
from skelgen.stages.subject.posing import SubjectPoses

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

    @property
    def deviation(self) -> float:
        """Median distance [mm] of the points from their markers' places; infinite if none has a marker."""
        if (self.marker_of_point < 0).all():
            return np.inf
        positions = self.points.positions(self.marker_of_point, len(self.skeleton.limb_of_marker))
        off = positions - self.poses.markers(self.skeleton)
        return float(np.nanmedian(np.linalg.norm(off, axis=2)))


def label_present_bodies(skeleton: Skeleton, label: Callable[[Skeleton], BodyLabels]) -> tuple[BodyLabels, str]:
    """Label a take by those of several bodies that it shows.

    Parameters
    ----------
    skeleton : Skeleton
        Of all bodies.
    label : callable
        Labels the take by a skeleton.

    Returns
    -------
    labels : BodyLabels
        By the bodies that are there.
    sentence : str
        How well each body fits where one of several fits as the only one; empty if no two compete.
    """
    best, sentence = label(skeleton), ""
    names = names_of_bodies(skeleton.bodies, skeleton.limb_names)
    while candidates := _without_absent(best, label):
        left_out, best = min(reversed(candidates), key=lambda one: one[1].deviation)
        sentence = _choice(candidates, left_out, names) if len(candidates) > 1 else ""
    return best, sentence


def _choice(candidates: list[tuple[int, BodyLabels]], left_out: int, names: tuple[str, ...]) -> str:
    """Say why one of several bodies is taken as absent."""
    fits = ", ".join(f"{fewer.deviation:.2f} mm without {names[body]}" for body, fewer in candidates)
    return (
        f"not all of {listed(names[body] for body, _ in candidates)} are there; {names[left_out]} is taken as absent, "
        f"by how far markers are from their places in the median: {fits}; if another one is absent, leave its skeleton "
        "out"
    )


def _without_absent(labels: BodyLabels, label: Callable[[Skeleton], BodyLabels]) -> list[tuple[int, BodyLabels]]:
    """Bodies that may be absent, by their number, each with the labels by all others."""
    limb_of_marker, n_frames, found = labels.skeleton.limb_of_marker, len(labels.explained), []
    for body, limbs in enumerate(labels.skeleton.bodies):
        is_own = np.isin(limb_of_marker, limbs)
        others = np.where(is_own, -1, limb_of_marker)
        n_others = int((others >= 0).sum())
        if not is_own.any() or n_others == 0 or labels.explained.sum() > n_others * n_frames:
            continue
        fewer = label(replace(labels.skeleton, limb_of_marker=others))
        is_there = labels.explained - fewer.explained >= PRESENT_SHARE * is_own.sum()
        if is_there.sum() < min(LEAST_FRAMES, n_frames):
            found.append((body, fewer))
    return found
