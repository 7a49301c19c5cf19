"""What the report says of joints: their table, joints that hold for a part of the take, and lengths between joints."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from skelgen.app.drawing import measures
from skelgen.app.drawing.graph import CostGraph, JointCost
from skelgen.app.drawing.wording import degrees, digits, fixed, plain, whole_percent
from skelgen.app.report.curves import common_reach, spread_figure
from skelgen.model import Joint, Project
from skelgen.model.arrays import Floats
from skelgen.model.joint_spans import JointSpan


@dataclass(frozen=True)
class FittedCells:
    """What the skeleton adds to the row of a joint; empty before the joint is fitted.

    Attributes
    ----------
    kind, axis, axis_std : str
        Type of the joint; its axis and the axis' standard deviation [deg], where there is one.
    std, child_std : str
        Standard deviations [mm] of its position in the parent and in the child.
    placed_by : str
        What places the joint where the motion does not: the marker set, or a choice.
    """

    kind: str = ""
    axis: str = ""
    axis_std: str = ""
    std: str = ""
    child_std: str = ""
    placed_by: str = ""


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
    fitted : FittedCells
        What the skeleton adds.
    """

    joint: JointCost
    called: str
    value: float
    iterations: int
    rival: str
    probability: str
    fitted: FittedCells


@dataclass(frozen=True, eq=False)
class JointsContent:
    """The section of joints.

    Attributes
    ----------
    rows : list of JointRow
        Every joint.
    spans : sequence of JointSpan
        Joints that hold for a part of the take only.
    is_fitted : bool
        Whether there is a skeleton.
    alpha : str
        Weight of the distance from the markers in the cost.
    """

    rows: list[JointRow]
    spans: Sequence[JointSpan]
    is_fitted: bool
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
    fitted = [_fitted(joint) for joint in project.skeleton.joints] if project.has("skeleton") else None
    rows = [
        JointRow(
            joint=joint,
            called=measures.joint_called(project, index),
            value=float(topology.values[index]),
            iterations=int(topology.n_iterations[index]),
            rival=_rival(joint),
            probability=_probability(joint),
            fitted=FittedCells() if fitted is None else fitted[index],
        )
        for index, joint in enumerate(graph.joints)
    ]
    return JointsContent(rows, topology.spans, is_fitted=fitted is not None, alpha=plain(topology.alpha))


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


def _fitted(joint: Joint) -> FittedCells:
    covariance = np.diag(joint.std**2) if joint.covariance is None else joint.covariance
    return FittedCells(
        kind=joint.kind,
        axis="" if joint.axis is None else ", ".join(fixed(value, 2) for value in joint.axis.tolist()),
        axis_std="" if joint.axis_std is None else degrees(float(np.linalg.norm(joint.axis_std))),
        std=_place_std(joint, covariance),
        child_std=_place_std(joint, joint.covariance_in_child),
        placed_by=_placed_by(joint),
    )


def _placed_by(joint: Joint) -> str:
    """What places a joint where the motion does not; empty if it does."""
    if joint.is_placed_by_marker_set:
        return "by the marker set"
    if joint.is_determined:
        return "" if joint.is_fully_determined else "a choice along its axis"
    return "a choice"


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
