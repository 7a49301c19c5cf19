"""Takes of bodies with orientation: sensors that slipped are repaired, joints that hold for a span are found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from skelgen.app.inputs import poses_of_markers
from skelgen.app.set_prior import HeldNotices
from skelgen.model import Poses, Project, Topology
from skelgen.progress import Monitor

if TYPE_CHECKING:
    from skelgen.stages.joints import JointConstraints


def repaired_sensors(poses: Poses, monitor: Monitor) -> Poses:
    """Return bodies whose exchanged sensors are exchanged back, and whose sensors that slipped are moved back.

    Parameters
    ----------
    poses : Poses
        As they were recorded.
    monitor : Monitor
        Receives a notice of each.
    """
    from skelgen.stages.joints import slips_moved_back  # noqa: PLC0415 - loads the stage
    from skelgen.stages.repair import exchanged_back  # noqa: PLC0415

    world_from_body, exchanges = exchanged_back(poses.world_from_body)
    for one, other, frame in exchanges:
        pair = f"{poses.names[one]} and {poses.names[other]}"
        monitor.notice(f"the sensors of {pair} are exchanged from frame {frame} on; they are exchanged back")
    bodies, slips = slips_moved_back(replace(poses, world_from_body=world_from_body) if exchanges else poses)
    for slip in slips:
        monitor.notice(slip.sentence(poses.names[slip.limb]))
    return bodies


def joints_of_bodies(
    project: Project, find: Callable[..., Topology], constraints: JointConstraints, monitor: Monitor
) -> Topology:
    """Return the tree of bodies with orientation, and joints beyond it that hold for a part of the take only.

    Parameters
    ----------
    project : Project
        With limbs.
    find : callable (constraints, monitor) -> Topology
        Finds joints and tree.
    constraints : JointConstraints
        What the user states of the tree.
    monitor : Monitor
        Receives progress and notices.
    """
    from skelgen.stages.joints import find_joint_spans  # noqa: PLC0415 - loads the stage

    held = HeldNotices(monitor)
    topology = find(constraints=constraints, monitor=held)
    markers = project.trajectories
    spans, parted = find_joint_spans(poses_of_markers(markers), topology.parents, markers.rate)
    if parted and constraints.parents is None and not set(parted) & set(constraints.joined):
        topology = find(constraints=replace(constraints, parted=(*constraints.parted, *parted)))
    else:
        held.release()
    for span in spans:
        monitor.notice(span.sentence(project.limbs.names))
    return replace(topology, spans=spans)
