"""What moves before the simulated rig: a simulated structure, or rigid targets on paths of their own."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from skelgen.capture.optics import in_image, project, view_centre
from skelgen.capture.reference_rig import reference_arm
from skelgen.errors import InputError
from skelgen.geometry.rotations import frame_along, matrix_from_vector, moved_points, transform_from
from skelgen.model.arrays import (
    Bools,
    Floats,
    Ints,
    check_bools,
    check_floats,
    check_ints,
    check_names,
    check_rate,
    set_fields,
)
from skelgen.model.rig import BodyTarget, StereoRig, TargetJoint
from skelgen.parameters import ParameterValue
from skelgen.simulation import Structure, find_structure, simulate
from skelgen.simulation.motion import smooth_curves
from skelgen.simulation.truth import Truth
from skelgen.simulation.visibility import blocked_by_limbs

RIG_FROM_SIMULATION = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
"""Turn from the simulation's x forward, y left, z up to the rig's x right, y down, z away: who walks forward walks
towards the cameras."""

_DISTANCES = np.arange(400.0, 12_000.0, 100.0)  # mm: where a structure may be put
_WHOLLY_SEEN = 0.98  # of all marker positions in both images
_WALK = 30.0  # mm: a target or structure hardly leaves its place, so that it stays in both images
_TURN_FREQUENCIES = (0.1, 0.5)  # Hz: a robot's arm, moved by hand
_SHIFT_FREQUENCIES = (0.1, 0.4)


@dataclass(frozen=True, eq=False)
class Scene:
    """Balls in motion before a rig.

    Attributes
    ----------
    points : ndarray, shape (n_frames, n_balls, 3), mm
        Centres of the balls in the rig's world; NaN for balls that are not there.
    world_from_body : ndarray, shape (n_frames, n_bodies, 4, 4), translations in mm
        Poses of the bodies that carry the balls.
    body_of_ball : ndarray of intp, shape (n_balls,)
        Which body carries each ball.
    bodies : tuple of BodyTarget
        The bodies, with their balls in their own frames.
    joints : tuple of TargetJoint
        Ball joints and hinges between the bodies.
    hidden : ndarray of bool, shape (n_frames, 2, n_balls)
        Balls that something stands before, for the left and the right camera; balls hide each other by themselves.
    rate : float, Hz
        Frames a second.
    name : str
        What it is.
    truth : Truth or None
        Skeleton and motion of a simulated structure in the rig's world, to compare results with.
    """

    points: Floats
    world_from_body: Floats
    body_of_ball: Ints
    bodies: tuple[BodyTarget, ...]
    joints: tuple[TargetJoint, ...] = ()
    hidden: Bools = field(default_factory=lambda: np.empty((0, 2, 0), dtype=np.bool_))
    rate: float = 60.0
    name: str = "scene"
    truth: Truth | None = None

    def __post_init__(self) -> None:
        points = check_floats(self.points, (None, None, 3), "points of the scene")
        n_frames, n_balls = points.shape[:2]
        check_names([body.name for body in self.bodies], len(self.bodies), "target")
        poses = check_floats(self.world_from_body, (n_frames, len(self.bodies), 4, 4), "world_from_body", finite=True)
        hidden = self.hidden if self.hidden.size else np.zeros((n_frames, 2, n_balls), dtype=np.bool_)
        owners = check_ints(self.body_of_ball, (n_balls,), "body_of_ball")
        hidden = check_bools(hidden, (n_frames, 2, n_balls), "hidden")
        rate = check_rate(self.rate, "the scene")
        set_fields(self, points=points, world_from_body=poses, body_of_ball=owners, hidden=hidden, rate=rate)

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return len(self.points)


def scene_of_bodies(
    bodies: Sequence[BodyTarget],
    world_from_body: Floats,
    *,
    rate: float = 60.0,
    name: str = "targets",
) -> Scene:
    """Return a scene of rigid targets.

    Parameters
    ----------
    bodies : sequence of BodyTarget
        The targets.
    world_from_body : ndarray, shape (n_frames, n_bodies, 4, 4), translations in mm
        Their poses in the rig's world.
    rate : float, Hz
        Frames a second.
    name : str
        What it is.
    """
    poses = check_floats(world_from_body, (None, len(bodies), 4, 4), "world_from_body", finite=True)
    owners = np.repeat(np.arange(len(bodies)), [len(body.points) for body in bodies])
    placed = [moved_points(poses[:, index], body.points) for index, body in enumerate(bodies)]
    return Scene(np.concatenate(placed, axis=1), poses, owners, tuple(bodies), rate=rate, name=name)


def show_alone(scene: Scene, names: Sequence[str]) -> Scene:
    """Return a scene in which only some bodies carry balls, as when a target is calibrated by itself.

    Parameters
    ----------
    scene : Scene
        What moves; bodies that are not named still hide what is behind them.
    names : sequence of str
        The bodies whose balls are seen.

    Raises
    ------
    InputError
        If there is no such body.
    """
    known = [body.name for body in scene.bodies]
    for name in names:
        if name not in known:
            raise InputError(f"the {scene.name} has no target {name!r} to show; it has {', '.join(known)}")
    kept = np.isin(scene.body_of_ball, [known.index(name) for name in names])
    return replace(scene, points=np.where(kept[:, np.newaxis], scene.points, np.nan))


def scene_of_structure(
    structure: Structure | str,
    rig: StereoRig,
    *,
    distance: float = 0.0,
    seed: int = 0,
    hide: bool = True,
    **options: ParameterValue,
) -> Scene:
    """Return a scene of a structure that moves before a rig, as `skelgen simulate` moves it.

    Parameters
    ----------
    structure : Structure or str
        What moves, or its name for `find_structure`; ``arm`` is the reference arm.
    rig : StereoRig
        The cameras.
    distance : float, mm
        From the middle between the cameras to the middle of all markers; 0 = so near that both images show them whole.
    seed : int
        Of the motion.
    hide : bool
        Whether limbs hide what is behind them.
    **options
        `SimulationParameters` by name: ``n_frames`` (600 by default), ``rate`` (60 Hz), ``motion_range``, ``walk``, ...

    Raises
    ------
    ParameterError
        If there is no such structure or option.
    InputError
        If it fits into both images at no distance.
    """
    body = reference_arm() if structure == "arm" else structure
    if isinstance(body, str):
        body = find_structure(body, seed)
    options = {"n_frames": 600, "rate": 60.0, "walk": _WALK, **options, "labelled": True}
    simulated = simulate(body, seed=seed, parameters=None, **options)
    truth, seen = simulated.truth, simulated.take.positions  # type: ignore[union-attr]  # labelled: Trajectories
    points = (seen - truth.marker_positions.mean(axis=(0, 1))) @ RIG_FROM_SIMULATION.T
    place = view_centre(rig, distance) if distance > 0 else _near_place(points, rig)
    shift = place - RIG_FROM_SIMULATION @ truth.marker_positions.mean(axis=(0, 1))
    rig_from_simulation = transform_from(RIG_FROM_SIMULATION, shift)
    hidden = np.zeros((len(seen), 2, body.n_markers), dtype=np.bool_)
    if hide:
        for side, camera in enumerate((rig.left, rig.right)):
            centre = np.asarray(np.linalg.inv(camera.camera_from_world @ rig_from_simulation)[:3, 3], dtype=np.float64)
            hidden[:, side] = blocked_by_limbs(body, truth.world_from_limb, truth.marker_positions, centre)
    targets, joints = targets_of(body), joints_of(body)
    there = moved_truth(truth, rig_from_simulation)
    owners, rate = body.limb_of_marker, simulated.take.rate
    return Scene(points + place, there.world_from_limb, owners, targets, joints, hidden, rate, body.name, there)


def moved_truth(truth: Truth, pose: Floats) -> Truth:
    """Return the truth of what moves at another place.

    Parameters
    ----------
    truth : Truth
        Of a simulated structure.
    pose : ndarray, shape (4, 4), mm
        Brings its world into the new one.
    """
    return replace(
        truth,
        joint_positions=moved_points(pose, truth.joint_positions),
        joint_axes=truth.joint_axes @ pose[:3, :3].T,
        world_from_limb=pose @ truth.world_from_limb,
        marker_positions=moved_points(pose, truth.marker_positions),
    )


def targets_of(structure: Structure) -> tuple[BodyTarget, ...]:
    """Return the limbs of a structure as targets, in order."""
    return tuple(BodyTarget(limb.name, limb.markers) for limb in structure.limbs)


def joints_of(structure: Structure) -> tuple[TargetJoint, ...]:
    """Return the ball joints and hinges of a structure, outward; others have no model in a capture.

    All limb frames are turned alike when all angles are zero, and a hinge turns about the z axis of its joint's frames.
    """
    joints = []
    for limb in structure.limbs:
        if limb.kind in ("ball", "hinge"):
            in_child = np.eye(4)
            if limb.kind == "hinge":
                in_child[:3, :3] = frame_along(limb.axes[0])
            in_parent = in_child.copy()
            in_parent[:3, 3] = limb.joint
            joints.append(TargetJoint(limb.name, limb.kind, limb.parent, limb.name, in_parent, in_child))
    return tuple(joints)


@dataclass(frozen=True)
class Wandering:
    """How bodies move about before a rig.

    Attributes
    ----------
    distance : float, mm
        Of the middle of all bodies from the middle between the cameras.
    spread : float, mm
        How far bodies stand apart, side by side, and half of how far they move.
    turn : float, rad
        How far each turns about each axis from an attitude of its own.
    """

    distance: float = 1000.0
    spread: float = 120.0
    turn: float = 0.6


def wandering_poses(
    rig: StereoRig, n_frames: int, n_bodies: int, motion: Wandering | None = None, *, rate: float = 60.0, seed: int = 0
) -> Floats:
    """Return smooth random poses of bodies before a rig, shape (n_frames, n_bodies, 4, 4), translations in mm.

    Parameters
    ----------
    rig : StereoRig
        The cameras.
    n_frames, n_bodies : int
        How many.
    motion : Wandering, optional
        Where they are and how far they move.
    rate : float, Hz
        Frames a second.
    seed : int
        Of the motion.
    """
    motion = motion or Wandering()
    rng = np.random.default_rng(seed)
    poses = np.zeros((n_frames, n_bodies, 4, 4))
    poses[..., 3, 3] = 1.0
    aside = np.arange(n_bodies) - (n_bodies - 1) / 2
    for body in range(n_bodies):
        start = matrix_from_vector(rng.normal(size=3))
        turns = motion.turn * smooth_curves(rng, n_frames, rate, 3, _TURN_FREQUENCIES)
        shifts = motion.spread / 2 * smooth_curves(rng, n_frames, rate, 3, _SHIFT_FREQUENCIES)
        poses[:, body, :3, :3] = matrix_from_vector(turns) @ start
        shifts[:, 0] += motion.spread * aside[body]
        poses[:, body, :3, 3] = view_centre(rig, motion.distance) + shifts
    return poses


def _near_place(points: Floats, rig: StereoRig) -> Floats:
    """The place nearest to the rig where both images show nearly all points of a body around it."""
    for distance in _DISTANCES:
        place = view_centre(rig, distance)
        sides = [in_image(camera, project(camera, points + place)) for camera in (rig.left, rig.right)]
        if (sides[0] & sides[1]).mean() >= _WHOLLY_SEEN:
            return place
    raise InputError(
        f"the structure fits into both images at no distance up to {_DISTANCES[-1] / 1000:.0f} m; let it walk less, "
        "or give the distance"
    )


_IN_THE_HAND = Wandering(distance=900.0, spread=80.0, turn=0.9)
"""A target fills a fifth of the images, stays in both, and is seen from many sides, as the calibration asks for."""


def hand_held_target(name: str, rig: StereoRig, *, n_frames: int = 600, rate: float = 60.0, seed: int = 0) -> Scene:
    """Return the scene in which one target is turned, and nothing else is seen.

    Parameters
    ----------
    name : str
        A target of the arm; the first one if it is empty.
    rig : StereoRig
        The cameras.
    n_frames : int
        Length of the scene.
    rate : float, Hz
        Frames a second.
    seed : int
        Of the motion.

    Raises
    ------
    InputError
        If the arm has no such target.
    """
    targets = {target.name: target for target in targets_of(reference_arm())}
    if name and name not in targets:
        raise InputError(f"there is no target {name!r} to show; there are {', '.join(targets)}")
    chosen = targets[name] if name else next(iter(targets.values()))
    held = BodyTarget(chosen.name, chosen.points - chosen.points.mean(axis=0))
    poses = wandering_poses(rig, n_frames, 1, _IN_THE_HAND, rate=rate, seed=seed)
    return scene_of_bodies([held], poses, rate=rate, name=f"target {chosen.name}")
