"""Two results of one take beside each other: which markers, limbs and joints are the same, how far joints are apart."""

from dataclasses import dataclass

import numpy as np

from skelgen.app.drawing.wording import digits, whole_percent
from skelgen.errors import InputError
from skelgen.model import Project
from skelgen.model.arrays import Ints, spread_frames

_SAMPLES = 500  # frames that are compared
_SAME_PLACE = 1e-2  # mm: positions in files are rounded


@dataclass(frozen=True)
class ComparedMarker:
    """A marker, and the marker of the other result that it is.

    Attributes
    ----------
    marker, other : int
        Indices in both; `other` is -1 if none has its positions.
    share : float
        Of the frames in which either is seen: those in which both are the same point.
    """

    marker: int
    other: int
    share: float


@dataclass(frozen=True)
class ComparedJoint:
    """A joint, and the joint of the other result between the same limbs.

    Attributes
    ----------
    joint, other : int
        Indices in both; `other` is -1 if there is none.
    median, largest : float, mm
        Distance of both over the frames; NaN without another one, or before the skeletons are there.
    """

    joint: int
    other: int
    median: float
    largest: float


@dataclass(frozen=True)
class Comparison:
    """How two results of one take differ.

    Attributes
    ----------
    markers : tuple of ComparedMarker
        One for each marker of the first.
    other_of_limb : tuple of int
        The limb of the other with exactly the same markers, -1 = none.
    joints : tuple of ComparedJoint
        One for each joint of the first.
    """

    markers: tuple[ComparedMarker, ...]
    other_of_limb: tuple[int, ...]
    joints: tuple[ComparedJoint, ...]


def compare_results(one: Project, other: Project) -> Comparison:
    """Compare two results of the same take.

    Parameters
    ----------
    one, other : Project
        With labels; limbs and joints are compared if both have them.

    Raises
    ------
    InputError
        If they are of takes of different length, or one has no labels.
    """
    if one.take.n_frames != other.take.n_frames:
        raise InputError(
            f"{other.name} has {other.take.n_frames} frames, {one.name} has {one.take.n_frames}: they are of two takes"
        )
    markers = _markers(one, other)
    if not (one.has("limbs") and other.has("limbs")):
        return Comparison(markers, (), ())
    other_of_marker = np.array([match.other for match in markers], dtype=np.intp)
    limbs = _limbs(one, other, other_of_marker)
    if not (one.has("joints") and other.has("joints")):
        return Comparison(markers, limbs, ())
    return Comparison(markers, limbs, _joints(one, other, limbs))


def comparison_sentences(one: Project, other: Project, found: Comparison) -> tuple[str, ...]:
    """Return what is the same and what is not, in three sentences at most.

    Parameters
    ----------
    one, other : Project
        The two results.
    found : Comparison
        From `compare_results`.
    """
    n_same = sum(match.other >= 0 for match in found.markers)
    shares = [match.share for match in found.markers if match.other >= 0]
    mean = whole_percent(float(np.mean(shares))) if shares else "0 %"
    counts = (
        f"{n_same} of {len(found.markers)} markers are there in both ({len(other.trajectories.names)} in the other)"
    )
    sentences = [f"{counts}, the same point in {mean} of the frames"]
    if found.other_of_limb:
        n_limbs = sum(limb >= 0 for limb in found.other_of_limb)
        sentences.append(f"{n_limbs} of {len(found.other_of_limb)} limbs have the same markers")
    if found.joints:
        known = [match.median for match in found.joints if not np.isnan(match.median)]
        apart = f", {digits(float(np.median(known)))} mm apart in the median" if known else ""
        n_joints = sum(match.other >= 0 for match in found.joints)
        sentences.append(f"{n_joints} of {len(found.joints)} joints are between the same limbs{apart}")
    return tuple(sentences)


def _markers(one: Project, other: Project) -> tuple[ComparedMarker, ...]:
    frames = spread_frames(one.take.n_frames, _SAMPLES)
    mine, theirs = (project.trajectories.positions[frames] for project in (one, other))
    seen = ~np.isnan(theirs[..., 0])
    found = []
    for marker in range(mine.shape[1]):
        own = mine[:, marker]
        is_same = (np.abs(theirs - own[:, np.newaxis]) < _SAME_PLACE).all(axis=2)
        counts = is_same.sum(axis=0)
        best = int(counts.argmax()) if len(counts) else -1
        if best < 0 or not counts[best]:
            found.append(ComparedMarker(marker, -1, 0.0))
        else:
            either = (~np.isnan(own[:, 0]) | seen[:, best]).sum()
            found.append(ComparedMarker(marker, best, float(counts[best] / either)))
    return tuple(found)


def _limbs(one: Project, other: Project, other_of_marker: Ints) -> tuple[int, ...]:
    theirs = {frozenset(other.limbs.markers_of(limb).tolist()): limb for limb in range(other.limbs.n_limbs)}
    mine = (frozenset(other_of_marker[one.limbs.markers_of(limb)].tolist()) for limb in range(one.limbs.n_limbs))
    return tuple(theirs.get(markers, -1) for markers in mine)


def _joints(one: Project, other: Project, limbs: tuple[int, ...]) -> tuple[ComparedJoint, ...]:
    theirs = {frozenset(edge): joint for joint, edge in enumerate(other.topology.edges.tolist())}
    both = one.has("skeleton") and other.has("skeleton")
    found = []
    for joint, edge in enumerate(one.topology.edges.tolist()):
        match = theirs.get(frozenset(limbs[limb] for limb in edge), -1)
        median = largest = float("nan")
        if match >= 0 and both:
            apart = np.linalg.norm(
                one.motion.joint_positions[:, joint] - other.motion.joint_positions[:, match], axis=1
            )
            median, largest = float(np.nanmedian(apart)), float(np.nanmax(apart))
        found.append(ComparedJoint(joint, match, median, largest))
    return tuple(found)
