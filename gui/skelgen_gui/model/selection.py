"""What lies under the pointer, what a click selects, and what can be corrected of a selection."""

from dataclasses import dataclass, replace

import numpy as np

from skelgen.kinematics.joints.joint_type import DETERMINED_TYPES
from skelgen.model import Project
from skelgen.model.arrays import Floats
from skelgen.model.corrections import Correction
from skelgen_gui.model.picture import Picture
from skelgen_gui.model.scene import Scene

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
        found += [Offer("part", ends), *(Offer("kind", ends, kind) for kind in DETERMINED_TYPES)]
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


_REACH = 9.0  # pixels from a marker or joint at which it is still meant

_BONE_REACH = 5.0  # pixels from a bone at which it is still meant

MARKER, JOINT, BONE = "marker", "joint", "bone"

_SAME = 4.0  # px: among what is so near to the pointer, the nearest to the viewer is meant


@dataclass(frozen=True)
class Pick:
    """One thing of a snapshot.

    Attributes
    ----------
    kind : str
        ``marker``, ``joint`` or ``bone``.
    index : int
        Which.
    """

    kind: str
    index: int


def pick(picture: Picture, x: float, y: float) -> Pick | None:
    """Return what lies at a place in the picture; markers and joints go before bones.

    Parameters
    ----------
    picture : Picture
        What is drawn.
    x, y : float, px
        The place.
    """
    place = np.array([x, y])
    points = np.concatenate([picture.markers, picture.joints])
    depths = np.concatenate([picture.marker_depths, picture.joint_depths])
    found = _nearest(np.linalg.norm(points - place, axis=1), depths, _REACH)
    if found is not None:
        n_markers = len(picture.markers)
        return Pick(MARKER, found) if found < n_markers else Pick(JOINT, found - n_markers)
    found = _nearest(distances_to_lines(picture.bones, place), picture.bone_depths, _BONE_REACH)
    return None if found is None else Pick(BONE, found)


def is_drawn(picture: Picture, picked: Pick) -> bool:
    """Whether something is drawn: in another frame it may be hidden.

    Parameters
    ----------
    picture : Picture
        What is drawn.
    picked : Pick
        A marker, joint or bone.
    """
    places = {MARKER: picture.markers, JOINT: picture.joints, BONE: picture.bones}[picked.kind]
    return picked.index < len(places) and not bool(np.isnan(places[picked.index]).any())


def markers_within(picture: Picture, left: float, top: float, right: float, bottom: float) -> frozenset[int]:
    """Return the markers that are drawn within a rectangle [px], its border included.

    Parameters
    ----------
    picture : Picture
        What is drawn.
    left, top, right, bottom : float, px
        The rectangle.
    """
    inside = (picture.markers >= (left, top)) & (picture.markers <= (right, bottom))
    return frozenset(np.flatnonzero(inside.all(axis=1)).tolist())


def _nearest(distances: Floats, depths: Floats, reach: float) -> int | None:
    """The one in reach that is nearest; of those equally near, the one in front."""
    near = np.flatnonzero(distances <= reach)
    if not len(near):
        return None
    order = np.lexsort([depths[near], np.floor(distances[near] / _SAME)])
    return int(near[order[0]])


@dataclass(frozen=True)
class Marked:
    """What stands out.

    Attributes
    ----------
    selection : Selection
        What is selected.
    hovered : Pick or None
        What is under the pointer.
    """

    selection: Selection
    hovered: Pick | None = None

    def markers(self, scene: Scene) -> set[int]:
        """Return the markers that have a ring: selected ones, those of the selected limb, that under the pointer."""
        markers = set(self.selection.markers)
        if self.selection.limb is not None:
            markers |= set(np.flatnonzero(scene.limb_of_marker == self.selection.limb).tolist())
        return markers | self._hovered(MARKER)

    @property
    def joints(self) -> set[int]:
        """The joints that have a ring."""
        selected = set() if self.selection.joint is None else {self.selection.joint}
        return selected | self._hovered(JOINT)

    def limb(self, scene: Scene) -> int:
        """Return the limb whose bones stand out, or -1."""
        for bone in self._hovered(BONE):
            return int(scene.bones.limb[bone])
        return -1 if self.selection.limb is None else self.selection.limb

    def _hovered(self, kind: str) -> set[int]:
        return {self.hovered.index} if self.hovered is not None and self.hovered.kind == kind else set()


def is_selected(picked: Pick, selection: Selection, scene: Scene) -> bool:
    """Whether something is selected already.

    Parameters
    ----------
    picked : Pick
        A marker, joint or bone.
    selection : Selection
        What is selected.
    scene : Scene
        Knows the limbs of bones and markers.
    """
    marked = Marked(selection)
    if picked.kind == BONE:
        return int(scene.bones.limb[picked.index]) == selection.limb
    return picked.index in (marked.markers(scene) if picked.kind == MARKER else marked.joints)


def with_pick(before: Selection, picked: Pick, scene: Scene) -> Selection:
    """Add a marker, a joint, or a bone's limb to a selection; a marker that is in it is taken away.

    Parameters
    ----------
    before : Selection
        What is selected already.
    picked : Pick
        A marker, joint or bone.
    scene : Scene
        Knows the limbs of bones.
    """
    if picked.kind == MARKER:
        return replace(before, markers=before.markers ^ {picked.index})
    if picked.kind == JOINT:
        return replace(before, joint=picked.index)
    return replace(before, limb=int(scene.bones.limb[picked.index]))


def distances_to_lines(lines: Floats, place: Floats) -> Floats:
    """Return the distance [px] of a place from each line between two ends, shape (n_lines,).

    Parameters
    ----------
    lines : ndarray, shape (n_lines, 2, 2), px
        Both ends of each; NaN gives NaN.
    place : ndarray, shape (2,), px
        The place.
    """
    start, along = lines[:, 0], lines[:, 1] - lines[:, 0]
    squares = np.maximum((along**2).sum(axis=1), np.finfo(np.float64).tiny)
    parts = np.clip(((place - start) * along).sum(axis=1) / squares, 0.0, 1.0)
    return np.asarray(np.linalg.norm(start + parts[:, np.newaxis] * along - place, axis=1))
