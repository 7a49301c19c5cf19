"""Labels by a subject's skeleton: which point of a new take is which of its markers, and what the others are.

Points are matched with the skeleton's markers by its pose (`stages.labels.by_skeleton`). What a take
without names has left then is labelled by a skeleton that is fitted to it: skin moves otherwise and joints turn farther
than in the calibrated take, which may have been short; at last, distances of both takes put all right.
Tracks that remain and keep their place on a limb are markers: moved ones, where one of the limb is missing, or new.
"""

from dataclasses import dataclass

import numpy as np

from skelgen.errors import InputError
from skelgen.model import PointCloud, Skeleton, Trajectories
from skelgen.model.arrays import Ints
from skelgen.progress import SILENT, Monitor
from skelgen.stages.labels import (
    FollowedPoints,
    LabelParameters,
    SkeletonPoses,
    gates_of,
    match_points,
    n_carried,
    pose_skeleton,
    refit_labels,
    tracked_points,
    typical_spacing,
)
from skelgen.stages.subject.points import PlacedTrack, place_tracks
from skelgen.stages.subject.present import BodyLabels, label_present_bodies

LEAST_EXPLAINED = 0.5
"""Of the positions that markers of the skeleton or points of the take could give: less is no take of this body."""

OTHER_BODY = "it is of another body, or of other markers: calibrate this take by itself, without that skeleton"
"""What a take is that the skeleton explains no better, if its points lie as far apart as markers of bodies do."""


@dataclass(frozen=True, eq=False)
class SubjectLabels:
    """Points of a take as markers of a subject.

    Attributes
    ----------
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point; beyond those of the skeleton new ones; -1 for none.
    points : FollowedPoints
        The points.
    poses : SkeletonPoses
        Of the skeleton, by the points at their places.
    moved : tuple of PlacedTrack
        Markers of the skeleton that are at another place of their limb.
    new : tuple of PlacedTrack
        Markers that the skeleton does not know, in the order of their numbers.
    explained : float
        Part of the positions that could be explained which lie where the skeleton has its markers.
    by_name : bool
        Whether the names of the take decided.
    alike_bodies : tuple of str
        Which bodies are alike, so that another one may be there, or two be exchanged; see `label_present_bodies`.
    """

    marker_of_point: Ints
    points: FollowedPoints
    poses: SkeletonPoses
    moved: tuple[PlacedTrack, ...]
    new: tuple[PlacedTrack, ...]
    explained: float
    by_name: bool
    alike_bodies: tuple[str, ...] = ()


def label_by_subject(
    take: PointCloud | Trajectories,
    skeleton: Skeleton,
    calibrated: Trajectories,
    parameters: LabelParameters | None = None,
    monitor: Monitor = SILENT,
) -> SubjectLabels:
    """Label a take by the skeleton of the body that it shows.

    Parameters
    ----------
    take : PointCloud or Trajectories
        The take; names that it has count where they agree with the skeleton.
    skeleton : Skeleton
        Calibrated on another take.
    calibrated : Trajectories
        Its markers in that take.
    parameters : LabelParameters, optional
        How points without names are followed.
    monitor : Monitor
        Receives progress; may cancel.

    Raises
    ------
    InputError
        If the skeleton explains too little of the take: it shows another body, or other markers.
    """
    monitor.begin("labels by the subject's skeleton")
    parameters, names = parameters or LabelParameters(), calibrated.names
    points = tracked_points(take, parameters, monitor)

    def labelled(sought: Skeleton, some: FollowedPoints) -> BodyLabels:
        return BodyLabels(sought, some, *match_points(some, sought, names, monitor))

    present, sentences = label_present_bodies(points, skeleton, labelled)
    skeleton, placed, poses = present.skeleton, present.marker_of_point, present.poses
    # Part of what could be explained, frame by frame the fewer of points and markers, that is explained
    possible = np.minimum(points.cloud.points_per_frame, n_carried(skeleton)).sum()
    explained = float((placed >= 0).sum() / max(int(possible), 1))
    if explained < LEAST_EXPLAINED:
        raise InputError(
            f"{take.name or 'the take'}: the skeleton explains {100 * explained:.0f} % of the positions that it could; "
            + (_other_unit(points.cloud, tracked_points(calibrated, parameters, monitor).cloud) or OTHER_BODY)
        )
    if not points.names:
        refit = refit_labels(points, placed, skeleton, calibrated, parameters, monitor)
        if not np.array_equal(refit, placed):
            placed, poses = refit, pose_skeleton(skeleton, points.positions(refit, len(names)), monitor=monitor)
    names_of_tracks = {index: names.index(name) for index, name in enumerate(points.names) if name in names}
    moved, new = place_tracks(points, placed, skeleton, poses, gates_of(skeleton), names_of_tracks)
    result = placed.copy()
    for number, one in enumerate((*moved, *new)):
        marker = one.marker if number < len(moved) else len(names) + number - len(moved)
        result[one.points] = marker
    return SubjectLabels(result, points, poses, moved, new, explained, present.by_name, sentences)


def _other_unit(cloud: PointCloud, calibrated: PointCloud) -> str:
    """Say that a take is in another unit of length, if its points lie so far apart; empty if not."""
    spacing, usual = typical_spacing(cloud), typical_spacing(calibrated)
    if not (spacing > 0.0 and usual > 0.0):
        return ""
    factor = 10.0 ** round(float(np.log10(spacing / usual)))
    if factor == 1.0:
        return ""
    apart = f"{factor:g} times as far apart" if factor > 1.0 else f"{1.0 / factor:g} times as close together"
    return f"its points are about {apart} as the skeleton's markers, so that its unit of length is probably another one"
