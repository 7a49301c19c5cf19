"""USD with UsdSkel (.usdc, .usda, .usd): a skeleton, its animation, and the measured markers as points.

A skeleton root, ``/body``, holds the prims ``skeleton`` (joints named by their paths, such as ``limb1/limb0``, with the
reference pose as bind and rest pose), ``motion`` (a time sample per frame) and ``markers`` (points; those that are
unseen in a frame are not among its points, ``ids`` say which marker each is). The y axis of a joint points along its
limb, to the next joint; a limb that carries no other has a joint where it ends. What UsdSkel has no attribute for
stands beside, in the namespace ``skelgen``: kinds, axes and deviations of the joints on the skeleton, in its axes, what
limbs and joints are called,
names and limbs of the markers on the points.

Unit, axis and rate stand in the stage's metadata. ``framesPerSecond`` is the take's rate. Of time codes there are 24 in
a second unless the user wants others, for Blender takes them as frames of its scene whatever the stage says.

USD transforms rows: its matrices are the transposes of the usual ones.
"""

from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from skelgen.errors import WriteError
from skelgen.files import replacing
from skelgen.geometry.rotations import transform_from
from skelgen.geometry.up_axis import AS_RECORDED
from skelgen.model import Project, Skeleton, Trajectories
from skelgen.model.arrays import Floats
from skelgen.model.placed_joints import place_of
from skelgen.progress import Monitor, with_progress
from skelgen_formats.bones import (
    along_bones,
    bone_end,
    bone_facts,
    bone_names,
    bone_transforms,
    check_single_precision,
    end_names,
    limb_from_bone,
    lost_in_animations,
    scaled_poses,
    turned_bones,
    xyzw_from_matrix,
)
from skelgen_formats.options import (
    AXES,
    BONE_NAMES,
    METRES,
    MM_PER_UNIT,
    RATE,
    REST,
    Format,
    Option,
    Options,
    Writable,
    moving_project,
    per_mm,
)
from skelgen_formats.writing import turned_up

_TITLE = "USD"
_CODES = 24.0  # per second: Blender's frame rate, and USD's own default
_WIDTH = 14.0  # mm: the diameter of a usual marker
_MM_PER_METRE = 1000.0


def _write(value: Writable, path: Path, options: Options, monitor: Monitor) -> None:
    """Write skeleton, motion and measured markers of a finished project; the suffix chooses text or binary."""
    project = _project(value)
    check_single_precision(project, _TITLE)
    from pxr import Tf, Usd, UsdGeom  # noqa: PLC0415 - an extra

    n_frames, rate, time_codes = project.motion.n_frames, project.motion.rate, options.time_codes
    codes = np.array([frame * ((time_codes or rate) / rate) for frame in range(n_frames)])
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, (turned_up(options.axes) or _up(project)).upper())
    UsdGeom.SetStageMetersPerUnit(stage, MM_PER_UNIT[options.unit] / _MM_PER_METRE)
    stage.SetTimeCodesPerSecond(time_codes or project.motion.rate)
    stage.SetFramesPerSecond(project.motion.rate)
    stage.SetStartTimeCode(0)
    stage.SetEndTimeCode(float(codes[-1]))
    _fill(stage, project, per_mm(options.unit), codes, monitor)
    with replacing(path) as temporary:
        try:
            written = stage.GetRootLayer().Export(str(temporary))
        except Tf.ErrorException as error:
            raise WriteError(f"{path}: cannot be written: {str(error).strip().splitlines()[-1].strip()}") from error
        if not written:
            raise WriteError(f"{path}: cannot be written: the disk may be full")


def _project(value: Writable) -> Project:
    project = moving_project(value, _TITLE)
    if find_spec("pxr") is None:
        raise WriteError("USD files are written with Pixar's library: pip install 'skelgen-mocap[usd]'")
    return project


def _up(project: Project) -> str:
    from skelgen.geometry.up_axis import up_of  # noqa: PLC0415 - scipy is slow to load

    return "y" if up_of(project) == "y" else "z"


def _fill(stage: Any, project: Project, scale: float, codes: Floats, monitor: Monitor) -> None:
    from pxr import UsdSkel  # noqa: PLC0415 - an extra

    root = UsdSkel.Root.Define(stage, "/body")
    stage.SetDefaultPrim(root.GetPrim())
    bones = _Bones(project.skeleton, scale)
    skeleton = _define_skeleton(stage, project.skeleton, bones)
    motion = _define_motion(stage, project, bones, codes, monitor)
    binding = UsdSkel.BindingAPI.Apply(skeleton.GetPrim())
    binding.CreateAnimationSourceRel().SetTargets([motion.GetPath()])
    _define_markers(stage, project, scale, codes)


