"""What lies under the pointer or in a rectangle, what stands out, and what a click selects."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from skelgen.model.arrays import Floats
from skelgen_gui.model.lines import distances_to_lines
from skelgen_gui.model.picture import Picture
from skelgen_gui.model.scene import Scene
from skelgen_gui.model.selection import Selection

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
