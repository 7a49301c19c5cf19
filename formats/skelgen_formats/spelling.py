"""Titles of columns as few scripts write them, and how they are read: `skelgen_formats.titles` tells the usual form."""

import contextlib
import math
import re
from collections.abc import Sequence
from functools import lru_cache

from skelgen_formats.turn_titles import AXES, BETWEEN, COMPONENTS

LENGTH = r"(?:mm|cm|m|(?:milli|centi)?met(?:er|re)s?|inch(?:es)?|ft|feet|(?<=[\[(])in)"
"""A unit of length, in a regular expression."""

PLACE_WORD = (
    rf"(?:(?:local|global|world){BETWEEN}?)?"
    rf"(?:posi?|position|trans|translation|loc|location|tvec|coord|coords|coordinate){BETWEEN}?"
)
"""A word for a place, in a regular expression."""

_AXIS_WORD = r"axis|coord(?:inate)?|pos(?:ition|\.)?|koordinate|achse|座標|坐标|좌표"
_AXIS_WORD_BEFORE = rf"(?:world|global|axis|coordonn[ée]e|coordenada|coordinata|koordinate){BETWEEN}"
_VERSION = r"3d|filt\w*|smooth\w*|interp\w*|raw|mean|avg|val(?:ue)?|est\w*|true|gt|world|global|lab"
OF_VERSION = re.compile(rf"(.+{BETWEEN}[xyz])(?:{BETWEEN}(?:{_VERSION})|3d)", re.IGNORECASE)
"""A title of a version of a coordinate, such as knee_x_raw, of which another may stand beside it."""

_TURN = "quat|quaternion|rot|rotation|orientation|euler"
_RW = re.compile(rf"((?:.+{BETWEEN})?)r([wxyz])", re.IGNORECASE)  # components of a quaternion, if one is w
_POSE, _AGAIN = "xyzxyzw", re.compile(r"[wxyz]\.\d+", re.IGNORECASE)  # pandas writes x.1 for the second x
_UNIT_TOLERANCE = 0.1  # of the length of a quaternion, which may be printed with one digit
_NO_NAME = rf"(?:{LENGTH}|std\w*|err\w*|{_VERSION})"
_SPELT = (
    # p_RS_R_x [m], q_RS_w [] of EuRoC
    (re.compile(r"([pq])(?:_[A-Z]{1,3}){1,3}_([wxyz](?: \[m\])?)(?: \[\])?"), r"\1_\2"),
    (
        re.compile(
            rf"(?:{PLACE_WORD}|{_AXIS_WORD_BEFORE})([xyz]){BETWEEN}(?!{_NO_NAME}$)(\w.{{0,200}})", re.IGNORECASE
        ),
        r"\2_\1",
    ),  # Pos_X_knee
    (re.compile(rf"(.*?(?<![a-z])[xyz])[-_ ]?(?:{_AXIS_WORD})(\W.*)?", re.IGNORECASE), r"\1\2"),
    (OF_VERSION, r"\1"),
    (re.compile(rf"(.+{BETWEEN}[xyz]){BETWEEN}(?:{_VERSION}){BETWEEN}(mm|cm|m)", re.IGNORECASE), r"\1 [\2]"),
    (re.compile(rf"(.+{BETWEEN}[xyz](?: ?[\[(]{LENGTH}[\])])?) ?[\[(](?:{_VERSION})[\])]", re.IGNORECASE), r"\1"),
    (re.compile(r"(.+)\[['\"]?([xyz])['\"]?\]", re.IGNORECASE), r"\1_\2"),  # knee['x']
    (re.compile(rf"(.+{BETWEEN})([xyz]){BETWEEN}(l|r|left|right)", re.IGNORECASE), r"\1\3_\2"),  # knee_x_L
    *(
        (re.compile(rf"((?:.*{BETWEEN})?[tr]vec)[_ ]?[\[(]?{n}[\])]?", re.IGNORECASE), rf"\1_{axis}")
        for n, axis in enumerate(AXES)
    ),
    (re.compile(rf"([tr]vec){BETWEEN}?(\w{{0,200}}?\d){BETWEEN}([xyz])", re.IGNORECASE), r"\2_\1_\3"),  # tvec_4_x
    (re.compile(r"(.+?) ?\[[#-]?\]"), r"\1"),  # Sensor 1 Q0 []
    (re.compile(rf"(.+{BETWEEN}[xyz]) ?\((?:ap|ml|v|si|is|pd|lat|vert|up)\)", re.IGNORECASE), r"\1"),  # knee_X(AP)
    (re.compile(rf"(.+?) ?[\[(]({LENGTH})[\])]({BETWEEN}[xyz])", re.IGNORECASE), r"\1\3 [\2]"),  # knee_pos[m]_x
    (re.compile(rf"([xyz]) ?[\[(]({LENGTH})[\])]{BETWEEN}(.+)", re.IGNORECASE), r"\3_\1 [\2]"),  # X [mm] knee
    # tx_left_wrist_device of Aria, Tx(knee)
    (re.compile(r"([tp][xyz])[_.(]([a-z]\w{1,200})\)?", re.IGNORECASE), r"\2_\1"),
    (re.compile(r"([xyz]) of (.+)", re.IGNORECASE), r"\2_\1"),
    (re.compile(rf"([xyz]){BETWEEN}(.+)_(mm|cm)", re.IGNORECASE), r"\2_\1 [\3]"),  # X_knee_mm
    (re.compile(rf"([wxyz]){BETWEEN}(rotation|orientation)(\W.*)?", re.IGNORECASE), r"\2_\1\3"),
    (re.compile(rf"(roll|pitch|yaw){BETWEEN}(?!deg|rad|rate|vel|acc|angle)(.+)", re.IGNORECASE), r"\2_\1"),
    (re.compile(rf"({_TURN}){BETWEEN}?([wxyz]){BETWEEN}(.+)", re.IGNORECASE), r"\3_\1_\2"),  # quat_w_knee
    (re.compile(rf"(.+{BETWEEN})([wxyz]){BETWEEN}?({_TURN})", re.IGNORECASE), r"\1\3_\2"),  # knee_wquat
    (re.compile(rf"(quat|quaternion|euler){BETWEEN}(.+){BETWEEN}([wxyz])", re.IGNORECASE), r"\2_\1_\3"),
)
"""What stands around an axis in other spellings, and how such titles are read."""