class _Bones:
    """The joints as UsdSkel wants them, parents before children: limbs from the roots outward, then ends of limbs."""

    def __init__(self, skeleton: Skeleton, scale: float) -> None:
        self.parents, self.scale, self.turns = skeleton.parents, scale, limb_from_bone(skeleton)
        self.limbs = skeleton.outward.tolist()
        ended = [limb for limb in self.limbs if not (skeleton.parents == limb).any()]
        self.ends = along_bones([float(np.linalg.norm(bone_end(skeleton, limb))) * scale for limb in ended])
        paths, names, of_ends = {-1: ""}, bone_names(skeleton), end_names(skeleton)
        for limb in self.limbs:
            paths[limb] = f"{paths[int(skeleton.parents[limb])]}/{names[limb]}".removeprefix("/")
        self.paths = [paths[limb] for limb in self.limbs] + [f"{paths[limb]}/{of_ends[limb]}" for limb in ended]
        self.ended = [self.limbs.index(limb) for limb in ended]

    def world(self, poses: Floats) -> Floats:
        """World from joint, shape (n_joints, 4, 4), in the file's unit."""
        posed = turned_bones(scaled_poses(poses, self.scale), self.turns)[self.limbs]
        return np.concatenate([posed, posed[self.ended] @ self.ends])

    def local(self, poses: Floats) -> Floats:
        """Parent from joint, shape (..., n_joints, 4, 4), in the file's unit."""
        bones = turned_bones(scaled_poses(poses, self.scale), self.turns)
        ends = np.broadcast_to(self.ends, (*poses.shape[:-3], len(self.ended), 4, 4))
        moves = [transform_from(*bone_transforms(bones, int(self.parents[limb]), limb)[::-1]) for limb in self.limbs]
        return np.concatenate([np.stack(moves, axis=-3), ends], axis=-3)


def _define_skeleton(stage: Any, skeleton: Skeleton, bones: _Bones) -> Any:
    from pxr import Sdf, UsdSkel, Vt  # noqa: PLC0415 - an extra

    prim = UsdSkel.Skeleton.Define(stage, "/body/skeleton")
    prim.CreateJointsAttr(bones.paths)
    prim.CreateBindTransformsAttr(Vt.Matrix4dArray.FromNumpy(_rows(bones.world(skeleton.reference_pose))))
    prim.CreateRestTransformsAttr(Vt.Matrix4dArray.FromNumpy(_rows(bones.local(skeleton.reference_pose))))
    kinds, axes, deviations = _facts(skeleton, bones)
    types = Sdf.ValueTypeNames
    _state(prim, "jointKinds", types.TokenArray, kinds)
    _state(prim, "jointAxesInParents", types.Float3Array, _vectors(axes))
    _state(prim, "jointStdInMillimetres", types.Float3Array, _vectors(deviations))
    called = {joint.child: skeleton.joint_name(joint) for joint in skeleton.joints}
    _state(prim, "limbNames", types.StringArray, [skeleton.limb_names[limb] for limb in bones.limbs])
    _state(prim, "jointNames", types.StringArray, [called.get(limb, "") for limb in bones.limbs])
    stated = (
        ("jointIsDetermined", {joint.child: joint.is_determined for joint in skeleton.joints}),
        ("jointIsFullyDetermined", {joint.child: joint.is_fully_determined for joint in skeleton.joints}),
    )
    remarks = {joint.child: place_of(joint).remark for joint in skeleton.joints}
    _state(prim, "jointPlaceRemarks", types.StringArray, [remarks.get(limb, "") for limb in bones.limbs])
    for name, of_limb in stated:
        _state(prim, name, types.BoolArray, [of_limb.get(limb, True) for limb in skeleton.outward.tolist()])
    return prim


def _facts(skeleton: Skeleton, bones: _Bones) -> tuple[list[str], Floats, Floats]:
    """Kind, axis (zero for those without) and deviation [mm] of each joint; roots and ends have none."""
    axes, deviations = np.zeros((2, len(bones.paths), 3))
    kinds = ["root"] * len(bones.limbs) + ["end"] * len(bones.ended)
    for child, (joint, axis, _, std) in bone_facts(skeleton, bones.turns).items():
        index = bones.limbs.index(child)
        kinds[index], deviations[index] = joint.kind, std
        axes[index] = 0.0 if axis is None else axis
    return kinds, axes, deviations


