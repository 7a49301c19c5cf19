"""glTF 2.0 as one binary file (.glb): a skin of bones that an animation moves, with the markers as points on it.

Every limb is a node, below its parent's; all roots hang on the node ``skeleton``. The y axis of a node points along
its limb, to the next joint; a limb that carries no other has a node where it ends, so that every bone has a length. At
rest nodes stand as in the skeleton's reference pose. The animation has a rotation for every limb and a translation for
every root, linear between keys. Each marker is a point that its limb carries with weight 1: it lies where the skeleton
has it, not where it was measured. What glTF has no field for stands in ``extras``: of a node the type, axis and
deviation of its joint in the axes of the nodes, what limb and joint are called, of the mesh the names of the markers.

Numbers are single precision, little endian; quaternions are x y z w; matrices are stored column by column.
"""

import json
import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skelgen.errors import WriteError
from skelgen.files import replacing
from skelgen.geometry.rotations import transform_from
from skelgen.model import Project, Skeleton
from skelgen.model.arrays import Floats
from skelgen.model.placed_joints import place_of
from skelgen.progress import Monitor, with_progress
from skelgen_formats import bones
from skelgen_formats.options import BONE_NAMES, METRES, RATE, REST, Format, Options, Writable, moving_project, per_mm
from skelgen_formats.writing import UPRIGHT, remark_on_up

_TITLE = "glTF"
_UP = "y"

_MAGIC, _VERSION = b"glTF", 2
_JSON_CHUNK, _BINARY_CHUNK = b"JSON", b"BIN\0"
_LARGEST = 2**32 - 1  # bytes of a file: its length is stored in 32 bits
_FLOAT, _USHORT = 5126, 5123
_TYPES = {(): "SCALAR", (3,): "VEC3", (4,): "VEC4", (4, 4): "MAT4"}
_VERTICES = 34962  # of a buffer view that holds attributes of a mesh
_POINTS = 0
_SKELETON_NODE = 0


def _write(value: Writable, path: Path, options: Options, monitor: Monitor) -> None:
    """Write skeleton, motion and markers of a finished project."""
    project = moving_project(value, _TITLE)
    bones.check_single_precision(project, _TITLE)
    data = _Data()
    document = _document(project, per_mm(options.unit), data, monitor)
    document |= {"bufferViews": data.views, "accessors": data.accessors, "buffers": [{"byteLength": len(data.content)}]}
    text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
    chunks = _chunk(_JSON_CHUNK, text, b" ") + _chunk(_BINARY_CHUNK, bytes(data.content), b"\0")
    length = 12 + len(chunks)
    if length > _LARGEST:
        raise WriteError(f"{path}: a glTF file holds at most 4 GB; choose a lower frame rate")
    with replacing(path) as temporary:
        temporary.write_bytes(_MAGIC + struct.pack("<II", _VERSION, length) + chunks)


def _chunk(kind: bytes, content: bytes, padding: bytes) -> bytes:
    padded = content + padding * (-len(content) % 4)
    return struct.pack("<I", len(padded)) + kind + padded


class _Data:
    """The binary part while it grows, with the views and accessors that say what is where."""

    def __init__(self) -> None:
        self.content = bytearray()
        self.views: list[dict[str, int]] = []
        self.accessors: list[dict[str, object]] = []

    def add(self, values: NDArray[Any], *, vertices: bool = False, bounds: bool = False) -> int:
        """Append an array, one element per row, and return the index of its accessor."""
        kind = _USHORT if values.dtype.kind in "iu" else _FLOAT
        array = values.astype("<u2" if kind == _USHORT else "<f4")
        view = {"buffer": 0, "byteOffset": len(self.content), "byteLength": array.nbytes}
        self.views.append(view | {"target": _VERTICES} if vertices else view)
        self.content += array.tobytes()  # of two-byte numbers there are four to an element: all stays aligned to four
        accessor: dict[str, object] = {"bufferView": len(self.views) - 1, "componentType": kind, "count": len(array)}
        accessor["type"] = _TYPES[array.shape[1:]]
        if bounds:
            low, high = np.atleast_1d(array.min(axis=0)), np.atleast_1d(array.max(axis=0))
            accessor |= {"min": low.astype(float).tolist(), "max": high.astype(float).tolist()}
        self.accessors.append(accessor)
        return len(self.accessors) - 1


def _document(project: Project, scale: float, data: _Data, monitor: Monitor) -> dict[str, object]:
    skeleton, turns = project.skeleton, bones.limb_from_bone(project.skeleton)
    ends = [limb for limb in range(skeleton.n_limbs) if not (skeleton.parents == limb).any()]
    rest = bones.turned_bones(bones.scaled_poses(skeleton.reference_pose, scale), turns)
    nodes: list[dict[str, object]] = [
        {"name": "skeleton", "children": [_node(root) for root in skeleton.roots.tolist()]}
    ]
    nodes += _bones(skeleton, rest, turns, ends)
    lengths = [float(np.linalg.norm(bones.bone_end(skeleton, limb))) * scale for limb in ends]
    names = bones.end_names(skeleton, bones.COLON)
    nodes += [{"name": names[one], "translation": [0.0, way, 0.0]} for one, way in zip(ends, lengths, strict=True)]
    shown = [_SKELETON_NODE]
    document: dict[str, object] = {"asset": {"version": "2.0", "generator": "skelgen"}, "scene": 0, "nodes": nodes}
    posed = np.concatenate([rest, rest[ends] @ bones.along_bones(lengths)])
    back = posed[..., :3, :3].swapaxes(-1, -2)
    matrices = data.add(transform_from(back, -(back @ posed[..., :3, 3, np.newaxis])[..., 0]).swapaxes(-1, -2))
    joints = [_node(index) for index in range(len(posed))]
    document["skins"] = [{"joints": joints, "skeleton": _SKELETON_NODE, "inverseBindMatrices": matrices}]
    if (skeleton.limb_of_marker >= 0).any():
        document["meshes"] = [_markers(project, scale, data)]
        nodes.append({"name": "markers", "mesh": 0, "skin": 0})
        shown.append(len(nodes) - 1)
    document["animations"] = [_animation(project, scale, turns, data, monitor)]
    return document | {"scenes": [{"nodes": shown}]}


