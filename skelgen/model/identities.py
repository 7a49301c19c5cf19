"""Identities that the user states by hand: this point in this frame is that marker."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from skelgen.errors import FormatError, InputError, SkelgenError

NOBODY = "nobody"
"""Name that the user gives to a point that is no marker at all."""


@dataclass(frozen=True)
class Identity:
    """One statement: a point in a frame is a marker.

    Attributes
    ----------
    name : str
        The marker, or `NOBODY`.
    frame : int
        Frame, from 0.
    position : tuple of three floats, mm, or None
        Where the point is; either this or `point` is given.
    point : int or None
        Index of the point within its frame, from 0; of labelled takes the index of the marker.
    last_frame : int or None
        The statement holds for the stretch of the point's track from `frame` to this frame and says nothing of the
        rest; None: for the whole track, as far as nothing else is stated of it.
    line : int
        Line of the file, for errors; 0 = not from a file.
    """

    name: str
    frame: int
    position: tuple[float, float, float] | None = None
    point: int | None = None
    last_frame: int | None = None
    line: int = 0

    def __post_init__(self) -> None:
        if not self.name.strip():
            raise InputError("an identity has an empty name; write a marker's name, or 'nobody'")
        if self.frame < 0 or (self.point is not None and self.point < 0):
            raise InputError(f"{self.name}: frames and points are counted from 0")
        if self.last_frame is not None and self.last_frame < self.frame:
            raise InputError(f"{self.name}: the last frame {self.last_frame} comes before the first, {self.frame}")
        if (self.position is None) == (self.point is None):
            raise InputError(f"{self.name}: either a position or the index of a point must be given")
        if self.position is not None:
            position = tuple(float(value) for value in self.position)
            if len(position) != 3 or not all(math.isfinite(value) for value in position):
                raise InputError(f"{self.name}: a position must be three finite numbers [mm]")
            object.__setattr__(self, "position", position)

    @property
    def is_nobody(self) -> bool:
        """Whether the point is said to be no marker."""
        return self.name == NOBODY


@dataclass(frozen=True)
class Identities:
    """All that the user states about a take.

    Attributes
    ----------
    entries : tuple of Identity
        The statements.
    source : str
        The file that they come from, for errors; empty if they were made in a program.
    """

    entries: tuple[Identity, ...]
    source: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "entries", tuple(self.entries))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the markers, in the order in which they are first stated."""
        return tuple(dict.fromkeys(entry.name for entry in self.entries if not entry.is_nobody))

    def error(self, entry: Identity, what: str) -> SkelgenError:
        """Return the error that names the file and line of a statement."""
        if self.source and entry.line:
            return FormatError(self.source, entry.line, f"{entry.name}: {what}")
        return InputError(f"identity of {entry.name} in frame {entry.frame}: {what}")


def identities_of(named: Sequence[tuple[str, int, Sequence[float]]]) -> Identities:
    """Make identities from (name, frame, position [mm]), for programs."""
    entries = (Identity(name, frame, (float(at[0]), float(at[1]), float(at[2]))) for name, frame, at in named)
    return Identities(tuple(entries))
