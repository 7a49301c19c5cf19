"""OpenSim 4: a model (.osim), its motion (.mot), the measured markers (.trc) and a setup (.ik.xml).

The setup gives OpenSim's inverse kinematics a weight for each marker: that of the fit, so that the angles of the motion
come back. One body per limb. A hinge is a PinJoint about the z axis of its frames; a universal joint is
a CustomJoint with two rotations, because UniversalJoint demands axes at right angles; balls and roots turn by three
angles about x, y and z of the body. The files are in metres, degrees (.mot) and radians (.osim); the markers stay in
mm, as .trc says.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from skelgen.files import arriving_together
from skelgen.geometry.rotations import euler_angles
from skelgen.model import Project
from skelgen.model.arrays import Floats
from skelgen.progress import SILENT, Monitor, with_progress
from skelgen_formats import articulated
from skelgen_formats.articulated import Link
from skelgen_formats.bones import plain_names
from skelgen_formats.capsules import DENSITY, M_PER_MM, capsule_of
from skelgen_formats.options import JOINTS, RATE, Format, Options, Writable, files_beside, moving_project
from skelgen_formats.trc import write_trc
from skelgen_formats.writing import UPRIGHTABLE, choices_in, gravity, remark_on_up, turned_up
from skelgen_formats.xml_text import number_text, write_tree

SUFFIXES = (".osim", ".mot", ".trc", ".ik.xml")
"""Of model, motion, markers and setup."""

_TITLE, _UP = "OpenSim", "y"
_VERSION = "40000"  # of the first files with sockets and frames
_ACCURACY = "1e-9"  # of its search; OpenSim's own 1e-5 leaves tenths of a degree
_JOINT_TYPES = {
    "free": "FreeJoint",
    "ball": "BallJoint",
    "universal": "CustomJoint",
    "hinge": "PinJoint",
    "rigid": "WeldJoint",
}


def _write(value: Writable, path: Path, options: Options, monitor: Monitor) -> None:
    """Write model, motion, markers and setup beside each other, whichever of the first two `path` names."""
    project = moving_project(value, _TITLE)
    links = articulated.links_of(project, options.joints)
    named = replace(project.trajectories, names=plain_names(project.trajectories.names))
    with arriving_together(path.parent) as folder:
        model, motion, markers, setup = files = files_beside(folder / path.name, *SUFFIXES)
        falling = gravity(project, turned_up(options.axes), _UP)
        document = _document(replace(project, _trajectories=named), links, options.density, falling)
        document[0].set("name", plain_names([path.stem])[0])
        write_tree(model, document)
        write_tree(setup, _setup(project, named.names, files))
        with motion.open("w", encoding="ascii", errors="replace", newline="\n") as stream:
            stream.writelines(_motion(project, links, plain_names([path.stem])[0], monitor))
        write_trc(named, markers, Options(), SILENT)


def _document(project: Project, links: Sequence[Link], density: float, gravity_vector: Floats) -> Element:
    document = Element("OpenSimDocument", Version=_VERSION)
    articulated.add_choices(document, project)
    model = SubElement(document, "Model")
    _add(model, "gravity", number_text(gravity_vector))
    _add(model, "length_units", "meters")
    _add(model, "force_units", "N")
    bodies, joints, markers = (_objects(model, which) for which in ("BodySet", "JointSet", "MarkerSet"))
    for link in links:
        body = SubElement(bodies, "Body", name=link.name)
        capsule = capsule_of(project.skeleton, link.limb, density)
        inertia = capsule.inertia()
        _add(body, "mass", repr(capsule.mass))
        _add(body, "mass_center", number_text(capsule.centre))
        _add(body, "inertia", number_text([*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]]))
        _add_joint(joints, link)
        for marker, place in articulated.markers_on(project, link.limb):
            element = SubElement(markers, "Marker", name=project.trajectories.names[marker])
            _add(element, "socket_parent_frame", f"/bodyset/{link.name}")
            _add(element, "location", number_text(place * M_PER_MM))
            _add(element, "fixed", "true")
    return document


def _objects(model: Element, which: str) -> Element:
    return SubElement(SubElement(model, which, name=which.lower()), "objects")


def _add_joint(joints: Element, link: Link) -> None:
    element = SubElement(joints, _JOINT_TYPES[link.kind], name=link.joint)
    frames = (f"{link.parent_name}_offset", f"{link.name}_offset")
    _add(element, "socket_parent_frame", frames[0])
    _add(element, "socket_child_frame", frames[1])
    coordinates = SubElement(element, "coordinates")
    moved = [*((0.0, angles, articulated.ANGLE_MARGIN) for angles in link.angles.T)]
    if link.kind == "free":
        places = zip((link.place * M_PER_MM).tolist(), (link.translations * M_PER_MM).T, strict=True)
        moved += [(rest, values, articulated.PLACE_MARGIN) for rest, values in places]
    for name, (rest, values, margin) in zip(_coordinate_names(link), moved, strict=True):
        coordinate = SubElement(coordinates, "Coordinate", name=name)
        _add(coordinate, "default_value", repr(rest))
        _add(coordinate, "range", number_text(articulated.range_of(values, rest, margin)))
    owned = SubElement(element, "frames")
    turn = articulated.rotation_of_z_to(link.axes[0]) if link.kind == "hinge" else np.eye(3)
    above, orientation = euler_angles("XYZ", np.stack([link.rest @ turn, turn]))
    place = np.zeros(3) if link.kind == "free" else link.place
    _add_frame(owned, frames[0], f"/bodyset/{link.parent_name}" if link.parent >= 0 else "/ground", place, above)
    _add_frame(owned, frames[1], f"/bodyset/{link.name}", np.zeros(3), orientation)
    if link.kind == "universal":
        _add_two_rotations(element, link)


def _add_frame(frames: Element, name: str, parent: str, place: Floats, orientation: Floats) -> None:
    frame = SubElement(frames, "PhysicalOffsetFrame", name=name)
    _add(frame, "socket_parent", parent)
    _add(frame, "translation", number_text(place * M_PER_MM))
    _add(frame, "orientation", number_text(orientation))


def _add_two_rotations(joint: Element, link: Link) -> None:
    """Add the motion of a CustomJoint: two turns, and four freedoms that stay at 0 about and along axes of any kind."""
    third = np.cross(*link.axes)
    rotations = (*link.axes, third / np.linalg.norm(third))
    transform = SubElement(joint, "SpatialTransform")
    moved = [*link.angle_names, *[""] * 4]
    kinds = [f"{kind}{number}" for kind in ("rotation", "translation") for number in (1, 2, 3)]
    for kind, axis, coordinate in zip(kinds, (*rotations, *np.eye(3)), moved, strict=True):
        element = SubElement(transform, "TransformAxis", name=kind)
        _add(element, "coordinates", coordinate)
        _add(element, "axis", number_text(axis))
        if coordinate:
            _add(SubElement(element, "LinearFunction", name="function"), "coefficients", "1 0")
        else:
            _add(SubElement(element, "Constant", name="function"), "value", "0")


def _setup(project: Project, marker_names: Sequence[str], files: Sequence[Path]) -> Element:
    """Return a setup of OpenSim's inverse kinematics, in which markers count by the inverse of their variances."""
    from skelgen.kinematics.inverse.skeleton_tree import noise_of_markers  # noqa: PLC0415 - scipy is slow to load

    model, motion, markers, _ = files
    document = Element("OpenSimDocument", Version=_VERSION)
    tool = SubElement(document, "InverseKinematicsTool", name=motion.stem)
    _add(tool, "model_file", model.name)
    _add(tool, "marker_file", markers.name)
    _add(tool, "time_range", number_text((0.0, project.motion.times[-1])))
    _add(tool, "output_motion_file", f"{motion.stem}.ik.mot")
    _add(tool, "accuracy", _ACCURACY)
    tasks = _objects(tool, "IKTaskSet")
    used = np.flatnonzero(project.skeleton.limb_of_marker >= 0)
    noise = noise_of_markers(project.skeleton, None)[used]
    weights = (noise.min() / noise) ** 2 if len(noise) and noise.min() > 0 else np.ones(len(used))
    for marker, weight in zip(used.tolist(), weights.tolist(), strict=True):
        task = SubElement(tasks, "IKMarkerTask", name=marker_names[marker])
        _add(task, "apply", "true")
        _add(task, "weight", repr(weight))
    return document