def _node(limb: int) -> int:
    """Index of a limb's node, or behind the limbs, of an end's."""
    return limb + 1


def _bones(skeleton: Skeleton, rest: Floats, turns: Floats, ends: Sequence[int]) -> Iterator[dict[str, object]]:
    """Yield the nodes of the limbs; those of `ends` carry a node that stands behind all limbs, in that order."""
    facts, names = bones.bone_facts(skeleton, turns), bones.bone_names(skeleton, bones.COLON)
    for limb in range(skeleton.n_limbs):
        translation, rotation = bones.bone_transforms(rest, int(skeleton.parents[limb]), limb)
        node: dict[str, object] = {"name": names[limb], "translation": translation.tolist()}
        node["rotation"] = bones.xyzw_from_matrix(rotation).tolist()
        children = [_node(int(child)) for child in np.flatnonzero(skeleton.parents == limb)]
        node["children"] = children or [_node(skeleton.n_limbs + ends.index(limb))]
        stated: dict[str, object] = {"limb": skeleton.limb_names[limb]}
        node["extras"] = stated
        if limb in facts:
            joint, axis, second, std = facts[limb]
            axes = {"axis_in_parent": axis, "second_axis_in_child": second}
            stated |= {"joint": skeleton.joint_name(joint), "kind": joint.kind, "std_mm": std.tolist()}
            stated["determined"] = joint.is_determined
            stated["fully_determined"] = joint.is_fully_determined
            stated |= {"place": remark} if (remark := place_of(joint).remark) else {}
            stated |= {name: axis.tolist() for name, axis in axes.items() if axis is not None}
        yield node


def _markers(project: Project, scale: float, data: _Data) -> dict[str, object]:
    skeleton = project.skeleton
    carried = np.flatnonzero(skeleton.limb_of_marker >= 0)
    limbs = skeleton.limb_of_marker[carried]
    offsets = skeleton.marker_offsets[carried] * scale
    rest = bones.scaled_poses(skeleton.reference_pose, scale)
    places = (rest[limbs, :3, :3] @ offsets[..., np.newaxis])[..., 0] + rest[limbs, :3, 3]
    ridden, weights = np.zeros((len(carried), 4), dtype=np.intp), np.zeros((len(carried), 4))
    ridden[:, 0], weights[:, 0] = limbs, 1.0
    attributes = {
        "POSITION": data.add(places, vertices=True, bounds=True),
        "JOINTS_0": data.add(ridden, vertices=True),
        "WEIGHTS_0": data.add(weights, vertices=True),
    }
    names = [project.trajectories.names[marker] for marker in carried.tolist()]
    primitive = {"attributes": attributes, "mode": _POINTS}
    return {"name": "markers", "primitives": [primitive], "extras": {"marker_names": names}}


def _animation(project: Project, scale: float, turns: Floats, data: _Data, monitor: Monitor) -> dict[str, object]:
    skeleton, poses = project.skeleton, bones.turned_bones(project.motion.world_from_limb, turns)
    keys = data.add(project.motion.times, bounds=True)
    free = bones.free_limbs(skeleton, poses)
    samplers: list[dict[str, object]] = []
    channels: list[dict[str, object]] = []

    def move(limb: int, what: str, values: Floats) -> None:
        samplers.append({"input": keys, "output": data.add(values), "interpolation": "LINEAR"})
        channels.append({"sampler": len(samplers) - 1, "target": {"node": _node(limb), "path": what}})

    for limb in with_progress(skeleton.outward.tolist(), skeleton.n_limbs, monitor, every=1):
        parent = int(skeleton.parents[limb])
        translation, rotation = bones.bone_transforms(poses, parent, limb)
        if limb in free:
            move(limb, "translation", translation * scale)
        # of the two signs of a quaternion, the one nearer to the frame before
        quaternions = bones.xyzw_from_matrix(rotation)
        flips = np.where((quaternions[1:] * quaternions[:-1]).sum(axis=-1) < 0, -1.0, 1.0)
        move(limb, "rotation", quaternions * np.cumprod(np.concatenate([[1.0], flips]))[:, np.newaxis])
    return {"name": "motion", "samplers": samplers, "channels": channels}


def _remarks(project: Project, options: Options) -> tuple[str, ...]:
    remarks = [*remark_on_up(project, options, _UP, "glTF")]
    if options.unit != METRES.default:
        remarks.append(f"glTF demands metres: other programs will take the {options.unit} in the file for metres.")
    riding = "Markers ride on their limbs, where the skeleton has them; measured positions and gaps are not held."
    return (*remarks, riding, *bones.lost_in_animations(project, _TITLE))


FORMAT = Format(
    name="gltf",
    title="glTF 2.0, binary",
    suffixes=(".glb",),
    holds="skeleton",
    up=_UP,
    write=_write,
    check=lambda value, options: moving_project(value, _TITLE),
    keeps=("names", "limbs", "joints", "kinds", "uncertainty", "motion"),
    marks_open="`extras` of the nodes: `determined`, `fully_determined`, `place`",
    remarks=_remarks,
    options=(UPRIGHT, METRES, RATE, BONE_NAMES, REST),
    note="Skin, joints, animation, and markers as points that ride on their limbs; metres by default.",
)
