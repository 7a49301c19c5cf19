"""A person: the simulated human in somebody's size and proportions, with toes, and a marker set on the body.

The places of markers are anatomical (``tables/places.toml``); whoever sticks them on misses each by some mm (Della
Croce et al., Gait & Posture 21 (2005) 226-237), and so do we.
"""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from skelgen.errors import InputError
from skelgen.model.arrays import Floats, Ints
from skelgen.simulation.articulated import Attachment, Capsule, LimbModel, Structure, Swing, limb, resized, unit
from skelgen.simulation.people.tables import tissue_factor_at, worn_markers
from skelgen.simulation.structures import SIDES, human

HEIGHT = 1750.0
"""Height [mm] of the body that the tables describe."""

HEIGHTS = (1000.0, 2300.0)
"""Smallest and largest person [mm]."""

_MEAN_HEIGHT, _HEIGHT_SPREAD, _USUAL = 1720.0, 95.0, (1500.0, 2000.0)  # mm, of adults
_PROPORTIONS = 0.03  # one standard deviation of the logarithm of lengths against the height
_GIRTH = 0.06  # the same of widths
_LEGS = 890.0  # mm from the ground to the hips
_NO_MARKERS = np.empty((0, 3))
_SOLE = ((-50.0, 0.0, -65.0), (118.0, -38.0, -65.0), (98.0, 42.0, -65.0))  # mm: heel and ball in the foot's frame
_TOE = ((62.0, -8.0, -20.0),)  # mm, in the toes' frame


@dataclass(frozen=True, eq=False)
class Person:
    """A body with and without a marker set.

    Attributes
    ----------
    body : Structure
        All limbs, without markers.
    worn : Structure
        Those limbs that carry markers or lead to such: hands and toes that carry none are left out.
    limbs : ndarray of intp, shape (n_worn_limbs,)
        Place of each of these in `body`.
    tissue_factors : ndarray, shape (n_markers,)
        Factor on soft-tissue motion at each marker's place.
    plates : tuple of str, length n_markers
        What markers of one stiff plate share; empty for others.
    contacts : dict of str to ndarray, shape (n_points, 3), mm
        Points of feet and toes that touch the ground, in the limbs' frames.
    """

    body: Structure
    worn: Structure
    limbs: Ints
    tissue_factors: Floats
    plates: tuple[str, ...]
    contacts: dict[str, Floats]


def person(marker_set: str, height: float, rng: np.random.Generator, placed: float = 0.0) -> Person:
    """Make up a person who wears a marker set.

    Parameters
    ----------
    marker_set : str
        One of `MARKER_SETS` or `LABORATORY_SETS`.
    height : float, mm
        Body height; 0 for one that is drawn.
    rng : numpy.random.Generator
        Source of height, proportions and of what the markers miss their places by.
    placed : float, mm
        Least standard deviation of a coordinate by which they do.

    Raises
    ------
    InputError
        If the set leaves a limb between two marked ones without a marker.
    """
    drawn = np.clip(rng.normal(_MEAN_HEIGHT, _HEIGHT_SPREAD), *_USUAL)
    scales = _scales((height or drawn) / HEIGHT, rng)
    body = resized(Structure(marker_set, tuple(_unmarked_limbs())), scales)
    markers = worn_markers(marker_set)
    missed = np.array([[max(one.misplaced, placed)] for one in markers]) * rng.normal(size=(len(markers), 3))
    worn, kept, order = _dressed(body, marker_set, scales, missed)
    tissue_factors = np.array([tissue_factor_at(markers[index].place) for index in order])
    plates = tuple(markers[index].plate for index in order)
    return Person(body, worn, np.array(kept, dtype=np.intp), tissue_factors, plates, _contacts(scales))


@cache
def usual_person(marker_set: str) -> Structure:
    """Return somebody of usual proportions, `HEIGHT` tall, whose markers of a set are stuck where they belong."""
    body = Structure(marker_set, tuple(_unmarked_limbs()))
    same = dict.fromkeys(body.limb_names, np.ones(3))
    return _dressed(body, marker_set, same, np.zeros((len(worn_markers(marker_set)), 3)))[0]


