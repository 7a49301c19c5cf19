"""`skelgen evaluate rig`: what a rig can measure, against the distance from it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from skelgen.cli.screen import Screen

if TYPE_CHECKING:
    from skelgen.capture.error_propagation.by_distance import Curve, RigErrors

RIG = "rig"
"""What stands in the place of a result when a rig is to be evaluated; a project of this name is ``./rig``."""


def evaluate_rig(settings: Path, plot: Path | None, screen: Screen) -> None:
    """Print the standard deviations of points, bodies and joint angles; draw them if a file is named."""
    from skelgen_formats.capture_settings import read_settings

    from skelgen.capture.error_propagation.by_distance import errors_by_distance

    errors = errors_by_distance(read_settings(settings))
    screen.say(
        f"standard deviations for {errors.noise:g} px of noise in the images; distances from the cameras' middle"
    )
    for curve in errors.curves:
        screen.table(f"{curve.what.capitalize()} [{curve.unit}]", _rows(errors, curve))
    if plot is not None:
        from skelgen.capture.error_propagation.plot import plot_errors

        plot_errors(errors, plot)
        screen.say(f"written: {plot}")
    screen.json(_mapping(errors))


def _rows(errors: RigErrors, curve: Curve) -> list[dict[str, Any]]:
    return [
        {
            "distance [mm]": f"{distance:g}",
            **{name: _number(value) for name, value in zip(curve.columns, row, strict=True)},
        }
        for distance, row in zip(errors.distances, curve.std, strict=True)
    ]


def _number(value: float) -> float | None:
    return round(float(value), 4) if math.isfinite(value) else None


def _mapping(errors: RigErrors) -> dict[str, Any]:
    return {
        "noise_px": errors.noise,
        "distances_mm": errors.distances.tolist(),
        "curves": [{"what": curve.what, "unit": curve.unit, "rows": _rows(errors, curve)} for curve in errors.curves],
    }
