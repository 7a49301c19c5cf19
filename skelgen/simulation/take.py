"""A simulated take: a structure moves, a tracker watches, and the truth is kept."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from skelgen.errors import ParameterError
from skelgen.model import PointCloud, Trajectories
from skelgen.model.arrays import Floats, Ints, check_whole
from skelgen.parameters import Declaration, StageParameters, declare
from skelgen.simulation.articulated import Structure
from skelgen.simulation.markers import (
    carried_markers,
    dropouts,
    duplicates,
    edge_jumps,
    ghosts,
    merged_points,
    pieces_lost,
    shuffled_points,
    soft_tissue_motion,
)
from skelgen.simulation.motion import random_angles, random_walk, world_from_limbs
from skelgen.simulation.people import (
    HEIGHTS,
    MARKER_SETS,
    MOTIONS,
    SLOWEST,
    Person,
    natural_motion,
    person,
    skin_motion,
)
from skelgen.simulation.recorded import RecordedBody
from skelgen.simulation.structures import find_structure
from skelgen.simulation.subjects import side_by_side, with_spacing
from skelgen.simulation.truth import Truth
from skelgen.simulation.visibility import CAMERAS_NEEDED, camera_ring, seen_by_cameras

# Each has its own random numbers, by its place in the list.
_STREAMS = ("motion", "tissue", "noise", "dropouts", "ghosts", "order", "edges", "duplicates", "person")
_UNLABELLED = ("ghosts", "merged", "duplicates")  # faults whose points cannot carry one label
_OF_RANDOM_MOTION = ("motion_range", "walk", "speed")
_OF_STRUCTURES = ("spacing", "subjects", "apart")
_NEXT_SUBJECT = 1_000_003
"""Step of the seeds of further bodies, which no user counts up to."""

_OF_PEOPLE = ("motion", "marker_set", "height")
_REALISTIC, _NONE = "realistic", "none"
_SLIDE = Declaration("soft_tissue", float, 0.0, "", unit="mm", low=0.0, high=1000.0)


@dataclass(frozen=True)
class SimulationParameters(StageParameters):
    """Parameters of the motion, and of the faults of the tracker."""

    stage: ClassVar[str] = "simulate"

    n_frames: int = declare(1000, "Length of the take.", unit="frames", within=(1, 1_000_000))
    rate: float = declare(100.0, "Frame rate.", unit="Hz", within=(1e-3, 1e5))
    noise: float = declare(0.0, "Standard deviation of each measured coordinate.", unit="mm", within=(0.0, 1000.0))
    soft_tissue: str = declare(
        _NONE,
        "What skin does to markers: realistic, as measured on people; none; or the standard deviation of each marker's "
        "slide on its limb, per coordinate, in mm.",
    )
    dropouts: float = declare(0.0, "Part of all marker positions that is lost, mostly in bursts.", within=(0.0, 0.95))
    dropout_seconds: float = declare(
        0.0,
        "Mean length of the pieces that are lost, which varies as waiting times do; 0: bursts of 5 to 40 frames, and "
        "single ones.",
        unit="s",
        within=(0.0, 100.0),
    )
    n_cameras: int = declare(0, "Cameras around the volume that limbs can block; 0 sees everything.", within=(0, 64))
    ghosts: float = declare(0.0, "Mean number of false points per frame; needs labelled = false.", within=(0.0, 1000.0))
    merged: float = declare(
        0.0,
        "Markers nearer than this become one point, their mean, which is no marker's in the truth; needs labelled = "
        "false.",
        unit="mm",
        within=(0.0, 1000.0),
    )
    duplicates: float = declare(
        0.0, "Mean number of markers per frame that are seen as two points; needs labelled = false.", within=(0.0, 1e3)
    )
    edge_jumps: float = declare(
        0.0,
        "Standard deviation of each coordinate in the first and last frames in which a marker is seen.",
        unit="mm",
        within=(0.0, 1000.0),
    )
    labelled: bool = declare(True, "Whether markers carry names; otherwise they are points in random order.")
    motion_range: float = declare(1.0, "Factor on the amplitude of all joint angles.", within=(0.0, 3.0))
    walk: float = declare(1000.0, "How far the root walks from the centre along x and y.", unit="mm", within=(0.0, 1e5))
    speed: float = declare(1.0, "How many times as fast as usual limbs and root move at random.", within=(0.01, 100.0))
    spacing: float = declare(
        0.0,
        "Median distance of markers from the nearest one on their limb, which are drawn together; 0: as they are worn.",
        unit="mm",
        within=(0.0, 1000.0),
    )
    subjects: int = declare(1, "How many bodies there are, each with a motion of its own.", within=(1, 20))
    apart: float = declare(3000.0, "How far neighbouring bodies are apart.", unit="mm", within=(0.0, 1e5))
    motion: str = declare("random", "How a human moves.", choices=("random", *MOTIONS))
    marker_set: str = declare(
        _NONE,
        "Markers as people wear them, on a human; none: markers that wind around all limbs. A human who walks, runs or "
        "the like wears plug-in-gait unless told otherwise.",
        choices=(_NONE, *MARKER_SETS),
    )
    height: float = declare(
        0.0, "Height of a human who wears a marker set; 0: drawn by the seed.", unit="mm", within=(0.0, HEIGHTS[1])
    )

    def __post_init__(self) -> None:
        object.__setattr__(self, "soft_tissue", str(self.soft_tissue))
        super().__post_init__()
        if 0 < self.height < HEIGHTS[0]:
            raise ParameterError(f"{self.stage}: height is {self.height:g}; it must be 0 or at least {HEIGHTS[0]:g} mm")
        if self.soft_tissue not in {_REALISTIC, _NONE}:
            try:
                _SLIDE.check(self.soft_tissue, self.stage)
            except ParameterError as error:
                raise ParameterError(f"{error}, or be {_REALISTIC} or {_NONE}") from error

    @property
    def slide(self) -> float:
        """Standard deviation [mm] that `soft_tissue` states; 0 where it is realistic or none."""
        return 0.0 if self.soft_tissue in {_REALISTIC, _NONE} else float(self.soft_tissue)

    @property
    def is_of_person(self) -> bool:
        """Whether somebody with a size, a marker set and a natural motion is simulated."""
        return any(getattr(self, option) != getattr(type(self), option) for option in _OF_PEOPLE)


@dataclass(frozen=True, eq=False)
class SimulatedTake:
    """A take and what is true of it.

    Attributes
    ----------
    take : Trajectories or PointCloud
        What the tracker delivers.
    truth : Truth
        What happened.
    """

    take: Trajectories | PointCloud
    truth: Truth


def simulate(
    structure: Structure | RecordedBody | str = "human",
    *,
    seed: int = 0,
    parameters: SimulationParameters | None = None,
    **options: Any,
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
        A `Trajectories`, or a `PointCloud` with ``labelled=False``, and its `Truth`.

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
        scene = _played(structure, _settings(parameters or recorded, options), seed)
    else:
        settings = _settings(parameters or SimulationParameters(), options)
        make = _living if settings.is_of_person else _moved
        bodies = [make(structure, settings, seed + number * _NEXT_SUBJECT) for number in range(settings.subjects)]
        if len(bodies) > 1:
            return _delivered(*_together(bodies))
        scene = bodies[0]
    return _delivered(scene, _displaced(scene))


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


def _played(recorded: RecordedBody, settings: SimulationParameters, seed: int) -> _Scene:
    """Move a body as recorded; the seed is that of the faults alone."""
    _refuse(settings, _OF_RANDOM_MOTION, "random motion; a recorded one is played as it is")
    _refuse(settings, _OF_PEOPLE, "the simulated human; bones of a recorded motion get markers_per_limb")
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
        _refuse(settings, _OF_PEOPLE, f"the structure human, not to {name}")
    _refuse(settings, ("spacing",), "structures without a marker set")
    streams, n_frames, rate = _streams(seed), settings.n_frames, settings.rate
    marker_set = MARKER_SETS[0] if settings.marker_set == _NONE else settings.marker_set
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
    first, displaced = bodies[0], np.concatenate([_displaced(body) for body in bodies], axis=1)
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
    return scene, displaced


def _settings(parameters: SimulationParameters, options: dict[str, object]) -> SimulationParameters:
    wanted = parameters.as_mapping() | options
    settings = SimulationParameters.from_mapping(wanted | {"soft_tissue": str(wanted["soft_tissue"])})
    unnamed = [fault for fault in _UNLABELLED if getattr(settings, fault) > 0]
    if settings.labelled and unnamed:
        raise ParameterError(f"points of the fault {unnamed[0]} have no label of their own: it needs labelled = false")
    if 0 < settings.n_cameras < CAMERAS_NEEDED:
        raise ParameterError(f"one camera sees no positions; n_cameras must be 0 or at least {CAMERAS_NEEDED}")
    return settings


def _displaced(scene: _Scene) -> Floats:
    """What soft tissue does to the markers [mm], shape (n_frames, n_markers, 3)."""
    body, settings, rng = scene.body, scene.settings, scene.streams["tissue"]
    if settings.soft_tissue == _REALISTIC:
        sliding, plates = (scene.person.sliding, scene.person.plates) if scene.person else (None, ())
        return skin_motion(body, scene.poses, scene.angles, settings.rate, rng, sliding=sliding, plates=plates)
    if settings.slide > 0:
        return soft_tissue_motion(
            body, scene.poses, scene.angles, rate=settings.rate, deviation=settings.slide, rng=rng
        )
    return np.zeros_like(scene.rigid)


def _observed(scene: _Scene, displaced: Floats) -> Floats:
    body, settings, streams, positions = scene.body, scene.settings, scene.streams, scene.rigid + displaced
    observed = positions + settings.noise * streams["noise"].normal(size=positions.shape)
    if settings.n_cameras:
        cameras = camera_ring(positions, settings.n_cameras)
        observed[~seen_by_cameras(body, scene.poses, positions, cameras)] = np.nan
    if settings.dropouts > 0:
        n_frames, n_markers = positions.shape[:2]
        rng, mean_frames = streams["dropouts"], settings.dropout_seconds * settings.rate
        if mean_frames > 0:
            lost = pieces_lost(n_frames, n_markers, settings.dropouts, mean_frames, rng)
        else:
            lost = dropouts(n_frames, n_markers, settings.dropouts, rng)
        observed[lost] = np.nan
    if settings.edge_jumps > 0:
        observed = edge_jumps(observed, settings.edge_jumps, streams["edges"])
    return observed


def _delivered(scene: _Scene, displaced: Floats) -> SimulatedTake:
    settings, observed = scene.settings, _observed(scene, displaced)
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
    )
