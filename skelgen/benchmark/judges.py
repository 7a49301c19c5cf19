"""Poses of the bones in exported files, as the programs or libraries that own the formats have them.

Each judge is imported where it is used; where it is not installed, its format is not judged.
"""

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from skelgen_formats.bones import bone_names, matrix_from_xyzw
from skelgen_formats.motion_csv import MARK
from skelgen_formats.registry import write_file

from skelgen.geometry.rotations import transform_from
from skelgen.model import Project
from skelgen.model.arrays import Floats

PER_METRE = 1000.0  # mm

Bones = dict[str, Floats]
"""World pose of every bone in every frame, by name, shape (n_frames, 4, 4), lengths in the file's unit."""


@dataclass(frozen=True)
class Judge:
    """Who poses a format, and how far the result may be off.

    Attributes
    ----------
    suffix : str
        Of the file to write.
    name : str
        Of the library that poses it.
    tolerance : float
        Wanted [mm].
    places : callable (files, project) -> ndarray, shape (n_frames, n_limbs or n_joints, 3), mm
        Where the written files have limbs or joints.
    of_joints : bool
        Whether it is joints that are placed, not limbs.
    axes : str
        The choice of axes, where the default is not as recorded.
    """

    suffix: str
    name: str
    tolerance: float
    places: Callable[[Sequence[Path], Project], Floats]
    of_joints: bool = False
    axes: str = ""

    def write(self, project: Project, folder: Path) -> list[Path]:
        """Write a project in this format, in the axes of its motion.

        Parameters
        ----------
        project : Project
            Finished.
        folder : Path
            Where the files go.
        """
        path = folder / f"take{self.suffix}"
        return write_file(project, path, axes=self.axes) if self.axes else write_file(project, path)

    def deviation(self, files: Sequence[Path], project: Project) -> float:
        """Return the largest distance [mm] along an axis between what the judge poses and the project's motion.

        Parameters
        ----------
        files : sequence of Path
            The export.
        project : Project
            What was exported.
        """
        motion = project.motion
        truth = motion.joint_positions if self.of_joints else motion.world_from_limb[..., :3, 3]
        return float(np.nanmax(np.abs(self.places(files, project) - truth)))


def bones_of_bvh(path: Path, n_frames: int) -> Bones:
    """Return the poses that bvhio gives the bones of a BVH file.

    Parameters
    ----------
    path : Path
        The file.
    n_frames : int
        Number of its frames.
    """
    import bvhio  # noqa: PLC0415 - a judge, installed with the extra `dev`

    root = bvhio.readAsHierarchy(str(path))
    poses: dict[str, list[Floats]] = {}
    for frame in range(n_frames):
        root.loadPose(frame)
        for joint, *_ in root.layout():
            poses.setdefault(joint.Name, []).append(np.array(joint.SpaceWorld.to_list()).T)
    return {name: np.array(frames, dtype=float) for name, frames in poses.items()}


def bones_of_usd(path: Path) -> Bones:
    """Return the poses that UsdSkel's skeleton cache gives the joints of a USD file."""
    from pxr import Usd, UsdGeom, UsdSkel  # noqa: PLC0415 - the extra `usd`

    stage = Usd.Stage.Open(str(path))
    cache = UsdSkel.Cache()
    cache.Populate(UsdSkel.Root(stage.GetDefaultPrim()), Usd.PrimDefaultPredicate)
    (binding,) = [cache.GetSkelQuery(UsdSkel.Skeleton(prim)) for prim in stage.Traverse() if prim.IsA(UsdSkel.Skeleton)]
    (motion,) = [UsdSkel.Animation(prim) for prim in stage.Traverse() if prim.IsA(UsdSkel.Animation)]
    times = motion.GetRotationsAttr().GetTimeSamples()
    poses = [np.array(binding.ComputeJointWorldTransforms(UsdGeom.XformCache(time))) for time in times]
    names = [str(joint).rpartition("/")[2] for joint in binding.GetJointOrder()]
    return dict(zip(names, np.array(poses).swapaxes(-1, -2).swapaxes(0, 1), strict=True))


