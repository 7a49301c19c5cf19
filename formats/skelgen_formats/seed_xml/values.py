"""What the seed's XML file holds, as values."""

from __future__ import annotations

from dataclasses import dataclass

from skelgen.model import Motion, Skeleton, Trajectories
from skelgen.model.arrays import Floats, check_floats


@dataclass(frozen=True)
class MarkerDistance:
    """How constant the distance between a marker and a joint is over all frames in which both are known.

    Attributes
    ----------
    marker : int
        Marker index.
    mean : float, mm
        Average distance.
    sigma : float, mm
        Standard deviation of the distance.
    """

    marker: int
    mean: float
    sigma: float


@dataclass(frozen=True)
class JointStats:
    """How the minimisation of the joint cost went for one joint: the file's ``StatsElements``.

    Attributes
    ----------
    first_bone, second_bone : int
        Parent and child limb.
    alpha : float
        Weight of the mean distance in the joint cost.
    first, second : tuple of MarkerDistance
        Markers of the parent and of the child; one that is never seen together with the joint is left out.
    n_iterations : int
        Iterations of the minimisation.
    value : float, mm^2
        Joint cost at the solution; NaN if unknown.
    """

    first_bone: int
    second_bone: int
    alpha: float
    first: tuple[MarkerDistance, ...]
    second: tuple[MarkerDistance, ...]
    n_iterations: int
    value: float


@dataclass(frozen=True, eq=False)
class SeedXml:
    """Everything that a seed XML file holds.

    Attributes
    ----------
    trajectories : Trajectories
        Tracked positions [mm] with the names of the markers; NaN where unseen.
    skeleton : Skeleton
        Limbs, joints and markers on the limbs.
    motion : Motion
        Poses, final joint positions and reconstructed markers in every frame.
    bone_translations : ndarray, shape (n_frames, n_limbs, 3), mm
        Translation of each bone relative to its parent, of a root to the world, as in the file.
    bone_rotations_xyzw : ndarray, shape (n_frames, n_limbs, 4)
        Rotation of each bone relative to its parent, of a root to the world, as in the file.
    raw_joint_positions : ndarray, shape (n_frames, n_joints, 3), mm
        Joints before the fit of rigid limbs; NaN where not to be told.
    offsets_from_center : ndarray, shape (n_markers, 3), mm
        Each marker relative to the centre of mass of its limb's markers, along the axes of the limb's frame; NaN for
        markers that are left out.
    centers_of_mass : ndarray, shape (n_limbs, 3), mm
        Centre of mass of each limb's markers in the limb's frame; NaN for a limb without markers.
    joint_stats : tuple of JointStats
        One per joint, in the order of the skeleton's joints.
    """

    trajectories: Trajectories
    skeleton: Skeleton
    motion: Motion
    bone_translations: Floats
    bone_rotations_xyzw: Floats
    raw_joint_positions: Floats
    offsets_from_center: Floats
    centers_of_mass: Floats
    joint_stats: tuple[JointStats, ...]

    def __post_init__(self) -> None:
        n_frames, n_limbs = self.motion.n_frames, self.skeleton.n_limbs
        n_markers, n_joints = self.trajectories.n_markers, self.skeleton.n_joints
        shapes = {
            "bone_translations": (n_frames, n_limbs, 3),
            "bone_rotations_xyzw": (n_frames, n_limbs, 4),
            "raw_joint_positions": (n_frames, n_joints, 3),
            "offsets_from_center": (n_markers, 3),
            "centers_of_mass": (n_limbs, 3),
        }
        for name, shape in shapes.items():
            object.__setattr__(self, name, check_floats(getattr(self, name), shape, name))
        object.__setattr__(self, "joint_stats", tuple(self.joint_stats))
