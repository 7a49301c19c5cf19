"""What a user can set about the simulated rig."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from skelgen.parameters import StageParameters, declare


@dataclass(frozen=True)
class RenderParameters(StageParameters):
    """What balls, lamps, lenses and sensors of the simulated rig are like; the defaults are the seed's conditions.

    Attributes
    ----------
    diameter, limb_darkening
        The balls.
    brightness, bright_distance, lamp_offset, lamp_lobe, border_falloff
        How bright a ball is, by its distance and its place in the image. Above 255 the sensor is saturated.
    blur
        What lens and sensor make of an edge.
    background, noise, shot_noise
        The sensor.
    reflections, reflection_level
        Dull metal in the scene.
    """

    stage: ClassVar[str] = "rig"

    diameter: float = declare(14.0, "Diameter of the balls.", unit="mm", low=0.5, high=500.0, basic=True)
    limb_darkening: float = declare(
        0.4, "How much darker the rim of a ball is than its middle, as a part of it.", low=0.0, high=1.0
    )
    brightness: float = declare(
        400.0,
        "Brightness of a ball in the middle of the image at the bright distance; above 255 the sensor saturates.",
        unit="grey levels",
        low=0.0,
        high=1e5,
        basic=True,
    )
    bright_distance: float = declare(
        1000.0, "Distance at which a ball has that brightness.", unit="mm", low=10.0, high=1e5
    )
    lamp_offset: float = declare(
        40.0,
        "Distance of the lamps from the lens; near balls send part of the light past it.",
        unit="mm",
        low=0.0,
        high=1000.0,
    )
    lamp_lobe: float = declare(
        4.0,
        "Angle about the lamp within which balls send its light back (one standard deviation).",
        unit="deg",
        low=0.1,
        high=90.0,
    )
    border_falloff: float = declare(
        5.0,
        "Power of the cosine of the angle off the axis with which brightness falls towards the border.",
        low=0.0,
        high=40.0,
    )
    blur: float = declare(0.7, "Standard deviation of the blur of lens and sensor.", unit="px", low=0.1, high=3.0)
    background: float = declare(8.0, "Brightness of what is dark.", unit="grey levels", low=0.0, high=255.0)
    noise: float = declare(
        1.5, "Standard deviation of a dark pixel's noise.", unit="grey levels", low=0.0, high=50.0, basic=True
    )
    shot_noise: float = declare(
        0.02, "Variance of a pixel that each grey level of light adds.", unit="grey levels", low=0.0, high=10.0
    )
    reflections: int = declare(3, "Dull metal reflections in the scene.", low=0, high=1000)
    reflection_level: float = declare(
        45.0, "Brightness of the brightest reflection.", unit="grey levels", low=0.0, high=255.0
    )
