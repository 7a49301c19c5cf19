"""USD with UsdSkel (.usdc, .usda, .usd): a skeleton, its animation, and the measured markers as points.

A skeleton root, ``/body``, holds the prims ``skeleton`` (joints named by their paths, such as ``limb1/limb0``, with the
reference pose as bind and rest pose), ``motion`` (a time sample per frame) and ``markers`` (points; those that are
unseen in a frame are not among its points, ``ids`` say which marker each is). A time code is a frame; unit, axis and
rate stand in the stage's metadata. What UsdSkel has no attribute for stands beside, in the namespace ``skelgen``:
kinds, axes and deviations of the joints on the skeleton, names and limbs of the markers on the points.

USD transforms rows: its matrices are the transposes of the usual ones.
"""

from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from skelgen.errors import WriteError
from skelgen.files import replacing
from skelgen.geometry.up_axis import AS_RECORDED
from skelgen.model import Project, Skeleton, Trajectories
from skelgen.model.arrays import Floats
from skelgen.progress import SILENT, Monitor, with_progress
from skelgen_formats.bones import (
    bone_name,
    bone_transforms,
    check_single_precision,
    lost_in_animations,
    xyzw_from_matrix,
)
from skelgen_formats.options import AXES, MM_PER_UNIT, RATE, UNIT, Format, Options, Writable, moving_project, per_mm

_TITLE = "USD"
_UP = {AS_RECORDED: "Z", "z-to-y": "Y", "y-to-z": "Z"}
_WIDTH = 14.0  # mm: the diameter of a usual marker
_MM_PER_METRE = 1000.0


def write_usd(
    value: Writable, path: Path, unit: str = "mm", axes: str = AS_RECORDED, monitor: Monitor = SILENT
) -> list[Path]:
    """Write skeleton, motion and measured markers of a finished project; the suffix chooses text or binary.

    Parameters
    ----------
    value : Project
        In the axes that the file will state.
    path : Path
        The file.
    unit : str
        Unit of the lengths, stated in the file.
    axes : str
        How the world was turned, from which follows the axis that points up; as recorded that is taken to be z.
    monitor : Monitor
        Shows progress; may cancel.

    Raises
    ------
    WriteError
        If the value is no project or has no frames, USD is not installed, a number is beyond single precision, or the
        file cannot be written.
    MissingResultError
        If the project has no skeleton yet.
    """
    project = _project(value)
    check_single_precision(project, _TITLE)
    from pxr import Tf  # noqa: PLC0415 - an extra

    stage = _stage(project, unit, axes, monitor)
    with replacing(path) as temporary:
        try:
            written = stage.GetRootLayer().Export(str(temporary))
        except Tf.ErrorException as error:
            raise WriteError(f"{path}: cannot be written: {str(error).strip().splitlines()[-1].strip()}") from error
        if not written:
            raise WriteError(f"{path}: cannot be written: the disk may be full")
    return [path]


def _project(value: Writable) -> Project:
    project = moving_project(value, _TITLE)
    if find_spec("pxr") is None:
        raise WriteError("USD files are written with Pixar's library: pip install 'skelgen-mocap[usd]'")
    return project


def _stage(project: Project, unit: str, axes: str, monitor: Monitor) -> Any:
    from pxr import Usd, UsdGeom, UsdSkel  # noqa: PLC0415 - an extra

    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, _UP[axes])
    UsdGeom.SetStageMetersPerUnit(stage, MM_PER_UNIT[unit] / _MM_PER_METRE)
    stage.SetTimeCodesPerSecond(project.motion.rate)
    stage.SetFramesPerSecond(project.motion.rate)
    stage.SetStartTimeCode(0)
    stage.SetEndTimeCode(project.motion.n_frames - 1)
    root = UsdSkel.Root.Define(stage, "/body")
    stage.SetDefaultPrim(root.GetPrim())
    skeleton = _define_skeleton(stage, project.skeleton, per_mm(unit))
    motion = _define_motion(stage, project, per_mm(unit), monitor)
    binding = UsdSkel.BindingAPI.Apply(skeleton.GetPrim())
    binding.CreateAnimationSourceRel().SetTargets([motion.GetPath()])
    _define_markers(stage, project, per_mm(unit))
    return stage


def _joint_paths(skeleton: Skeleton) -> list[str]:
    """Path of each limb's joint, in the order of `Skeleton.outward`, as UsdSkel wants parents before children."""
    paths: dict[int, str] = {}
    for limb in skeleton.outward.tolist():
        parent = int(skeleton.parents[limb])
        paths[limb] = bone_name(limb) if parent < 0 else f"{paths[parent]}/{bone_name(limb)}"
    return list(paths.values())


