"""glTF posed after its specification: chapters 3.6 (accessors), 3.7.3 (skins) and 3.11 (animations)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from skelgen_formats.bones import matrix_from_xyzw

from skelgen.geometry.rotations import transform_from
from skelgen.model.arrays import Floats

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
