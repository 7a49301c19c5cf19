"""Balls of a scene without rendering: where they are in both images, with noise and in no order."""

from __future__ import annotations

import numpy as np

from skelgen.capture.blobs import Balls
from skelgen.capture.optics.projection import in_image, project
from skelgen.capture.rig.scene import Scene
from skelgen.model.arrays import Ints
from skelgen.model.rig import StereoRig

_AREA, _BRIGHTNESS = 30.0, 4000.0  # px, grey levels: of a ball at the seed's distance


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
        Standard deviation of a centre along one axis; balls that touch are told apart nevertheless.
    rng : Generator
        Noise, and the order of the balls.
    """
    return _seen(scene, frame, 0, rig, noise, rng), _seen(scene, frame, 1, rig, noise, rng)


def _seen(
    scene: Scene, frame: int, side: int, rig: StereoRig, noise: float, rng: np.random.Generator
) -> tuple[Balls, Ints]:
    camera = (rig.left, rig.right)[side]
    centres = project(camera, scene.points[frame])
    index = rng.permutation(np.flatnonzero(in_image(camera, centres) & ~scene.hidden[frame, side]))
    n_balls = len(index)
    seen = Balls(
        centres=centres[index] + rng.normal(scale=noise, size=(n_balls, 2)),
        area=np.full(n_balls, _AREA),
        brightness=np.full(n_balls, _BRIGHTNESS),
        std=np.full(n_balls, noise),
        touching=np.zeros(n_balls, dtype=np.bool_),
    )
    return seen, index
