"""A skeleton that was calibrated with sensors, applied to another take of bodies with orientation."""

from __future__ import annotations

import time
from typing import cast

import numpy as np
from threadpoolctl import threadpool_limits

from skelgen.app.configuration import Settings
from skelgen.app.inputs import body_of, check_take, trajectories_from_poses
from skelgen.errors import InputError
from skelgen.model import Limbs, Poses, Project, StageReport, Trajectories
from skelgen.model.arrays import Floats
from skelgen.model.skeleton import Skeleton
from skelgen.progress import Monitor
from skelgen.stages.known.posing import known_motion, pose_known
from skelgen.stages.known.sensors import Seat, reseated
from skelgen.stages.skeleton.parameters import SkeletonParameters


def apply_to_sensors(project: Project, known: Project, settings: Settings, monitor: Monitor) -> Project:
    """Pose a take of bodies with orientation by the skeleton of another one.

    Parameters
    ----------
    project : Project
        The new take.
    known : Project
        The calibrated take of sensors of the same names, all stages done.
    settings : Settings
        Of which `skeleton` says what is an outlier.
    monitor : Monitor
        Told of progress and of what the user should know.

    Returns
    -------
    Project
        Bone lengths and joints are those of `known`; sensors that sit elsewhere on their limbs are placed anew.

    Raises
    ------
    InputError
        If no body of the take is one of the skeleton's.
    """
    take, started = cast(Poses, project.take), time.perf_counter()
    check_take(take)
    posing = cast(SkeletonParameters, settings.of("skeleton"))
    monitor.begin("poses of the known skeleton")
    names = known.trajectories.names
    positions = _positions(take, known)
    with threadpool_limits(limits=1):
        skeleton, seats, loose = reseated(known.skeleton, known.trajectories.positions, positions)
        poses = pose_known(skeleton, positions, posing, monitor)
        motion = known_motion(skeleton, poses, positions, take.rate)
    sentences = _sentences(take, names, skeleton, seats, loose)
    for sentence in sentences:
        monitor.notice(sentence)
    source = known.source.path if known.source is not None else known.name
    taken = (f"taken from the known skeleton of {source}",)
    seconds = time.perf_counter() - started
    trajectories = Trajectories(positions, names, take.rate, take.name, take.notices)
    done = project.with_trajectories(trajectories, StageReport({}, 0.0, (*taken, *sentences)))
    nothing = np.full((len(names), len(names)), np.nan)
    done = done.with_limbs(Limbs(skeleton.limb_of_marker, nothing), StageReport({}, 0.0, taken))
    done = done.with_topology(known.topology.for_take(take.n_frames), StageReport({}, 0.0, taken))
    return done.with_skeleton(skeleton, motion, StageReport(posing.as_mapping(), seconds, taken))


def _positions(take: Poses, known: Project) -> Floats:
    """Virtual markers of the take's bodies in the skeleton's order [mm], NaN for bodies that it does not have."""
    names = known.trajectories.names
    bodies = list(dict.fromkeys(map(body_of, names)))
    if not set(bodies) & set(take.names):
        given, wanted = (", ".join(some) for some in (take.names, bodies))
        raise InputError(
            f"{take.name or 'the take'}: its bodies are called {given}, those of the known skeleton {wanted}; "
            "name them alike"
        )
    virtual = trajectories_from_poses(take, length=_axis_length(known.trajectories.positions, names))
    positions = np.full((take.n_frames, len(names), 3), np.nan)
    for column, name in enumerate(names):
        if name in virtual.names:
            positions[:, column] = virtual.positions[:, virtual.names.index(name)]
    return positions


def _axis_length(positions: Floats, names: tuple[str, ...]) -> float:
    """How far the virtual markers are from their bodies' origins [mm]: all alike, as far as they are seen."""
    from_origin = [
        np.nanmedian(np.linalg.norm(positions[:, column] - positions[:, names.index(f"{body_of(name)}:o")], axis=1))
        for column, name in enumerate(names)
        if name.endswith(":x") and not np.isnan(positions[:, column, 0]).all()
    ]
    return float(np.median(from_origin))


def _sentences(
    take: Poses, names: tuple[str, ...], skeleton: Skeleton, seats: tuple[Seat, ...], loose: tuple[int, ...]
) -> tuple[str, ...]:
    def body(limb: int) -> str:
        return body_of(names[int(skeleton.markers_of(limb)[0])])

    bodies = dict.fromkeys(map(body_of, names))
    said = ["posed by the known skeleton"]
    if seats:
        parts = ", ".join(f"{body(seat.limb)} by {seat.shift:.1f} mm and {seat.turn:.1f} degrees" for seat in seats)
        said.append(
            "sensors that sit elsewhere on their limbs than in the calibrated take, placed anew by their joints: "
            + parts
        )
    if loose:
        joints = [skeleton.joints[index] for index in loose]
        parts = ", ".join(f"{body(joint.parent)} - {body(joint.child)}" for joint in joints)
        said.append(f"joints that do not hold together: {parts}; a sensor slipped in the take, or this is another body")
    missing = [name for name in bodies if name not in take.names]
    if missing:
        said.append(f"bodies of the skeleton that the take does not have: {', '.join(missing)}")
    new = [name for name in take.names if name not in bodies]
    if new:
        said.append(f"bodies that the skeleton does not know, left out: {', '.join(new)}")
    return tuple(said)
