"""The graph of joint costs, with the tree that was found in it."""

from skelgen_gui.graph.widget import GraphView

__all__ = ["GraphView"]
