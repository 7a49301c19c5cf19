"""What the report says of joints: their table, those of a part of the take, lengths between them, and their angles."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from skelgen.app.drawing import measures
from skelgen.app.drawing.graph import CostGraph, JointCost
from skelgen.app.drawing.wording import digits, plain, whole_percent
from skelgen.app.report.curves import angle_figure, common_reach, spread_figure
from skelgen.kinematics.inverse.inverse_kinematics import Posture
from skelgen.kinematics.inverse.motion import spread_posture
from skelgen.kinematics.joints.angles import angle_names
from skelgen.kinematics.joints.observability import RangeOfMotion, observed_joints
from skelgen.model import Joint, Project
from skelgen.model.arrays import Floats
from skelgen.model.joint_spans import JointSpan
from skelgen.model.limbs import with_names_of_limbs
from skelgen.model.placed_joints import place_of

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
class JointRow:
    """A joint of the tree, as the report words it.

    Attributes
    ----------
    joint : JointCost
        The limbs that it connects, and its cost in the tree.
    called : str
        Name of the joint; empty where it has none.
    value : float, mm^2
        The final cost over all frames.
    iterations : int
        Steps until the final cost.
    rival : str
        The cheapest other joint, and its cost.
    probability : str
        How likely its limbs are neighbours; where that is doubtful, also how likely those of the rival are.
    """

    joint: JointCost
    called: str
    value: float
    iterations: int
    rival: str
    probability: str


@dataclass(frozen=True, eq=False)
class JointsContent:
    """The section of joints.

    Attributes
    ----------
    rows : list of JointRow
        Every joint.
    spans : sequence of JointSpan
        Joints that hold for a part of the take only.
    fitted : list of tuple
        Every joint of the skeleton, the standard deviations [mm] of its position in the parent and in the child, and
        what places it where the motion does not (`placed_joints.Place.words`). Empty before there is a skeleton.
    alpha : str
        Weight of the distance from the markers in the cost.
    """

    rows: list[JointRow]
    spans: Sequence[JointSpan]
    fitted: list[tuple[Joint, str, str, str]]
    alpha: str


def joints_content(project: Project, graph: CostGraph) -> JointsContent:
    """Return the section of joints.

    Parameters
    ----------
    project : Project
        With joints.
    graph : CostGraph
        What `find_cost_graph` gives.
    """
    topology = project.topology
    rows = [
        JointRow(
            joint=joint,
            called=measures.joint_called(project, index),
            value=float(topology.values[index]),
            iterations=int(topology.n_iterations[index]),
            rival=_rival(joint),
            probability=_probability(joint),
        )
        for index, joint in enumerate(graph.joints)
    ]
    fitted = [_fitted(joint) for joint in project.skeleton.joints] if project.has("skeleton") else []
    return JointsContent(rows, topology.spans, fitted, plain(topology.alpha))


def _probability(joint: JointCost) -> str:
    """How likely it is that the two limbs are neighbours, and that those of the rival are instead."""
    if np.isnan(joint.probability):
        return "–"
    own = whole_percent(joint.probability)
    if joint.rival is None or not joint.is_doubtful:
        return own
    return f"{own} ({joint.rival[0]}–{joint.rival[1]}: {whole_percent(joint.rival_probability)})"


def _rival(joint: JointCost) -> str:
    if joint.rival is None:
        return "none"
    ratio = f" (×{digits(joint.ratio, 2)})" if joint.cost > 0 else ""
    return f"{joint.rival[0]}–{joint.rival[1]}: {digits(joint.cost + joint.margin)}{ratio}"


def _fitted(joint: Joint) -> tuple[Joint, str, str, str]:
    in_parent, in_child = (_place_std(joint, one) for one in (joint.place_covariance, joint.covariance_in_child))
    return joint, in_parent, in_child, place_of(joint).words


def _place_std(joint: Joint, covariance: Floats | None) -> str:
    """Standard deviations along three axes, of hinges across and along theirs."""
    if covariance is None:
        return "–"
    axis = joint.free_axis()
    if not axis.any():
        return ", ".join(digits(value, 2) for value in np.sqrt(np.maximum(np.diag(covariance), 0.0)).tolist())
    along = float(axis @ covariance @ axis)
    across = max(float(np.trace(covariance)) - along, 0.0)
    return f"{digits(float(np.sqrt(across)), 2)} across, {digits(float(np.sqrt(along)), 2)} along"


@dataclass(frozen=True, eq=False)
class LengthsContent:
    """The section of lengths between joints.

    Attributes
    ----------
    rows : list of tuple of Length and Markup
        Every length, with box and whiskers of the distance between the raw joint positions.
    reach : float, mm
        Half the width of their pictures.
    has_rigid : bool
        Whether there is a skeleton.
    """

    rows: list[tuple[measures.Length, Markup]]
    reach: float
    has_rigid: bool


def lengths_content(project: Project, lengths: list[measures.Length]) -> LengthsContent:
    """Return the section of lengths between joints.

    Parameters
    ----------
    project : Project
        With joints.
    lengths : list of Length
        What `measures.joint_lengths` gives.
    """
    reach = common_reach(lengths)
    rows = [(each, spread_figure(each, reach)) for each in lengths]
    return LengthsContent(rows, reach, has_rigid=project.has("skeleton"))


@dataclass(frozen=True, eq=False)
class AnglesContent:
    """The section of joint angles.

    Attributes
    ----------
    motions : list of RangeOfMotion
        Of every joint.
    figures : list of tuple
        Title and drawing of the angles of each joint that is drawn.
    n_open : int
        Figures that are open when the page is loaded.
    sentences : list of str
        What the motion does not determine.
    words : mapping of str to str
        What angles are called.
    """

    motions: list[RangeOfMotion]
    figures: list[tuple[str, Markup]]
    n_open: int
    sentences: list[str]
    words: Mapping[str, str]


def angles_content(project: Project) -> AnglesContent:
    """Return the section of joint angles of a project with a skeleton."""
    skeleton, motion = project.skeleton, project.motion
    observed = observed_joints(skeleton, motion)
    frames, posture = spread_posture(skeleton, motion, project.trajectories.positions)
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
    return AnglesContent([seen.motion for seen in observed], figures, _OPEN_FIGURES, sentences, _ANGLE_WORDS)


def _figure(posture: Posture, joint: Joint, index: int, times: Floats) -> Markup:
    names = tuple(_ANGLE_WORDS[name] for name in angle_names(joint))
    return angle_figure(times, np.rad2deg(posture.angles[index]), np.rad2deg(posture.angle_std[index]), names)
