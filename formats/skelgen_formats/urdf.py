"""URDF (.urdf), and its motion beside it (.urdf.csv): metres and radians, as ROS has them.

A hinge is a revolute joint, or a continuous one if it goes through full turns, as wheels do. URDF knows no other
turns, so a universal joint is two of them in a row and a ball three, with links of next to no mass between; a root
hangs on the link ``world`` by three prismatic and three revolute joints, or by a fixed one if it stands in the room.
In the reference pose every joint is at 0. Frames have the orientation of the world then, but for the links of hinges
and universal joints, whose z axis is the axis they turn about, as robots have it.
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
from skelgen.progress import Monitor
from skelgen_formats import articulated
from skelgen_formats.articulated import Link
from skelgen_formats.bones import plain_names
from skelgen_formats.capsules import DENSITY, M_PER_MM, capsule_of
from skelgen_formats.motion_csv import MARKS_OPEN, with_marks, write_motion
from skelgen_formats.options import JOINTS, RATE, Format, Options, Writable, files_beside, moving_project
from skelgen_formats.writing import UPRIGHTABLE, remark_on_up
from skelgen_formats.xml_text import number_text, write_tree

MODEL_SUFFIX, MOTION_SUFFIX = ".urdf", ".urdf.csv"

_TITLE, _UP = "URDF", "z"
_EFFORT, _VELOCITY = "1000", "100"  # URDF demands limits; nothing was measured that says any
_BONE_RADIUS_M = "0.01"
_ORIGIN = np.zeros(3)
_NO_MASS_KG, _NO_INERTIA = 1e-6, np.eye(3) * 1e-9  # of what has none; simulators refuse to move links without


class _Single(NamedTuple):
    """One joint of one freedom; its axis is in the joint's frame, which `turn` gives in that of the limb."""

    name: str
    kind: str
    axis: Floats
    turn: Floats
    values: Floats
    unit: str

    @property
    def type(self) -> str:
        """The type that URDF knows it by."""
        return "continuous" if self.kind == "revolute" and articulated.turns_fully(self.values) else self.kind


def _write(value: Writable, path: Path, options: Options, monitor: Monitor) -> None:
    """Write the robot, and a table with the value of each joint in every frame."""
    project = moving_project(value, _TITLE)
    links = articulated.links_of(project, options.joints)
    singles = [single for link in links for single in _singles(link)]
    columns = [f"{single.name}_{single.unit}" for single in singles]
    with arriving_together(path.parent) as folder:
        model, motion = files_beside(folder / path.name, MODEL_SUFFIX, MOTION_SUFFIX)
        write_tree(model, _robot(project, links, path.stem, options.density))
        values = [np.stack([single.values for single in singles], axis=1)]
        names = plain_names(project.skeleton.joint_names)
        columns, marked = with_marks(columns, values, project.skeleton, names)
        write_motion(motion, columns, project.motion.times, marked)


def _robot(project: Project, links: Sequence[Link], name: str, density: float) -> Element:
    robot = Element("robot", name=plain_names([name])[0])
    articulated.add_choices(robot, project)
    SubElement(robot, "link", name="world")
    marker_names = plain_names(project.trajectories.names)
    turns = {-1: np.eye(3)} | {link.limb: link.turn for link in links}
    for link in links:
        body = SubElement(robot, "link", name=link.name)
        capsule = capsule_of(project.skeleton, link.limb, density)
        inertia = link.turn.T @ capsule.inertia() @ link.turn
        _add_inertial(body, capsule.mass, capsule.centre @ link.turn, inertia)
        for end in articulated.bones_of(project, link):
            _add_bone(body, end @ link.turn)
        _add_joints(robot, link, turns[link.parent])
        for marker, place in articulated.markers_on(project, link.limb):
            marker_name = f"marker_{marker_names[marker]}"
            _add_inertial(SubElement(robot, "link", name=marker_name))
            names = (f"{marker_name}_joint", link.name, marker_name)
            _add_joint(robot, "fixed", names, place @ link.turn, np.eye(3))
    return robot


