"""A person: the simulated human in somebody's size and proportions, with toes, a marker set, and soft tissue.

The places of markers are anatomical (`skelgen.marker_sets`); whoever sticks them on misses each by some mm (Della
Croce et al., Gait & Posture 21 (2005) 226-237), and so do we.

Skin follows the joints beside it, swings after impacts, and wanders. With q the rotation vectors of the joints of a
marker's limb and w a weight that falls with the distance from each,

    d = sum over joints of w (sqrt(s) C + sqrt(1 - s) O) q + x + slow wandering

where C is one random 3 x 3 matrix for all markers of the limb, O one for each that is alike for neighbours, s the
share that moves together, and x the answer of a damped spring to the limb's acceleration. That skin is linear in the
angles of both joints of a segment: Camomilla et al., J Biomech 46 (2013) 2216-2222; Bonci et al., J Biomech 47 (2014)
2354-2361.
"""

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from skelgen.errors import InputError
from skelgen.geometry.rotations import unit_vectors
from skelgen.marker_sets import read_table, worn_markers
from skelgen.model.arrays import Floats, Ints
from skelgen.simulation.articulated import Attachment, Capsule, LimbModel, Structure, Swing, limb, resized
from skelgen.simulation.motion import smooth_curves
from skelgen.simulation.structures import find_structure

SIDES = {"left": 1.0, "right": -1.0}
"""Sides of a body, and the sign of y there."""

TABLES = Path(__file__).parent / "tables"
"""Soft tissue and motions; the places of markers stand with the marker sets."""

HEIGHT = 1750.0
"""Height [mm] of the body that the tables describe."""

HEIGHTS = (1000.0, 2300.0)
"""Smallest and largest person [mm]."""

_MEAN_HEIGHT, _HEIGHT_SPREAD, _HEIGHT_RANGE = 1720.0, 95.0, (1500.0, 2000.0)  # mm, of adults
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
    drawn = np.clip(rng.normal(_MEAN_HEIGHT, _HEIGHT_SPREAD), *_HEIGHT_RANGE)
    scales = _scales((height or drawn) / HEIGHT, rng)
    body = resized(Structure(marker_set, tuple(_unmarked_limbs())), scales)
    markers = worn_markers(marker_set)
    missed = np.array([[max(one.misplaced, placed)] for one in markers]) * rng.normal(size=(len(markers), 3))
    worn, kept, order = _with_worn_markers(body, marker_set, scales, missed)
    tissue_factors = np.array([tissue_factor_at(markers[index].place) for index in order])
    plates = tuple(markers[index].plate for index in order)
    return Person(body, worn, np.array(kept, dtype=np.intp), tissue_factors, plates, _contacts(scales))


@cache
def usual_person(marker_set: str) -> Structure:
    """Return somebody of usual proportions, `HEIGHT` tall, whose markers of a set are stuck where they belong."""
    body = Structure(marker_set, tuple(_unmarked_limbs()))
    same = dict.fromkeys(body.limb_names, np.ones(3))
    return _with_worn_markers(body, marker_set, same, np.zeros((len(worn_markers(marker_set)), 3)))[0]


