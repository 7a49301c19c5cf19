"""Balls that simulated cameras see, without rendering: noisy centres and the truth beside them."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from skelgen.capture.optics import in_image, project
from skelgen.capture.room.points import balls_at
from skelgen.capture.room.simulated import RoomScene
from skelgen.capture.simulated_rig.scene import Scene
from skelgen.capture.values import Balls
from skelgen.model.arrays import Floats, Ints
from skelgen.model.rig import CameraRig, StereoRig

_NOBODY = -1
_AREA, _BRIGHTNESS = 30.0, 4000.0  # px, grey levels: of a ball at the distance of the reference rig


def blobs_of(
    scene: RoomScene, frame: int, rig: CameraRig, rng: np.random.Generator, merged: float = 4.0
) -> tuple[list[Balls], list[Ints]]:
    """Return the balls that all images of a frame show, and which of the scene they are.

    Parameters
    ----------
    scene : RoomScene
        What moves.
    frame : int
        Which moment.
    rig : CameraRig
        The cameras; their noise is added.
    rng : Generator
        Noise, and the order of the balls.
    merged : float, px
        Balls nearer than this are seen as one in their middle, which is none of them: -1.
    """
    views, numbers = [], []
    for index, camera in enumerate(rig.cameras):
        centres = project(camera, scene.positions[frame])
        seen = np.flatnonzero(in_image(camera, centres) & ~scene.hidden[frame, index])
        centres, seen = _merged(centres[seen], seen, merged)
        order = rng.permutation(len(seen))
        views.append(balls_at(centres[order] + rng.normal(scale=rig.noise, size=(len(order), 2)), rig.noise))
        numbers.append(seen[order])
    return views, numbers


def views_of_scene(scene: RoomScene, rig: CameraRig, seed: int = 0) -> list[list[Balls]]:
    """Return the balls that all images of a scene show, frame by frame.

    Parameters
    ----------
    scene : RoomScene
        What moves.
    rig : CameraRig
        The cameras.
    seed : int
        Of their noise.
    """
    rng = np.random.default_rng(seed)
    return [blobs_of(scene, frame, rig, rng)[0] for frame in range(scene.n_frames)]


def _merged(centres: Floats, numbers: Ints, reach: float) -> tuple[Floats, Ints]:
    """Balls that are nearer to each other than this as one."""
    pairs = cKDTree(centres).query_pairs(reach, output_type="ndarray") if len(centres) > 1 else np.empty((0, 2), int)
    if not len(pairs):
        return centres, numbers
    middle = centres[pairs].mean(axis=1)
    alone = np.setdiff1d(np.arange(len(centres)), pairs)
    return np.concatenate([centres[alone], middle]), np.append(numbers[alone], np.full(len(pairs), _NOBODY))


def projected_balls(
    scene: Scene, frame: int, rig: StereoRig, noise: float, rng: np.random.Generator
) -> tuple[tuple[Balls, Ints], tuple[Balls, Ints]]:
    """Return the balls that the left and the right image of a frame show, and which balls of the scene they are.

    Parameters
    ----------
    scene : Scene
        What moves.
    frame : int
        Which moment.
    rig : StereoRig
        The cameras.
    noise : float, px
        Standard deviation of a centre along one axis, also of balls that touch.
    rng : Generator
        Noise, and the order of the balls.
    """
    seen = []
    for side, camera in enumerate((rig.left, rig.right)):
        centres = project(camera, scene.points[frame])
        index = rng.permutation(np.flatnonzero(in_image(camera, centres) & ~scene.hidden[frame, side]))
        places = centres[index] + rng.normal(scale=noise, size=(len(index), 2))
        area, brightness, std = (np.full(len(index), value) for value in (_AREA, _BRIGHTNESS, noise))
        seen.append((Balls(places, area, brightness, std, np.zeros(len(index), dtype=np.bool_)), index))
    left, right = seen
    return left, right
