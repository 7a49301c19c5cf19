"""Limbs from the bones of a recorded motion: bones that move as one are one limb, and joints are points.

Animation files hold bones that no skeleton has: a fixed frame in which the hips slide, bones without length that share
the rotation of one joint, bones that are fixed to their parents. Here they are removed, one rule after another.
"""

from dataclasses import dataclass

import numpy as np

from skelgen.errors import InputError
from skelgen.geometry.rotations import transform_from, vector_from_matrix
from skelgen.model.arrays import Floats, Ints
from skelgen.model.takes import BoneMotion

STILL_MM = 0.1
"""mm; a bone that moves its farthest point by less does not move: files hold angles to a hundredth of a degree."""


@dataclass(frozen=True, eq=False)
class BoneTree:
    """Limbs, the root first and parents before their children.

    Attributes
    ----------
    names : tuple of str, length n_limbs
        Names of the bones nearest to the root in each limb.
    parents : ndarray of intp, shape (n_limbs,)
        Parents, -1 for the root.
    rotations : ndarray, shape (n_frames, n_limbs, 3, 3)
        Parent from limb.
    root_places : ndarray, shape (n_frames, 3), mm
        The root's origin in the world.
    joints : ndarray, shape (n_limbs, 3), mm
        Each limb's origin in its parent; of the root, its mean position.
    points : tuple of ndarray, length n_limbs, shape (n_points, 3), mm
        Points of each limb: its origin first, then ends of its bones and joints of its children.
    notices : tuple of str
        Differences of limbs from bones.
    """

    names: tuple[str, ...]
    parents: Ints
    rotations: Floats
    root_places: Floats
    joints: Floats
    points: tuple[Floats, ...]
    notices: tuple[str, ...]

    @property
    def n_limbs(self) -> int:
        """Number of limbs."""
        return len(self.names)

    def forward_kinematics(self, rotations: Floats, root_places: Floats) -> Floats:
        """Return the poses of the limbs, shape (n_frames, n_limbs, 4, 4), translations in mm.

        Parameters
        ----------
        rotations : ndarray, shape (n_frames, n_limbs, 3, 3)
            Parent from limb.
        root_places : ndarray, shape (n_frames, 3), mm
            The root's origin.
        """
        poses = transform_from(rotations, np.broadcast_to(self.joints, (*rotations.shape[:2], 3)))
        poses[:, 0, :3, 3] = root_places
        for limb, parent in enumerate(self.parents.tolist()):
            if parent >= 0:
                poses[:, limb] = poses[:, parent] @ poses[:, limb]
        return poses


def bone_tree(motion: BoneMotion, root: str = "", shortest: float = 0.0) -> BoneTree:
    """Return the limbs of a motion.

    Parameters
    ----------
    motion : BoneMotion
        The bones.
    root : str
        Bone whose branch is taken; empty for all.
    shortest : float, mm
        Bones without children that are shorter are left out.

    Raises
    ------
    InputError
        If there is no such bone, no joint rotates, or there are several bodies.
    """
    tree = _BoneReduction(motion, root)
    tree.remove_fixed_roots()
    tree.merge_fixed()
    tree.remove_zero_length()
    tree.merge_fixed()
    tree.remove_short(shortest)
    return tree.finished(motion.name)


