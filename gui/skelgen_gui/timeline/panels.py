"""What is drawn over time beside the lanes: residuals, the selected joint's angles and deviations, spare points."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from skelgen.app.report.measures import residual_per_frame
from skelgen.model import Project
from skelgen_gui.timeline.angles import joint_curve
from skelgen_gui.timeline.curve import Curve, Extremes, Panel
from skelgen_gui.timeline.lanes import point_counts

MOST_CURVES = 6
"""Markers whose residuals are drawn at once: the legend has room for no more."""

_ABOUT_RESIDUALS = "How far markers were measured from where the skeleton has them: the mean, and selected markers."
_ABOUT_ANGLES = "Angles of the joint, 0 in the reference pose; within the bands with a probability of 95 %."
_ABOUT_DEVIATION = "Standard deviation of the joint's place, the root of the sum of squares over three axes."
_ABOUT_POINTS = "Points of each frame that belong to no marker."
_SURE = 1.96  # standard deviations of 95 %


def residual_curve(project: Project) -> Curve:
    """Return the mean residual of the markers of each frame."""
    return Curve("mean", Extremes.of(residual_per_frame(project.motion)[0]))


def residual_panel(project: Project, mean: Curve, markers: Iterable[int]) -> Panel:
    """Return the residuals: their mean, and those of some markers."""
    markers = list(markers)
    limbs = project.limbs.limb_of_marker[markers].tolist()
    shown = tuple(
        Curve(
            project.trajectories.names[marker],
            Extremes.of(project.motion.residuals[:, marker]),
            limb=limb,
            shade=limbs[:number].count(limb),
        )
        for number, (marker, limb) in enumerate(zip(markers[:MOST_CURVES], limbs, strict=False))
    )
    note = f"{len(markers) - MOST_CURVES} more are not drawn" if len(markers) > MOST_CURVES else ""
    return Panel("Residual", "mm", (mean, *shown), note, _ABOUT_RESIDUALS)


def joint_panels(project: Project, joint: int) -> tuple[Panel, ...]:
    """Return the angles of a joint, and how sure its place is."""
    one = project.skeleton.joints[joint]
    found = joint_curve(project, joint)
    curves = []
    for number, name in enumerate(found.names):
        angles = np.degrees(found.angles[:, number])
        wide = _SURE * np.degrees(found.std[:, number])
        band = Extremes.of(angles - wide, angles + wide)
        curves.append(Curve(name, Extremes.of(angles), band, component=number))
    panels = []
    if curves:
        about = _ABOUT_ANGLES + (f" Bands are those of every {found.step}th frame." if found.step > 1 else "")
        panels.append(Panel(f"Joint {one.parent}–{one.child}", "°", tuple(curves), one.kind, about, from_zero=False))
    if project.motion.joint_std is not None:
        size = np.linalg.norm(project.motion.joint_std[:, joint], axis=1)
        deviation = Curve("of the place", Extremes.of(size), limb=one.child)
        panels.append(Panel("Deviation", "mm", (deviation,), about=_ABOUT_DEVIATION))
    return tuple(panels)


def count_panel(project: Project) -> Panel | None:
    """Return how many points of each frame belong to no marker; None for takes that came with labels."""
    counts = point_counts(project)
    if counts is None:
        return None
    title = "Points left out" if project.has("labels") else "Points"
    return Panel(title, "", (Curve("points", Extremes.of(counts.astype(np.float64))),), about=_ABOUT_POINTS)
