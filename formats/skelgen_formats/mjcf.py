"""MJCF, the models of MuJoCo (.mjcf.xml), and their motion (.qpos.csv): metres and radians.

One body per limb, nested; hinges and balls as MuJoCo has them, two hinges in one body for a universal joint, a free
joint for each root that moves, none for a rigid joint and a base that stands in the room. The columns of the motion are
MuJoCo's ``qpos`` in its order: quaternions are w x y z of the limb against its parent. The keyframe ``start`` is the
first frame. Markers are sites. The z axis of a hinge's body is the axis it turns about; other bodies have the
orientation of the world in the reference pose.
"""

from collections.abc import Mapping
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from skelgen.files import arriving_together
from skelgen.geometry.rotations import quaternion_from_matrix, vector_from_matrix
from skelgen.model import Project
from skelgen.model.arrays import Bools, Floats, displayable
from skelgen.progress import Monitor
from skelgen_formats.articulated import (
    ANGLE_MARGIN,
    Link,
    add_choices,
    bones_of,
    links_of,
    markers_on,
    range_of,
    remarks_on_joints,
    turns_fully,
)
from skelgen_formats.bones import plain_names
from skelgen_formats.capsules import DENSITY, M_PER_MM, capsule_of
from skelgen_formats.motion_csv import MARKS_OPEN, with_marks, write_motion
from skelgen_formats.options import JOINTS, RATE, Format, Options, Writable, files_beside, moving_project
from skelgen_formats.writing import UPRIGHTABLE, gravity, remark_on_up, turned_up
from skelgen_formats.xml_text import number_text, write_tree

MODEL_SUFFIX, MOTION_SUFFIX = ".mjcf.xml", ".qpos.csv"

_TITLE, _UP = "MJCF", "z"
_BONE_RADIUS_M, _SITE_RADIUS_M = "0.01", "0.005"


def _write(value: Writable, path: Path, options: Options, monitor: Monitor) -> None:
    """Write the model, and a table with the coordinates of every frame."""
    project = moving_project(value, _TITLE)
    links = {link.name: link for link in links_of(project, options.joints)}
    with arriving_together(path.parent) as folder:
        model, motion = files_beside(folder / path.name, MODEL_SUFFIX, MOTION_SUFFIX)
        document = Element("mujoco", model=displayable(model.name.removesuffix(MODEL_SUFFIX)))
        add_choices(document, project)
        SubElement(document, "compiler", angle="radian")
        SubElement(document, "option", gravity=number_text(gravity(project, turned_up(options.axes), _UP)))
        order = [links[name] for name in _add_bodies(document, project, links, options.density)]
        qpos = np.concatenate([_coordinates(link) for link in order], axis=1)
        SubElement(SubElement(document, "keyframe"), "key", name="start", qpos=number_text(qpos[0]))
        write_tree(model, document)
        columns, names = [name for link in order for name in _columns(link)], plain_names(project.skeleton.joint_names)
        columns, marked = with_marks(columns, [qpos], project.skeleton, names)
        write_motion(motion, columns, project.motion.times, marked)


def _add_bodies(document: Element, project: Project, links: Mapping[str, Link], density: float) -> list[str]:
    """Add the bodies, and return their names in MuJoCo's order: as they stand in the file."""
    default = SubElement(document, "default")
    attributes = {"type": "capsule", "size": _BONE_RADIUS_M, "contype": "0", "conaffinity": "0"}
    SubElement(default, "geom", attributes, density=repr(density))
    SubElement(default, "site", size=_SITE_RADIUS_M)
    elements = {"world": SubElement(document, "worldbody")}
    for name, link in links.items():
        above = links[link.parent_name].turn if link.parent >= 0 else np.eye(3)
        elements[name] = body = SubElement(elements[link.parent_name], "body", name=name)
        body.set("pos", number_text(link.place @ above * M_PER_MM))
        body.set("quat", number_text(quaternion_from_matrix(above.T @ link.rest @ link.turn)))
        _add_joints(body, link)
        capsule = capsule_of(project.skeleton, link.limb, density)
        ends = np.concatenate([capsule.start @ link.turn, capsule.end @ link.turn])
        SubElement(body, "geom", name=name, fromto=number_text(ends), size=repr(capsule.radius))
        for end in bones_of(project, link):  # for people to see
            SubElement(body, "geom", fromto=number_text([0.0, 0.0, 0.0, *(end @ link.turn * M_PER_MM)]), mass="0")
        for marker, place in markers_on(project, link.limb):
            where = number_text(place @ link.turn * M_PER_MM)
            SubElement(body, "site", name=project.trajectories.names[marker], pos=where)
    return [str(body.get("name")) for body in elements["world"].iter("body")]


def _add_joints(body: Element, link: Link) -> None:
    if link.kind == "free":
        SubElement(body, "freejoint", name=link.joint)
    elif link.kind == "ball":
        _, most = range_of(np.linalg.norm(vector_from_matrix(link.rotations), axis=1), 0.0, ANGLE_MARGIN)
        limits = {"range": number_text((0.0, most))} if most < np.pi else {}
        SubElement(body, "joint", limits, name=link.joint, type="ball")
    else:
        for name, axis, angles in zip(link.angle_names, link.axes, link.angles.T, strict=True):
            is_free = turns_fully(angles)
            limits = {"limited": "false"} if is_free else {"range": number_text(range_of(angles, 0.0, ANGLE_MARGIN))}
            SubElement(body, "joint", limits, name=name, type="hinge", axis=number_text(axis @ link.turn))


def _columns(link: Link) -> list[str]:
    quaternion = [f"{link.joint}_q{letter}" for letter in "wxyz"]
    if link.kind == "free":
        return [*(f"{link.joint}_{letter}_m" for letter in "xyz"), *quaternion]
    return quaternion if link.kind == "ball" else [f"{name}_rad" for name in link.angle_names]


def _coordinates(link: Link) -> Floats:
    """Values of ``qpos`` for one limb, shape (n_frames, n_columns)."""
    if link.kind not in {"free", "ball"}:
        return link.angles
    quaternions = quaternion_from_matrix(link.rotations)
    turned_back: Bools = np.cumsum((quaternions[1:] * quaternions[:-1]).sum(axis=1) < 0) % 2 == 1
    quaternions[1:][turned_back] *= -1  # q and -q are one rotation: no jumps, so that frames can be interpolated
    if link.kind == "ball":
        return quaternions
    return np.concatenate([link.translations * M_PER_MM, quaternions], axis=1)


def _remarks(project: Project, options: Options) -> tuple[str, ...]:
    return (
        f"Ranges are those of this motion with a margin, masses those of capsules of {options.density:g} kg/m³; the"
        " deviations of angles are not written.",
        *remark_on_up(project, options, _UP, _TITLE),
        *remarks_on_joints(project, options, by_three_angles=False),
    )


FORMAT = Format(
    name="mjcf",
    title="MJCF model of MuJoCo and its motion",
    suffixes=(MODEL_SUFFIX, ".mjcf"),
    holds="skeleton",
    up=_UP,
    write=_write,
    check=lambda value, options: moving_project(value, _TITLE),
    files=lambda path, options: files_beside(path, MODEL_SUFFIX, MOTION_SUFFIX),
    keeps=("names", "limbs", "joints", "angles", "kinds", "motion"),
    marks_open=f"comments of the model; in the motion, {MARKS_OPEN}",
    remarks=_remarks,
    options=(UPRIGHTABLE, RATE, JOINTS, DENSITY),
    note="Two files are written, .mjcf.xml and .qpos.csv with MuJoCo's coordinates in every frame; in m and rad.",
)
