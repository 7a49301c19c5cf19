"""What stands out in the 3-D view, and what is selected by picking something."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from skelgen_gui.session import Selection
from skelgen_gui.view3d.picking import BONE, JOINT, MARKER, Pick
from skelgen_gui.view3d.scene import Scene


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
    """Whether something is selected already."""
    marked = Marked(selection)
    if picked.kind == BONE:
        return int(scene.bones.limb[picked.index]) == selection.limb
    return picked.index in (marked.markers(scene) if picked.kind == MARKER else marked.joints)


def with_pick(before: Selection, picked: Pick, scene: Scene) -> Selection:
    """Add a marker, a joint, or a bone's limb to a selection; a marker that is in it is taken away."""
    if picked.kind == MARKER:
        return replace(before, markers=before.markers ^ {picked.index})
    if picked.kind == JOINT:
        return replace(before, joint=picked.index)
    return replace(before, limb=int(scene.bones.limb[picked.index]))
