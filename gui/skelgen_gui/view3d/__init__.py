"""The 3-D view: what a project holds in one frame, projected and painted without a graphics card."""

from skelgen_gui.view3d.frustum import frustum
from skelgen_gui.view3d.shown import Shown
from skelgen_gui.view3d.widget import View3D

__all__ = ["Shown", "View3D", "frustum"]
