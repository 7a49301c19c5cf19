"""Bones in motion, as animation files tell it: a tree of frames whose joints turn and may slide."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from skelgen.errors import InputError
from skelgen.model.arrays import Floats, Ints, check_floats, check_ints, check_names, check_rate


@dataclass(frozen=True, eq=False)
class BoneMotion:
    """A tree of bones and where each is in its parent in every frame; no markers, no kinds of joints.

    Attributes
    ----------
    names : tuple of str, length n_bones
        Names of the bones.
    parents : ndarray of intp, shape (n_bones,)
        Parent of each bone, which stands before it; -1 for roots, which are placed in the world.
    rotations : ndarray, shape (n_frames, n_bones, 3, 3)
        Parent from bone.
    places : ndarray, shape (n_frames, n_bones, 3), mm
        Each bone's origin in its parent's frame; the same in all frames unless the bone slides.
    tips : tuple of ndarray, length n_bones, shape (n_tips, 3), mm
        Where a bone ends in its own frame, besides the origins of its children.
    rate : float, Hz
        Frame rate.
    name : str
        Name of the motion.
    notices : tuple of str
        What the reader did that the user should know.
    """

    names: tuple[str, ...]
    parents: Ints
    rotations: Floats
    places: Floats
    tips: tuple[Floats, ...]
    rate: float
    name: str = ""
    notices: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        object.__setattr__(self, "parents", check_ints(self.parents, (None,), "parents"))
        n_bones = len(self.parents)
        if n_bones == 0:
            raise InputError("a motion needs at least one bone")
        object.__setattr__(self, "names", check_names(self.names, n_bones, "bone"))
        if (self.parents >= np.arange(n_bones)).any() or (self.parents < -1).any():
            raise InputError("the parent of each bone must stand before it")
        rotations = check_floats(self.rotations, (None, n_bones, 3, 3), "rotations", finite=True)
        if len(rotations) == 0:
            raise InputError("a motion needs at least one frame")
        object.__setattr__(self, "rotations", rotations)
        places = check_floats(self.places, (len(rotations), n_bones, 3), "places", finite=True)
        object.__setattr__(self, "places", places)
        if len(self.tips) != n_bones:
            raise InputError(f"tips of {len(self.tips)} bones where {n_bones} belong")
        tips = (check_floats(tips, (None, 3), "tips of a bone", finite=True) for tips in self.tips)
        object.__setattr__(self, "tips", tuple(tips))
        object.__setattr__(self, "rate", check_rate(self.rate, "the motion"))

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return len(self.rotations)

    @property
    def n_bones(self) -> int:
        """Number of bones."""
        return len(self.parents)

    @property
    def world_from_bone(self) -> Floats:
        """Poses of all bones, shape (n_frames, n_bones, 4, 4), translations in mm."""
        poses = np.zeros((self.n_frames, self.n_bones, 4, 4))
        poses[..., :3, :3], poses[..., :3, 3], poses[..., 3, 3] = self.rotations, self.places, 1.0
        for bone, parent in enumerate(self.parents.tolist()):
            if parent >= 0:
                poses[:, bone] = poses[:, parent] @ poses[:, bone]
        return poses