def _add_joints(robot: Element, link: Link, above: Floats) -> None:
    """Add a limb's joints in a row; all but the last end in links that have no name elsewhere and next to no mass."""
    place, singles = link.place @ above, _singles(link)
    if not singles:
        _add_joint(robot, "fixed", (link.joint, link.parent_name, link.name), place, above.T @ link.rest @ link.turn)
    parent = link.parent_name
    for number, single in enumerate(singles, start=1):
        child = link.name if number == len(singles) else f"{single.name}_link"
        if child != link.name:
            _add_inertial(SubElement(robot, "link", name=child))
        joint = _add_joint(robot, single.type, (single.name, parent, child), place, above.T @ single.turn)
        SubElement(joint, "axis", xyz=number_text(single.axis))
        limit = SubElement(joint, "limit", effort=_EFFORT, velocity=_VELOCITY)
        if single.type != "continuous":
            least = articulated.ANGLE_MARGIN if single.unit == "rad" else articulated.PLACE_MARGIN
            lower, upper = articulated.range_of(single.values, 0.0, least)
            limit.attrib.update(lower=repr(lower), upper=repr(upper))
        parent, place, above = child, np.zeros(3), single.turn


def _add_joint(robot: Element, kind: str, names: tuple[str, str, str], place: Floats, turn: Floats) -> Element:
    """Add a joint of a name between a parent and a child, at a place [mm] and with a frame given in the parent's."""
    name, parent, child = names
    joint = SubElement(robot, "joint", name=name, type=kind)
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    SubElement(joint, "origin", xyz=number_text(place * M_PER_MM), rpy=_rpy(turn))
    return joint


def _add_inertial(
    body: Element, mass: float = _NO_MASS_KG, centre: Floats = _ORIGIN, inertia: Floats = _NO_INERTIA
) -> None:
    element = SubElement(body, "inertial")
    SubElement(element, "origin", xyz=number_text(centre), rpy="0 0 0")
    SubElement(element, "mass", value=repr(mass))
    pairs = [(row, column) for row in range(3) for column in range(row, 3)]
    values = {f"i{'xyz'[row]}{'xyz'[column]}": repr(float(inertia[row, column])) for row, column in pairs}
    SubElement(element, "inertia", values)


def _add_bone(body: Element, end: Floats) -> None:
    """Add a cylinder from the limb's joint to another of its joints, for people to see."""
    visual = SubElement(body, "visual")
    SubElement(visual, "origin", xyz=number_text(end / 2 * M_PER_MM), rpy=_rpy(articulated.rotation_of_z_to(end)))
    geometry = SubElement(visual, "geometry")
    SubElement(geometry, "cylinder", radius=_BONE_RADIUS_M, length=repr(float(np.linalg.norm(end)) * M_PER_MM))


def _rpy(rotation: Floats) -> str:
    """Roll, pitch and yaw turn about fixed x, y, z: the rotation is Rz(yaw) Ry(pitch) Rx(roll)."""
    return number_text(-euler_angles("XYZ", rotation.T[np.newaxis])[0])


def _singles(link: Link) -> list[_Single]:
    turns = zip(link.angle_names, link.axes, link.angles.T, strict=True)
    if link.kind in {"hinge", "universal"}:
        about_z = np.array([0.0, 0.0, 1.0])
        return [
            _Single(name, "revolute", about_z, articulated.rotation_of_z_to(axis), values, "rad")
            for name, axis, values in turns
        ]
    revolute = [_Single(name, "revolute", axis, np.eye(3), values, "rad") for name, axis, values in turns]
    return [*_shifts(link), *revolute]


def _shifts(link: Link) -> Iterator[_Single]:
    if link.kind == "free":
        for letter, axis, values in zip("xyz", np.eye(3), ((link.translations - link.place) * M_PER_MM).T, strict=True):
            yield _Single(f"{link.joint}_t{letter}", "prismatic", axis, np.eye(3), values, "m")


def _remarks(project: Project, options: Options) -> tuple[str, ...]:
    return (
        "URDF has no balls, universal joints or free bodies: they become three, two and six joints in a row.",
        f"Limits are the range of this motion with a margin, masses those of capsules of {options.density:g} kg/m³; the"
        " deviations of angles are not written.",
        *remark_on_up(project, options, _UP, "A robot"),
        *articulated.remarks_on_joints(project, options, by_three_angles=True),
    )


FORMAT = Format(
    name="urdf",
    title="URDF robot and its motion",
    suffixes=(MODEL_SUFFIX,),
    holds="skeleton",
    up=_UP,
    write=_write,
    check=lambda value, options: moving_project(value, _TITLE),
    files=lambda path, options: files_beside(path, MODEL_SUFFIX, MOTION_SUFFIX),
    keeps=("names", "limbs", "joints", "angles", "kinds", "motion"),
    marks_open=f"comments of the robot; in the motion, {MARKS_OPEN}",
    remarks=_remarks,
    options=(UPRIGHTABLE, RATE, JOINTS, DENSITY),
    note="Two files are written, .urdf and .urdf.csv with the value of each joint in every frame; in m and rad.",
)
