"""Bones between keypoints: the spanning tree of the points over how much their distances vary.

Bones that meet in a point and do not turn about it are one: pelvis, feet and head have more than two points. Where two
bones meet there is a joint; every bone but the root's begins in a point of its parent.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Collection
from dataclasses import dataclass
from itertools import chain, combinations

import numpy as np

from skelgen.geometry.keypoints import distance_table, is_pelvis, joint_of_name, named_bones
from skelgen.model import Trajectories
from skelgen.model.arrays import Floats, Ints
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
