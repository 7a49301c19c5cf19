"""Curves of the take: residuals, and angles and deviations of the selected joint."""

from __future__ import annotations

from functools import partial

import numpy as np
from PySide6.QtCore import QSize
from PySide6.QtWidgets import QWidget

from skelgen.model import Project
from skelgen_gui.derived import Deriver
from skelgen_gui.session import Session
from skelgen_gui.timeline.curve import Curve, Panel
from skelgen_gui.timeline.panels import joint_panels, residual_curve, residual_panel
from skelgen_gui.timeline.plot_view import PlotView
from skelgen_gui.timeline.span import VisibleSpan


class Curves(PlotView):
    """Residuals of all and of selected markers, angles of the selected joint with their band, and its deviation.

    Of a selected limb the joint above it is shown.

    Parameters
    ----------
    session : Session
        What is shown.
    span : VisibleSpan, optional
        Which frames are in sight; give that of the timeline to keep both together.
    """

    def __init__(self, session: Session, span: VisibleSpan | None = None, parent: QWidget | None = None) -> None:
        super().__init__(session, span or VisibleSpan(session, parent), parent)
        self._mean: tuple[Project, Curve] | None = None
        self.deriver = Deriver(self)
        self.setAccessibleName(self.tr("Curves"))
        self.setToolTip(self.tr("Residuals, and angles of the selected joint. Wheel: zoom, click: go there"))
        session.project_changed.connect(self._follow)
        session.selection_changed.connect(self._follow)
        self._follow()

    def sizeHint(self) -> QSize:
        """Return room for three panels."""
        return QSize(640, 320)

    def _follow(self) -> None:
        """Derive what is selected; the mean of all markers only once for each project."""
        project, selection = self._session.project, self._session.selection
        if project is None or not project.has("skeleton"):
            self.deriver.forget()
            self.show_panels((), self.tr("Run the step Skeleton to see residuals and angles of joints"))
            return
        joint = selection.joint
        if joint is None and selection.limb is not None:
            above = np.flatnonzero(project.topology.children == selection.limb)
            joint = int(above[0]) if len(above) else None
        mean = self._mean[1] if self._mean is not None and self._mean[0] is project else None
        wanted = partial(_panels, project, mean, tuple(sorted(selection.markers)), joint)
        self.deriver.derive(wanted, partial(self._take, project, joint))

    def _take(self, project: Project, joint: int | None, panels: tuple[Panel, ...]) -> None:
        self._mean = project, panels[0].curves[0]
        self.show_panels(panels, "" if joint is not None else self.tr("Select a joint or a limb to see its angles"))


def _panels(project: Project, mean: Curve | None, markers: tuple[int, ...], joint: int | None) -> tuple[Panel, ...]:
    residuals = residual_panel(project, mean or residual_curve(project), markers)
    return (residuals, *(joint_panels(project, joint) if joint is not None else ()))