def _coordinate_names(link: Link) -> tuple[str, ...]:
    translations = tuple(f"{link.joint}_{name}" for name in ("tx", "ty", "tz")) if link.kind == "free" else ()
    return (*link.angle_names, *translations)


def _motion(project: Project, links: Sequence[Link], name: str, monitor: Monitor) -> Iterator[str]:
    columns = [np.rad2deg(link.angles) for link in links]
    for index, link in enumerate(links):
        if link.kind == "free":
            columns[index] = np.concatenate([columns[index], link.translations * M_PER_MM], axis=1)
    names = [name for link in links for name in _coordinate_names(link)]
    yield f"{name}\nversion=1\nnRows={project.motion.n_frames}\nnColumns={len(names) + 1}\ninDegrees=yes\n"
    yield from (f"{' '.join(sentence.split())}\n" for sentence in choices_in(project))
    yield "endheader\n"
    yield "\t".join(["time", *names]) + "\n"
    rows = zip(project.motion.times.tolist(), np.concatenate(columns, axis=1).tolist(), strict=True)
    for time, values in with_progress(rows, project.motion.n_frames, monitor):
        yield "\t".join(repr(value) for value in (time, *values)) + "\n"


def _add(parent: Element, name: str, text: str) -> None:
    SubElement(parent, name).text = text


def _remarks(project: Project, options: Options) -> tuple[str, ...]:
    own = [
        f"Masses and inertias are those of capsules of {options.density:g} kg/m³, ranges those of this motion with a"
        " margin, and angles come without their deviations.",
        *remark_on_up(project, options, _UP, _TITLE),
    ]
    names = project.trajectories.names
    if plain_names(names) != names:
        own.append("Characters of marker names that OpenSim does not take become _.")
    return (*own, *articulated.remarks_on_joints(project, options, by_three_angles=True))


FORMAT = Format(
    name="opensim",
    title="OpenSim model, motion and markers",
    suffixes=SUFFIXES[:2],
    holds="skeleton",
    up=_UP,
    write=_write,
    check=lambda value, options: moving_project(value, _TITLE),
    files=lambda path, options: files_beside(path, *SUFFIXES),
    keeps=("markers", "names", "limbs", "joints", "angles", "kinds", "motion"),
    marks_open="comments of the model, header of the motion",
    remarks=_remarks,
    options=(UPRIGHTABLE, RATE, JOINTS, DENSITY),
    note="Four files are written: .osim, .mot, .trc, and .ik.xml for inverse kinematics; m and degrees, markers in mm.",
)
