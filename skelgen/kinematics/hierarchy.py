"""Bodies with poses as an articulated hierarchy: which are joined, where their joints are, and how they play back.

A joint is tried between every two bodies; how far its two images are apart is the weight of the pair, and the minimum
spanning tree of the weights is the hierarchy, unless it is given (O'Brien, Bodenheimer, Brostow and Hodgins 2000).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from skelgen.errors import InputError
from skelgen.kinematics.joints.closed_form import fit_fixed_point
from skelgen.kinematics.joints.fit import TypeChoice, choose_type, fit_joint_type
from skelgen.kinematics.joints.joint_type import DETERMINED_TYPES
from skelgen.kinematics.joints.relative_poses import RelativePoses, body_index, noise_size, relative_poses
from skelgen.model import Poses
from skelgen.model.arrays import Floats, Ints
from skelgen.model.topology import joint_children, parents_from_names, spanning_forest

LOOP_GAP = 3.0
"""Joints outside the tree are candidates if their gap is below this many times the median gap of the tree's joints."""

LOOP_NOISE = 1.15
"""They close a loop if their weighted residuals are below this many times the median of the tree's."""

ACROSS = 0.1
"""Cosine between a length and a hinge's axis below which a shift along the axis hardly changes the length."""

_EXACT_GAP = 1e-3
"""mm; gaps below count alike: the ridge of the closed form leaves as much."""


@dataclass(frozen=True)
class Length:
    """The distance between two joints of one body.

    Attributes
    ----------
    body : str
        Name of the body.
    first, second : str
        The bodies on the other side of the two joints.
    length, std : float, mm
        Distance and its standard deviation.
    is_determined : bool
        False where a hinge is free along its axis: then the length is one of many.
    """

    body: str
    first: str
    second: str
    length: float
    std: float
    is_determined: bool


@dataclass(frozen=True, eq=False)
class Hierarchy:
    """An articulated hierarchy of bodies.

    Attributes
    ----------
    names : tuple of str
        The bodies.
    parents : ndarray of intp, shape (n_bodies,)
        Parent of each body, -1 for a root.
    gaps : ndarray, shape (n_bodies, n_bodies), mm
        Root mean square distance of the two images of the best joint between each two bodies; NaN where they are never
        seen together.
    joints : dict of int to TypeChoice
        The joint above each body that is no root.
    loops : tuple of pairs of int
        Bodies that are joined beyond the tree, as found or as stated.
    loop_joints : tuple of TypeChoice
        Their joints, in this order: the first body is the parent.
    """

    names: tuple[str, ...]
    parents: Ints
    gaps: Floats
    joints: dict[int, TypeChoice]
    loops: tuple[tuple[int, int], ...]
    loop_joints: tuple[TypeChoice, ...] = ()

    @property
    def lengths(self) -> tuple[Length, ...]:
        """Distances between each two joints of one body: the table of limb lengths."""
        return tuple(length for body in range(len(self.names)) for length in self._lengths_of(body))

    def _lengths_of(self, body: int) -> list[Length]:
        pairs = [(*pair, joint.fit) for pair, joint in zip(self.loops, self.loop_joints, strict=True)]
        pairs += [(int(self.parents[child]), child, joint.fit) for child, joint in self.joints.items()]
        places = []
        for parent, child, fit in pairs:
            if body == parent:
                places.append(_Place(child, fit.kind, fit.in_parent, fit.covariance[:3, :3], fit.axis_in_parent))
            elif body == child:
                places.append(_Place(parent, fit.kind, fit.in_child, fit.covariance[3:, 3:], fit.axis_in_child))
        lengths = []
        for first, second in combinations(places, 2):
            vector = first.point - second.point
            length = float(np.linalg.norm(vector))
            unit = vector / length if length > 0 else vector
            variance = float(unit @ (first.covariance + second.covariance) @ unit)
            is_determined = first.is_determined_along(unit) and second.is_determined_along(unit)
            names = (self.names[body], self.names[first.other], self.names[second.other])
            lengths.append(Length(*names, length, float(np.sqrt(max(variance, 0.0))), is_determined))
        return lengths


@dataclass(frozen=True, eq=False)
class _Place:
    """A joint in one of its bodies: the body on its other side, kind, point [mm], covariance [mm^2], axis."""

    other: int
    kind: str
    point: Floats
    covariance: Floats
    axis: Floats | None

    def is_determined_along(self, unit: Floats) -> bool:
        """Whether the position is determined along a direction."""
        free = self.kind == "hinge" and self.axis is not None and abs(float(self.axis @ unit)) >= ACROSS
        return self.kind != "rigid" and not free


