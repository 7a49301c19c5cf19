"""Titles of columns with rotations: components of a quaternion, angles, cells of a matrix; `titles` shows them."""

import re
from collections import Counter
from collections.abc import Sequence
from functools import lru_cache

from skelgen_formats.options import ROTATION_VECTOR

AXES = "xyz"
COMPONENTS = "wxyz"
"""Of a unit quaternion, scalar first."""

BETWEEN = r"[ _.:/|>-]"
"""What stands between the name of a point and its axis, in a regular expression."""

_TURN_WORD = (
    rf"(?:(?:(?:quat|quaternion)(?:_wxyz|_xyzw)?|rot|rotation|ori|orient|orientation|att|attitude){BETWEEN}?){{1,2}}"
)
_QUATERNION = re.compile(
    rf"(?:(.{{1,200}}?){BETWEEN})??(?:q{BETWEEN}?([wxyz0-3])|{_TURN_WORD}q?([wxyz0]))", re.IGNORECASE
)
_QUATERNION_IN_NAME = re.compile(rf"(.{{1,200}}?)(?:Rot|Rotation|Quat|Quaternion|Orientation|Q){BETWEEN}?([WXYZwxyz])")
_QUATERNION_FIRST = re.compile(rf"q([wxyzo0]){BETWEEN}?(.{{1,200}})", re.IGNORECASE)
_ANGLE_UNIT = re.compile(r"(.+?)(?: ?/ ?|[ _]?[\[(]?)(deg|rad|°)(?:s|rees?|ians?)?[\])]?", re.IGNORECASE)
_NAVIGATED = re.compile(rf"(?:(.{{1,200}}?){BETWEEN}?)??(?:(?<![a-z])(?:{_TURN_WORD}))?(roll|pitch|yaw)", re.IGNORECASE)
_ABOUT_AXIS = re.compile(
    rf"(?:(.{{1,200}}?){BETWEEN})??(?:(?:{_TURN_WORD})?(?:euler(?:{BETWEEN}?angles?)?|rotvec|rvec)|{_TURN_WORD}|r){BETWEEN}?([xyz])",
    re.IGNORECASE,
)
_MATRIX_WORD = "rot|rotation|mat|matrix|rotmat|dcm"
_MATRIX = re.compile(
    rf"(?:(.{{1,200}}?){BETWEEN})??(?:(?:r|m|{_MATRIX_WORD}){BETWEEN}?[\[(]?([0-4])(?:\]\[|[ ,])?([0-4])[\])]?"
    rf"|(?:{_MATRIX_WORD}){BETWEEN}([0-3]){BETWEEN}([0-3])"
    rf"|(?-i:Rot)\[([0-8])\]|(?:{_MATRIX_WORD}|r(?=[\[(])){BETWEEN}?[\[(]?([0-9])[\])]?)",
    re.IGNORECASE,
)
_NUMBERED = re.compile(
    rf"(?:(.{{1,200}}?){BETWEEN})??(?:quat|quaternion|rot|rotation|ori|orientation)[_ .-]?[\[(]?([0-4])[\])]?",
    re.IGNORECASE,
)
_SURE_ANGLE = re.compile("euler|rotvec|rvec", re.IGNORECASE)
_ROLL_PITCH_YAW = {"roll": "x", "pitch": "y", "yaw": "z"}
_TITLES = 1000  # of a table, each of which several readers look at several times
_UNITY_ORDER = "yxz"
_NAVIGATION_ORDER = "zyx"  # what most mean by roll, pitch, yaw, in whichever order they stand


def component_alone(title: str) -> str:
    """Return the component, w, x, y or z, of a quaternion whose title has no name, such as ``qx``; else an empty text.

    Parameters
    ----------
    title : str
        Without quotes.
    """
    name, component = quaternion_of(title) or ("", "")
    return "" if name else component


def angle_alone(title: str) -> tuple[str, str, str] | None:
    """Return axis, order and unit of a title of an angle without a name, such as ``roll`` or ``Rx [deg]``, or None.

    The order is empty where the columns tell it, the unit where the title names none.

    Parameters
    ----------
    title : str
        Without quotes.
    """
    match = _ABOUT_AXIS.fullmatch(title.strip())
    found = angle_of(title) or (("", match[2].lower(), "") if match and not match[1] else None)
    return (found[1], order_by_words(title), found[2]) if found and not found[0] else None


@lru_cache(maxsize=_TITLES)
def angle_of(title: str) -> tuple[str, str, str] | None:
    """Return name, axis and unit of a title that is surely one of an angle, or None.

    Parameters
    ----------
    title : str
        Without quotes.
    """
    named = _ANGLE_UNIT.fullmatch(title.strip())
    text, unit = (named[1], named[2].lower().replace("°", "deg")) if named else (title.strip(), "")
    if match := _NAVIGATED.fullmatch(text):
        return match[1] or "", _ROLL_PITCH_YAW[match[2].lower()], unit
    match = _ABOUT_AXIS.fullmatch(text)
    is_sure = match is not None and (unit or _SURE_ANGLE.search(text))
    return (match[1] or "", match[2].lower(), unit) if match and is_sure else None


def order_by_words(title: str) -> str:
    """Return how an angle turns a body by the usual meaning of its title, empty if the columns tell.

    Parameters
    ----------
    title : str
        Without quotes.
    """
    if re.search("rotvec|rvec", title, re.IGNORECASE):
        return ROTATION_VECTOR
    if "eulerangles" in title.lower():
        return _UNITY_ORDER
    return _NAVIGATION_ORDER if re.search("roll|pitch|yaw", title, re.IGNORECASE) else ""


@lru_cache(maxsize=_TITLES)
def cell_of(title: str) -> tuple[str, str] | None:
    """Return the name, and row and column such as ``12``, or the number, of a title of a matrix's cell, or None.

    Parameters
    ----------
    title : str
        Without quotes.
    """
    match = _MATRIX.fullmatch(title.strip())
    if match and match[6]:  # of Track Manager, column by column
        return match[1] or "", f"{int(match[6]) % 3}{int(match[6]) // 3}"
    return (match[1] or "", match[7] or f"{match[2] or match[4]}{match[3] or match[5]}") if match else None


@lru_cache(maxsize=_TITLES)
def quaternion_of(title: str) -> tuple[str, str] | None:
    """Return name and component of a title of a quaternion's component, or None.

    Parameters
    ----------
    title : str
        Without quotes.
    """
    text = title.strip()
    if cell_of(text):
        return None
    if match := _QUATERNION.fullmatch(text):
        component = (match[2] or match[3]).lower()
        return match[1] or "", COMPONENTS[int(component)] if component.isdigit() else component
    if match := _QUATERNION_IN_NAME.fullmatch(text):
        return match[1], match[2].lower()
    if match := _QUATERNION_FIRST.fullmatch(text):
        return match[2], match[1].lower().replace("0", "w").replace("o", "w")
    return None


def numbered_quaternions(titles: Sequence[str]) -> list[str]:
    """Return names of quaternions whose components have numbers, ``knee_quat_1`` to ``knee_quat_4``.

    Which of them is the scalar, no title says.

    Parameters
    ----------
    titles : sequence of str
        Of the columns, without quotes.
    """
    found = [(match[1] or "", match[2]) for match in map(_NUMBERED.fullmatch, map(str.strip, titles)) if match]
    count = Counter(name for name, _ in dict.fromkeys(found))
    return [name or "quaternion" for name, n in count.items() if n == len(COMPONENTS)]
