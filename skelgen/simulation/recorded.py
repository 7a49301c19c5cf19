"""A body that moves as recorded: markers are put on the bones of a recorded motion.

Bones that never rotate against their parent are one limb with it, and the rotation of a bone without length passes to
its children. What slides in its joint is fixed at its mean position. So limbs are rigid and joints are points: the
truth of a simulated take is exact, and near to the motion as recorded.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from skelgen.geometry.frame_rate import transforms_at_rate, vectors_at_rate
from skelgen.geometry.rotations import transform_from, vector_from_matrix
from skelgen.geometry.up_axis import AS_RECORDED, TURNS, turned_poses
from skelgen.kinematics.joints.closed_form import nearest_hinge, nearest_universal
from skelgen.kinematics.joints.rotations import ConstrainedRotation
from skelgen.model.arrays import Floats
from skelgen.model.takes import BoneMotion
from skelgen.parameters import StageParameters, declare
from skelgen.simulation.articulated import MARKER_STANDOFF, LimbModel, Structure, markers_around
from skelgen.simulation.bone_tree import STILL_MM, BoneTree, bone_tree

_RADIUS_PER_LENGTH = 0.16  # thighs, shanks and arms of the simulated human have 0.12 to 0.17
_REFINEMENTS = 8  # Gauss-Newton from a few degrees to rounding takes five
_RADII = (8.0, 110.0)  # mm: a finger's and a chest's


@dataclass(frozen=True)
class BoneParameters(StageParameters):
    """Parameters of the limbs and markers that are made from the bones of a recorded motion."""

    stage: ClassVar[str] = "simulate --motion"

    markers_per_limb: int = declare(3, "Markers on every limb.", within=(2, 5))
    shortest_bone: float = declare(
        30.0,
        "Bones that carry no other and are shorter than this get no markers and are left out.",
        unit="mm",
        within=(0.0, 1e4),
    )
    motion_root: str = declare("", "Bone from which on the body is simulated; empty for all of it.")
    motion_axes: str = declare(
        AS_RECORDED, "Turn the world: y-to-z makes what was up along y up along z.", choices=tuple(TURNS)
    )


@dataclass(frozen=True, eq=False)
class RecordedBody:
    """A structure and its poses in every frame.

    Attributes
    ----------
    structure : Structure
        Limbs, joints of the types that the motion shows, and markers. Amplitudes and offsets are those of the motion.
    angles : tuple of ndarray, shape (n_frames, n_angles), rad
        Angles of each limb in its joint; of the root and of balls the rotation vector.
    world_from_limb : ndarray, shape (n_frames, n_limbs, 4, 4), translations in mm
        Poses of the limbs; joints are points of both of their limbs in every frame.
    rate : float, Hz
        Frame rate.
    name : str
        Name of the motion.
    notices : tuple of str
        Differences of the body from the bones.
    """

    structure: Structure
    angles: tuple[Floats, ...]
    world_from_limb: Floats
    rate: float
    name: str
    notices: tuple[str, ...] = field(default=())


def recorded_body(
    motion: BoneMotion, parameters: BoneParameters | None = None, rate: float | None = None
) -> RecordedBody:
    """Put markers on the bones of a motion.

    Parameters
    ----------
    motion : BoneMotion
        What was recorded.
    parameters : BoneParameters, optional
        How; the defaults if left out.
    rate : float, Hz, optional
        Frame rate of the result, by default that of the motion. Between two frames the root moves along a line, and
        joints rotate at a constant rate.

    Raises
    ------
    InputError
        If no body moves, or more than one.
    """
    settings = parameters or BoneParameters()
    tree = bone_tree(motion, settings.motion_root, settings.shortest_bone)
    wanted = rate or motion.rate
    turns = [_turn(tree, limb).at_rate(motion.rate, wanted) for limb in range(tree.n_limbs)]
    roots = vectors_at_rate(tree.root_places, motion.rate, wanted)
    poses = tree.forward_kinematics(np.stack([turn.rotations for turn in turns], axis=1), roots)
    limbs = [_limb(tree, limb, turn, settings.markers_per_limb) for limb, turn in enumerate(turns)]
    structure, angles = Structure(motion.name or "motion", tuple(limbs)), tuple(turn.angles for turn in turns)
    notices = (*motion.notices, *tree.notices)
    return RecordedBody(structure, angles, turned_poses(poses, settings.motion_axes), wanted, motion.name, notices)


@dataclass(frozen=True, eq=False)
class _Turn:
    """Rotation of a limb in its joint: parent from limb, (n_frames, 3, 3), and its angles about axes."""

    kind: str
    rotations: Floats
    angles: Floats
    axes: Floats
    rotation: ConstrainedRotation | None = None

    def at_rate(self, recorded: float, rate: float) -> _Turn:
        """Interpolate to another rate [Hz]: angles about the axes if there are some, else by the shortest rotation."""
        if rate == recorded:
            return self
        if self.rotation is None:
            poses = transforms_at_rate(transform_from(self.rotations, np.zeros(3)), recorded, rate)
            return _ball(poses[..., :3, :3], self.kind)
        angles = vectors_at_rate(np.unwrap(self.rotation.angles, axis=0), recorded, rate)
        return _about_axes(replace(self.rotation, angles=angles))


def _turn(tree: BoneTree, limb: int) -> _Turn:
    rotations = tree.rotations[:, limb]
    if tree.parents[limb] < 0:
        return _ball(rotations, "free")
    reach = np.linalg.norm(tree.points[limb], axis=1).max()
    for candidate in (nearest_hinge(rotations), _refined(nearest_universal(rotations), rotations)):
        if np.linalg.norm(_missing(candidate, rotations), axis=1).max() * reach < STILL_MM:
            return _about_axes(candidate)
    return _ball(rotations, "ball")


def _missing(rotation: ConstrainedRotation, rotations: Floats) -> Floats:
    """Rotation vectors [rad] in the parent's axes from a joint's rotations to the given ones, shape (n_frames, 3)."""
    return vector_from_matrix(rotations @ rotation.rotations().swapaxes(-1, -2))


def _refined(rotation: ConstrainedRotation, rotations: Floats) -> ConstrainedRotation:
    """Refine axes and angles by Gauss-Newton steps, as the closed form is not exact to `STILL_MM`."""
    for _ in range(_REFINEMENTS):
        missing, (of_constants, of_angles) = _missing(rotation, rotations)[..., np.newaxis], rotation.slopes()
        back = np.linalg.pinv(of_angles)
        beside = np.eye(3) - of_angles @ back  # projector on what the angles of a frame cannot explain
        left, right = (beside @ of_constants).reshape(-1, rotation.n_constants), (beside @ missing).reshape(-1)
        constants = np.asarray(np.linalg.lstsq(left, right, rcond=None)[0], dtype=np.float64)
        angles = back @ (missing - (of_constants @ constants)[..., np.newaxis])
        rotation = rotation.stepped(constants, angles[..., 0])
    return rotation


def _ball(rotations: Floats, kind: str) -> _Turn:
    return _Turn(kind, rotations, vector_from_matrix(rotations), np.eye(3))


def _about_axes(rotation: ConstrainedRotation) -> _Turn:
    axes = np.array(rotation.axes())[: rotation.n_angles]
    return _Turn(rotation.kind, rotation.rotations(), np.unwrap(rotation.angles, axis=0), axes, rotation)


def _limb(tree: BoneTree, limb: int, turn: _Turn, n_markers: int) -> LimbModel:
    """A limb along the longest line between its points, with markers around it."""
    points, parent = tree.points[limb], int(tree.parents[limb])
    apart = np.linalg.norm(points[:, np.newaxis] - points, axis=2)
    start, end = np.unravel_index(int(np.argmax(apart)), apart.shape)
    segment = points[[start, end]]
    radius = float(np.clip(_RADIUS_PER_LENGTH * apart.max(), *_RADII))
    low, high = np.rad2deg(turn.angles.min(axis=0)), np.rad2deg(turn.angles.max(axis=0))
    markers = markers_around(segment, radius + MARKER_STANDOFF, n_markers, phase=float(limb))
    amplitudes, offsets = (high - low) / 2, (high + low) / 2
    name, above, joint = tree.names[limb], tree.names[parent] if parent >= 0 else "", tree.joints[limb]
    return LimbModel(name, above, turn.kind, joint, segment, radius, markers, turn.axes, amplitudes, offsets)
