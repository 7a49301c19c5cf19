"""Two results of one take beside each other: which markers, limbs and joints are the same, how far joints are apart."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from skelgen.app.drawing.wording import digits, whole_percent
from skelgen.errors import InputError
from skelgen.geometry.rotations import nearest_rotation, vector_from_matrix
from skelgen.model import Project
from skelgen.model.arrays import Floats, Ints, spread_frames

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
        Share of the frames that show either marker in which both are the same point.
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
    angle : float, rad
        Median angle between the rotations of the joint in both results; the choice of the limbs' frames does not
        matter; NaN as above.
    """

    joint: int
    other: int
    median: float
    largest: float
    angle: float


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


def comparison_sentences(other: Project, found: Comparison) -> tuple[str, ...]:
    """Return what is the same and what is not, in three sentences at most.

    Parameters
    ----------
    other : Project
        The second of the two results.
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
        angles = [match.angle for match in found.joints if not np.isnan(match.angle)]
        apart = (
            f", {digits(float(np.median(known)))} mm apart in the median, and turned by "
            f"{digits(float(np.degrees(np.median(angles))))}° against each other"
            if known
            else ""
        )
        n_joints = sum(match.other >= 0 for match in found.joints)
        sentences.append(f"{n_joints} of {len(found.joints)} joints are between the same limbs{apart}")
    return tuple(sentences)


def comparison_tables(one: Project, other: Project, found: Comparison) -> Mapping[str, Sequence[Mapping[str, object]]]:
    """Return rows of bodies, limbs, joints and markers, for tables and JSON; None where the other result has none.

    Parameters
    ----------
    one, other : Project
        The two results.
    found : Comparison
        From `compare_results`.
    """
    bodies = [
        {
            "result": place,
            "root": project.limbs.names[body.root],
            "limbs": len(body.limbs),
            "markers": len(body.markers),
        }
        for place, project in (("first", one), ("second", other))
        if project.has("joints")
        for body in project.bodies
    ]
    limbs = [
        {"limb": one.limbs.names[limb], "other": other.limbs.names[match] if match >= 0 else None}
        for limb, match in enumerate(found.other_of_limb)
    ]
    joints = [
        {
            "joint": _ends(one, match.joint),
            "other": _ends(other, match.other) if match.other >= 0 else None,
            "median_mm": _known(match.median),
            "largest_mm": _known(match.largest),
            "angle_deg": _known(float(np.degrees(match.angle))),
        }
        for match in found.joints
    ]
    mine, theirs = one.trajectories.names, other.trajectories.names
    markers = [
        {"marker": mine[each.marker], "other": theirs[each.other] if each.other >= 0 else None, "same": each.share}
        for each in found.markers
    ]
    return {"bodies": bodies, "limbs": limbs, "joints": joints, "markers": markers}


def _ends(project: Project, joint: int) -> str:
    return " – ".join(project.limbs.names[limb] for limb in project.topology.edges[joint].tolist())


def _known(value: float) -> float | None:
    return None if np.isnan(value) else value


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
        median = largest = angle = float("nan")
        if match >= 0 and both:
            apart = np.linalg.norm(
                one.motion.joint_positions[:, joint] - other.motion.joint_positions[:, match], axis=1
            )
            median, largest = float(np.nanmedian(apart)), float(np.nanmax(apart))
            angle = _median_turn(*(_limb_rotations(one, other, limb, limbs[limb]) for limb in edge))
        found.append(ComparedJoint(joint, match, median, largest, angle))
    return tuple(found)


def _limb_rotations(one: Project, other: Project, limb: int, match: int) -> tuple[Floats, Floats]:
    """Rotations of a limb in both results, shape (n_frames, 3, 3), both of the limb's frame in the first result."""
    mine, theirs = one.motion.rotations[:, limb], other.motion.rotations[:, match]
    between = nearest_rotation(np.einsum("fji,fjk->ik", theirs, mine))
    return mine, theirs @ between


def _median_turn(parent: tuple[Floats, Floats], child: tuple[Floats, Floats]) -> float:
    """Median angle [rad] between the rotations of a joint in both results, from those of its limbs."""
    mine, theirs = (np.swapaxes(parent[side], 1, 2) @ child[side] for side in range(2))
    angles = np.linalg.norm(vector_from_matrix(np.swapaxes(mine, 1, 2) @ theirs), axis=1)
    return float(np.median(angles))
