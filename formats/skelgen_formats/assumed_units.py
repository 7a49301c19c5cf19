"""The unit of length of positions for which no file names one, by their size, and what else they may be.

Coordinates of a capture in metres lie within a room, those in millimetres hardly ever do. What decides is said to the
user, with the size of what was captured, and with a doubt where that would be a person's in centimetres, or where
positions look as if they were made of images.
"""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from skelgen.errors import FormatError
from skelgen.model.arrays import Floats
from skelgen_formats.markers import frames_in_blocks, mm_of_unit, mm_per_unit
from skelgen_formats.options import AUTO, MM_PER_UNIT

_HUMAN_SIZE_M = 50.0  # all coordinates of a capture in metres lie below this, of one in mm hardly ever
_LOOKED_AT = 200  # frames that tell how large is what was captured
_PERSON = (0.5, 3.0)  # m, from end to end
_FLAT = 0.01  # of the largest coordinates along x and y: depths that are none
_VISIBILITY = re.compile(r"(?:.*[_ .])?vis(?:ibility)?(?:[_ .]?\d+)?", re.IGNORECASE)
_FEW = 0.1  # of the coordinates in an image that lie out of it, left or above
_FRACTIONS = (
    "fractions of an image, as MediaPipe's landmarks, are no positions; if they are that, give its world landmarks,"
    " in metres"
)
_FEWEST_PIXELS, _LEAST_SPAN = 50.0, 0.1  # the largest coordinate in an image; span of what fills a part of it


def mm_per_recorded_unit(
    path: Path, place: str | int, unit: str, positions: Floats, stated: str, notices: list[str]
) -> float:
    """Return how many mm the unit of positions has: as the file names it, else as the user states, else by size.

    Parameters
    ----------
    path : Path
        The file, for errors.
    place : str or int
        Line, or another place in it, for errors.
    unit : str
        What the file says, or empty.
    positions : ndarray, shape (n_frames, n_markers, 3)
        In the file's unit; NaN where unseen.
    stated : str
        By the user: one of `RECORDED_UNIT`.
    notices : list of str
        Gets sentences if it is assumed, or the user states another than the file.
    """
    if not unit:
        return assumed_mm_per_unit(positions, notices, stated)
    if mm_of_unit(unit) is None:
        what = f"the length unit {unit.strip()[:20]!r} is none that is known"
        if stated == AUTO:
            raise FormatError(path, place, f"{what}, as mm, cm, m, inches and feet are; `--recorded-unit` states one")
        notices.append(f"{what}; {stated} is taken, as stated")
        return MM_PER_UNIT[stated]
    factor = mm_per_unit(path, place, unit)
    if stated != AUTO and MM_PER_UNIT[stated] != factor:
        named = f"the file names its length unit, {unit.strip()}, which is taken"
        notices.append(f"{named}; `--recorded-unit {stated}` is for files that name none")
    return factor


def assumed_mm_per_unit(positions: Floats, notices: list[str], stated: str = AUTO) -> float:
    """Return how many mm the unit of positions has that no file names: as stated, else metres for a room, or mm.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3)
        In the file's unit; NaN where unseen.
    notices : list of str
        Gets sentences if it is assumed.
    stated : str
        By the user: one of `RECORDED_UNIT`.
    """
    if stated != AUTO:
        return MM_PER_UNIT[stated]
    far = max((float(np.nanmax(np.abs(block), initial=0.0)) for _, block in frames_in_blocks(positions)), default=0.0)
    unit = "m" if far < _HUMAN_SIZE_M else "mm"
    span = _span(_some(positions))
    size = f"; the points of a frame then span {span * MM_PER_UNIT[unit] / 1e3:.3g} m" if span else ""
    in_cm = span * MM_PER_UNIT["cm"] / 1e3
    if unit == "mm" and _PERSON[0] <= in_cm <= _PERSON[1]:
        size += f" ({in_cm:.3g} m, as people do, if this is cm)"
    assumed = f"the file names no length unit; {unit} is assumed since coordinates reach {far:.3g}{size}"
    notices.append(f"{assumed}; `--recorded-unit` states another")
    return MM_PER_UNIT[unit]


def _span(positions: Floats) -> float:
    """Return the median over frames of how far points lie apart along an axis; 0 if none are seen."""
    if not positions.size:
        return 0.0
    with np.errstate(invalid="ignore", over="ignore"):
        spans = (np.fmax.reduce(positions, axis=1) - np.fmin.reduce(positions, axis=1)).max(axis=1)
    spans = spans[np.isfinite(spans)]
    return float(np.median(spans)) if len(spans) else 0.0


def notice_images(positions: Floats, notices: list[str]) -> None:
    """Say if positions look as if they were those in images: fractions of one, or pixels with hardly any depth.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3)
        In the file's unit, which it does not name; NaN where unseen.
    notices : list of str
        Gets a sentence.
    """
    some = _some(positions)
    points = some[np.isfinite(some).all(axis=2)]
    if not len(points):
        return
    across, depth = np.abs(points[:, :2]).max(), np.abs(points[:, 2]).max()
    if _span(some) > _LEAST_SPAN and points[:, :2].min() >= 0.0 and max(across, depth) <= 1.0:
        notices.append(f"x and y lie between 0 and 1: {_FRACTIONS}")
    elif 0.0 < depth < _FLAT * across and across > _FEWEST_PIXELS:
        notices.append("z is far smaller than x and y: pixels of an image are no positions; triangulate them first")


def notice_landmarks(titles: Sequence[str], positions: Floats, notices: list[str]) -> None:
    """Say if positions beside columns of visibility look like fractions of an image, some of them out of the picture.

    Parameters
    ----------
    titles : sequence of str
        Of the columns.
    positions : ndarray, shape (n_frames, n_markers, 3)
        In the file's unit, which it does not name; NaN where unseen. World landmarks are around (0, 0, 0).
    notices : list of str
        Gets a sentence.
    """
    across = _some(positions)[..., :2]
    across = across[np.isfinite(across)] if any(map(_VISIBILITY.fullmatch, titles)) else across[:0]
    is_told = any(_FRACTIONS in notice for notice in notices)
    if len(across) and not is_told and (across < 0.0).mean() < _FEW and np.median(across) < 1.0:
        notices.append(f"x and y beside columns of visibility are mostly between 0 and 1: {_FRACTIONS}")


def _some(positions: Floats) -> Floats:
    """Return frames from all over the take."""
    return positions[:: max(1, len(positions) // _LOOKED_AT)]
