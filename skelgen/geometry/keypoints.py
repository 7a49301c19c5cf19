"""Keypoints: points that sit on the joints of a body, as pose estimation gives them; markers sit on its limbs.

Between two joints that a bone joins lies a constant distance; a point that has such a distance to two others which come
nearer to each other and part again is a joint. Markers show no such points, but rigid triads. Estimated keypoints are
too noisy for that test: they are known by their names, which say joints that no marker can be put on (both hips).
"""

import re
from collections.abc import Sequence

import numpy as np

from skelgen.geometry.statistics import sorted_pair_lengths
from skelgen.model.arrays import Floats, spread_frames

_MOST_FRAMES, _FEWEST_FRAMES, _SHARED_OUT = 300, 30, 20_000  # frames with distances: fewer of many points

_JOINTS = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
_BONES = (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist"))
_MIDDLE = (
    "nose|neck|head|headtop|headtip|headcenter|top|pelvis|midhip|hips?center|hips?|root|spine[a-z]*|midspine|chest"
)
_MIDDLE += "|thorax|torso|belly|jaw|(?:mid|center)?shoulder(?:center|mid)?|neckcenter|chestcenter|trunkcenter"
_SIDED = "eye(?:inner|outer)?|ear|mouth|hand(?:tip|[a-z]*)|foot(?:index)?|heel|(?:big|small)?toe|index|pinky|thumb"
_SIDED += "|clavicle|collar"
_SIDE = "left|right|l|r"
_KEYPOINT = re.compile(
    rf"(?:body)?(?:(?:{_MIDDLE})|(?P<before>{_SIDE})(?P<first>{'|'.join(_JOINTS)}|{_SIDED})"
    rf"|(?P<second>{'|'.join(_JOINTS)}|{_SIDED}|mouth)(?P<after>{_SIDE})|face[a-z]*)"
)
_BONE_ENDS = {
    "thigh": ("knee",),
    "shank": ("ankle",),
    "foot": ("foot", "heel", "bigtoe", "smalltoe", "toe"),
    "upper arm": ("elbow",),
    "forearm": ("wrist",),
    "hand": ("hand", "index", "pinky", "thumb"),
    "pelvis": ("hip", "pelvis", "midhip", "root", "spinebase"),
    "head": ("head", "nose", "top", "jaw", "eye", "ear", "mouth", "face"),
}
_UNSIDED = frozenset({"pelvis", "chest", "head"})
_LEAST_JOINTS, _LEAST_SHARE = 8, 0.6  # of the twelve joints of arms and legs, and of all names
_CONSTANT, _ROUNDING = 0.003, 0.05  # a length that varies by this part, or by this [mm], is constant
_FLEXING = 5.0  # times as much as a constant one: a distance across a joint
_LEAST_POINTS, _LEAST_FLEXING = 10, 0.3  # points of a body, and the part of them that must be joints
_LEAST_FRAMES, _TAILS = 10, 0.02  # frames that tell; and the part of them whose lengths may be wrong, at either end


def keypoint_evidence(names: Sequence[str], positions: Floats) -> str:
    """Return why points are keypoints, as the end of a sentence; empty if they are markers, as far as can be told.

    Parameters
    ----------
    names : sequence of str, length n_points
        Their labels.
    positions : ndarray, shape (n_frames, n_points, 3), mm
        NaN where unseen.
    """
    if _are_named_so(names):
        return "their names say so"
    if len(names) >= _LEAST_POINTS and len(positions) >= _LEAST_FRAMES and _are_joints_of_bones(positions):
        return "bones of constant length join them, and no rigid limbs"
    return ""


def joint_of_name(name: str) -> tuple[str, str]:
    """Return the side (l or r) and the joint of arm or leg that a keypoint is called after; empty texts for others."""
    found = _KEYPOINT.fullmatch(_plain(name))
    part = (found["first"] or found["second"] or "") if found else ""
    return ((found["before"] or found["after"])[0], part) if found and part in _JOINTS else ("", "")


def segment_of_name(name: str) -> str:
    """Return the segment whose bone ends in a keypoint, by its name, with its side; empty if that is not known.

    Examples
    --------
    >>> segment_of_name("RKnee"), segment_of_name("left_wrist"), segment_of_name("neck"), segment_of_name("M017")
    ('right thigh', 'left forearm', 'chest', '')
    """
    plain = _plain(name)
    found = _KEYPOINT.fullmatch(plain)
    if found is None:
        return ""
    side = (found["before"] or found["after"] or "")[:1]
    part = found["first"] or found["second"] or plain
    segment = next((segment for segment, words in _BONE_ENDS.items() if part.startswith(words)), "chest")
    return f"{'left' if side == 'l' else 'right'} {segment}" if side and segment not in _UNSIDED else segment


def named_bones(names: Sequence[str]) -> list[tuple[int, int]]:
    """Return the bones of arms and legs, as pairs of points, that the names of keypoints tell."""
    place = {joint_of_name(name): point for point, name in enumerate(names)}
    pairs = [((side, one), (side, other)) for one, other in _BONES for side in "lr"]
    return [(place[one], place[other]) for one, other in pairs if one in place and other in place]


def is_pelvis(name: str) -> bool:
    """Whether a keypoint is called after the middle of the hips."""
    return re.fullmatch(r"(?:body)?(?:pelvis|midhip|hips?center|hips?|root|spinebase)", _plain(name)) is not None


def distance_table(positions: Floats, tails: float = 0.25) -> tuple[Floats, Floats]:
    """Return medians and ranges of the distances between points, each of shape (n_points, n_points), mm.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_points, 3), mm
        NaN where unseen; some hundred frames of them count.
    tails : float
        Part of the frames that the range leaves out at either end.

    Returns
    -------
    lengths, ranges : ndarray, mm
        NaN where two points are never seen together.
    """
    n_points = positions.shape[1]
    most = int(np.clip(_SHARED_OUT // max(n_points, 1), _FEWEST_FRAMES, _MOST_FRAMES))
    sample = positions[spread_frames(len(positions), most)]
    lengths, ranges = np.full((n_points, n_points), np.nan), np.full((n_points, n_points), np.nan)
    first, second = np.triu_indices(n_points)
    for part, ordered in sorted_pair_lengths(sample, first, second):
        pairs, last = np.arange(ordered.shape[1]), np.maximum((~np.isnan(ordered)).sum(axis=0) - 1, 0)
        low, middle, high = (ordered[(share * last).astype(np.intp), pairs] for share in (tails, 0.5, 1.0 - tails))
        one, other = first[part], second[part]
        lengths[one, other] = lengths[other, one] = middle
        ranges[one, other] = ranges[other, one] = high - low
    return lengths, ranges


def _are_named_so(names: Sequence[str]) -> bool:
    n_known = sum(_KEYPOINT.fullmatch(_plain(name)) is not None for name in names)
    joints = {joint_of_name(name) for name in names} - {("", "")}
    hips = {("l", "hip"), ("r", "hip")} <= joints
    return hips and len(joints) >= _LEAST_JOINTS and n_known >= _LEAST_SHARE * len(names)


def _are_joints_of_bones(positions: Floats) -> bool:
    lengths, ranges = distance_table(positions, _TAILS)
    limit = np.maximum(_CONSTANT * lengths, _ROUNDING)
    constant = (ranges <= limit) & ~np.eye(len(lengths), dtype=bool)
    flexing = ranges > _FLEXING * limit
    reached = np.zeros(len(lengths), dtype=bool)
    reached[int(constant.sum(axis=0).argmax())] = True
    for _ in range(len(lengths)):
        reached |= constant[reached].any(axis=0)
    joints = [flexing[np.ix_(near, near)].any() for near in constant]
    return bool(reached.all()) and float(np.mean(joints)) >= _LEAST_FLEXING


def _plain(name: str) -> str:
    return re.sub(r"[^a-z]", "", name.rpartition(":")[2].lower())
