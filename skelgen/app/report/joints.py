"""What the report says of joints: their table, angles and turns, what is not determined, and lengths between them."""

from typing import Any

import numpy as np

from skelgen.app.drawing import measures
from skelgen.app.drawing.graph import CostGraph, JointCost
from skelgen.app.drawing.wording import digits, fixed, plain, whole_percent
from skelgen.app.report.curves import angle_figure, common_reach, spread_figure
from skelgen.kinematics.inverse.inverse_kinematics import Posture, posture_of
from skelgen.kinematics.inverse.motion import MOST_FRAMES, AngleRange
from skelgen.kinematics.joints.angles import angle_names
from skelgen.kinematics.joints.observability import Observed, observed_joints
from skelgen.model import Joint, Project
from skelgen.model.arrays import Floats, spread_frames
from skelgen.model.limbs import with_names_of_limbs

Content = dict[str, Any]

_OPEN_FIGURES, _MOST_FIGURES = 2, 24
"""Joints whose angles are drawn at once, and those that can be opened: a page of some megabytes is enough."""

_LEAST_SHOWN = 0.001  # deg

_ANGLE_WORDS = {
    "turn": "about its axis",
    "first": "about the axis in the parent",
    "second": "about the axis in the child",
    "x": "x",
    "y": "y",
    "z": "z",
}


def joints_content(project: Project, graph: CostGraph, lengths: list[measures.Length]) -> Content:
    """Return the sections of a tree's joints: ``joints``, ``lengths``, and ``angles`` where there is a skeleton.

    Parameters
    ----------
    project : Project
        With joints.
    graph : CostGraph
        What `find_cost_graph` gives.
    lengths : list of Length
        What `measures.joint_lengths` gives.
    """
    content = {"joints": _joints(project, graph), "lengths": _lengths(project, lengths)}
    if project.has("skeleton"):
        content["angles"] = _angles(project, graph)
    return content


def _joints(project: Project, graph: CostGraph) -> Content:
    topology = project.topology
    fitted = project.skeleton.joints if project.has("skeleton") else ()
    rows = []
    for index, joint in enumerate(graph.joints):
        row: Content = {"joint": index, "called": measures.joint_called(project, index), "cost": digits(joint.cost)}
        row |= {"parent": joint.parent, "child": joint.child}
        row |= {"value": digits(topology.values[index]), "iterations": int(topology.n_iterations[index])}
        row |= {"rival": _rival(joint), "sure": _sure(joint), "is_doubtful": joint.is_doubtful}
        row |= _fitted(fitted[index]) if fitted else {}
        rows.append(row)
    spans = [
        {
            "limbs": span.limbs,
            "frames": f"{span.first_frame} to {span.last_frame}",
            "how": "fixed to each other" if span.is_fixed else "joined",
            "gap": fixed(span.gap, 1),
            "beyond": fixed(span.gap_beyond, 1),
        }
        for span in topology.spans
    ]
    return {"rows": rows, "fitted": bool(fitted), "alpha": plain(topology.alpha), "spans": spans}


def _sure(joint: JointCost) -> str:
    """How likely it is that the two limbs are neighbours, and that those of the rival are instead."""
    if np.isnan(joint.probability):
        return "–"
    own = whole_percent(joint.probability)
    if joint.rival is None or not joint.is_doubtful:
        return own
    return f"{own}, {joint.rival[0]}–{joint.rival[1]} {whole_percent(joint.rival_probability)}"


def _rival(joint: JointCost) -> str:
    if joint.rival is None:
        return "none"
    ratio = f" (×{digits(joint.ratio, 2)})" if joint.cost > 0 else ""
    return f"{joint.rival[0]}–{joint.rival[1]}: {digits(joint.cost + joint.margin)}{ratio}"


def _fitted(joint: Joint) -> Content:
    axis = "" if joint.axis is None else ", ".join(fixed(value, 2) for value in joint.axis.tolist())
    axis_std = "" if joint.axis_std is None else _degrees(float(np.linalg.norm(joint.axis_std)))
    covariance = np.diag(joint.std**2) if joint.covariance is None else joint.covariance
    stds = {"std": _place_std(joint, covariance), "child_std": _place_std(joint, joint.covariance_in_child)}
    return {"placed": _placed(joint), "kind": joint.kind, "axis": axis, "axis_std": axis_std} | stds


def _placed(joint: Joint) -> str:
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


def _lengths(project: Project, lengths: list[measures.Length]) -> Content:
    reach = common_reach(lengths)
    rows = [
        {
            "limb": each.limb,
            "joints": f"J{each.first} – J{each.second}",
            "rigid": digits(each.rigid, 4),
            "std": digits(each.std, 2),
            "raw": digits(each.raw_mean, 4),
            "spread": digits(each.spread),
            "figure": spread_figure(each, reach),
        }
        for each in lengths
    ]
    return {"rows": rows, "reach": digits(reach, 2), "has_rigid": project.has("skeleton")}


def _angles(project: Project, graph: CostGraph) -> Content:
    skeleton, motion, positions = project.skeleton, project.motion, project.trajectories.positions
    observed = observed_joints(skeleton, motion)
    rows = [
        _angle_row(index, joint, graph.joints[index].ranges, observed[index])
        | {"called": measures.joint_called(project, index)}
        for index, joint in enumerate(skeleton.joints)
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
    return {
        "rows": rows,
        "figures": figures,
        "n_open": _OPEN_FIGURES,
        "sentences": [with_names_of_limbs(seen.notice, project.limbs) for seen in observed if seen.sentence],
    }


def _angle_row(index: int, joint: Joint, ranges: tuple[AngleRange, ...], seen: Observed) -> Content:
    angles = [
        {
            "name": _ANGLE_WORDS[angle.name],
            "from": _degrees(angle.low),
            "to": _degrees(angle.high),
            "std": _degrees(angle.std),
        }
        for angle in ranges
    ]
    turns = [
        (", ".join(fixed(value, 2) for value in direction.tolist()), _degrees(turn))
        for direction, turn in zip(seen.motion.directions, seen.motion.ranges.tolist(), strict=True)
    ]
    return {"joint": index, "kind": joint.kind, "angles": angles, "turns": turns, "is_open": bool(seen.sentence)}


def _figure(posture: Posture, joint: Joint, index: int, times: Floats) -> str:
    names = tuple(_ANGLE_WORDS[name] for name in angle_names(joint))
    return angle_figure(times, np.rad2deg(posture.angles[index]), np.rad2deg(posture.angle_std[index]), names)


def _degrees(angle: float) -> str:
    degrees = float(np.rad2deg(angle))
    return "0" if abs(degrees) < _LEAST_SHOWN else digits(degrees)
