"""Curves over the frames of a take: residuals, joint angles, points; any stretch of them is drawn at once."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from skelgen.app.drawing.measures import joint_called, residual_per_frame
from skelgen.app.drawing.scales import Extremes
from skelgen.kinematics.inverse.inverse_kinematics import posture_of
from skelgen.kinematics.joints.angles import angle_names, angles_over_time
from skelgen.model import Project
from skelgen.model.arrays import Floats
from skelgen_gui.model import translate
from skelgen_gui.model.lanes import point_counts

# Frames of which deviations are computed, which takes about 20 µs each; of longer takes, evenly spaced ones
_MOST_POSTURES = 20_000

MOST_CURVES = 6
"""Markers whose curves are drawn at once: the legend has room for no more."""

_SURE = 1.96  # standard deviations of 95 %


@dataclass(frozen=True, eq=False)
class Curve:
    """One curve of a panel.

    Attributes
    ----------
    name : str
        For the legend.
    line : Extremes
        The values.
    band : Extremes or None
        Between which values the truth lies.
    limb : int or None
        Drawn in the colour of this limb.
    shade : int
        How many curves before it have the same limb.
    component : int or None
        Drawn in the colour of this component; without limb and component, in that of texts.
    """

    name: str
    line: Extremes
    band: Extremes | None = None
    limb: int | None = None
    shade: int = 0
    component: int | None = None


class Columns(NamedTuple):
    """Lowest and highest values of a curve, and of its band, in each column of a picture."""

    line: tuple[Floats, Floats]
    band: tuple[Floats, Floats] | None


@dataclass(frozen=True, eq=False)
class Panel:
    """Curves with one scale.

    Attributes
    ----------
    title, unit : str
        What is shown.
    curves : tuple of Curve
        At least one.
    note : str
        A few words below the legend.
    about : str
        What the curves and bands mean, for the tool tip.
    from_zero : bool
        Whether the scale begins at 0.
    """

    title: str
    unit: str
    curves: tuple[Curve, ...]
    note: str = ""
    about: str = ""
    from_zero: bool = True

    def columns(self, first: float, end: float, n_columns: int) -> list[Columns]:
        """Return what each curve has in the columns of a picture of a stretch [frames].

        Parameters
        ----------
        first, end : float
            The stretch [frames] that the picture shows.
        n_columns : int
            Columns of the picture.
        """
        stretch = first, end, n_columns
        return [
            Columns(curve.line.columns(*stretch), None if curve.band is None else curve.band.columns(*stretch))
            for curve in self.curves
        ]

    def scale(self, columns: list[Columns]) -> tuple[float, float]:
        """Return the lowest and highest value of columns; 0 and 1 where nothing is known."""
        parts = [part for one in columns for part in (one.line, one.band) if part is not None]
        values = np.concatenate([extreme for part in parts for extreme in part])
        values = values[~np.isnan(values)]
        low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
        low = min(low, 0.0) if self.from_zero else low
        return (low, high) if high > low else (low, low + 1.0)


@dataclass(frozen=True, eq=False)
class JointCurve:
    """Angles of a joint, with their deviations.

    Attributes
    ----------
    names : tuple of str
        Of the angles, as `skelgen.kinematics.joints.angles` has them.
    angles : ndarray, shape (n_frames, n_angles), rad
        Those about axes without jumps of a full turn.
    std : ndarray, shape (n_frames, n_angles), rad
        Their standard deviations.
    step : int
        Deviations were computed for every how manieth frame, and hold until the next one.
    """

    names: tuple[str, ...]
    angles: Floats
    std: Floats
    step: int


def joint_curve(project: Project, joint: int) -> JointCurve:
    """Return the angles of a joint of a project with a skeleton.

    Parameters
    ----------
    project : Project
        With a skeleton.
    joint : int
        Index of the joint.
    """
    one, motion = project.skeleton.joints[joint], project.motion
    step = -(-motion.n_frames // _MOST_POSTURES) if motion.n_frames else 1
    frames = np.arange(0, motion.n_frames, step)
    posture = posture_of(project.skeleton, motion, project.trajectories.positions, frames)
    std = np.repeat(posture.angle_std[joint], step, axis=0)[: motion.n_frames]
    return JointCurve(angle_names(one), angles_over_time(one, motion), std, step)


def residual_curve(project: Project) -> Curve:
    """Return the mean residual of the markers of each frame."""
    return Curve(translate("Curves", "mean"), Extremes.of(residual_per_frame(project.motion)[0]))


def residual_panel(project: Project, mean: Curve, markers: Iterable[int]) -> Panel:
    """Return the residuals: their mean, and those of some markers.

    Parameters
    ----------
    project : Project
        With a skeleton.
    mean : Curve
        The mean residual of all markers.
    markers : iterable of int
        Markers whose residuals are drawn.
    """
    markers = list(markers)
    drawn = markers[:MOST_CURVES]
    shown = marker_curves(project, drawn, [project.motion.residuals[:, marker] for marker in drawn])
    more = len(markers) - MOST_CURVES
    note = translate("Curves", "{0} more are not drawn").format(more) if more > 0 else ""
    about = translate(
        "Curves", "How far markers were measured from their places on the skeleton: the mean, and selected markers."
    )
    return Panel(translate("Curves", "Residual"), "mm", (mean, *shown), note, about)


def marker_curves(project: Project, markers: Sequence[int], values: Iterable[Floats]) -> list[Curve]:
    """Return a curve of each marker in its limb's colour, in one colour before limbs are known.

    Parameters
    ----------
    project : Project
        With labels.
    markers : sequence of int
        Which ones.
    values : iterable of ndarray, shape (n_frames,)
        Of each of them.
    """
    limbs = [int(project.limbs.limb_of_marker[marker]) if project.has("limbs") else 0 for marker in markers]
    return [
        Curve(project.trajectories.names[marker], Extremes.of(one), limb=limb, shade=limbs[:number].count(limb))
        for number, (marker, limb, one) in enumerate(zip(markers, limbs, values, strict=True))
    ]


def sure_band(values: Floats, std: Floats) -> Extremes:
    """Return where values with standard deviations are with a probability of 95 %.

    Parameters
    ----------
    values, std : ndarray, shape (n_frames,)
        The values, and their standard deviations.
    """
    return Extremes.of(values - _SURE * std, values + _SURE * std)


def joint_panels(project: Project, joint: int) -> tuple[Panel, ...]:
    """Return the angles of a joint, and how sure its place is.

    Parameters
    ----------
    project : Project
        With a skeleton.
    joint : int
        Index of the joint.
    """
    one = project.skeleton.joints[joint]
    found = joint_curve(project, joint)
    curves = []
    for number, name in enumerate(found.names):
        angles, std = np.degrees(found.angles[:, number]), np.degrees(found.std[:, number])
        curves.append(Curve(name, Extremes.of(angles), sure_band(angles, std), component=number))
    panels = []
    if curves:
        called = joint_called(project, joint).capitalize()
        numbers = translate("Curves", "Joint {0}–{1}").format(one.parent, one.child)
        title = translate("Curves", called) if called else numbers
        about = translate(
            "Curves", "Angles of the joint, 0 in the reference pose; within the bands with a probability of 95 %."
        )
        if found.step > 1:
            about += " " + translate("Curves", "Bands are those of every {0}th frame.").format(found.step)
        panels.append(Panel(title, "°", tuple(curves), translate("Graph", one.kind), about, from_zero=False))
    if project.motion.joint_std is not None:
        size = np.linalg.norm(project.motion.joint_std[:, joint], axis=1)
        deviation = Curve(translate("Curves", "of the place"), Extremes.of(size), limb=one.child)
        about = translate(
            "Curves", "Standard deviation of the joint's place, the root of the sum of squares over three axes."
        )
        panels.append(Panel(translate("Curves", "Deviation"), "mm", (deviation,), about=about))
    return tuple(panels)


def count_panel(project: Project) -> Panel | None:
    """Return how many points of each frame belong to no marker; None for takes that came with labels."""
    counts = point_counts(project)
    if counts is None:
        return None
    title = translate("Curves", "Points left out") if project.has("labels") else translate("Curves", "Points")
    about = translate("Curves", "Points of each frame that belong to no marker.")
    curve = Curve(translate("Curves", "points"), Extremes.of(counts.astype(np.float64)))
    return Panel(title, "", (curve,), about=about)
