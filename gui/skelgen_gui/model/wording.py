"""What the 3-D view says of a marker, a joint or a bone."""

from __future__ import annotations

import math

import numpy as np
from PySide6.QtCore import QObject

from skelgen.model import Project
from skelgen.model.arrays import Floats
from skelgen_gui.model.picking import JOINT, MARKER, Pick
from skelgen_gui.model.scene import Scene, Snapshot, State


class Wording(QObject):
    """Sentences about what lies under the pointer."""

    def about(self, picked: Pick, scene: Scene, snapshot: Snapshot) -> str:
        """Say what something is, a fact a line.

        Parameters
        ----------
        picked : Pick
            What is meant.
        scene : Scene
            Its project.
        snapshot : Snapshot
            The frame.
        """
        if picked.kind == MARKER:
            return self._marker(picked.index, scene, snapshot)
        if picked.kind == JOINT:
            return self._joint(picked.index, scene.project, snapshot)
        return self.limb(int(scene.bones.limb[picked.index]), scene)

    def limb(self, limb: int, scene: Scene) -> str:
        """Name of a limb, with the number of its markers."""
        count = int((scene.limb_of_marker == limb).sum())
        return self.tr("limb {limb}").format(limb=limb) + "\n" + self.tr("{count} markers").format(count=count)

    def _marker(self, marker: int, scene: Scene, snapshot: Snapshot) -> str:
        limb = int(scene.limb_of_marker[marker])
        lines = [scene.names[marker]]
        if limb >= 0:
            lines.append(self.tr("limb {limb}").format(limb=limb))
        elif scene.project.has("limbs"):
            lines.append(self.tr("on no limb"))
        lines.append(self._place(snapshot.markers[marker]))
        if snapshot.state[marker] == State.FILLED:
            lines.append(self.tr("unseen: where the skeleton places it"))
            return "\n".join(lines)
        if scene.project.has("labels") and scene.project.has_labelling:
            confidence = 100 * float(scene.project.labelling.confidence[snapshot.frame, marker])
            lines.append(self.tr("confidence {value:.0f} %").format(value=confidence))
        return "\n".join(lines + self._residual(scene.project, snapshot.frame, marker))

    def _residual(self, project: Project, frame: int, marker: int) -> list[str]:
        residual = float(project.motion.residuals[frame, marker]) if project.has("skeleton") else math.nan
        return [] if math.isnan(residual) else [self.tr("residual {value:.1f} mm").format(value=residual)]

    def _joint(self, joint: int, project: Project, snapshot: Snapshot) -> str:
        parent, child = (int(limb) for limb in project.topology.edges[joint])
        lines = [self.tr("joint {joint}: limbs {parent} and {child}").format(joint=joint, parent=parent, child=child)]
        if project.has("skeleton"):
            lines.append(self._kind(project.skeleton.joints[joint].kind))
        lines.append(self._place(snapshot.joints[joint]))
        if len(snapshot.covariances):
            std = float(np.sqrt(np.linalg.eigvalsh(snapshot.covariances[joint])[-1]))
            lines.append(self.tr("known to ±{value:.2g} mm").format(value=std))
        return "\n".join(lines)

    def _kind(self, kind: str) -> str:
        words = {
            "ball": self.tr("ball joint"),
            "universal": self.tr("universal joint"),
            "hinge": self.tr("hinge"),
            "rigid": self.tr("rigid"),
            "undetermined": self.tr("turns too little to tell its kind"),
        }
        return words[kind]

    def _place(self, position: Floats) -> str:
        x, y, z = position.tolist()
        return self.tr("x {x:.1f}  y {y:.1f}  z {z:.1f} mm").format(x=x, y=y, z=z)
