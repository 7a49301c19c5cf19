"""The matrix of distance deviations."""

from skelgen_gui.matrix.widget import MatrixView

__all__ = ["MatrixView"]
