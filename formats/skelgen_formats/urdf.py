"""URDF (.urdf), and its motion beside it (.urdf.csv): metres and radians, as ROS has them.

A hinge is a revolute joint. URDF knows no other turns, so a universal joint is two of them in a row and a ball three,
with links without mass between; a root hangs on the link ``world`` by three prismatic and three revolute joints. All
frames have the orientation of the world in the reference pose, where every angle is 0.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from skelgen.files import arriving_together
from skelgen.geometry.rotations import euler_angles
from skelgen.model import Project
from skelgen.model.arrays import Floats
from skelgen.progress import SILENT, Monitor
from skelgen_formats.articulated import (
    M_PER_MM,
    Link,
    bones_of,
    frame_along,
    links_of,
    markers_on,
    plain_names,
    remarks_on_joints,
)
from skelgen_formats.motion_csv import write_motion
from skelgen_formats.options import AS_MOVED, AXES, JOINTS, RATE, Format, Options, Writable, moving_project
from skelgen_formats.text import number_text, write_tree

MODEL_SUFFIX, MOTION_SUFFIX = ".urdf", ".urdf.csv"

_TITLE = "URDF"
_EFFORT, _VELOCITY = "1000", "100"  # URDF demands limits; nothing was measured that says any
_BONE_RADIUS_M = "0.01"


class _Single(NamedTuple):
    """One joint of one freedom."""

    name: str
    kind: str
    axis: Floats
    values: Floats
    unit: str


def write_urdf(value: Writable, path: Path, joints: str = AS_MOVED, monitor: Monitor = SILENT) -> list[Path]:
    """Write the robot, and a table with the value of each joint in every frame.

    Parameters
    ----------
    value : Project
        Finished.
    path : Path
        The robot; its motion stands beside it.
    joints : str
        `AS_MOVED` or `AS_FOUND`.
    monitor : Monitor
        Shows progress; may cancel.

    Raises
    ------
    WriteError
        If the value is no project or has no frames, or a file cannot be written.
    MissingResultError
        If the project has no skeleton yet.
    """
    project = moving_project(value, _TITLE)
    links = links_of(project, joints)
    singles = [single for link in links for single in _singles(link)]
    columns = [f"{single.name}_{single.unit}" for single in singles]
    with arriving_together(path.parent) as folder:
        model, motion = _files(folder / path.name)
        write_tree(model, _robot(project, links, path.stem))
        write_motion(motion, columns, project.motion.times, [np.stack([single.values for single in singles], axis=1)])
    return list(_files(path))


def _files(path: Path) -> tuple[Path, Path]:
    return path.with_suffix(MODEL_SUFFIX), path.with_suffix(MOTION_SUFFIX)


def _robot(project: Project, links: Sequence[Link], name: str) -> Element:
    robot = Element("robot", name=plain_names([name])[0])
    SubElement(robot, "link", name="world")
    marker_names = plain_names(project.trajectories.names)
    for link in links:
        _add_link(robot, link, bones_of(project, link))
        for marker, place in markers_on(project, link.limb):
            marker_name = f"marker_{marker_names[marker]}"
            SubElement(robot, "link", name=marker_name)
            _add_joint(robot, "fixed", f"{marker_name}_joint", link.name, marker_name, place)
    return robot


def _add_link(robot: Element, link: Link, bones: Sequence[Floats]) -> None:
    """Add a limb, and its joints in a row; all but the last end in links that have no name elsewhere and no mass."""
    body = SubElement(robot, "link", name=link.name)
    for end in bones:
        _add_bone(body, end)
    singles = _singles(link)
    place = np.zeros(3) if link.kind == "free" else link.place
    if not singles:
        _add_joint(robot, "fixed", link.joint, link.parent_name, link.name, place)
    parent = link.parent_name
    for number, single in enumerate(singles, start=1):
        last = number == len(singles)
        child = link.name if last else f"{single.name}_link"
        if not last:
            SubElement(robot, "link", name=child)
        joint = _add_joint(robot, single.kind, single.name, parent, child, place if number == 1 else np.zeros(3))
        SubElement(joint, "axis", xyz=number_text(single.axis))
        lower, upper = (repr(float(end)) for end in (single.values.min(), single.values.max()))
        SubElement(joint, "limit", lower=lower, upper=upper, effort=_EFFORT, velocity=_VELOCITY)
        parent = child


def _add_joint(robot: Element, kind: str, name: str, parent: str, child: str, place: Floats) -> Element:
    joint = SubElement(robot, "joint", name=name, type=kind)
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    SubElement(joint, "origin", xyz=number_text(place * M_PER_MM), rpy="0 0 0")
    return joint


def _add_bone(body: Element, end: Floats) -> None:
    """Add a cylinder from the limb's joint to another of its joints, for people to see."""
    visual = SubElement(body, "visual")
    # roll, pitch and yaw turn about fixed x, y, z: the rotation is Rz(yaw) Ry(pitch) Rx(roll)
    roll, pitch, yaw = -euler_angles("XYZ", frame_along(end).T[np.newaxis])[0]
    SubElement(visual, "origin", xyz=number_text(end / 2 * M_PER_MM), rpy=number_text([roll, pitch, yaw]))
    geometry = SubElement(visual, "geometry")
    SubElement(geometry, "cylinder", radius=_BONE_RADIUS_M, length=repr(float(np.linalg.norm(end)) * M_PER_MM))


def _singles(link: Link) -> list[_Single]:
    turns = zip(link.angle_names, link.axes, link.angles.T, strict=True)
    revolute = [_Single(name, "revolute", axis, values, "rad") for name, axis, values in turns]
    return [*_shifts(link), *revolute]


def _shifts(link: Link) -> Iterator[_Single]:
    if link.kind == "free":
        for letter, axis, values in zip("xyz", np.eye(3), (link.translations * M_PER_MM).T, strict=True):
            yield _Single(f"{link.joint}_t{letter}", "prismatic", axis, values, "m")


def _remarks(project: Project, options: Options) -> tuple[str, ...]:
    return (
        "URDF has no balls, universal joints or free bodies: they become three, two and six joints in a row.",
        "Limits are the range of this motion; masses, and the deviations of angles, are not written.",
        *remarks_on_joints(project, options, by_three_angles=True),
    )


FORMAT = Format(
    name="urdf",
    title="URDF robot and its motion",
    suffixes=(MODEL_SUFFIX,),
    holds="skeleton",
    write=lambda value, path, options, monitor: write_urdf(value, path, options.joints, monitor),
    check=lambda value, options: moving_project(value, _TITLE),
    files=lambda path, options: _files(path),
    keeps=("names", "limbs", "joints", "angles", "motion"),
    remarks=_remarks,
    options=(AXES, RATE, JOINTS),
    note="Two files are written, .urdf and .urdf.csv with the value of each joint in every frame; in m and rad.",
)
