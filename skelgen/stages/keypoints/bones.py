"""Bones between keypoints: the spanning tree of the points over how much their distances vary, and poses.

Bones that meet in a point and do not turn about it are one: pelvis, feet and head have more than two points. Where two
bones meet there is a joint; every bone but the root's begins in a point of its parent.

Shapes and poses are closed forms. Every bone turns about the point of its parent in which it begins, from the root
outward (Schönauer 2007, 3.8). Two points do not say how a bone turns about itself: it turns as little as possible
against its parent. That comes as one more term of the moments, so small that it counts for nothing else.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Collection
from dataclasses import dataclass
from itertools import chain, combinations

import numpy as np

from skelgen.geometry.keypoints import distance_table, is_pelvis, joint_of_name, named_bones
from skelgen.geometry.orientation import fit_transform
from skelgen.geometry.rotations import fill_rotations, fill_vectors, nearest_rotation, transform_from
from skelgen.kinematics.rigid_bodies import FLATNESS, fit_shape
from skelgen.model import Trajectories
from skelgen.model.arrays import Bools, Floats, Ints, spread_frames
from skelgen.model.topology import spanning_forest

_LENGTH_COST = 0.01  # of a length, added to its range: of two bones that vary alike the shorter one is likelier
_ALIKE, _ROUNDING = 1.25, 0.1  # a distance that varies by so much more than two bones [mm] is that of a joint
_KNOWN_COST = 1e-6  # mm, of a bone that the names tell: less than any other has


@dataclass(frozen=True, eq=False)
class Bones:
    """Bones between points, from the root outward.

    Attributes
    ----------
    points : tuple of ndarray of intp
        Points of each bone: that in which it begins, then its own ones; all of a root are its own.
    parents : ndarray of intp, shape (n_bones,)
        Parent of each bone, -1 for a root.
    lengths, ranges : ndarray, shape (n_points, n_points), mm
        Medians and ranges of the distances between points.
    """

    points: tuple[Ints, ...]
    parents: Ints
    lengths: Floats
    ranges: Floats

    @property
    def bone_of_point(self) -> Ints:
        """The bone of which each point is one of its own, shape (n_points,); -1 where a point is on none."""
        found = np.full(len(self.lengths), -1, dtype=np.intp)
        for bone in range(len(self.points)):
            found[self.own_points(bone)] = bone
        return found

    def own_points(self, bone: int) -> Ints:
        """Points of a bone but the one in which it begins."""
        return self.points[bone] if self.parents[bone] < 0 else self.points[bone][1:]


def find_bones(trajectories: Trajectories, root: Collection[int] = ()) -> Bones:
    """Find the bones between keypoints, and their tree.

    Parameters
    ----------
    trajectories : Trajectories
        Keypoints.
    root : collection of int
        Points of the bone that is the root; if there are none, the pelvis, or the bone with most joints.
    """
    lengths, ranges = distance_table(trajectories.positions)
    costs, named = ranges + _LENGTH_COST * lengths, named_bones(trajectories.names)
    inner = [point for point, count in Counter(chain.from_iterable(named)).items() if count > 1]
    costs[inner] = costs[:, inner] = np.nan  # knees and elbows join nothing but the bones of their limb
    for first, second in named:
        costs[first, second] = costs[second, first] = _KNOWN_COST
    parents = spanning_forest(costs)
    edges = [(int(parents[point]), point) for point in np.flatnonzero(parents >= 0).tolist()]
    groups = _rigid_groups(edges, ranges, {frozenset(bone) for bone in named})
    lonely = [{point} for point in np.flatnonzero(parents < 0).tolist() if all(point not in edge for edge in edges)]
    seen = np.asarray(trajectories.seen.any(axis=0))
    groups += [group for group in lonely if seen[list(group)].all()]
    return _rooted(groups, trajectories.names, root, lengths, ranges)


def _rigid_groups(edges: list[tuple[int, int]], ranges: Floats, named: Collection[frozenset[int]]) -> list[set[int]]:
    """Merge edges that meet in a point and do not turn about it, the surest first; bones of arms and legs stay."""
    group_of = {edge: {*edge} for edge in edges}
    meeting = []
    movable = [edge for edge in edges if frozenset(edge) not in named]
    for one, other in combinations(movable, 2):
        if shared := {*one} & {*other}:
            (end,), (other_end,) = {*one} - shared, {*other} - shared
            limit = _ALIKE * max(ranges[one], ranges[other]) + _ROUNDING
            meeting.append((float(ranges[end, other_end] / limit), one, other, limit))
    for share, one, other, limit in sorted(meeting):
        first, second = group_of[one], group_of[other]
        across = ranges[np.ix_(sorted(first - second), sorted(second - first))]
        if share <= 1.0 and first is not second and (across <= limit).all():
            together = first | second
            group_of = {edge: together if group in (first, second) else group for edge, group in group_of.items()}
    return list({id(group): group for group in group_of.values()}.values())


def _rooted(
    groups: list[set[int]], names: tuple[str, ...], root: Collection[int], lengths: Floats, ranges: Floats
) -> Bones:
    """Order bones from their roots outward."""
    groups_at: dict[int, list[int]] = {}
    for index, group in enumerate(groups):
        for point in sorted(group):
            groups_at.setdefault(point, []).append(index)

    def rank(index: int) -> tuple[bool, int, int, int, int]:
        group = groups[index]
        n_joints = sum(len(groups_at[point]) > 1 for point in group)
        n_pelvis = sum(2 * is_pelvis(names[point]) + (joint_of_name(names[point])[1] == "hip") for point in group)
        return bool(root) and group.issuperset(root), n_pelvis, n_joints, len(group), -min(group)

    points: list[Ints] = []
    parents: list[int] = []
    placed: set[int] = set()
    for start in sorted(range(len(groups)), key=rank, reverse=True):
        waiting = deque([(start, -1, -1)])
        while waiting:
            index, parent, begin = waiting.popleft()
            if index in placed:
                continue
            placed.add(index)
            own = sorted(groups[index] - {begin})
            points.append(np.array([begin, *own] if parent >= 0 else own, dtype=np.intp))
            parents.append(parent)
            bone = len(points) - 1
            waiting.extend((other, bone, point) for point in own for other in groups_at[point] if other not in placed)
    return Bones(tuple(points), np.array(parents, dtype=np.intp), lengths, ranges)


_WEAK = 1e-9  # weight of the parent's rotation, in squared lengths of the bone; rounding is 1e-16
_NOTHING = 1e-9  # mm, mm^2; so that nothing is divided by zero
_SHAPE_FRAMES = 500


@dataclass(frozen=True, eq=False)
class PosedBones:
    """Shapes of bones and their poses.

    Attributes
    ----------
    reference : int
        Frame in which no bone is turned.
    offsets : list of ndarray, shape (n_points_of_bone, 3), mm
        Points of each bone from its origin, axes as the world's in the reference frame.
    poses : ndarray, shape (n_frames, n_bones, 4, 4)
        World from bone.
    posed : ndarray of bool, shape (n_frames, n_bones)
        Where points of the bone were seen; elsewhere it is interpolated.
    """

    reference: int
    offsets: list[Floats]
    poses: Floats
    posed: Bools


def pose_bones(positions: Floats, bones: Bones) -> PosedBones:
    """Find the shape of every bone, and pose all of them in every frame.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_points, 3), mm
        Keypoints, NaN where unseen.
    bones : Bones
        From the root outward.
    """
    n_frames, n_bones = len(positions), len(bones.points)
    seen = ~np.isnan(positions[:, :, 0])
    reference = int(seen.sum(axis=1).argmax())
    offsets = [_shape(positions, bones, bone, reference) for bone in range(n_bones)]
    poses, posed = np.tile(np.eye(4), (n_frames, n_bones, 1, 1)), np.zeros((n_frames, n_bones), dtype=bool)
    for bone, parent in enumerate(bones.parents.tolist()):
        if parent < 0:
            poses[:, bone], posed[:, bone] = _root_pose(positions, bones, bone, offsets[bone], reference)
            continue
        own, arms = bones.own_points(bone), offsets[bone][1:]
        place = offsets[parent][np.flatnonzero(bones.points[parent] == bones.points[bone][0])[0]]
        origins = poses[:, parent, :3, :3] @ place + poses[:, parent, :3, 3]
        turns, known = _turns(positions[:, own] - origins[:, np.newaxis], arms, poses[:, parent, :3, :3])
        poses[:, bone], posed[:, bone] = transform_from(turns, origins), known
    return PosedBones(reference, offsets, poses, posed)


def _shape(positions: Floats, bones: Bones, bone: int, reference: int) -> Floats:
    """Points of a bone from its origin: as they lie in the reference frame, with the lengths of all frames."""
    points = bones.points[bone]
    there = positions[reference, points]
    if np.isnan(there).any():  # never mind how it is turned: it is posed from its shape
        whole = ~np.isnan(positions[:, points, 0]).any(axis=1)
        there = positions[int(whole.argmax()), points] if whole.any() else _by_lengths(bones.lengths, points)
    shape = fit_shape(positions[:, points], spread_frames(len(positions), _SHAPE_FRAMES))
    if shape.has_pose and len(points) > 2:
        source = shape.points
        turned = fit_transform(source, there, np.ones(len(points), dtype=bool))
        there = source @ turned[:3, :3].T
    elif len(points) == 2:
        arm = there[1] - there[0]
        there = np.stack(
            [np.zeros(3), arm * (bones.lengths[points[0], points[1]] / max(np.linalg.norm(arm), _NOTHING))]
        )
    return np.asarray(there - (there[0] if bones.parents[bone] >= 0 else there.mean(axis=0)))


def _by_lengths(lengths: Floats, points: Ints) -> Floats:
    """Points in a row, of a bone that is never seen as a whole."""
    return np.array([[float(np.nan_to_num(lengths[points[0], point])), 0.0, 0.0] for point in points.tolist()])


def _root_pose(positions: Floats, bones: Bones, bone: int, offsets: Floats, reference: int) -> tuple[Floats, Bools]:
    """Pose of a root: about itself, where its points do not tell that, it turns with the bones that begin in it."""
    points = bones.points[bone]
    near = [bones.points[child] for child in np.flatnonzero(bones.parents == bone)]
    around = np.unique(np.concatenate([points, *near]))
    around = around[~np.isnan(positions[reference, around, 0])]
    measured = positions[:, points]
    seen = ~np.isnan(measured[:, :, 0])
    rough = fit_transform(positions[reference, around], positions[:, around], ~np.isnan(positions[:, around, 0]))
    about = np.nan_to_num(rough[:, :3, :3])
    about[np.isnan(rough[:, 0, 0])] = np.eye(3)
    count = np.maximum(seen.sum(axis=1), 1)[:, np.newaxis]
    middle = np.where(seen[..., np.newaxis], measured, 0.0).sum(axis=1) / count
    centre = (seen[..., np.newaxis] * offsets).sum(axis=1) / count
    turns, known = _turns(measured - middle[:, np.newaxis], offsets - centre[:, np.newaxis], about)
    origins = fill_vectors(middle - (turns @ centre[..., np.newaxis])[..., 0], np.asarray(seen.any(axis=1)))
    return transform_from(turns, origins), known


def _turns(measured: Floats, arms: Floats, about: Floats) -> tuple[Floats, Bools]:
    """Rotations that bring arms onto measured ones, else near `about`, shape (n_frames, 3, 3); and where one is seen.

    Parameters
    ----------
    measured : ndarray, shape (n_frames, n_points, 3), mm
        Points from the one that they turn about, in the world; NaN where unseen.
    arms : ndarray, shape (n_points, 3) or (n_frames, n_points, 3), mm
        The same in the bone.
    about : ndarray, shape (n_frames, 3, 3)
        Rotations to which the bone turns as near as it can.
    """
    seen = ~np.isnan(measured[:, :, 0])
    u, extents, axes = np.linalg.svd(arms if arms.ndim > 2 else arms[np.newaxis], full_matrices=False)
    extents[:, 1:] *= (extents[:, 1:2] > FLATNESS * extents[:, :1]) if extents.shape[1] > 1 else 1.0
    straight = (u * extents[:, np.newaxis]) @ axes  # points in one line do not tell how it turns about itself
    moments = np.einsum("fpi,fpj->fij", np.nan_to_num(measured), np.broadcast_to(straight, measured.shape))
    size = max(float((extents**2).sum(axis=1).max()), _NOTHING)
    known: Bools = np.asarray(seen.any(axis=1))
    turns = nearest_rotation(moments + _WEAK * size * about)
    relative = fill_rotations(about.swapaxes(1, 2) @ turns, known)
    return np.asarray(about @ relative), known
