"""A simulated take: a structure moves, a tracker watches, and the truth is kept."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from skelgen.errors import ParameterError
from skelgen.marker_sets import MARKER_SETS
from skelgen.model import PointCloud, Poses, Trajectories
from skelgen.model.arrays import Bools, Floats, Ints, check_whole
from skelgen.parameters import ParameterValue
from skelgen.simulation.articulated import Structure, side_by_side, with_spacing
from skelgen.simulation.markers import (
    bursts_lost,
    carried_markers,
    dropouts,
    duplicates,
    edge_jumps,
    ghosts,
    merged_points,
    shuffled_points,
    soft_tissue_motion,
)
from skelgen.simulation.motion import TOOL, Hold, held, random_angles, random_walk, sensed, world_from_limbs
from skelgen.simulation.parameters import NONE, OF_PEOPLE, REALISTIC, SimulationParameters
from skelgen.simulation.people import MOTIONS, SLOWEST, Person, natural_motion, person, realistic_soft_tissue
from skelgen.simulation.recorded import RecordedBody
from skelgen.simulation.structures import find_structure
from skelgen.simulation.truth import Truth
from skelgen.simulation.visibility import CAMERAS_NEEDED, camera_ring, seen_by_cameras

# Each has its own random numbers, by its place in the list.
_STREAMS = (
    *("motion", "tissue", "noise", "dropouts", "ghosts", "order", "edges", "duplicates", "person", "hold", "sensors"),
)
_UNLABELLED = ("ghosts", "merged", "duplicates")  # faults whose points cannot carry one label
_OF_RANDOM_MOTION = ("motion_range", "walk", "speed")
_OF_STRUCTURES = ("spacing", "subjects", "apart", "hold")
_NEXT_SUBJECT = 1_000_003
"""Step of the seeds of further bodies, which no user counts up to."""


@dataclass(frozen=True, eq=False)
class SimulatedTake:
    """A take and what is true of it.

    Attributes
    ----------
    take : Trajectories, PointCloud or Poses
        What the tracker delivers.
    truth : Truth
        What happened.
    """

    take: Trajectories | PointCloud | Poses
    truth: Truth


def simulate(
    structure: Structure | RecordedBody | str = "human",
    *,
    seed: int = 0,
    parameters: SimulationParameters | None = None,
    **options: ParameterValue,
) -> SimulatedTake:
    """Simulate a take of a moving structure.

    Parameters
    ----------
    structure : Structure, RecordedBody or str
        What moves: a structure, or its name for `find_structure`, e.g. ``classic-human`` or ``tree:8``; or a body with
        its recorded motion, which is taken as it is, at its own rate, as many frames as there are or are wished.
    seed : int
        Seed of the motion and of all faults. Each has random numbers of its own: more noise changes neither the motion
        nor the dropouts.
    parameters : SimulationParameters, optional
        All options; the defaults if left out.
    **options
        Changes to `parameters`, by name: ``n_frames``, ``noise``, ``motion``, ``marker_set``, ``soft_tissue``, ...

    Returns
    -------
    SimulatedTake
        A `Trajectories`, a `PointCloud` with ``labelled=False``, or `Poses` with ``sensors=True``; and its `Truth`.

    Raises
    ------
    ParameterError
        If an option is unknown or out of bounds, or there is no such structure.

    Examples
    --------
    >>> simulated = simulate("rods", n_frames=50, noise=0.5)
    >>> simulated.take.positions.shape
    (50, 9, 3)
    >>> walking = simulate("human", n_frames=50, motion="walk", marker_set="helen-hayes", soft_tissue="realistic")
    >>> walking.take.names[:3]
    ('R.ASIS', 'L.ASIS', 'V.Sacral')
    >>> simulated.truth.joint_names
    ('middle rod - rear rod', 'middle rod - front rod')
    """
    check_whole(seed, 0, "the seed")
    if not isinstance(structure, Structure | RecordedBody | str):
        raise ParameterError(f"the structure is {structure!r:.60}; it must be a structure or its name")
    if isinstance(structure, RecordedBody):
        recorded = SimulationParameters(n_frames=len(structure.world_from_limb), rate=structure.rate)
        scene = _recorded_motion(structure, _settings(parameters or recorded, options), seed)
    else:
        settings = _settings(parameters or SimulationParameters(), options)
        make = _living if settings.is_of_person else _moved
        bodies = [make(structure, settings, seed + number * _NEXT_SUBJECT) for number in range(settings.subjects)]
        if settings.hold == "tool":
            bodies.append(_moved(TOOL, settings, seed + _NEXT_SUBJECT))
        if len(bodies) > 1:
            return _simulated_take(*_together(bodies))
        scene = bodies[0]
    return _simulated_take(scene, _soft_tissue_shifts(scene))


@dataclass(frozen=True, eq=False)
class _Scene:
    """A body in motion, before it is measured."""

    body: Structure
    settings: SimulationParameters
    streams: dict[str, np.random.Generator]
    name: str
    angles: list[Floats]
    poses: Floats
    rigid: Floats
    person: Person | None = None
    holds: tuple[Hold, ...] = ()


def _recorded_motion(recorded: RecordedBody, settings: SimulationParameters, seed: int) -> _Scene:
    """Move a body as recorded; the seed is that of the faults alone."""
    _refuse(settings, _OF_RANDOM_MOTION, "random motion; a recorded one is played as it is")
    _refuse(settings, OF_PEOPLE, "the simulated human; bones of a recorded motion get markers_per_limb")
    _refuse(settings, _OF_STRUCTURES, "simulated bodies; a recorded motion is that of one")
    n_frames, recorded_frames = settings.n_frames, len(recorded.world_from_limb)
    if n_frames > recorded_frames:
        raise ParameterError(f"n_frames is {n_frames}; the motion has {recorded_frames} at {recorded.rate:g} Hz")
    if settings.rate != recorded.rate:
        moves = f"the body moves at {recorded.rate:g} Hz"
        raise ParameterError(f"rate is {settings.rate:g} Hz, {moves}: give the rate when it is made")
    poses = recorded.world_from_limb[:n_frames]
    angles = [angles[:n_frames] for angles in recorded.angles]
    body, name = recorded.structure, f"{recorded.name}-{seed}"
    return _Scene(body, settings, _streams(seed), name, angles, poses, carried_markers(body, poses))


def _streams(seed: int) -> dict[str, np.random.Generator]:
    return {name: np.random.default_rng([seed, index]) for index, name in enumerate(_STREAMS)}


def _refuse(settings: SimulationParameters, options: tuple[str, ...], belongs_to: str) -> None:
    for option in options:
        if getattr(settings, option) != getattr(SimulationParameters, option):
            raise ParameterError(f"{option} belongs to {belongs_to}")


def _living(structure: Structure | str, settings: SimulationParameters, seed: int) -> _Scene:
    """Let a person move, who wears a marker set."""
    if structure != "human":
        name = structure.name if isinstance(structure, Structure) else structure
        _refuse(settings, OF_PEOPLE, f"the structure human, not to {name}")
    _refuse(settings, ("spacing",), "structures without a marker set")
    streams, n_frames, rate = _streams(seed), settings.n_frames, settings.rate
    marker_set = MARKER_SETS[0] if settings.marker_set == NONE else settings.marker_set
    someone, rng = person(marker_set, settings.height, streams["person"]), streams["motion"]
    if settings.motion in MOTIONS:
        _refuse(settings, _OF_RANDOM_MOTION, f"random motion, not to motion {settings.motion}")
        if rate < SLOWEST:
            raise ParameterError(f"rate is {rate:g} Hz; motion {settings.motion} needs at least {SLOWEST:g} Hz")
        angles, poses = natural_motion(someone, settings.motion, n_frames, rate, rng)
    else:
        angles = random_angles(someone.body, n_frames, rate / settings.speed, rng, settings.motion_range)
        walked = random_walk(someone.body, n_frames, rate / settings.speed, rng, settings.walk)
        poses = world_from_limbs(someone.body, angles, walked)
    angles, poses = [angles[limb] for limb in someone.limbs], poses[:, someone.limbs]
    name = f"{marker_set}-{settings.motion}-{seed}"
    rigid = carried_markers(someone.worn, poses)
    return _Scene(someone.worn, settings, streams, name, angles, poses, rigid, someone)


def _moved(structure: Structure | str, settings: SimulationParameters, seed: int) -> _Scene:
    body = structure if isinstance(structure, Structure) else find_structure(structure, seed)
    body = with_spacing(body, settings.spacing) if settings.spacing else body
    streams = _streams(seed)
    n_frames, rate, rng = settings.n_frames, settings.rate / settings.speed, streams["motion"]
    angles = random_angles(body, n_frames, rate, rng, settings.motion_range)
    poses = world_from_limbs(body, angles, random_walk(body, n_frames, rate, rng, settings.walk))
    name = f"{body.name.replace(':', '-')}-{seed}"
    return _Scene(body, settings, streams, name, angles, poses, carried_markers(body, poses))


def _together(bodies: list[_Scene]) -> tuple[_Scene, Floats]:
    """Put bodies side by side into one scene, and say what soft tissue does to the markers of all [mm]."""
    first, displaced = bodies[0], np.concatenate([_soft_tissue_shifts(body) for body in bodies], axis=1)
    apart = first.settings.apart
    everybody = side_by_side([body.body for body in bodies], apart)
    poses, rigid = (np.concatenate([getattr(body, what) for body in bodies], axis=1) for what in ("poses", "rigid"))
    subject_of_limb, subject_of_marker = (
        np.repeat(np.arange(len(bodies)), [getattr(body.body, count) for body in bodies])
        for count in ("n_limbs", "n_markers")
    )
    poses[:, :, 1, 3] += apart * subject_of_limb
    rigid[:, :, 1] += apart * subject_of_marker
    angles = [angle for body in bodies for angle in body.angles]
    scene = _Scene(everybody, first.settings, first.streams, f"{len(bodies)}-{first.name}", angles, poses, rigid)
    if first.settings.hold == NONE:
        return scene, displaced
    poses, hold = held(everybody, poses, first.settings.hold == "tool", first.streams["hold"])
    return replace(scene, poses=poses, rigid=carried_markers(everybody, poses), holds=(hold,)), displaced


def _settings(parameters: SimulationParameters, options: Mapping[str, ParameterValue]) -> SimulationParameters:
    wanted = {**parameters.as_mapping(), **options}
    settings = SimulationParameters.from_mapping(wanted | {"soft_tissue": str(wanted["soft_tissue"])})
    unnamed = [fault for fault in _UNLABELLED if getattr(settings, fault) > 0]
    if settings.labelled and unnamed:
        raise ParameterError(f"points of the fault {unnamed[0]} have no label of their own: it needs labelled = false")
    if settings.dropouts == 0:
        _refuse(settings, ("dropout_seconds",), "what is lost: it needs dropouts above 0")
    if settings.subjects == 1 and settings.hold == NONE:
        _refuse(settings, ("apart",), "takes of several bodies: it needs subjects = 2 or more")
    if 0 < settings.n_cameras < CAMERAS_NEEDED:
        raise ParameterError(f"one camera sees no positions; n_cameras must be 0 or at least {CAMERAS_NEEDED}")
    return settings


def _soft_tissue_shifts(scene: _Scene) -> Floats:
    """What soft tissue does to the markers [mm], shape (n_frames, n_markers, 3)."""
    body, settings, rng = scene.body, scene.settings, scene.streams["tissue"]
    if settings.soft_tissue == REALISTIC:
        return realistic_soft_tissue(body, scene.poses, scene.angles, settings.rate, rng, scene.person)
    if settings.slide > 0:
        return soft_tissue_motion(
            body, scene.poses, scene.angles, rate=settings.rate, deviation=settings.slide, rng=rng
        )
    return np.zeros_like(scene.rigid)


def _measured_positions(scene: _Scene, displaced: Floats) -> Floats:
    body, settings, streams, positions = scene.body, scene.settings, scene.streams, scene.rigid + displaced
    observed = positions + settings.noise * streams["noise"].normal(size=positions.shape)
    if settings.n_cameras:
        cameras = camera_ring(positions, settings.n_cameras)
        observed[~seen_by_cameras(body, scene.poses, positions, cameras)] = np.nan
    if settings.dropouts > 0:
        observed[_lost(settings, positions.shape[1], streams["dropouts"])] = np.nan
    if settings.edge_jumps > 0:
        observed = edge_jumps(observed, settings.edge_jumps, streams["edges"])
    return observed


def _simulated_take(scene: _Scene, displaced: Floats) -> SimulatedTake:
    if scene.settings.sensors:
        return SimulatedTake(_sensor_take(scene), _truth(scene, np.empty(0, dtype=np.intp), displaced))
    settings, observed = scene.settings, _measured_positions(scene, displaced)
    if settings.labelled:
        take = Trajectories(observed, scene.body.marker_names, settings.rate, scene.name)
        return SimulatedTake(take, _truth(scene, np.empty(0, dtype=np.intp), displaced))
    more = [_of_nobody(*ghosts(scene.rigid, settings.ghosts, scene.streams["ghosts"]))]
    if settings.merged > 0:
        observed, merged_frames, places = merged_points(observed, settings.merged)
        more.append(_of_nobody(merged_frames, places))
    if settings.duplicates > 0:
        more.append(duplicates(observed, settings.duplicates, scene.streams["duplicates"]))
    frames, owners, points = (np.concatenate(parts) for parts in zip(*more, strict=True))
    points, starts, markers = shuffled_points(observed, (frames, owners, points), scene.streams["order"])
    cloud = PointCloud(points, starts, np.arange(settings.n_frames) / settings.rate, name=scene.name)
    return SimulatedTake(cloud, _truth(scene, markers, displaced))


def _sensor_take(scene: _Scene) -> Poses:
    settings, body = scene.settings, scene.body
    world = sensed(scene.poses, settings.noise, np.deg2rad(settings.turn_noise), scene.streams["sensors"])
    if settings.dropouts > 0:
        world[_lost(settings, body.n_limbs, scene.streams["dropouts"])] = np.nan
    return Poses(world, body.limb_names, settings.rate, scene.name)


def _lost(settings: SimulationParameters, count: int, rng: np.random.Generator) -> Bools:
    """Which of some markers or sensors are lost in which frames, shape (n_frames, count)."""
    mean_frames = settings.dropout_seconds * settings.rate
    if mean_frames > 0:
        return bursts_lost(settings.n_frames, count, settings.dropouts, mean_frames, rng)
    return dropouts(settings.n_frames, count, settings.dropouts, rng)


def _of_nobody(frames: Ints, points: Floats) -> tuple[Ints, Ints, Floats]:
    return frames, np.full(len(frames), -1, dtype=np.intp), points


def _truth(scene: _Scene, marker_of_point: Ints, displaced: Floats) -> Truth:
    body, poses, children = scene.body, scene.poses, scene.body.children
    joints = [body.limbs[child] for child in children]
    no_axis = np.full(3, np.nan)
    axes = np.array([no_axis if limb.kind == "ball" else limb.axes[0] for limb in joints]).reshape(-1, 3, 1)
    parent_turns = poses[:, body.parents[children], :3, :3]
    return Truth(
        marker_names=body.marker_names,
        limb_names=body.limb_names,
        limb_of_marker=body.limb_of_marker,
        parents=body.parents,
        joint_kinds=tuple(limb.kind for limb in joints),
        joint_positions=poses[:, children][..., :3, 3],
        joint_axes=(parent_turns @ axes)[..., 0],
        positions_in_parent=np.array([limb.joint for limb in joints]).reshape(-1, 3),
        positions_in_child=np.zeros((len(joints), 3)),
        world_from_limb=poses,
        marker_positions=scene.rigid,
        marker_of_point=marker_of_point,
        rate=scene.settings.rate,
        name=scene.name,
        soft_tissue=displaced,
        hold_limbs=np.array([hold.limbs for hold in scene.holds], dtype=np.intp).reshape(-1, 2),
        hold_frames=np.array([(hold.first_frame, hold.last_frame) for hold in scene.holds], dtype=np.intp).reshape(
            -1, 2
        ),
    )
