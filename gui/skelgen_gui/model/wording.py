"""Descriptions of a marker, a joint or a limb under the pointer in the 3-D view."""

import math

import numpy as np

from skelgen.app.drawing.measures import joint_called
from skelgen.app.drawing.wording import digits, percent, whole_percent
from skelgen.model import Project
from skelgen.model.arrays import Floats
from skelgen_gui.model import translate
from skelgen_gui.model.scene import Scene, Snapshot, State
from skelgen_gui.model.selection import JOINT, MARKER, Pick


def about(picked: Pick, scene: Scene, snapshot: Snapshot) -> str:
    """Describe what lies under the pointer, a line for each fact.

    Parameters
    ----------
    picked : Pick
        What lies under the pointer.
    scene : Scene
        Its project.
    snapshot : Snapshot
        The frame.
    """
    if picked.kind == MARKER:
        return "\n".join(_marker(picked.index, scene, snapshot))
    if picked.kind == JOINT:
        return "\n".join(_joint(picked.index, scene.project, snapshot))
    limb = int(scene.bones.limb[picked.index])
    count = int((scene.limb_of_marker == limb).sum())
    markers = _tr("1 marker") if count == 1 else _tr("{count} markers").format(count=count)
    return f"{limb_words(scene.project, limb)}\n{markers}"


def _marker(marker: int, scene: Scene, snapshot: Snapshot) -> list[str]:
    limb = int(scene.limb_of_marker[marker])
    lines = [scene.names[marker]]
    if limb >= 0:
        lines += [limb_words(scene.project, limb), *_membership(marker, scene.project)]
    elif scene.project.has("limbs"):
        lines.append(_tr("on no limb"))
    lines.append(_place(snapshot.markers[marker]))
    if snapshot.state[marker] == State.FILLED:
        return [*lines, _tr("unseen: where the skeleton places it")]
    if scene.project.has("labels") and scene.project.has_labelling:
        confidence = float(scene.project.labelling.confidence[snapshot.frame, marker])
        lines.append(_tr("{value} sure").format(value=percent(confidence)))
    if scene.project.has("skeleton"):
        residual = float(scene.project.motion.residuals[snapshot.frame, marker])
        lines += [] if math.isnan(residual) else [_tr("residual {value} mm").format(value=digits(residual))]
    return lines


def _membership(marker: int, project: Project) -> list[str]:
    """How likely the marker is on its limb, and where it is otherwise."""
    limbs = project.limbs
    if limbs.membership is None:
        return []
    (rivals, shares), own = limbs.rivals, whole_percent(float(limbs.probability[marker]))
    other = limb_words(project, int(rivals[marker])) if rivals[marker] >= 0 else _tr("a limb of its own")
    words = _tr("there with {own}, on {other} with {share}")
    return [words.format(own=own, other=other, share=whole_percent(float(shares[marker])))]


def _joint(joint: int, project: Project, snapshot: Snapshot) -> list[str]:
    parent, child = (int(limb) for limb in project.topology.edges[joint])
    first, second = (limb_words(project, limb) for limb in (parent, child))
    name = own_name_of_joint(project, joint) or _tr("joint {joint}").format(joint=joint)
    lines = [_tr("{name}: {parent} and {child}").format(name=name, parent=first, child=second)]
    if project.topology.edge_probability is not None:
        words = _tr("these limbs are neighbours with {own}")
        lines.append(words.format(own=whole_percent(float(project.topology.edge_probability[joint]))))
    if project.has("skeleton"):
        fitted = project.skeleton.joints[joint]
        lines.append(_kind(fitted.kind))
        if fitted.is_placed_by_marker_set:
            lines.append(_tr("the marker set places it: the motion does not determine where it is"))
        elif not fitted.is_determined:
            lines.append(_tr("its place is a choice: the motion does not determine it"))
        elif not fitted.is_fully_determined:
            lines.append(_tr("its place along its axis is a choice: the motion does not determine it"))
    lines.append(_place(snapshot.joints[joint]))
    if len(snapshot.covariances):
        std = float(np.sqrt(np.trace(snapshot.covariances[joint])))  # as the curve of the deviation has it
        lines.append(_tr("known to ±{value} mm").format(value=digits(std)))
    return lines


def joint_words(project: Project, joint: int) -> str:
    """Return what a joint of the tree is called: by its name, or else by its limbs.

    Parameters
    ----------
    project : Project
        With a tree.
    joint : int
        Index of the joint.
    """
    words = _tr("{0} – {1}").format(*(limb_words(project, limb) for limb in project.topology.edges[joint].tolist()))
    return own_name_of_joint(project, joint) or words


def own_name_of_joint(project: Project, joint: int) -> str:
    """Return the name of a joint; empty if it is only called by its limbs.

    Parameters
    ----------
    project, joint
        See `joint_words`.
    """
    called = joint_called(project, joint)
    limbs = "-".join(project.limbs.names[limb] for limb in project.topology.edges[joint].tolist())
    return "" if called == limbs else called


def limb_words(project: Project, limb: int) -> str:
    """Return what a limb is called: its name, or its number if it has none.

    Parameters
    ----------
    project : Project
        With limbs.
    limb : int
        Which one.
    """
    name = project.limbs.names[limb]
    return name if name != f"limb{limb}" else _tr("limb {limb}").format(limb=limb)


def _kind(kind: str) -> str:
    return {
        "ball": _tr("ball joint"),
        "universal": _tr("universal joint"),
        "hinge": _tr("hinge"),
        "rigid": _tr("rigid"),
        "undetermined": _tr("its turns do not tell its type"),
    }[kind]


def _place(position: Floats) -> str:
    x, y, z = position.tolist()
    return _tr("x {x:.1f}  y {y:.1f}  z {z:.1f} mm").format(x=x, y=y, z=z)


def _tr(text: str) -> str:
    return translate("Wording", text)