def _define_motion(stage: Any, project: Project, bones: _Bones, codes: Floats, monitor: Monitor) -> Any:
    from pxr import Gf, UsdSkel, Vt  # noqa: PLC0415 - an extra

    moves = bones.local(project.motion.world_from_limb)
    rotations = xyzw_from_matrix(moves[..., :3, :3]).astype(np.float32)
    prim = UsdSkel.Animation.Define(stage, "/body/motion")
    prim.CreateJointsAttr(bones.paths)
    prim.CreateScalesAttr(Vt.Vec3hArray([Gf.Vec3h(1, 1, 1)] * len(bones.paths)))
    translated, turned = prim.CreateTranslationsAttr(), prim.CreateRotationsAttr()
    for frame, code in enumerate(with_progress(codes.tolist(), len(codes), monitor)):
        translated.Set(_vectors(moves[frame, :, :3, 3]), code)
        turned.Set(Vt.QuatfArray.FromNumpy(rotations[frame]), code)
    return prim


def _define_markers(stage: Any, project: Project, scale: float, codes: Floats) -> None:
    from pxr import Sdf, UsdGeom, Vt  # noqa: PLC0415 - an extra

    markers: Trajectories = project.trajectories
    places = markers.positions * scale
    prim = UsdGeom.Points.Define(stage, "/body/markers")
    prim.CreateWidthsAttr(Vt.FloatArray([_WIDTH * scale]))
    prim.SetWidthsInterpolation(UsdGeom.Tokens.constant)
    seen_at_all = places[markers.seen]
    if len(seen_at_all):
        prim.CreateExtentAttr(_vectors(np.stack([seen_at_all.min(axis=0), seen_at_all.max(axis=0)])))
    points, ids = prim.CreatePointsAttr(), prim.CreateIdsAttr()
    for place, seen, code in zip(places, markers.seen, codes.tolist(), strict=True):
        points.Set(_vectors(place[seen]), code)
        ids.Set(Vt.Int64Array.FromNumpy(np.flatnonzero(seen).astype(np.int64)), code)
    _state(prim, "markerNames", Sdf.ValueTypeNames.StringArray, list(markers.names))
    _state(prim, "limbOfMarker", Sdf.ValueTypeNames.IntArray, project.skeleton.limb_of_marker.tolist())


def _state(prim: Any, name: str, kind: Any, value: Any) -> None:
    prim.GetPrim().CreateAttribute(f"skelgen:{name}", kind).Set(value)


def _rows(transforms: Floats) -> Floats:
    return np.ascontiguousarray(transforms.swapaxes(-1, -2))


def _vectors(places: Floats) -> Any:
    from pxr import Vt  # noqa: PLC0415 - an extra

    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(places, dtype=np.float32))


def _remarks(project: Project, options: Options) -> tuple[str, ...]:
    from skelgen.geometry.up_axis import up_of  # noqa: PLC0415 - scipy is slow to load

    found = up_of(project)
    unsure = "The recording does not tell which axis is up; the file states z unless axes turn it to y."
    other = f"USD takes y or z to be up, and in the recording it is {found}; the file states z."
    odd = (unsure if not found else other,) if found not in {"y", "z"} else ()
    up = odd if options.axes == AS_RECORDED else ()
    return (*up, *lost_in_animations(project, _TITLE))


TIME_CODES = Option(
    "time_codes",
    _CODES,
    "Time codes per second; 24 are the frames of Blender's scenes, which takes no notice of the rate; 0: one a frame.",
    reading=False,
    low=0.0,
    high=1e5,
)
"""The option of how time is counted."""


FORMAT = Format(
    name="usd",
    title="USD (UsdSkel)",
    suffixes=(".usdc", ".usda", ".usd"),
    holds="skeleton",
    write=_write,
    check=lambda value, options: _project(value),
    keeps=("markers", "names", "limbs", "joints", "kinds", "uncertainty", "motion"),
    marks_open="attributes `skelgen:jointIsDetermined`, `skelgen:jointPlaceRemarks` of the skeleton",
    remarks=_remarks,
    options=(AXES, METRES, RATE, TIME_CODES, BONE_NAMES, REST),
    note="Skeleton, animation and measured markers as points; needs `skelgen-mocap[usd]`; .usda is text.",
)