class _BoneReduction:
    """A tree of bones from which some are removed; those that are left are the keys of `parents`."""

    def __init__(self, motion: BoneMotion, root: str) -> None:
        self.names = motion.names
        self.notices: list[str] = []
        bones = range(motion.n_bones)
        self.rotations = {bone: np.asarray(motion.rotations[:, bone]) for bone in bones}
        self.places = {bone: np.asarray(motion.places[:, bone]) for bone in bones}
        self.tips = {bone: [*motion.tips[bone]] for bone in bones}
        self.parents = dict(enumerate(motion.parents.tolist()))
        if root:
            self._keep_from(motion, root)

    def _keep_from(self, motion: BoneMotion, root: str) -> None:
        if root not in motion.names:
            raise InputError(f"{motion.name}: there is no bone {root!r}; there are {', '.join(motion.names)}")
        first = motion.names.index(root)
        poses = motion.world_from_bone[:, first]
        self.rotations[first], self.places[first] = poses[:, :3, :3], poses[:, :3, 3]
        kept = {first}
        for bone, parent in self.parents.items():
            if parent in kept:
                kept.add(bone)
        self.parents = {bone: self.parents[bone] if bone != first else -1 for bone in sorted(kept)}

    def children(self, bone: int) -> list[int]:
        return [child for child, parent in self.parents.items() if parent == bone]

    def points(self, bone: int) -> Floats:
        joints = [self.places[child].mean(axis=0) for child in self.children(bone)]
        return np.array([np.zeros(3), *self.tips[bone], *joints])

    def below(self, bone: int) -> list[int]:
        """Return a bone and all of its branch, parents first."""
        found = [bone]
        for other in found:
            found += self.children(other)
        return found

    def reach(self, bone: int) -> float:
        """Return the largest possible distance [mm] of a point of a bone's branch from its origin."""
        away = {bone: 0.0}
        for other in self.below(bone)[1:]:
            away[other] = away[self.parents[other]] + float(np.linalg.norm(self.places[other], axis=1).max())
        return max(away[other] + float(np.linalg.norm(self.points(other), axis=1).max()) for other in away)

    def slides(self, bone: int) -> bool:
        return _spread(self.places[bone]) > STILL_MM

    def turns(self, bone: int) -> bool:
        first = self.rotations[bone][0]
        angles = np.linalg.norm(vector_from_matrix(first.T @ self.rotations[bone]), axis=1)
        return bool(angles.max() * self.reach(bone) > STILL_MM)

    def remove_fixed_roots(self) -> None:
        """Make roots of the bones that slide in a fixed root, and remove roots whose branches do not move."""
        for room in [bone for bone, parent in self.parents.items() if parent < 0]:
            if self.slides(room) or self.turns(room):
                continue
            for child in [child for child in self.children(room) if self.slides(child)]:
                self._attach(child, -1, room)
        if any(self._moves(root) for root in self.children(-1)):
            for root in [root for root in self.children(-1) if not self._moves(root)]:
                for bone in self.below(root):
                    del self.parents[bone]

    def _moves(self, root: int) -> bool:
        return any(self.slides(bone) or self.turns(bone) for bone in self.below(root))

    def _attach(self, bone: int, parent: int, through: int) -> None:
        """Attach a bone to another parent; `through` is its parent so far, given in the new one."""
        turn = self.rotations[through]
        self.places[bone] = (turn @ self.places[bone][..., np.newaxis])[..., 0] + self.places[through]
        self.rotations[bone] = turn @ self.rotations[bone]
        self.parents[bone] = parent

    def merge_fixed(self) -> None:
        """Merge bones that neither rotate nor slide with their parents."""
        for bone in list(self.parents):
            parent = self.parents[bone]
            if parent < 0 or self.slides(bone) or self.turns(bone):
                continue
            turn, place = self.rotations[bone][0], self.places[bone].mean(axis=0)
            self.rotations[bone] = np.broadcast_to(turn, self.rotations[bone].shape)
            self.tips[parent] += [turn @ tip + place for tip in (np.zeros(3), *self.tips[bone])]
            for child in self.children(bone):
                self._attach(child, parent, bone)
            del self.parents[bone]

    def remove_zero_length(self) -> None:
        """Remove bones without length; their rotations pass to their children, which begin at the same point."""
        for bone in list(self.parents):
            children = self.children(bone)
            if not children or np.abs(self.points(bone)).max() > STILL_MM or any(map(self.slides, children)):
                continue
            if self.parents[bone] < 0:
                self._replace_root(bone, children)
            else:
                for child in children:
                    self._attach(child, self.parents[bone], bone)
            del self.parents[bone]

    def _replace_root(self, root: int, children: list[int]) -> None:
        """Make the child with the largest reach the root, and the parent of the others."""
        heir = max(children, key=self.reach)
        back = self.rotations[heir].swapaxes(-1, -2)
        for child in children:
            if child != heir:
                apart = self.places[child] - self.places[heir]
                self.places[child] = (back @ apart[..., np.newaxis])[..., 0]
                self.rotations[child] = back @ self.rotations[child]
                self.parents[child] = heir
        self._attach(heir, -1, root)

    def remove_short(self, shortest: float) -> None:
        """Remove short bones without children, until there is none."""
        dropped: list[str] = []
        while short := [one for one, above in self.parents.items() if above >= 0 and self._is_short(one, shortest)]:
            for bone in short:
                self.tips[self.parents[bone]].append(self.places[bone].mean(axis=0))
                dropped.append(self.names[bone])
                del self.parents[bone]
        if dropped:
            self.notices.append(f"left out, being shorter than {shortest:g} mm: {', '.join(dropped)}")

    def _is_short(self, bone: int, shortest: float) -> bool:
        points = self.points(bone)
        return not self.children(bone) and bool(np.linalg.norm(points[:, np.newaxis] - points, axis=2).max() < shortest)

    def finished(self, name: str) -> BoneTree:
        """Return the limbs, joints fixed at their mean positions."""
        roots = self.children(-1)
        if len(roots) > 1:
            bodies = ", ".join(self.names[root] for root in roots)
            raise InputError(f"{name}: {len(roots)} bodies move ({bodies}); choose one: --motion-root NAME")
        if len(self.parents) < 2:
            raise InputError(f"{name}: no bone turns against another; there is no joint to be found")
        order = [roots[0]]
        for bone in order:
            order += self.children(bone)
        spreads = {self.names[bone]: _spread(self.places[bone]) for bone in order[1:] if self.slides(bone)}
        if spreads:
            most = max(spreads, key=lambda name: spreads[name])
            notice = f"joints that slide are held at their mean places: {', '.join(spreads)}"
            self.notices.append(f"{notice}; most: {most}, by up to {spreads[most]:.1f} mm")
        index_of = {bone: index for index, bone in enumerate(order)}
        names, points = tuple(self.names[bone] for bone in order), tuple(self.points(bone) for bone in order)
        parents = np.array([index_of.get(self.parents[bone], -1) for bone in order], dtype=np.intp)
        rotations = np.stack([self.rotations[bone] for bone in order], axis=1)
        joints = np.array([self.places[bone].mean(axis=0) for bone in order])
        root_places, notices = self.places[roots[0]], tuple(self.notices)
        return BoneTree(names, parents, rotations, root_places, joints, points, notices)


def _spread(places: Floats) -> float:
    """Largest distance [mm] from the mean position."""
    return float(np.linalg.norm(places - places.mean(axis=0), axis=1).max())
