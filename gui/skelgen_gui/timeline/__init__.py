"""The timeline and the curves below it: playing, a lane for each marker, residuals, angles of joints."""

from skelgen_gui.timeline.curves import Curves
from skelgen_gui.timeline.player import Player
from skelgen_gui.timeline.span import VisibleSpan
from skelgen_gui.timeline.widget import Timeline

__all__ = ["Curves", "Player", "Timeline", "VisibleSpan"]
