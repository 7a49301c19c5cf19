"""Labels found again by the skeleton of the take itself, if that explains more of it.

Tracklets, limbs, tree and poses improve one another (Schönauer 2007, 6.1). Labels that are mostly right imply a
skeleton that is mostly right; followed from frame to frame, its pose says who is who where whole limbs come back after
they were hidden, and where points are too fast for tracks. If these labels explain more of the take than those before,
the better of both is kept part by part (`merging.judging`), so that nothing is lost.
"""

from dataclasses import replace

import numpy as np

from skelgen.errors import InputError
from skelgen.model import Skeleton, Trajectories
from skelgen.model.arrays import Ints
from skelgen.progress import Monitor
from skelgen.stages.joints import JointParameters, find_joints
from skelgen.stages.labels import point_labels
from skelgen.stages.labels.by_skeleton.matching import pose_and_reassign, propose_markers, with_whole_tracks
from skelgen.stages.labels.by_skeleton.points import FollowedPoints
from skelgen.stages.labels.by_skeleton.posing import with_free_joints
from skelgen.stages.labels.confidence import label_quality
from skelgen.stages.labels.merging.followed import FollowedCloud
from skelgen.stages.labels.merging.judging import better_labels, fused_labels
from skelgen.stages.labels.merging.leftovers import label_rest
from skelgen.stages.labels.merging.turns import put_right
from skelgen.stages.limbs import LimbParameters, find_limbs
from skelgen.stages.skeleton import SkeletonParameters, fit_skeleton

DOUBTFUL = 0.01
"""Part of the positions that are expected to be another marker's from which labels are sought again; what lacks a
marker counts twice, as a doubt may be needless."""

LEFT_SECONDS = 0.06
"""s; what is followed for longer without a marker lacks one: false points do not last that long."""

PROMISING = 0.9
"""Part of the evidence found that the skeleton's labels must have before they are posed, which adds some of it."""

MOST_FRAMES = 10_000
"""Of longer takes, which show distances for longer, labels are not sought again: a frame takes some milliseconds."""

BY_MARKERS_ALONE = SkeletonParameters(soft_tissue=False, known_build=False)
"""How they are fitted: slides of skin, and what bodies are usually like, say little of who is who."""


def label_again(take: FollowedCloud, found: Ints, seed: int, monitor: Monitor) -> Ints:
    """Find labels again by the skeleton that they imply, if much of them is doubtful.

    Parameters
    ----------
    take : FollowedCloud
        The take.
    found : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    seed : int
        Random seed of the stages that find the skeleton.
    monitor : Monitor
        Receives progress; may cancel.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none; labels found if no skeleton explains more.
    """
    if take.cloud.n_frames > MOST_FRAMES or not _are_doubtful(take, found):
        return found
    monitor.begin("labels by the skeleton")
    skeleton = _skeleton_of(take, found, seed)
    if skeleton is None:
        return found
    frames = take.frame_of_point().astype(np.intp)
    points = FollowedPoints(take.cloud, frames, take.track_of_point.astype(np.intp), ())
    judge = replace(take, by_posture=True)
    evidence, chance = judge.evidence(found)
    proposed, _ = propose_markers(points, skeleton, monitor=monitor)
    if judge.evidence(label_rest(take, proposed.astype(np.int32)))[0] < PROMISING * evidence:
        return found
    reassigned, _ = pose_and_reassign(points, proposed, skeleton, monitor)
    whole = with_whole_tracks(points, reassigned, int(found.max()) + 1)
    fused = found
    for way in (whole, reassigned):
        other = label_rest(take, way.astype(np.int32))
        if judge.evidence(other)[0] > max(evidence, 0.0):  # of a skeleton that is off, parts explain more by chance
            fused = fused_labels(take, fused, other)
    if fused is found:
        return found
    right = better_labels(take, fused, label_rest(take, put_right(take, fused)))
    return better_labels(take, found, right, chance)


def _are_doubtful(take: FollowedCloud, found: Ints) -> bool:
    """Whether many positions are expected to be another marker's, or were followed without a marker."""
    if (found < 0).all():
        return False
    left = take.unlabelled_per_track(found)
    n_left = left[left >= LEFT_SECONDS * take.rate].sum()
    labelled = _trajectories(take, found)
    points = label_quality.PointLabels(take.cloud, take.track_of_point, found)
    history = label_quality.history_of(points, labelled.n_markers)
    confidence = label_quality.labelling_of_cloud(labelled, history).confidence
    return bool(2.0 * n_left / len(found) + np.nanmean(1.0 - confidence) > DOUBTFUL)


def _trajectories(take: FollowedCloud, found: Ints) -> Trajectories:
    names = point_labels.marker_names(int(found.max(initial=-1)) + 1)
    return Trajectories(point_labels.all_positions(take.cloud, found, len(names)), names, take.rate)


def _skeleton_of(take: FollowedCloud, found: Ints, seed: int) -> Skeleton | None:
    """The skeleton that labels imply, with joints that turn freely; None if there is none."""
    markers = _trajectories(take, found)
    try:
        limbs = find_limbs(markers, LimbParameters(), seed=seed)
        topology = find_joints(markers, limbs, JointParameters(), seed=seed)
        return with_free_joints(fit_skeleton(markers, limbs, topology, BY_MARKERS_ALONE)[0])
    except InputError:
        return None
