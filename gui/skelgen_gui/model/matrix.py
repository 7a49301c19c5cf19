"""What the matrix of distance deviations shows, and which part of it is in sight."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QCoreApplication, QPointF, QRectF

from skelgen.app.drawing.colours import ramp_rgba
from skelgen.app.drawing.measures import subtree_markers
from skelgen.app.drawing.scales import LogScale
from skelgen.app.drawing.wording import millimetres
from skelgen.model import Project
from skelgen.model.arrays import Floats, Ints

translate = QCoreApplication.translate


@dataclass(frozen=True, eq=False)
class Matrix:
    """The matrix of distance deviations, ordered by limb.

    Attributes
    ----------
    markers, limbs : ndarray of intp, shape (n,)
        Marker of each row and column, and its limb; -1 = none.
    names : tuple of str, length n
        Of the markers.
    values : ndarray, shape (n, n), mm
        NaN where two markers are never seen together, 0 on the diagonal.
    scale : LogScale
        Of the colours [mm].
    """

    markers: Ints
    limbs: Ints
    names: tuple[str, ...]
    values: Floats
    scale: LogScale

    @property
    def n(self) -> int:
        """Number of rows."""
        return len(self.markers)

    @property
    def pixels(self) -> NDArray[np.uint8]:
        """A pixel for each cell, shape (n, n, 4): red, green, blue, opacity."""
        return ramp_rgba(self.scale.fractions(self.values))

    @property
    def borders(self) -> list[int]:
        """Rows at which limbs begin, and `n`."""
        return [0, *(np.flatnonzero(np.diff(self.limbs)) + 1).tolist(), self.n] if self.n else [0]

    def sentence(self, row: int, column: int) -> str:
        """Return what is told of a cell."""
        first, second = self._name(row), self._name(column)
        if row == column:
            return first
        value = float(self.values[row, column])
        if np.isnan(value):
            return translate("Matrix", "{0} – {1}: never seen together").format(first, second)
        varies = translate("Matrix", "{0} – {1}: their distance varies by {2}")
        return varies.format(first, second, millimetres(value))

    def _name(self, row: int) -> str:
        number = int(self.limbs[row])
        limb = translate("Matrix", "limb {0}").format(number) if number >= 0 else translate("Matrix", "no limb")
        return f"{self.names[row]} ({limb})"


def find_matrix(project: Project) -> Matrix:
    """Return the matrix of a project with limbs."""
    markers = subtree_markers(project)
    values = project.limbs.distance_deviation[np.ix_(markers, markers)].copy()
    np.fill_diagonal(values, 0.0)
    names = tuple(project.trajectories.names[marker] for marker in markers.tolist())
    return Matrix(markers, project.limbs.limb_of_marker[markers], names, values, LogScale.of(values))


FEWEST_CELLS = 3
"""Rows that are in sight at the largest zoom."""


@dataclass(frozen=True)
class Region:
    """A square part of a matrix.

    Attributes
    ----------
    row, column : float
        Where it begins.
    size : float
        Rows and columns.
    """

    row: float
    column: float
    size: float

    @classmethod
    def whole(cls, n: int) -> Region:
        """Return all of a matrix."""
        return cls(0.0, 0.0, float(max(n, 1)))

    def within(self, n: int) -> Region:
        """Return the nearest part of a matrix with n rows."""
        size = min(max(self.size, float(FEWEST_CELLS)), float(max(n, 1)))
        row = min(max(self.row + (self.size - size) / 2, 0.0), n - size)
        column = min(max(self.column + (self.size - size) / 2, 0.0), n - size)
        return Region(max(row, 0.0), max(column, 0.0), size)

    def zoomed(self, factor: float, row: float, column: float) -> Region:
        """Return a part that is smaller by a factor, in which a place stays where it was."""
        return Region(row - (row - self.row) / factor, column - (column - self.column) / factor, self.size / factor)

    @classmethod
    def around(cls, first: tuple[float, float], second: tuple[float, float]) -> Region:
        """Return the smallest part that holds all cells between two corners, each a row and a column."""
        (top, bottom), (left, right) = (sorted(pair) for pair in zip(first, second, strict=True))
        top, left, bottom, right = np.floor(top), np.floor(left), np.ceil(bottom), np.ceil(right)
        size = max(bottom - top, right - left)
        return cls(float((top + bottom - size) / 2), float((left + right - size) / 2), float(size))


@dataclass(frozen=True)
class Placed:
    """A part of a matrix in a square of a widget.

    Attributes
    ----------
    region : Region
        What is in sight.
    square : QRectF
        Where it lies [px].
    n : int
        Rows of the whole matrix.
    """

    region: Region
    square: QRectF
    n: int

    @property
    def cell(self) -> float:
        """Side of a cell [px]."""
        return self.square.width() / self.region.size

    def x(self, column: float) -> float:
        """Return where a column begins, within the square."""
        x = self.square.left() + (column - self.region.column) * self.cell
        return min(max(x, self.square.left()), self.square.right())

    def y(self, row: float) -> float:
        """Return where a row begins, within the square."""
        y = self.square.top() + (row - self.region.row) * self.cell
        return min(max(y, self.square.top()), self.square.bottom())

    def block(self, first_row: float, end_row: float, first_column: float, end_column: float) -> QRectF:
        """Return where the part of a block lies that is in sight; empty if none is."""
        corner = QPointF(self.x(first_column), self.y(first_row))
        return QRectF(corner, QPointF(self.x(end_column), self.y(end_row)))

    def index_at(self, place: QPointF) -> tuple[float, float]:
        """Return row and column at a place, within what is in sight."""
        x = min(max(place.x(), self.square.left()), self.square.right())
        y = min(max(place.y(), self.square.top()), self.square.bottom())
        row = self.region.row + (y - self.square.top()) / self.cell
        return row, self.region.column + (x - self.square.left()) / self.cell

    def cell_at(self, place: QPointF) -> tuple[int, int] | None:
        """Return row and column of the cell at a place; None beside the matrix."""
        if not self.n or not self.square.contains(place):
            return None
        row, column = (min(int(index), self.n - 1) for index in self.index_at(place))
        return row, column
