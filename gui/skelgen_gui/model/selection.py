"""What is selected, and what can be corrected of it."""

from __future__ import annotations

from dataclasses import dataclass

from skelgen.kinematics.joints.joint_type import KNOWN_KINDS
from skelgen.model import Project
from skelgen.model.corrections import Correction

NO_MARKERS: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Selection:
    """What is selected.

    Attributes
    ----------
    markers : frozenset of int
        Indices of markers; of an unlabelled take, before the first stage, nothing can be selected.
    limb : int or None
        Index of a limb.
    joint : int or None
        Index into the topology's and the skeleton's joints; there can be one before there is a skeleton.
    """

    markers: frozenset[int] = NO_MARKERS
    limb: int | None = None
    joint: int | None = None


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
    """

    kind: str
    names: tuple[str, ...] = ()
    value: str = ""

    def correction(self, value: str = "", first: int | None = None, last: int | None = None) -> Correction:
        """Return the correction with what the user entered.

        Parameters
        ----------
        value : str
            What the user entered, where the offer has no value itself.
        first, last : int, optional
            Frames from which and to which it holds.
        """
        return Correction(self.kind, self.names, first, last, self.value or value)


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
                found.append(Offer("move", (*names, _name_of_limb(project, limb), *left)))
    return found


def _of_joints(project: Project, selection: Selection, names: tuple[str, ...]) -> list[Offer]:
    found = []
    limb_of_marker = project.limbs.limb_of_marker
    limbs = {int(limb_of_marker[marker]) for marker in selection.markers}
    if len(names) == 2 and len(limbs) == 2 and -1 not in limbs:
        found += [Offer("join", names), Offer("part", names)]
    if selection.joint is not None and project.has("skeleton"):
        joint = project.skeleton.joints[selection.joint]
        ends = (_name_of_limb(project, joint.parent), _name_of_limb(project, joint.child))
        found += [Offer("part", ends), *(Offer("kind", ends, kind) for kind in KNOWN_KINDS)]
    if selection.limb is not None:
        found.append(Offer("root", (_name_of_limb(project, selection.limb),)))
    return found


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