def _in_order(bones: Bones, project: Project) -> Floats:
    return np.stack([bones[name][:, :3, 3] for name in bone_names(project.skeleton)], axis=1)


def _by_gltf(files: Sequence[Path], project: Project) -> Floats:
    posed = GltfPoses(files[0])
    nodes = {node.name: index for index, node in enumerate(posed.gltf.nodes)}
    poses = posed.world_from_node()
    limbs = [nodes[name] for name in bone_names(project.skeleton)]
    return np.asarray(poses[:, limbs][..., :3, 3] * PER_METRE)


def _by_yourdfpy(files: Sequence[Path], project: Project) -> Floats:
    import yourdfpy  # noqa: PLC0415 - a judge, installed with the extra `dev`

    robot = yourdfpy.URDF.load(str(files[0]))
    header, numbers = read_columns(files[1])
    names = [name.rpartition("_")[0] for name in header[2:]]
    places = np.empty((len(numbers), project.skeleton.n_limbs, 3))
    for frame, row in enumerate(numbers[:, 2:]):
        robot.update_cfg(dict(zip(names, row, strict=True)))
        for limb, name in enumerate(bone_names(project.skeleton)):
            places[frame, limb] = robot.get_transform(name, "world")[:3, 3]
    return np.asarray(places * PER_METRE)


def _by_mujoco(files: Sequence[Path], project: Project) -> Floats:
    import mujoco  # noqa: PLC0415 - a judge, installed with the extra `dev`

    model = mujoco.MjModel.from_xml_path(str(files[0]))
    data = mujoco.MjData(model)
    numbers = read_columns(files[1])[1][:, 2:]
    places = np.empty((len(numbers), project.skeleton.n_limbs, 3))
    for frame, row in enumerate(numbers):
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        places[frame] = [data.body(name).xpos for name in bone_names(project.skeleton)]
    return np.asarray(places * PER_METRE)


def _by_opensim(files: Sequence[Path], project: Project) -> Floats:
    import opensim  # noqa: PLC0415 - a judge, installed with the extra `dev`

    opensim.Logger.setLevelString("off")
    model, motion = opensim.Model(str(files[0])), opensim_columns(files[1])
    places = np.empty((project.motion.n_frames, project.skeleton.n_limbs, 3))
    for frame, state in opensim_postures(model, motion, range(len(places))):
        for limb, name in enumerate(bone_names(project.skeleton)):
            origin = model.getBodySet().get(name).getTransformInGround(state).p()
            places[frame, limb] = [origin.get(axis) for axis in range(3)]
    return np.asarray(places * PER_METRE)


def opensim_columns(path: Path) -> dict[str, Floats]:
    """Return the columns of OpenSim's table of a motion, by name."""
    import opensim  # noqa: PLC0415

    columns = opensim.TimeSeriesTable(str(path))
    return dict(zip(columns.getColumnLabels(), columns.getMatrix().to_numpy().T, strict=True))


def opensim_postures(model: Any, motion: dict[str, Floats], frames: Sequence[int]) -> Any:
    """Yield each frame and OpenSim's state in it.

    Parameters
    ----------
    model : opensim.Model
        Loaded and initialised.
    motion : dict of str to ndarray, each of shape (n_frames,)
        Coordinates of the model by the columns of the motion file.
    frames : sequence of int
        Which frames.
    """
    import opensim  # noqa: PLC0415

    state = model.initSystem()
    coordinates = model.getCoordinateSet()
    for frame in frames:
        for name, values in motion.items():
            coordinate = coordinates.get(name)
            turns = coordinate.getMotionType() == opensim.Coordinate.Rotational
            coordinate.setValue(state, np.deg2rad(values[frame]) if turns else values[frame], False)
        model.realizePosition(state)
        yield frame, state


def _by_ezc3d(files: Sequence[Path], project: Project) -> Floats:
    import ezc3d  # noqa: PLC0415 - slow to load

    points = ezc3d.c3d(str(files[0]))["data"]["points"]
    n_joints = project.skeleton.n_joints
    return np.asarray(points[:3, -n_joints:].transpose(2, 1, 0))


