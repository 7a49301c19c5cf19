"""The selection, the thing under the pointer, and the thing that a click selects."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from skelgen.model import Project
from skelgen.model.arrays import Floats
from skelgen_gui.model.picture import Picture
from skelgen_gui.model.scene import Scene

_MOST = 0.5  # of a limb's markers must be on another one for it to be the same

NO_MARKERS: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Selection:
    """The selected markers, limbs, joint and point.

    Attributes
    ----------
    markers : frozenset of int
        Indices of markers; of an unlabelled take, before the first stage, nothing can be selected.
    limb : int or None
        Index of a limb, the one that was chosen last.
    joint : int or None
        Index into the topology's and the skeleton's joints; there can be one before there is a skeleton.
    others : frozenset of int
        Further limbs.
    point : tuple of (int, int) or None
        A point of an unlabelled take that belongs to no marker: its frame, and its index within that.
    """

    markers: frozenset[int] = NO_MARKERS
    limb: int | None = None
    joint: int | None = None
    others: frozenset[int] = NO_MARKERS
    point: tuple[int, int] | None = None

    @property
    def limbs(self) -> frozenset[int]:
        """All selected limbs."""
        return self.others if self.limb is None else self.others | {self.limb}

    def with_limbs(self, limbs: frozenset[int]) -> Selection:
        """Return the selection with these limbs; the limb chosen last stays the last one, if it is among them."""
        last = self.limb if self.limb in limbs else max(limbs, default=None)
        return replace(self, limb=last, others=limbs - {last} if last is not None else limbs)

    def with_limb(self, limb: int) -> Selection:
        """Return the selection with one limb more, or one less if it was selected."""
        if limb in self.limbs:
            return self.with_limbs(self.limbs - {limb})
        return replace(self, limb=limb, others=self.limbs)


def carried(selection: Selection, before: Project, after: Project) -> Selection:
    """Return the same selection in another result of the take: markers by name, limbs by markers, joints by limbs.

    Parameters
    ----------
    selection : Selection
        What is selected in `before`.
    before, after : Project
        Two results of one take; what `after` does not have yet is left out.
    """
    if not before.has("labels") or not after.has("labels"):
        return Selection()
    old, new = before.trajectories.names, after.trajectories.names
    place = {name: index for index, name in enumerate(new)}
    if len(old) == len(new):  # some may have other names
        place |= {name: index for index, name in enumerate(old) if name not in place}
    markers = frozenset(place[old[marker]] for marker in selection.markers if old[marker] in place)
    if not after.has("limbs") or not before.has("limbs"):
        return Selection(markers)

    def limb_of(limb: int) -> int | None:
        moved = [place[old[marker]] for marker in before.limbs.markers_of(limb).tolist() if old[marker] in place]
        limbs = after.limbs.limb_of_marker[moved]
        counts = np.bincount(limbs[limbs >= 0], minlength=1)
        return int(counts.argmax()) if moved and counts.max() > _MOST * len(moved) else None

    found = {limb: limb_of(limb) for limb in selection.limbs}
    limb = None if selection.limb is None else found[selection.limb]
    limbs = frozenset(one for one in found.values() if one is not None)
    joint = None
    if selection.joint is not None and before.has("joints") and after.has("joints"):
        ends = {limb_of(end) for end in before.topology.edges[selection.joint].tolist()}
        same = [index for index, edge in enumerate(after.topology.edges.tolist()) if set(edge) == ends]
        joint = same[0] if same else None
    return Selection(markers, limb, joint).with_limbs(limbs)


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
    """Markers, limbs and joints that are highlighted.

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
        """Return the markers with a ring: selected ones, those on the selected limb, and the one under the pointer."""
        markers = set(self.selection.markers)
        if self.selection.limbs:
            markers |= set(np.flatnonzero(np.isin(scene.limb_of_marker, list(self.selection.limbs))).tolist())
        return markers | self._hovered(MARKER)

    @property
    def joints(self) -> set[int]:
        """The joints that have a ring."""
        selected = set() if self.selection.joint is None else {self.selection.joint}
        return selected | self._hovered(JOINT)

    def points(self, frame: int) -> set[int]:
        """Return the points of a frame that have a ring."""
        point = self.selection.point
        return {point[1]} if point is not None and point[0] == frame else set()

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
        return int(scene.bones.limb[picked.index]) in selection.limbs
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
    return before.with_limb(int(scene.bones.limb[picked.index]))


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
