"""What is drawn over time beside the lanes: residuals, the selected joint's angles and deviations, spare points."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from PySide6.QtCore import QCoreApplication

from skelgen.app.report.measures import residual_per_frame
from skelgen.model import Project
from skelgen_gui.timeline.angles import joint_curve
from skelgen_gui.timeline.curve import Curve, Extremes, Panel
from skelgen_gui.timeline.lanes import point_counts

translate = QCoreApplication.translate

MOST_CURVES = 6
"""Markers whose residuals are drawn at once: the legend has room for no more."""

_SURE = 1.96  # standard deviations of 95 %


def residual_curve(project: Project) -> Curve:
    """Return the mean residual of the markers of each frame."""
    return Curve(translate("Curves", "mean"), Extremes.of(residual_per_frame(project.motion)[0]))


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
    more = len(markers) - MOST_CURVES
    note = translate("Curves", "{0} more are not drawn").format(more) if more > 0 else ""
    about = translate(
        "Curves", "How far markers were measured from where the skeleton has them: the mean, and selected markers."
    )
    return Panel(translate("Curves", "Residual"), "mm", (mean, *shown), note, about)


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
        title = translate("Curves", "Joint {0}–{1}").format(one.parent, one.child)
        kind = translate("Graph", one.kind)
        panels.append(Panel(title, "°", tuple(curves), kind, _about_angles(found.step), from_zero=False))
    if project.motion.joint_std is not None:
        size = np.linalg.norm(project.motion.joint_std[:, joint], axis=1)
        deviation = Curve(translate("Curves", "of the place"), Extremes.of(size), limb=one.child)
        about = translate(
            "Curves", "Standard deviation of the joint's place, the root of the sum of squares over three axes."
        )
        panels.append(Panel(translate("Curves", "Deviation"), "mm", (deviation,), about=about))
    return tuple(panels)


def _about_angles(step: int) -> str:
    about = translate(
        "Curves", "Angles of the joint, 0 in the reference pose; within the bands with a probability of 95 %."
    )
    every = translate("Curves", "Bands are those of every {0}th frame.").format(step)
    return f"{about} {every}" if step > 1 else about


def count_panel(project: Project) -> Panel | None:
    """Return how many points of each frame belong to no marker; None for takes that came with labels."""
    counts = point_counts(project)
    if counts is None:
        return None
    title = translate("Curves", "Points left out") if project.has("labels") else translate("Curves", "Points")
    about = translate("Curves", "Points of each frame that belong to no marker.")
    curve = Curve(translate("Curves", "points"), Extremes.of(counts.astype(np.float64)))
    return Panel(title, "", (curve,), about=about)