_PARTS = re.compile(r"[^(,)' ]+")  # of ('knee', 'x'), as pandas writes titles of several levels
_DIRECTIONS = (
    ("a/?p", "m/?l", "vt?|vert|s/?i|i/?s|p/?d|c/?c"),
    ("forwards?|fwd", "left", "up"),
    ("right", "forwards?|fwd", "up"),
    ("east", "north", "up"),
    ("north", "east", "down"),
)
"""Words for x, y and z, right-handed where they tell it: anatomical ones, those of vehicles and of maps."""


def spelt(titles: Sequence[str]) -> list[str]:
    """Return titles in the usual spelling, but those that there are in it already: knee_x_raw beside knee_x.

    Parameters
    ----------
    titles : sequence of str
        Of the columns, without quotes.
    """
    return [*_spelt(tuple(titles))]


@lru_cache(maxsize=16)  # reading a table asks for the same titles several times
def _spelt(titles: tuple[str, ...]) -> tuple[str, ...]:
    plain: list[str] = []
    lower = [*map(str.lower, titles)]
    whole = ("_".join(filter(None, _PARTS.findall(one))) if one.startswith("(") else one for one in titles)
    stripped = _with_quaternions(with_letters([*map(str.strip, whole)]))
    if any((match := _RW.fullmatch(one)) and match[2].lower() == "w" for one in stripped):
        stripped = [_RW.sub(r"\1q\2", one) if _RW.fullmatch(one) else one for one in stripped]
    for title in stripped:
        other = next((match.expand(usual) for one, usual in _SPELT if (match := one.fullmatch(title))), title)
        is_second = other != title and other in plain and titles.count(title) == 1
        # or a torque, tx_plate beside fx_plate
        beside = is_second or other in titles or f"f{title[1:]}".lower() in lower
        plain.append(title if beside else other)
    return tuple(plain)


def _with_quaternions(titles: list[str]) -> list[str]:
    """Return titles with qx to qw for x, y, z, w right behind x, y, z, as messages of ROS without their paths have."""
    found, plain = [*titles], _plain(titles)
    starts = [at for at in range(len(plain)) if plain[at : at + len(_POSE)] == [*_POSE]]
    if [title for title in plain if title in {*_POSE}] != [*_POSE] * len(starts):  # other points, or quaternions first
        return titles
    for count, at in enumerate(starts):
        name = f"{count + 1}_" * (len(starts) > 1)
        found[at : at + len(_POSE)] = [*(f"{name}{axis}" for axis in AXES), *(f"{name}q{one}" for one in _POSE[3:])]
    return found


def _plain(titles: Sequence[str]) -> list[str]:
    return [title.lower().rpartition(".")[0] if _AGAIN.fullmatch(title) else title.lower() for title in titles]


def with_lone_weight(titles: Sequence[str], rows: Sequence[Sequence[str]], names: Sequence[str] = ()) -> list[str]:
    """Return titles with `weight` for the w of x, y, z, x, y, z, w where the last four are no unit quaternion.

    Parameters
    ----------
    titles : sequence of str
        Of the columns, without quotes.
    rows : sequence of sequences of str
        Cells below them, as many as there are.
    names : sequence of str
        Above them, if there are any; other ones over the second x, y, z show that it is another point.
    """
    plain = _plain(titles)
    columns = [at for at, title in enumerate(plain) if title in {*COMPONENTS}]
    if [plain[at] for at in columns] != [*_POSE]:
        return [*titles]
    first, second = ([names[at] for at in some if at < len(names)] for some in (columns[:3], columns[3:6]))
    fours = []
    for row in rows:
        with contextlib.suppress(ValueError, IndexError):
            fours.append([float(row[at].replace(",", ".")) for at in columns[3:]])
    is_other = any(second) and any(first) and not {*filter(None, second)} <= {*first}
    lengths = [math.hypot(*four) for four in fours if len({*four}) > 1]  # -1 four times is a body that is lost
    known = [abs(one - 1.0) < _UNIT_TOLERANCE for one in lengths if not math.isnan(one)]
    is_turn = not is_other and 2 * sum(known) >= len(known)
    return [*titles] if is_turn else ["weight" if at == columns[-1] else title for at, title in enumerate(titles)]


def with_letters(titles: Sequence[str]) -> list[str]:
    """Return titles with x, y and z for directions in words, knee_AP, knee_ML, knee_V, if there are as many of each.

    Parameters
    ----------
    titles : sequence of str
        Of the columns, without quotes.
    """
    for words in _DIRECTIONS:
        word = "|".join(f"({one})" for one in words)
        found = [re.fullmatch(rf"(.+{BETWEEN})?(?:{word})(\W.*)?", title, re.IGNORECASE) for title in titles]
        axes = [
            "".join(axis for axis, one in zip(AXES, match.groups()[1:4], strict=True) if one) if match else ""
            for match in found
        ]
        if len({axes.count(axis) for axis in AXES}) == 1 and AXES[0] in axes:
            return [
                f"{match[1] or ''}{axis}{match[5] or ''}" if match else title
                for title, match, axis in zip(titles, found, axes, strict=True)
            ]
    return [*titles]