def _with_worn_markers(
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
    kept = _limbs_with_markers(limbs)
    return Structure(marker_set, tuple(limbs[index] for index in kept)), kept, order


def _unmarked_limbs() -> list[LimbModel]:
    """The simulated human with forearms that pronate, and with toes."""
    limbs = [replace(one, markers=_NO_MARKERS) for one in find_structure("human").limbs]
    for index, one in enumerate(limbs):
        if one.name.endswith("forearm"):
            s = SIDES[one.name.split()[0]]
            flexing = one.axes[0]
            pronating = unit_vectors(np.array([0.0, 0.0, -s]) + s * flexing[2] * flexing)
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
    return {one.name: scales[one.name.removeprefix("left ").removeprefix("right ")] for one in _unmarked_limbs()}


def _limbs_with_markers(limbs: list[LimbModel]) -> list[int]:
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


MEASURED_AT = np.deg2rad(60.0)
"""Angle [rad] of a joint for which the tables state displacements."""

_REACH = 200.0  # mm from a joint at which skin follows it half as far
_NEIGHBOURS = 80.0  # mm within which markers move alike
_YIELDING = 2 * MEASURED_AT  # beyond this angle skin is stretched, and follows less
_BETWEEN_PEOPLE = 0.25  # one standard deviation of the logarithm of amplitudes
_OWN_SWING = 0.3  # one standard deviation of how much more or less than its neighbours a marker swings
_WANDERING = (0.1, 0.5)  # Hz: breathing, belts
_CURVES = 0.42  # root mean square of smooth curves within -1 .. 1


@dataclass(frozen=True)
class SoftTissue:
    """What soft tissue of a segment does to its markers; see ``tables/soft_tissue.toml``.

    Attributes
    ----------
    joint : float, mm
        Displacement of a marker beside a joint that turns by 60 deg, root mean square.
    together : float
        Part of the squared displacement that all markers of the segment share.
    frequency : float, Hz
        Of its free vibration.
    damping : float
        Of that vibration, of the critical one.
    wander : float, mm
        Root mean square of slow motion without cause.
    """

    joint: float
    together: float
    frequency: float
    damping: float
    wander: float


def tissue_of(limb: str) -> SoftTissue:
    """Return the soft tissue of a limb by its name, e.g. ``left thigh`` or ``LeftUpLeg``."""
    rows = read_table("soft_tissue", TABLES)["segments"]
    row = next(row for row in rows if any(word in limb.lower() for word in row["words"]))
    return SoftTissue(row["joint"], row["together"], row["frequency"], row["damping"], row["wander"])


def tissue_factor_at(place: str) -> float:
    """Return by which factor soft tissue moves a marker more at a place than elsewhere on its segment."""
    return float(read_table("soft_tissue", TABLES)["places"].get(place, 1.0))


def realistic_soft_tissue(
    structure: Structure,
    world_from_limb: Floats,
    angles: list[Floats],
    rate: float,
    rng: np.random.Generator,
    person: Person | None = None,
) -> Floats:
    """Return the displacement of each marker by soft tissue [mm], in the world, shape (n_frames, n_markers, 3).

    Parameters
    ----------
    structure : Structure
        Markers and limbs; names of limbs tell their tissue (``tables/soft_tissue.toml``).
    world_from_limb : ndarray, shape (n_frames, n_limbs, 4, 4), translations in mm
        Poses of the limbs.
    angles : list of ndarray, shape (n_frames, n_angles), rad
        Joint angles of every limb; all 0 where nothing is displaced.
    rate : float, Hz
        Frame rate.
    rng : numpy.random.Generator
        Source of amplitudes and directions.
    person : Person, optional
        Who wears the markers: how far each slides, and which sit on one stiff plate. All slide alike if left out.
    """
    n_frames, n_markers = len(world_from_limb), structure.n_markers
    factors, plates = (person.tissue_factors, person.plates) if person else (np.ones(n_markers), ("",) * n_markers)
    between = np.exp(_BETWEEN_PEOPLE * rng.normal())
    displaced = np.zeros((n_frames, n_markers, 3))
    for index, model in enumerate(structure.limbs):
        markers = np.flatnonzero(structure.limb_of_marker == index)
        if not len(markers):
            continue
        soft_tissue = _soft_tissue_of(model, [plates[marker] for marker in markers])
        local = _following(structure, index, angles, soft_tissue, rng) + _wandering(n_frames, rate, soft_tissue, rng)
        turned = local @ world_from_limb[:, index, :3, :3].swapaxes(-1, -2)
        swings = 1 + _OWN_SWING * soft_tissue.alike @ rng.normal(size=len(markers))
        centre = world_from_limb[:, index, :3, :3] @ model.markers.mean(axis=0) + world_from_limb[:, index, :3, 3]
        turned += np.maximum(swings, 0.0)[:, np.newaxis] * _swinging(centre, rate, soft_tissue.tissue)[:, np.newaxis]
        displaced[:, markers] = between * factors[markers][:, np.newaxis] * turned
    return displaced


@dataclass(frozen=True, eq=False)
class _SoftTissue:
    """The soft tissue under the markers of a limb.

    `places`, shape (n_markers, 3) [mm], are where it carries them: of a stiff plate, its middle. The matrix `alike`
    turns independent numbers of the markers into ones that neighbours share, each of variance 1.
    """

    tissue: SoftTissue
    places: Floats
    alike: Floats


def _soft_tissue_of(model: LimbModel, plates: list[str]) -> _SoftTissue:
    places = model.markers.copy()
    for plate in {plate for plate in plates if plate}:
        members = [index for index, name in enumerate(plates) if name == plate]
        places[members] = model.markers[members].mean(axis=0)
    apart = np.linalg.norm(places[:, np.newaxis] - places, axis=2)
    values, vectors = np.linalg.eigh(np.exp(-0.5 * (apart / _NEIGHBOURS) ** 2))
    return _SoftTissue(tissue_of(model.name), places, vectors * np.sqrt(np.maximum(values, 0.0)) @ vectors.T)


def _following(
    structure: Structure, limb: int, angles: list[Floats], soft_tissue: _SoftTissue, rng: np.random.Generator
) -> Floats:
    """Displacements [mm] in the limb's frame that follow its joints, shape (n_frames, n_markers, 3)."""
    places, tissue = soft_tissue.places, soft_tissue.tissue
    found = np.zeros((len(angles[0]), len(places), 3))
    for joint, centre in _joints_of(structure, limb):
        turn = angles[joint] @ structure.limbs[joint].axes
        size = np.linalg.norm(turn, axis=1, keepdims=True)
        felt = turn / MEASURED_AT * np.sqrt(1.25 / (1 + (size / _YIELDING) ** 2))
        near = 1 / (1 + (np.linalg.norm(places - centre, axis=1) / _REACH) ** 2)
        shared, own = (
            rng.normal(size=(3, 3)),
            np.einsum("mn,nij->mij", soft_tissue.alike, rng.normal(size=(len(places), 3, 3))),
        )
        gains = np.sqrt(tissue.together) * shared + np.sqrt(1 - tissue.together) * own
        gains *= tissue.joint / np.sqrt(3) * near[:, np.newaxis, np.newaxis]
        found += np.einsum("mij,fj->fmi", gains, felt)
    return found


def _joints_of(structure: Structure, limb: int) -> list[tuple[int, Floats]]:
    """The limbs whose angles turn the joints of a limb, and where in its frame [mm] these are."""
    children: Ints = np.flatnonzero(structure.parents == limb)
    own = [] if structure.limbs[limb].kind == "free" else [(limb, np.zeros(3))]
    return own + [(int(child), structure.limbs[child].joint) for child in children]


def _wandering(n_frames: int, rate: float, soft_tissue: _SoftTissue, rng: np.random.Generator) -> Floats:
    n_markers, together = len(soft_tissue.places), soft_tissue.tissue.together
    curves = smooth_curves(rng, n_frames, rate, 3 * (n_markers + 1), _WANDERING).reshape(n_frames, n_markers + 1, 3)
    mixed = np.sqrt(together) * curves[:, :1] + np.sqrt(1 - together) * soft_tissue.alike @ curves[:, 1:]
    return np.asarray(soft_tissue.tissue.wander * mixed / (np.sqrt(3.0) * _CURVES))


def _swinging(centre: Floats, rate: float, tissue: SoftTissue) -> Floats:
    """Answer [mm] of x'' + 2 z w x' + w^2 x = -a to the acceleration a of a limb, about its mean."""
    acceleration = np.gradient(np.gradient(centre, axis=0), axis=0) * rate**2 if len(centre) > 1 else 0 * centre
    spring = 2 * np.pi * tissue.frequency
    from scipy.signal import bilinear, lfilter  # noqa: PLC0415 - slow to load, and who asks for tables needs it not

    above, below = bilinear([-1.0], [1.0, 2 * tissue.damping * spring, spring**2], rate)
    return np.asarray(lfilter(above, below, acceleration - acceleration.mean(axis=0), axis=0))
