"""From the middle of a ball's outline to the image of its centre, which is what a point in space is found from.

A ball off the axis is seen as an ellipse whose middle lies farther out than the image of the ball's centre, by the part
(radius / distance)^2 of its distance from the axis; and a lens that bends the outer edge more than the inner one shifts
it as much. At half a metre that is a tenth of a pixel, ten times what the camera's noise does.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from skelgen._kernels.camera import outline_offsets
from skelgen.capture.optics.projection import camera_numbers
from skelgen.capture.values import Balls
from skelgen.model.rig import Camera


def correct_eccentricity(camera: Camera, balls: Balls) -> Balls:
    """Return balls with their centres moved from the middles of their outlines to the images of their centres.

    Parameters
    ----------
    camera : Camera
        That saw them.
    balls : Balls
        As `detect_balls` finds them. Their brightness is the area of their outlines, as far as those are bright.

    Returns
    -------
    Balls
        The same balls. Those that the lens sends no ray to stay where they are.
    """
    if not len(balls):
        return balls
    centres, areas = (np.array(part, dtype=np.float64, order="C") for part in (balls.centres, balls.brightness))
    return replace(balls, centres=centres - outline_offsets(centres, areas, camera_numbers(camera)))
