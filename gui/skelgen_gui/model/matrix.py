"""The description of a cell of the matrix of distance deviations, and the part of the matrix that is in sight."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.app.drawing.measures import DeviationMatrix
from skelgen.app.drawing.wording import millimetres
from skelgen_gui.model import translate

_FEWEST_CELLS = 3  # rows that are in sight at the largest zoom


def cell_sentence(matrix: DeviationMatrix, row: int, column: int) -> str:
    """Say how much the distance between two markers varies.

    Parameters
    ----------
    matrix : DeviationMatrix
        The matrix.
    row, column : int
        The cell.
    """
    first, second = _name(matrix, row), _name(matrix, column)
    if row == column:
        return first
    value = float(matrix.values[row, column])
    if np.isnan(value):
        return translate("Matrix", "{0} – {1}: never seen together").format(first, second)
    varies = translate("Matrix", "{0} – {1}: their distance varies by {2}")
    return varies.format(first, second, millimetres(value))


def _name(matrix: DeviationMatrix, row: int) -> str:
    limb = int(matrix.limbs[row])
    return f"{matrix.names[row]} ({matrix.limb_names[limb] if limb >= 0 else translate('Matrix', 'no limb')})"


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
        size = min(max(self.size, float(_FEWEST_CELLS)), float(max(n, 1)))
        row = min(max(self.row + (self.size - size) / 2, 0.0), n - size)
        column = min(max(self.column + (self.size - size) / 2, 0.0), n - size)
        return Region(max(row, 0.0), max(column, 0.0), size)

    def zoomed(self, factor: float, row: float, column: float) -> Region:
        """Return a part that is smaller by a factor, in which a place stays where it was.

        Parameters
        ----------
        factor : float
            More than 1 enlarges.
        row, column : float
            The place.
        """
        return Region(row - (row - self.row) / factor, column - (column - self.column) / factor, self.size / factor)

    @classmethod
    def around(cls, first: tuple[float, float], second: tuple[float, float]) -> Region:
        """Return the smallest part that holds all cells between two corners.

        Parameters
        ----------
        first, second : tuple of float
            Row and column of each corner.
        """
        (top, bottom), (left, right) = (sorted(pair) for pair in zip(first, second, strict=True))
        top, left, bottom, right = np.floor(top), np.floor(left), np.ceil(bottom), np.ceil(right)
        size = max(bottom - top, right - left)
        return cls(float((top + bottom - size) / 2), float((left + right - size) / 2), float(size))


@dataclass(frozen=True)
class PlacedRegion:
    """A part of a matrix in a square of a widget.

    Attributes
    ----------
    region : Region
        The part that is in sight.
    left, top, side : float, px
        Where it lies.
    n : int
        Rows of the whole matrix.
    """

    region: Region
    left: float
    top: float
    side: float
    n: int

    @property
    def cell(self) -> float:
        """Side of a cell [px]."""
        return self.side / self.region.size

    def corner(self, row: float, column: float) -> tuple[float, float]:
        """Return where a row and a column begin, x and y [px], within the square.

        Parameters
        ----------
        row, column : float
            The row and the column.
        """
        x = self.left + (column - self.region.column) * self.cell
        return self._clamped(x, self.top + (row - self.region.row) * self.cell)

    def block(self, rows: tuple[float, float], columns: tuple[float, float]) -> tuple[float, float, float, float]:
        """Return left, top, width and height [px] of the part of a block that is in sight; empty if none is.

        Parameters
        ----------
        rows, columns : tuple of float
            First and end.
        """
        left, top = self.corner(rows[0], columns[0])
        right, bottom = self.corner(rows[1], columns[1])
        return left, top, right - left, bottom - top

    def index_at(self, x: float, y: float) -> tuple[float, float]:
        """Return row and column at a place [px], within what is in sight.

        Parameters
        ----------
        x, y : float, px
            The place.
        """
        x, y = self._clamped(x, y)
        return self.region.row + (y - self.top) / self.cell, self.region.column + (x - self.left) / self.cell

    def cell_at(self, x: float, y: float) -> tuple[int, int] | None:
        """Return row and column of the cell at a place [px]; None beside the matrix.

        Parameters
        ----------
        x, y : float, px
            The place.
        """
        if not self.n or self._clamped(x, y) != (x, y):
            return None
        row, column = (min(int(index), self.n - 1) for index in self.index_at(x, y))
        return row, column

    def _clamped(self, x: float, y: float) -> tuple[float, float]:
        """The nearest place within the square [px]."""
        return min(max(x, self.left), self.left + self.side), min(max(y, self.top), self.top + self.side)
