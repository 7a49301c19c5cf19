"""What the report says of joint angles: their ranges and curves, and what the motion of a joint does not determine."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from skelgen.app.drawing import measures
from skelgen.app.drawing.graph import CostGraph, JointCost
from skelgen.app.drawing.wording import degrees, fixed
from skelgen.app.report.curves import angle_figure
from skelgen.kinematics.inverse.inverse_kinematics import Posture, posture_of
from skelgen.kinematics.inverse.motion import MOST_FRAMES
from skelgen.kinematics.joints.angles import angle_names
from skelgen.kinematics.joints.observability import RangeOfMotion, observed_joints
from skelgen.model import Joint, Project
from skelgen.model.arrays import Floats, spread_frames
from skelgen.model.limbs import with_names_of_limbs

_OPEN_FIGURES, _MOST_FIGURES = 2, 24
"""Joints whose angles are drawn at once, and those that can be opened: a page of some megabytes is enough."""

_ANGLE_WORDS = {
    "turn": "about its axis",
    "first": "about the axis in the parent",
    "second": "about the axis in the child",
    "x": "x",
    "y": "y",
    "z": "z",
}


@dataclass(frozen=True)
class AngleRow:
    """The angles and the range of motion of a joint, as the report words them.

    Attributes
    ----------
    called : str
        Its name, empty where it has none.
    joint : JointCost
        Its type, and the ranges of its angles.
    turns : list of tuple of str
        Its three principal directions in the parent, and the range of motion about each [deg].
    """

    called: str
    joint: JointCost
    turns: list[tuple[str, str]]


@dataclass(frozen=True, eq=False)
class AnglesContent:
    """The section of joint angles.

    Attributes
    ----------
    rows : list of AngleRow
        Every joint.
    figures : list of tuple
        Title and drawing of the angles of each joint that is drawn.
    n_open : int
        Figures that are open when the page is loaded.
    sentences : list of str
        What the motion does not determine.
    words : mapping of str to str
        What angles are called.
    """

    rows: list[AngleRow]
    figures: list[tuple[str, Markup]]
    n_open: int
    sentences: list[str]
    words: Mapping[str, str]


def angles_content(project: Project, graph: CostGraph) -> AnglesContent:
    """Return the section of joint angles.

    Parameters
    ----------
    project : Project
        With a skeleton.
    graph : CostGraph
        What `find_cost_graph` gives.
    """
    skeleton, motion, positions = project.skeleton, project.motion, project.trajectories.positions
    observed = observed_joints(skeleton, motion)
    rows = [
        AngleRow(measures.joint_called(project, index), joint, _turns(observed[index].motion))
        for index, joint in enumerate(graph.joints)
    ]
    frames = spread_frames(motion.n_frames, MOST_FRAMES)
    posture = posture_of(skeleton, motion, positions, frames)
    times = frames / motion.rate
    called = project.limbs.called
    figures = [
        (
            f"J{index}: {joint.kind} between {called(joint.parent)} and {called(joint.child)}",
            _figure(posture, joint, index, times),
        )
        for index, joint in enumerate(skeleton.joints[:_MOST_FIGURES])
        if angle_names(joint)
    ]
    sentences = [with_names_of_limbs(seen.notice, project.limbs) for seen in observed if seen.sentence]
    return AnglesContent(rows, figures, _OPEN_FIGURES, sentences, _ANGLE_WORDS)


def _turns(motion: RangeOfMotion) -> list[tuple[str, str]]:
    return [
        (", ".join(fixed(value, 2) for value in direction.tolist()), degrees(turn))
        for direction, turn in zip(motion.directions, motion.ranges.tolist(), strict=True)
    ]


def _figure(posture: Posture, joint: Joint, index: int, times: Floats) -> Markup:
    names = tuple(_ANGLE_WORDS[name] for name in angle_names(joint))
    return angle_figure(times, np.rad2deg(posture.angles[index]), np.rad2deg(posture.angle_std[index]), names)
