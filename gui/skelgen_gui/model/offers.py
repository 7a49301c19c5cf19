"""Corrections that the user can make of a selection: the entries of the menus of corrections."""

from collections.abc import Iterable
from dataclasses import dataclass

from skelgen.kinematics.joints.joint_type import DETERMINED_TYPES
from skelgen.model import Project
from skelgen.model.corrections import Correction
from skelgen_gui.model.selection import Selection
from skelgen_gui.model.wording import joint_words, limb_words

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
