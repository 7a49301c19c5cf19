"""A single target of the arm as somebody turns it in the hand before the cameras, to calibrate it."""

from __future__ import annotations

from skelgen.capture.rig.arm import seed_arm
from skelgen.capture.rig.scene import Scene, scene_of_bodies, targets_of, wandering_poses
from skelgen.errors import InputError
from skelgen.model.rig import BodyTarget, StereoRig

_DISTANCE = 900.0  # mm: a target fills a fifth of the images, and stays in both
_SPREAD = 80.0  # mm
_TURN = 0.9  # rad about each axis: seen from many sides, as the calibration asks for


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
    targets = {target.name: target for target in targets_of(seed_arm())}
    if name and name not in targets:
        raise InputError(f"there is no target {name!r} to show; there are {', '.join(targets)}")
    chosen = targets[name] if name else next(iter(targets.values()))
    held = BodyTarget(chosen.name, chosen.points - chosen.points.mean(axis=0))
    poses = wandering_poses(rig, n_frames, 1, distance=_DISTANCE, spread=_SPREAD, turn=_TURN, rate=rate, seed=seed)
    return scene_of_bodies([held], poses, rate=rate, name=f"target {chosen.name}")