def read_columns(path: Path) -> tuple[list[str], Floats]:
    """Return the header and the numbers of a motion that stands beside a robot's model, without marks of joints."""
    header, *rows = csv.reader(path.read_text(encoding="utf-8").splitlines())
    n_columns = sum(not name.endswith(MARK) for name in header)  # marks are the last
    return header[:n_columns], np.array(rows, dtype=float)[:, :n_columns]


JUDGES = (
    Judge(
        ".bvh",
        "bvhio",
        0.01,
        lambda files, project: _in_order(bones_of_bvh(files[0], project.motion.n_frames), project),
    ),
    Judge(".glb", "pygltflib", 0.01, _by_gltf, axes="as-recorded"),
    Judge(".usdc", "pxr", 0.01, lambda files, one: PER_METRE * _in_order(bones_of_usd(files[0]), one)),
    Judge(".osim", "opensim", 0.1, _by_opensim),
    Judge(".urdf", "yourdfpy", 0.01, _by_yourdfpy),
    Judge(".mjcf.xml", "mujoco", 0.01, _by_mujoco),
    Judge(".joints.c3d", "ezc3d", 0.001, _by_ezc3d, of_joints=True),  # single precision at some metres
)
"""In the order of the page."""


_DTYPES = {5126: "<f4", 5123: "<u2"}
_SHAPES: dict[str, tuple[int, ...]] = {"SCALAR": (), "VEC3": (3,), "VEC4": (4,), "MAT4": (4, 4)}


class GltfPoses:
    """Nodes and skinned points of a binary glTF file at every key of its animation.

    Parameters
    ----------
    path : Path
        The file; its first animation must have the same keys in all channels.
    """

    def __init__(self, path: Path) -> None:
        import pygltflib  # noqa: PLC0415 - a judge, installed with the extra `dev`

        self.gltf = pygltflib.GLTF2().load_binary(str(path))
        self.animation = self.gltf.animations[0]
        self.times = self.values(self.animation.samplers[0].input)

    def values(self, index: int) -> Floats:
        """Return the numbers of an accessor."""
        accessor = self.gltf.accessors[index]
        shape = (accessor.count, *_SHAPES[accessor.type])
        start = self.gltf.bufferViews[accessor.bufferView].byteOffset
        dtype = np.dtype(_DTYPES[accessor.componentType])
        return np.frombuffer(self.gltf.binary_blob(), dtype, int(np.prod(shape)), start).reshape(shape).astype(float)

    def world_from_node(self) -> Floats:
        """Return the pose of every node at every key, shape (n_keys, n_nodes, 4, 4)."""
        nodes = self.gltf.nodes
        parts = {(index, "translation"): node.translation or [0, 0, 0] for index, node in enumerate(nodes)}
        parts |= {(index, "rotation"): node.rotation or [0, 0, 0, 1] for index, node in enumerate(nodes)}
        for channel in self.animation.channels:
            key = (channel.target.node, channel.target.path)
            parts[key] = self.values(self.animation.samplers[channel.sampler].output)
        poses = np.empty((len(self.times), len(nodes), 4, 4))
        waiting = [(root, np.eye(4)) for root in self.gltf.scenes[0].nodes]
        while waiting:
            index, parent = waiting.pop()
            rotation = matrix_from_xyzw(np.asarray(parts[index, "rotation"], dtype=float))
            poses[:, index] = parent @ transform_from(rotation, np.asarray(parts[index, "translation"], dtype=float))
            waiting += [(child, poses[:, index]) for child in nodes[index].children or []]
        return poses

    def points(self) -> Floats:
        """Return the skinned points at every key, shape (n_keys, n_points, 3)."""
        attributes = self.gltf.meshes[0].primitives[0].attributes
        skin = self.gltf.skins[0]
        bind = self.values(skin.inverseBindMatrices).swapaxes(-1, -2)
        carried = self.world_from_node()[:, skin.joints] @ bind
        bones, weights = self.values(attributes.JOINTS_0).astype(int), self.values(attributes.WEIGHTS_0)
        matrices = (weights[..., np.newaxis, np.newaxis] * carried[:, bones]).sum(axis=2)
        places = self.values(attributes.POSITION)
        return np.asarray((matrices[..., :3, :3] @ places[..., np.newaxis])[..., 0] + matrices[..., :3, 3])