def _dressed(
    body: Structure, marker_set: str, scales: dict[str, Floats], missed: Floats
) -> tuple[Structure, list[int], list[int]]:
    """Put the markers of a set on a body; also return the limbs that are left, and the order of the markers."""
    markers, limbs, order = worn_markers(marker_set), [], []
    for one in body.limbs:
        mine = [index for index, marker in enumerate(markers) if marker.limb == one.name]
        places = [scales[one.name] * markers[index].offset + missed[index] for index in mine]
        names = tuple(markers[index].name for index in mine)
        limbs.append(replace(one, markers=np.array(places).reshape(-1, 3), marker_names=names))
        order += mine
    kept = _marked(limbs)
    return Structure(marker_set, tuple(limbs[index] for index in kept)), kept, order


def _unmarked_limbs() -> list[LimbModel]:
    """The simulated human with forearms that pronate, and with toes."""
    limbs = [replace(one, markers=_NO_MARKERS) for one in human().limbs]
    for index, one in enumerate(limbs):
        if one.name.endswith("forearm"):
            s = SIDES[one.name.split()[0]]
            flexing = one.axes[0]
            pronating = unit(np.array([0.0, 0.0, -s]) + s * flexing[2] * flexing)
            axes, amplitudes, offsets = np.stack([flexing, pronating]), np.array([50.0, 40.0]), np.array([60.0, 20.0])
            limbs[index] = replace(one, kind="universal", axes=axes, amplitudes=amplitudes, offsets=offsets)
    for side in SIDES:
        joint = Attachment(f"{side} foot", "hinge", (130, 0, -45), Swing((20,), (15,), [(0, -1, 0)]))
        limbs.append(replace(limb(f"{side} toes", joint, Capsule((60, 0, -5), 14), 2), markers=_NO_MARKERS))
    return limbs


def _scales(height: float, rng: np.random.Generator) -> dict[str, Floats]:
    """Factors along x, y and z of every limb's frame; legs and trunk together keep the height."""
    leg, arm, foot = np.exp(_PROPORTIONS * rng.normal(size=3))
    girth = np.exp(_GIRTH * rng.normal())
    trunk = (HEIGHT - _LEGS * leg) / (HEIGHT - _LEGS)
    along = {"pelvis": trunk, "chest": trunk, "head": trunk, "upper arm": arm, "forearm": arm, "hand": arm}
    along |= {"thigh": leg, "shank": leg}
    scales = {segment: height * np.array([girth, girth, length]) for segment, length in along.items()}
    scales["head"] = height * np.array([1.0, 1.0, trunk])
    scales["foot"] = scales["toes"] = height * np.array([foot, foot, leg])
    return {one.name: scales[_segment(one.name)] for one in _unmarked_limbs()}


def _segment(limb_name: str) -> str:
    return limb_name.removeprefix("left ").removeprefix("right ")


def _marked(limbs: list[LimbModel]) -> list[int]:
    """Places of the limbs that are left when ends without markers are removed, again and again."""
    kept = list(range(len(limbs)))
    for index in reversed(range(len(limbs))):
        if not len(limbs[index].markers) and limbs[index].name not in {limbs[other].parent for other in kept}:
            kept.remove(index)
    for index in kept:
        if not len(limbs[index].markers):
            raise InputError(f"the marker set has no marker on the {limbs[index].name}, but has some beyond it")
    return kept


def _contacts(scales: dict[str, Floats]) -> dict[str, Floats]:
    found = {}
    for side, s in SIDES.items():
        mirror = np.array([1.0, s, 1.0])
        found[f"{side} foot"] = np.array(_SOLE) * mirror * scales[f"{side} foot"]
        found[f"{side} toes"] = np.array(_TOE) * mirror * scales[f"{side} toes"]
    return found
