"""What the user states: corrections of markers, limbs and joints, and identities of points; every later run obeys."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from skelgen.errors import FormatError, InputError, SkelgenError
from skelgen.model.arrays import Floats, check_whole, set_fields
from skelgen.model.limbs import body_and_limb
from skelgen.model.skeleton import JOINT_TYPES
from skelgen.progress import counted, listed

SAME_PLACE = 1e-3
"""mm: a marker's place is a measured position, which only rounding in a file may change."""

NUMBERS = ("n_markers", "n_limbs")
"""Kinds whose value is a number."""

BY_SKELETON = "skeleton"
"""The way of filling that needs a skeleton."""

FILL_METHODS = (BY_SKELETON, "rigid", "spline", "pattern")
"""Ways of filling gaps: by the skeleton, by markers that move along, by its own motion, by the path of another one."""

_DONORS = {"rigid": (3, math.inf), "pattern": (1, 1)}  # fewest and most markers that fill another one

NOBODY = "nobody"
"""Name that the user gives to a point that is no marker at all."""


@dataclass(frozen=True)
class Rule:
    """What a kind of correction consists of.

    Attributes
    ----------
    stage : str
        The stage that obeys it: its result and all after it are computed anew.
    sentence : str
        What it says, with ``{names}``, ``{first}``, ``{rest}``, ``{value}``.
    least, most : int
        How many markers it names; `most` 0 means any number from `least` on.
    needs_value : bool
        Whether it needs a value: a name, a number, a type of joint.
    has_frames : bool
        Whether it may hold for some frames only.
    """

    stage: str
    sentence: str
    least: int = 1
    most: int = 1
    needs_value: bool = False
    has_frames: bool = False


RULES: Mapping[str, Rule] = MappingProxyType(
    {
        "merge": Rule("labels", "{names} are one marker, {first}", least=2, most=0),
        "split": Rule("labels", "{first} is another marker, {value}", needs_value=True, has_frames=True),
        "rename": Rule("labels", "{first} is called {value}", needs_value=True),
        "delete": Rule("labels", "{names} is nobody", most=0, has_frames=True),
        "swap": Rule("labels", "{names} change places", least=2, most=2, has_frames=True),
        "confirm": Rule("labels", "{names} is rightly called so", most=0, has_frames=True),
        "smooth": Rule("labels", "{names} is smoothed at {value} Hz", most=0, needs_value=True, has_frames=True),
        "n_markers": Rule("labels", "there are {value} markers", least=0, most=-1, needs_value=True),
        "together": Rule("limbs", "{names} share a limb", least=2, most=0),
        "apart": Rule("limbs", "no two of {names} share a limb", least=2, most=0),
        "move": Rule("limbs", "{first} is on the limb of {rest}", least=2, most=0),
        "name": Rule("limbs", "the limb of {names} is called {value}", most=0, needs_value=True),
        "n_limbs": Rule("limbs", "there are {value} limbs", least=0, most=-1, needs_value=True),
        "join": Rule("joints", "the limbs of {names} are joined", least=2, most=2),
        "part": Rule("joints", "the limbs of {names} are not joined", least=2, most=2),
        "root": Rule("joints", "the limb of {first} is the root"),
        "fill": Rule("skeleton", "gaps of {first} are filled by {value}", most=0, needs_value=True, has_frames=True),
        "name-joint": Rule("skeleton", "the joint between the limbs of {names} is called {value}", 2, 2, True),
        "kind": Rule("skeleton", "the joint between the limbs of {names} is of the type {value}", 2, 2, True),
    }
)
"""Kinds of corrections."""


@dataclass(frozen=True)
class Place:
    """Where a marker is in one frame: it is found there again although a new run calls it otherwise.

    Attributes
    ----------
    frame : int
        A frame in which the marker is seen.
    position : tuple of three floats, mm
        Its measured position there.
    """

    frame: int
    position: tuple[float, float, float]

    def __post_init__(self) -> None:
        position = tuple(float(value) for value in self.position)
        if self.frame < 0 or len(position) != 3 or not all(math.isfinite(value) for value in position):
            raise InputError("a marker's place is a frame from 0 and three finite numbers [mm]")
        object.__setattr__(self, "position", position)


