"""What the report says of limbs and joints: tables with their doubts, residuals, lengths between joints, angles.

Each section is what the template shows, by the names by which the template knows it.
"""

import numpy as np
from markupsafe import Markup

from skelgen.app.drawing import measures
from skelgen.app.drawing.graph import CostGraph, JointCost
from skelgen.app.drawing.wording import digits, percent, plain, whole_percent
from skelgen.app.report.curves import angle_figure, common_reach, deviation_bars, residual_figure, spread_figure
from skelgen.app.report.pictures import deviation_figure
from skelgen.kinematics.inverse.inverse_kinematics import Posture, posture_of
from skelgen.kinematics.inverse.motion import MOST_FRAMES
from skelgen.kinematics.joints.angles import angle_names
from skelgen.kinematics.joints.observability import observed_joints
from skelgen.model import Joint, Limbs, Project
from skelgen.model.arrays import Floats, spread_frames
from skelgen.model.limbs import with_names_of_limbs
from skelgen.progress import counted, listed

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


def limbs_content(project: Project) -> dict[str, object]:
    """Return the section of limbs of a project that has limbs."""
    names, parents = project.trajectories.names, project.topology.parents if project.has("joints") else None
    rows, doubts = [], _doubts(project.limbs)
    for limb in measures.limb_order(project):
        markers = project.limbs.markers_of(limb)
        inside = project.limbs.distance_deviation[np.ix_(markers, markers)][np.triu_indices(len(markers), 1)]
        inside = inside[~np.isnan(inside)]
        rows.append(
            {
                "limb": limb,
                "called": project.limbs.names[limb].removeprefix(f"limb{limb}"),
                "parent": "" if parents is None else "root" if parents[limb] < 0 else str(parents[limb]),
                "names": [(names[marker], doubts.get(int(marker), "")) for marker in markers],
                "inside": digits(float(inside.mean())) if len(inside) else "–",
            }
        )
    left_out = [names[marker] for marker in project.limbs.left_out]
    figure, has_parents = deviation_figure(project), parents is not None
    return {"rows": rows, "has_parents": has_parents, "left_out": left_out, "figure": figure}


def _doubts(limbs: Limbs) -> dict[int, str]:
    """For each marker that may be on another limb: how likely it is on its own, and on the next."""
    rivals, shares = limbs.rivals
    others = [limbs.called(limb) if limb >= 0 else "alone" for limb in rivals.tolist()]
    return {
        marker: f"{100 * limbs.probability[marker]:.0f} %, {others[marker]} {100 * shares[marker]:.0f} %"
        for marker in limbs.doubtful.tolist()
    }


def deviations_content(project: Project) -> dict[str, object]:
    """Return the sections of residuals of a project that has a skeleton."""
    order, stds = measures.subtree_markers(project), project.skeleton.offset_std
    rows = measures.marker_deviations(project.trajectories, project.limbs, project.motion, order)
    groups = []
    for limb in measures.limb_order(project):
        own = [row for row in rows if row.limb == limb]
        values = project.motion.residuals[:, [row.marker for row in own]]
        whole = measures.spread_of(values[~np.isnan(values)])
        groups.append({"limb": limb, "called": project.limbs.called(limb), "rows": own, "whole": whole})
    return {
        "groups": groups,
        "place_std": np.full(project.trajectories.n_markers, np.nan) if stds is None else stds.max(axis=1),
        "bars": deviation_bars([row for row in rows if row.limb >= 0]),
        "residual": residual_figure(project.motion),
        "interpolated": _interpolated(project),
    }


def _interpolated(project: Project) -> str:
    unseen, never = project.motion.interpolated, [project.limbs.called(limb) for limb in project.motion.never_seen]
    untold = f" No frame tells all turns of {listed(never)}: too few markers." if never else ""
    if not unseen.any():
        others = "other " if never else ""
        return f"Every {others}limb's rotation rests on markers seen in the frame, in every frame.{untold}"
    worst = int(unseen.sum(axis=0).argmax())
    return (
        f"{percent(float(unseen.mean()))} of the limb rotations are interpolated in time because too few markers were "
        f"seen; most often {project.limbs.called(worst)}, in {counted(int(unseen[:, worst].sum()), 'frame')}.{untold}"
    )


def joints_content(project: Project, graph: CostGraph) -> dict[str, object]:
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
        {
            "joint": joint,
            "called": measures.joint_called(project, index),
            "value": float(topology.values[index]),
            "iterations": int(topology.n_iterations[index]),
            "rival": _rival(joint),
            "probability": _probability(joint),
        }
        for index, joint in enumerate(graph.joints)
    ]
    fitted = [_fitted(joint) for joint in project.skeleton.joints] if project.has("skeleton") else []
    return {"rows": rows, "spans": topology.spans, "fitted": fitted, "alpha": plain(topology.alpha)}


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
    covariance = np.diag(joint.std**2) if joint.covariance is None else joint.covariance
    return joint, _place_std(joint, covariance), _place_std(joint, joint.covariance_in_child), _placed_by(joint)


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


def lengths_content(project: Project, lengths: list[measures.Length]) -> dict[str, object]:
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
    return {"rows": rows, "reach": reach, "has_rigid": project.has("skeleton")}


def angles_content(project: Project) -> dict[str, object]:
    """Return the section of joint angles of a project with a skeleton."""
    skeleton, motion, positions = project.skeleton, project.motion, project.trajectories.positions
    observed = observed_joints(skeleton, motion)
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
    motions = [seen.motion for seen in observed]
    found = {"motions": motions, "figures": figures, "n_open": _OPEN_FIGURES}
    return found | {"sentences": sentences, "words": _ANGLE_WORDS}


def _figure(posture: Posture, joint: Joint, index: int, times: Floats) -> Markup:
    names = tuple(_ANGLE_WORDS[name] for name in angle_names(joint))
    return angle_figure(times, np.rad2deg(posture.angles[index]), np.rad2deg(posture.angle_std[index]), names)
