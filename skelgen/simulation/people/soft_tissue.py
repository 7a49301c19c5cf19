"""What soft tissue does to markers: skin follows the joints beside it, swings after impacts, and wanders.

With q the rotation vectors of the joints of a marker's limb and w a weight that falls with the distance from each,

    d = sum over joints of w (sqrt(s) C + sqrt(1 - s) O) q + x + slow wandering

where C is one random 3 x 3 matrix for all markers of the limb, O one for each that is alike for neighbours, s the
share that moves together, and x the answer of a damped spring to the limb's acceleration. That skin is linear in the
angles of both joints of a segment: Camomilla et al., J Biomech 46 (2013) 2216-2222; Bonci et al., J Biomech 47 (2014)
2354-2361.
"""

from dataclasses import dataclass

import numpy as np

from skelgen.model.arrays import Floats, Ints
from skelgen.simulation.articulated import LimbModel, Structure
from skelgen.simulation.motion import smooth_curves
from skelgen.simulation.people.body import Person
from skelgen.simulation.people.tables import SoftTissue, tissue_of

MEASURED_AT = np.deg2rad(60.0)
"""Angle [rad] of a joint for which the tables state displacements."""

_REACH = 200.0  # mm from a joint at which skin follows it half as far
_NEIGHBOURS = 80.0  # mm within which markers move alike
_YIELDING = 2 * MEASURED_AT  # beyond this angle skin is stretched, and follows less
_BETWEEN_PEOPLE = 0.25  # one standard deviation of the logarithm of amplitudes
_OWN_SWING = 0.3  # one standard deviation of how much more or less than its neighbours a marker swings
_WANDERING = (0.1, 0.5)  # Hz: breathing, belts
_CURVES = 0.42  # root mean square of smooth curves within -1 .. 1


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
    for limb, model in enumerate(structure.limbs):
        markers = np.flatnonzero(structure.limb_of_marker == limb)
        if not len(markers):
            continue
        skin = _skin(model, [plates[marker] for marker in markers])
        local = _following(structure, limb, angles, skin, rng) + _wandering(n_frames, rate, skin, rng)
        turned = local @ world_from_limb[:, limb, :3, :3].swapaxes(-1, -2)
        swings = 1 + _OWN_SWING * skin.alike @ rng.normal(size=len(markers))
        centre = world_from_limb[:, limb, :3, :3] @ model.markers.mean(axis=0) + world_from_limb[:, limb, :3, 3]
        turned += np.maximum(swings, 0.0)[:, np.newaxis] * _swinging(centre, rate, skin.tissue)[:, np.newaxis]
        displaced[:, markers] = between * factors[markers][:, np.newaxis] * turned
    return displaced


@dataclass(frozen=True, eq=False)
class _Skin:
    """The skin under the markers of a limb.

    `places`, shape (n_markers, 3) [mm], are where it carries them: of a stiff plate, its middle. The matrix `alike`
    turns independent numbers of the markers into ones that neighbours share, each of variance 1.
    """

    tissue: SoftTissue
    places: Floats
    alike: Floats


def _skin(model: LimbModel, plates: list[str]) -> _Skin:
    places = model.markers.copy()
    for plate in {plate for plate in plates if plate}:
        members = [index for index, name in enumerate(plates) if name == plate]
        places[members] = model.markers[members].mean(axis=0)
    apart = np.linalg.norm(places[:, np.newaxis] - places, axis=2)
    values, vectors = np.linalg.eigh(np.exp(-0.5 * (apart / _NEIGHBOURS) ** 2))
    return _Skin(tissue_of(model.name), places, vectors * np.sqrt(np.maximum(values, 0.0)) @ vectors.T)


def _following(structure: Structure, limb: int, angles: list[Floats], skin: _Skin, rng: np.random.Generator) -> Floats:
    """Displacements [mm] in the limb's frame that follow its joints, shape (n_frames, n_markers, 3)."""
    places, tissue = skin.places, skin.tissue
    found = np.zeros((len(angles[0]), len(places), 3))
    for joint, centre in _joints_of(structure, limb):
        turn = angles[joint] @ structure.limbs[joint].axes
        size = np.linalg.norm(turn, axis=1, keepdims=True)
        felt = turn / MEASURED_AT * np.sqrt(1.25 / (1 + (size / _YIELDING) ** 2))
        near = 1 / (1 + (np.linalg.norm(places - centre, axis=1) / _REACH) ** 2)
        shared, own = (
            rng.normal(size=(3, 3)),
            np.einsum("mn,nij->mij", skin.alike, rng.normal(size=(len(places), 3, 3))),
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


def _wandering(n_frames: int, rate: float, skin: _Skin, rng: np.random.Generator) -> Floats:
    n_markers, together = len(skin.places), skin.tissue.together
    curves = smooth_curves(rng, n_frames, rate, 3 * (n_markers + 1), _WANDERING).reshape(n_frames, n_markers + 1, 3)
    mixed = np.sqrt(together) * curves[:, :1] + np.sqrt(1 - together) * skin.alike @ curves[:, 1:]
    return np.asarray(skin.tissue.wander * mixed / (np.sqrt(3.0) * _CURVES))


def _swinging(centre: Floats, rate: float, tissue: SoftTissue) -> Floats:
    """Answer [mm] of x'' + 2 z w x' + w^2 x = -a to the acceleration a of a limb, about its mean."""
    acceleration = np.gradient(np.gradient(centre, axis=0), axis=0) * rate**2 if len(centre) > 1 else 0 * centre
    spring = 2 * np.pi * tissue.frequency
    from scipy.signal import bilinear, lfilter  # noqa: PLC0415 - slow to load, and who asks for tables needs it not

    above, below = bilinear([-1.0], [1.0, 2 * tissue.damping * spring, spring**2], rate)
    return np.asarray(lfilter(above, below, acceleration - acceleration.mean(axis=0), axis=0))