@dataclass(frozen=True)
class Correction:
    """One statement of the user.

    Attributes
    ----------
    kind : str
        One of `RULES`.
    names : tuple of str
        The markers that it is about; limbs are named by one of their markers, a joint by one marker of either limb.
        Of ``move``: the marker, one of the limb that it goes to, and perhaps one of the limb that it leaves; behind it
        the others of the limb that it goes to, which stay together.
    first_frame, last_frame : int or None
        Frames for which it holds, both included; None: from the first, to the last.
    value : str
        The new name, the number or the type of joint.
    places : tuple of Place
        A position of each named marker in one frame; empty if only the names are known.
    """

    kind: str
    names: tuple[str, ...] = ()
    first_frame: int | None = None
    last_frame: int | None = None
    value: str = ""
    places: tuple[Place, ...] = ()

    def __post_init__(self) -> None:
        if self.kind not in RULES:
            raise InputError(f"there is no correction {self.kind!r}; there are {', '.join(RULES)}")
        set_fields(self, names=tuple(self.names), places=tuple(self.places))
        if not all(isinstance(text, str) for text in (*self.names, self.value)):
            raise InputError(f"{self.kind}: names of markers and the value must be texts")
        for frame in (self.first_frame, self.last_frame):
            if frame is not None:
                check_whole(frame, 0, f"{self.kind}: a frame")
        rule, n_names = self.rule, len(self.names)
        if n_names < rule.least or (rule.most and n_names > max(rule.most, 0)):
            belongs = f"{rule.least} {'belongs' if rule.least == 1 else 'belong'} there"
            raise InputError(f"{self.kind}: {counted(n_names, 'marker is', 'markers are')} named; {belongs}")
        if len(set(self.names)) != n_names or not all(name.strip() for name in self.names):
            raise InputError(f"{self.kind}: every marker must have a name, and be named once")
        if self.places and len(self.places) != n_names:
            raise InputError(f"{self.kind}: {len(self.places)} places for {n_names} markers")
        first, last = self.first_frame, self.last_frame
        if not rule.has_frames and (first is not None or last is not None):
            raise InputError(f"{self.kind}: it holds for the whole take, not for some frames")
        if (first or 0) < 0 or (last is not None and last < (first or 0)):
            raise InputError(f"{self.kind}: frames {first} to {last} are none")
        if rule.needs_value != bool(self.value.strip()):
            raise InputError(f"{self.kind}: a value {'is missing' if rule.needs_value else 'has no meaning'}")
        self._check_value()

    def _check_value(self) -> None:
        """Refuse values that a kind does not know."""
        if self.kind in NUMBERS and not (self.value.isdecimal() and int(self.value) > 0):
            raise InputError(f"{self.kind}: {self.value!r} is no number from 1 on")
        stated_types = [kind for kind in JOINT_TYPES if kind != "undetermined"]
        if self.kind == "kind" and self.value not in stated_types:
            raise InputError(f"kind: {self.value!r} is no type of a joint; there are {', '.join(stated_types)}")
        if self.kind == "fill" and self.value not in FILL_METHODS:
            raise InputError(f"fill: {self.value!r} is no way of filling; there are {', '.join(FILL_METHODS)}")
        if self.kind == "fill":
            least, most = _DONORS.get(self.value, (0, 0))
            if not least <= len(self.names) - 1 <= most:
                wanted = f"at least {least}" if most > least else str(least)
                raise InputError(
                    f"fill: by {self.value} with {len(self.names) - 1} other markers; {wanted} belong there"
                )
        if self.kind == "smooth":
            try:
                frequency = float(self.value)
            except ValueError as error:
                raise InputError(f"smooth: {self.value!r} is no frequency [Hz]") from error
            if not (math.isfinite(frequency) and frequency > 0):
                raise InputError(f"smooth: {self.value} Hz; the frequency must be above 0")

    @property
    def rule(self) -> Rule:
        """What this kind consists of."""
        return RULES[self.kind]

    @property
    def stage(self) -> str:
        """The stage that obeys it."""
        return self.rule.stage

    @property
    def sentence(self) -> str:
        """What it says."""
        names = listed(self.names)
        first, rest = (*self.names, "")[0], ", ".join((*self.names[1:2], *self.names[3:]))
        sentence = self.rule.sentence.format(names=names, first=first, rest=rest, value=self.value)
        if self.first_frame is None and self.last_frame is None:
            return sentence
        first = "the first frame" if self.first_frame is None else f"frame {self.first_frame}"
        last = "the end" if self.last_frame is None else f"frame {self.last_frame}"
        return f"{sentence}, from {first} to {last}"


