"""What is said of a marker, a joint or a limb under the pointer, and which corrections can be made of a selection."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from skelgen.app.drawing.measures import joint_called
from skelgen.app.drawing.wording import digits, percent, whole_percent
from skelgen.kinematics.joints.joint_type import DETERMINED_TYPES
from skelgen.model import Project
from skelgen.model.arrays import Floats
from skelgen.model.corrections import Correction
from skelgen.model.placed_joints import place_of
from skelgen_gui.model import translate
from skelgen_gui.model.scene import Scene, Snapshot, State
from skelgen_gui.model.selection import JOINT, MARKER, Pick, Selection


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
        if remark := place_of(fitted).remark:
            lines.append(_tr(remark))
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


_NAMING = 3  # markers by which a limb is found again that has a name


@dataclass(frozen=True)
class Offer:
    """A correction that the selection allows.

    Attributes
    ----------
    kind : str
        Of the correction.
    names : tuple of str
        Markers that it names.
    value : str
        Its value where it is known; empty where the user enters it.
    about : tuple of str
        What it is about, in words: limbs by their names; the markers themselves if empty.
    also : tuple of Correction
        What is stated with it.
    """

    kind: str
    names: tuple[str, ...] = ()
    value: str = ""
    about: tuple[str, ...] = ()
    also: tuple[Correction, ...] = ()

    def correction(self, value: str = "", first: int | None = None, last: int | None = None) -> Correction:
        """Return the correction with what the user entered.

        Parameters
        ----------
        value : str
            What the user entered, where the offer has no value itself.
        first, last : int, optional
            Frames from which and to which it holds.
        """
        kind = "join" if self.kind == "instead" else self.kind
        return Correction(kind, self.names, first, last, self.value or value)


def offers(project: Project | None, selection: Selection) -> tuple[Offer, ...]:
    """Return what can be corrected, in the order of the stages.

    Parameters
    ----------
    project : Project or None
        The open project.
    selection : Selection
        What is selected.
    """
    if project is None or not project.has("labels"):
        return ()
    names = tuple(project.trajectories.names[marker] for marker in sorted(selection.markers))
    found = [*_of_labels(names)]
    if project.has("limbs"):
        found += _of_limbs(project, selection, names)
        found += _of_joints(project, selection, names)
    return tuple(found)


def new_name(project: Project, name: str) -> str:
    """Propose a name that no marker has yet for a part of a marker.

    Parameters
    ----------
    project : Project
        With labels.
    name : str
        Name of the marker.
    """
    number = 2
    while f"{name}_{number}" in project.trajectories.names:
        number += 1
    return f"{name}_{number}"


def naming_markers(project: Project, limb: int) -> tuple[str, ...]:
    """Return markers by which a limb that is given a name is found again.

    Parameters
    ----------
    project : Project
        With limbs.
    limb : int
        Index of the limb.
    """
    return tuple(project.trajectories.names[marker] for marker in project.limbs.markers_of(limb)[:_NAMING].tolist())


def ends_of_joint(project: Project, joint: int) -> tuple[str, ...]:
    """Return a marker on each of the two limbs that a joint of the tree joins.

    Parameters
    ----------
    project : Project
        With a tree.
    joint : int
        Index of the joint.
    """
    return tuple(_name_of_limb(project, limb) for limb in project.topology.edges[joint].tolist())


def _of_labels(names: tuple[str, ...]) -> list[Offer]:
    found = []
    if len(names) >= 2:
        found.append(Offer("merge", names))
    if len(names) == 2:
        found.append(Offer("swap", names))
    if len(names) == 1:
        found += [Offer("split", names), Offer("rename", names)]
    if names:
        found.append(Offer("delete", names))
    return found


def _of_limbs(project: Project, selection: Selection, names: tuple[str, ...]) -> list[Offer]:
    found = [Offer(kind, names) for kind in ("together", "apart") if len(names) >= 2]
    if len(names) == 1:
        marker = next(iter(selection.markers))
        own = int(project.limbs.limb_of_marker[marker])
        mates = [other for other in project.limbs.markers_of(own).tolist() if other != marker] if own >= 0 else []
        left = (project.trajectories.names[mates[0]],) if mates else ()
        for limb in range(project.limbs.n_limbs):
            if limb != own:
                target = _name_of_limb(project, limb)
                found.append(Offer("move", (*names, target, *left), about=(limb_words(project, limb),)))
    if len(selection.limbs) >= 2:
        found.append(Offer("together", _names_on(project, selection.limbs), about=_words(project, selection.limbs)))
    if selection.limb is not None:
        words = (limb_words(project, selection.limb),)
        found.append(Offer("name", naming_markers(project, selection.limb), about=words))
    return found


def _of_joints(project: Project, selection: Selection, names: tuple[str, ...]) -> list[Offer]:
    found = []
    limb_of_marker = project.limbs.limb_of_marker
    limbs = {int(limb_of_marker[marker]) for marker in selection.markers}
    if len(names) == 2 and len(limbs) == 2 and -1 not in limbs:
        found += [Offer("join", names), Offer("part", names)]
    if len(selection.limbs) == 2 and project.has("joints"):
        found += _of_pair(project, selection)
    elif selection.joint is not None and project.has("joints"):
        found += _of_joint(project, selection.joint)
    if len(selection.limbs) == 1 and selection.limb is not None:
        words = (limb_words(project, selection.limb),)
        found.append(Offer("root", (_name_of_limb(project, selection.limb),), about=words))
    return found


def _of_joint(project: Project, joint: int) -> list[Offer]:
    """Corrections of a joint of the tree."""
    ends, words = ends_of_joint(project, joint), _words(project, project.topology.edges[joint].tolist())
    found = [Offer("part", ends, about=words)]
    if project.has("skeleton"):
        found.append(Offer("name-joint", ends, about=(joint_words(project, joint),)))
        found += [Offer("kind", ends, kind) for kind in DETERMINED_TYPES]
    return found


def _of_pair(project: Project, selection: Selection) -> list[Offer]:
    """Corrections of two limbs: of their joint if they have one, otherwise the statement that they have one."""
    edges = [set(edge) for edge in project.topology.edges.tolist()]
    if set(selection.limbs) in edges:
        return _of_joint(project, edges.index(set(selection.limbs)))
    limbs, joint = sorted(selection.limbs), selection.joint
    ends, words = tuple(_name_of_limb(project, limb) for limb in limbs), _words(project, limbs)
    if joint is None or set(project.topology.rivals[joint].tolist()) != selection.limbs:
        return [Offer("join", ends, about=words)]
    dropped = project.topology.edges[joint].tolist()
    part = Correction("part", tuple(_name_of_limb(project, limb) for limb in dropped))
    return [Offer("instead", ends, about=(*words, *_words(project, dropped)), also=(part,))]


def _words(project: Project, limbs: Iterable[int]) -> tuple[str, ...]:
    """Names of limbs."""
    return tuple(limb_words(project, limb) for limb in sorted(limbs))


def _names_on(project: Project, limbs: Iterable[int]) -> tuple[str, ...]:
    """The markers on limbs."""
    names = project.trajectories.names
    return tuple(names[marker] for limb in sorted(limbs) for marker in project.limbs.markers_of(limb).tolist())


def _name_of_limb(project: Project, limb: int) -> str:
    """Return the marker by which a limb is named: its first.

    Parameters
    ----------
    project : Project
        With limbs.
    limb : int
        Index of the limb.
    """
    return project.trajectories.names[int(project.limbs.markers_of(limb)[0])]