def _define_skeleton(stage: Any, skeleton: Skeleton, scale: float) -> Any:
    from pxr import Sdf, UsdSkel, Vt  # noqa: PLC0415 - an extra

    bind = skeleton.reference_pose[skeleton.outward].copy()
    rest = np.tile(np.eye(4), (skeleton.n_limbs, 1, 1))
    for index, limb in enumerate(skeleton.outward.tolist()):
        moved, turned = bone_transforms(skeleton.reference_pose, int(skeleton.parents[limb]), limb)
        rest[index, :3, 3], rest[index, :3, :3] = moved, turned
    bind[:, :3, 3] *= scale
    rest[:, :3, 3] *= scale
    prim = UsdSkel.Skeleton.Define(stage, "/body/skeleton")
    prim.CreateJointsAttr(_joint_paths(skeleton))
    prim.CreateBindTransformsAttr(Vt.Matrix4dArray.FromNumpy(_rows(bind)))
    prim.CreateRestTransformsAttr(Vt.Matrix4dArray.FromNumpy(_rows(rest)))
    kinds, axes, deviations = _facts(skeleton)
    types = Sdf.ValueTypeNames
    _state(prim, "jointKinds", types.TokenArray, kinds)
    _state(prim, "jointAxesInParents", types.Float3Array, _vectors(axes))
    _state(prim, "jointStdInMillimetres", types.Float3Array, _vectors(deviations))
    return prim


def _facts(skeleton: Skeleton) -> tuple[list[str], Floats, Floats]:
    """Kind, axis (zero for those without) and deviation [mm] of each bone's joint; roots have none."""
    kinds, axes, deviations = {}, np.zeros((skeleton.n_limbs, 3)), np.zeros((skeleton.n_limbs, 3))
    for joint in skeleton.joints:
        kinds[joint.child] = joint.kind
        axes[joint.child] = 0.0 if joint.axis is None else joint.axis
        deviations[joint.child] = joint.std
    order = skeleton.outward.tolist()
    return [kinds.get(limb, "root") for limb in order], axes[order], deviations[order]


def _define_motion(stage: Any, project: Project, scale: float, monitor: Monitor) -> Any:
    from pxr import Gf, UsdSkel, Vt  # noqa: PLC0415 - an extra

    skeleton, motion = project.skeleton, project.motion
    translations = np.empty((motion.n_frames, skeleton.n_limbs, 3))
    rotations = np.empty((motion.n_frames, skeleton.n_limbs, 4))
    for index, limb in enumerate(skeleton.outward.tolist()):
        moved, turned = bone_transforms(motion.world_from_limb, int(skeleton.parents[limb]), limb)
        translations[:, index], rotations[:, index] = moved * scale, xyzw_from_matrix(turned)
    prim = UsdSkel.Animation.Define(stage, "/body/motion")
    prim.CreateJointsAttr(_joint_paths(skeleton))
    prim.CreateScalesAttr(Vt.Vec3hArray([Gf.Vec3h(1, 1, 1)] * skeleton.n_limbs))
    moves, turns = prim.CreateTranslationsAttr(), prim.CreateRotationsAttr()
    for frame in with_progress(range(motion.n_frames), motion.n_frames, monitor):
        moves.Set(_vectors(translations[frame]), frame)
        turns.Set(Vt.QuatfArray.FromNumpy(rotations[frame].astype(np.float32)), frame)
    return prim


def _define_markers(stage: Any, project: Project, scale: float) -> None:
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
    for frame, seen in enumerate(markers.seen):
        points.Set(_vectors(places[frame, seen]), frame)
        ids.Set(Vt.Int64Array.FromNumpy(np.flatnonzero(seen).astype(np.int64)), frame)
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
    up = "The file states that z is up; where y is up in the recording, choose axes y-to-z."
    return (*((up,) if options.axes == AS_RECORDED else ()), *lost_in_animations(project, _TITLE))


FORMAT = Format(
    name="usd",
    title="USD (UsdSkel)",
    suffixes=(".usdc", ".usda", ".usd"),
    holds="skeleton",
    write=lambda value, path, options, monitor: write_usd(value, path, options.unit, options.axes, monitor),
    check=lambda value, options: _project(value),
    keeps=("markers", "names", "limbs", "joints", "kinds", "uncertainty", "motion"),
    remarks=_remarks,
    options=(AXES, UNIT, RATE),
    note="Skeleton, animation and measured markers as points; needs `skelgen-mocap[usd]`; .usda is text.",
)