def named_marker(correction: Correction, which: int, names: Sequence[str], positions: Callable[[int], Floats]) -> int:
    """Find a marker that a correction names: by its place if one is stated and found, else by its name.

    Parameters
    ----------
    correction : Correction
        The correction.
    which : int
        Index into its names.
    names : sequence of str
        All markers.
    positions : callable (frame) -> ndarray, shape (n_markers, 3), mm
        Positions in a frame, NaN where unseen; no rows for a frame outside the take.

    Raises
    ------
    InputError
        If there is no such marker.
    """
    if correction.places:
        place = correction.places[which]
        off = np.nan_to_num(np.abs(positions(place.frame) - place.position).max(axis=1), nan=np.inf)
        if off.min(initial=np.inf) <= SAME_PLACE:
            return int(off.argmin())
    if correction.names[which] in names:
        return list(names).index(correction.names[which])
    of_bodies = [name for name in names if body_and_limb(name)[1] == correction.names[which]]
    raise InputError(
        f"the correction '{correction.sentence}' names {correction.names[which]!r}, which the labels do not have; take "
        f"it back, or name one of {', '.join(of_bodies or names)}"
    )


def names_after(corrections: Sequence[Correction]) -> tuple[tuple[str, ...], ...]:
    """Return what the markers that each correction names are called after all corrections.

    Parameters
    ----------
    corrections : sequence of Correction
        In the order in which they were made.

    Returns
    -------
    tuple of tuple of str
        For each correction its names, and that of the marker that it splits off, as later corrections rename and merge
        them.

    Examples
    --------
    >>> names_after([Correction("confirm", ("M001",)), Correction("rename", ("M001",), value="LKNE")])
    (('LKNE',), ('LKNE',))
    """
    called: dict[str, str] = {}
    found = []
    for one in reversed(corrections):
        own = (*one.names, one.value) if one.kind == "split" else one.names
        if one.kind == "rename":
            called[one.names[0]] = called.pop(one.value, one.value)
        elif one.kind == "merge":
            called |= dict.fromkeys(one.names[1:], called.get(one.names[0], one.names[0]))
        found.append(tuple(called.get(name, name) for name in own))
    return tuple(found[::-1])


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
        The statement holds for the point's track from `frame` to this frame. None: for the whole track, as far as
        nothing else is stated of it.
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
        """Whether the statement is that the point is no marker."""
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
        entries = tuple(self.entries) if isinstance(self.entries, Iterable) else (self.entries,)
        if not all(isinstance(entry, Identity) for entry in entries):
            raise InputError("identities are made of statements: Identities((Identity('LFHD', frame=0, point=3),))")
        object.__setattr__(self, "entries", entries)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the markers, in the order in which they are first stated."""
        return tuple(dict.fromkeys(entry.name for entry in self.entries if not entry.is_nobody))

    def error(self, entry: Identity, what: str) -> SkelgenError:
        """Return the error that names the file and line of a statement.

        Parameters
        ----------
        entry : Identity
            The statement.
        what : str
            What is wrong with it.
        """
        if self.source and entry.line:
            return FormatError(self.source, entry.line, f"{entry.name}: {what}")
        return InputError(f"identity of {entry.name} in frame {entry.frame}: {what}")
