"""The marker sets that people wear: each marker with its place on the body, from readable tables.

They are what stages look for in a take, and what simulated people wear. The tables, `tables/*.toml`, name their sources
and are read when they are first needed. What is wrong in them is a defect of the package, which its tests find.
"""

import tomllib
from dataclasses import dataclass
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from skelgen.model.arrays import Floats

MARKER_SETS = (
    *("plug-in-gait", "helen-hayes", "ior", "cast", "animation-41", "animation-53"),
    *("optitrack-37", "optitrack-41", "optitrack-50", "qualisys-42"),
)
"""Marker sets that people can wear."""

LABORATORY_SETS = ("cleveland-clinic", "cgm2-5", "human-body-model", "optitrack-biomech-57", "opencap")
"""More of them, with markers whose places differ between laboratories."""

EVERY_PLACE = "every place"
"""Markers at all places at once, which nobody wears: how places lie to each other is learned from it."""

_PALPATION, _LOOSE = 5.0, 25.0  # mm by which a marker misses its place, per coordinate

_FOLDER = Path(__file__).parent / "tables"


@cache
def read_table(name: str, folder: Path = _FOLDER) -> dict[str, Any]:
    """Return a table, by the name of its file.

    Parameters
    ----------
    name : str
        ``places``, ``marker_sets`` or ``laboratory_sets``, or a table of another folder.
    folder : Path
        Where it stands.
    """
    return tomllib.loads(folder.joinpath(f"{name}.toml").read_text(encoding="utf-8"))


@dataclass(frozen=True, eq=False)
class WornMarker:
    """One marker of a set, on a person of 1750 mm.

    Attributes
    ----------
    name, limb, place : str
        The marker, the limb that carries it, and the anatomical place without its side.
    offset : ndarray, shape (3,), mm
        Place in the limb's frame.
    plate : str
        What all markers of one stiff plate share; empty for a marker of its own.
    misplaced : float, mm
        Standard deviation of a coordinate from the place.
    """

    name: str
    limb: str
    place: str
    offset: Floats
    plate: str
    misplaced: float


@cache
def worn_markers(marker_set: str) -> tuple[WornMarker, ...]:
    """Return the markers of a set in `MARKER_SETS` or `LABORATORY_SETS`, in its order, or of `EVERY_PLACE`."""
    table = _every_place() if marker_set == EVERY_PLACE else _table_of(marker_set)
    plate_of = {name: plate[0] for plate in table.get("plates", ()) for name in plate}
    loose = {name for text in table.get("loose", ()) for name, _ in _of_both_sides(text, "")}
    segments = {place: name for name, places in read_table("places").items() for place in places}
    found = []
    for name, text in chain.from_iterable(_of_both_sides(*one) for one in table["markers"].items()):
        side, _, rest = text.partition(" ")
        place = rest if side in {"left", "right"} else text
        segment = segments[place]
        offset = np.array(read_table("places")[segment][place], dtype=np.float64)
        limb = segment if segment in {"pelvis", "chest", "head"} else f"{side} {segment}"
        offset[1] *= -1 if side == "right" else 1
        misplaced = _LOOSE if name in loose else _PALPATION
        found.append(WornMarker(name, limb, place, offset, plate_of.get(name, ""), misplaced))
    return tuple(found)


def _table_of(marker_set: str) -> dict[str, Any]:
    return dict(read_table("marker_sets" if marker_set in MARKER_SETS else "laboratory_sets")[marker_set])


def _every_place() -> dict[str, Any]:
    """A table of all places, as if they were a set; those that some set has its markers about are loose."""
    middle = {"pelvis", "chest", "head"}
    places = [
        place if segment in middle and not offset[1] else f"@ {place}"
        for segment, of_segment in read_table("places").items()
        for place, offset in of_segment.items()
    ]
    tables = [_table_of(name) for name in (*MARKER_SETS, *LABORATORY_SETS)]
    loose = {table["markers"][name] for table in tables for name in table.get("loose", ())}
    return {"markers": {place: place for place in places}, "loose": sorted(loose & {*places})}


def _of_both_sides(name: str, place: str) -> list[tuple[str, str]]:
    """Return a marker and its place, or those of both sides where `@` stands for them."""
    if "@" not in name:
        return [(name, place)]
    return [(name.replace("@", side[0].upper()), place.replace("@", side)) for side in ("left", "right")]


__all__ = ["EVERY_PLACE", "LABORATORY_SETS", "MARKER_SETS", "WornMarker", "read_table", "worn_markers"]