def find_hierarchy(
    poses: Poses,
    tree: Mapping[str, str | None] | int | str | None = None,
    covariances: Floats | None = None,
    size: float | None = None,
    *,
    types: Mapping[str, str] | None = None,
    loops: Sequence[tuple[str, str]] | None = None,
) -> Hierarchy:
    """Find the hierarchy of bodies and fit its joints.

    Parameters
    ----------
    poses : Poses
        Bodies with orientation.
    tree : mapping of str to str or None, or int or str, optional
        The parent of every body by name, None or empty for a root. Or the root of a tree that is found, by index or
        name; by default the body with most branches of similar size.
    covariances, size
        As for `fit_joint`.
    types : mapping of str to str, optional
        Types of joints that are stated, by the child's name.
    loops : sequence of pairs of str, optional
        Bodies that are joined beyond the tree, such as clasped hands; found if left out.

    Raises
    ------
    InputError
        If the bodies are markers or another value, names are unknown, the parents form a cycle, or two bodies to be
        joined are not seen together.
    """
    if not isinstance(poses, Poses):
        what = "the hierarchy of bodies is found from Poses, and that of markers by skelgen.reconstruct"
        raise InputError(f"the poses are {type(poses).__name__}: {what}")
    gaps = joint_gaps(poses)
    if isinstance(tree, Mapping):
        parents = parents_from_names(poses.names, tree)
    else:
        parents = spanning_forest(gaps, roots=() if tree is None else (body_index(poses, tree),))
    for name, kind in (types or {}).items():
        if name not in poses.names or kind not in DETERMINED_TYPES:
            raise InputError(
                f"types: {name}={kind} names no body or no type of joint; types are {', '.join(DETERMINED_TYPES)}"
            )
    wanted = {poses.names.index(name): kind for name, kind in (types or {}).items()}
    size = noise_size(poses) if size is None else size

    def relate(parent: int, child: int) -> RelativePoses:
        return relative_poses(poses, parent, child, covariances, size)

    children: list[int] = joint_children(parents).tolist()
    joints = {child: choose_type(relate(int(parents[child]), child), wanted.get(child)) for child in children}
    found = Hierarchy(poses.names, parents, gaps, joints, ())
    if loops is None:
        pairs = _loops(found, relate)
    else:
        pairs = tuple((body_index(poses, first), body_index(poses, second)) for first, second in loops)
    joined = tuple(choose_type(relate(first, second)) for first, second in pairs)
    return replace(found, loops=pairs, loop_joints=joined)


def without_residual(poses: Poses, hierarchy: Hierarchy) -> Poses:
    """Play a motion back with its joints held together: rotations and the roots' places are kept (O'Brien 2000, 3.4).

    Parameters
    ----------
    poses : Poses
        The motion.
    hierarchy : Hierarchy
        Its joints. A body is unseen where it or one between it and its root is.
    """
    world = poses.world_from_body.copy()
    for body in joint_children(hierarchy.parents).tolist():
        parent, fit = int(hierarchy.parents[body]), hierarchy.joints[body].fit
        joint = world[:, parent, :3, :3] @ fit.in_parent + world[:, parent, :3, 3]
        world[:, body, :3, 3] = joint - world[:, body, :3, :3] @ fit.in_child
    return replace(poses, world_from_body=world)


def joint_gaps(poses: Poses) -> Floats:
    """Root mean square gap [mm] of the best joint between each two bodies, shape (n_bodies, n_bodies)."""
    gaps = np.full((poses.n_bodies, poses.n_bodies), np.nan)
    np.fill_diagonal(gaps, 0.0)
    nowhere = np.zeros(3)
    world = poses.world_from_body
    for first, second in combinations(range(poses.n_bodies), 2):
        fit = fit_fixed_point(world[:, first], world[:, second], nowhere, nowhere)
        if fit is not None:
            gaps[first, second] = gaps[second, first] = np.sqrt(fit.gap)
    return gaps


def _loops(hierarchy: Hierarchy, relate: Callable[[int, int], RelativePoses]) -> tuple[tuple[int, int], ...]:
    """Pairs outside the tree whose joint fits as well as those inside; bodies that never moved apart are one."""
    parents, gaps, joints = hierarchy.parents, hierarchy.gaps, hierarchy.joints
    if not joints:
        return ()
    gap = LOOP_GAP * max(float(np.median([gaps[child, parents[child]] for child in joints])), _EXACT_GAP)
    noise = LOOP_NOISE * float(np.median([joint.fit.noise for joint in joints.values()]))
    one = {child: joints[child].kind in {"rigid", "undetermined"} for child in joints}
    pairs = []
    for first, second in combinations(range(len(parents)), 2):
        in_tree = parents[first] == second or parents[second] == first
        between = set(_to_root(parents, first)) ^ set(_to_root(parents, second))
        if in_tree or not gaps[first, second] <= gap or any(one.get(body, False) for body in between):
            continue
        if gaps[first, second] <= _EXACT_GAP or fit_joint_type("ball", relate(first, second)).noise <= noise:
            pairs.append((first, second))
    return tuple(pairs)


def tree_path(parents: Ints, first: int, second: int) -> list[int]:
    """Return the limbs from one to another along the tree, both included; none between separate bodies.

    Parameters
    ----------
    parents : ndarray of intp, shape (n_limbs,)
        Parent of each limb, -1 for a root.
    first, second : int
        Limbs.
    """
    to_root = [_to_root(parents, limb) for limb in (first, second)]
    shared = next((limb for limb in to_root[0] if limb in to_root[1]), None)
    if shared is None:
        return []
    there, back = (path[: path.index(shared)] for path in to_root)
    return [*there, shared, *reversed(back)]


def _to_root(parents: Ints, limb: int) -> list[int]:
    path = [limb]
    while parents[path[-1]] >= 0:
        path.append(int(parents[path[-1]]))
    return path
