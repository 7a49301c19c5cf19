"""UsdSkel's own skeleton cache is the judge: where it poses the joints at every frame, the skeleton must be."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest
from skelgen_formats.bones import bone_end, limb_from_bone
from skelgen_formats.options import Options
from skelgen_formats.registry import find_format, write_file

from skelgen.benchmark.judges import bones_of_usd
from skelgen.errors import WriteError
from skelgen.geometry.up_axis import with_up_axis

pytest.importorskip("pxr", reason="pip install 'skelgen-mocap[usd]', which also judges")
from pxr import Usd, UsdGeom, UsdSkel

POSITION_MM = 0.01  # demanded; single precision has steps of 0.0002 mm at 2 m


def deviation(path, motion, per_mm=0.001) -> float:
    """Largest distance [mm] between posed joints and the limbs' origins."""
    bones = bones_of_usd(path)
    limbs = range(motion.world_from_limb.shape[1])
    found = np.stack([bones[f"limb{limb}"] for limb in limbs], axis=1)[..., :3, 3] / per_mm
    return float(np.abs(found - motion.world_from_limb[..., :3, 3]).max())


CASES = ["one root in the middle", "two roots, deep", "a single frame", "a single limb"]


@pytest.fixture(scope="module", params=CASES)
def project(request, make_project):
    return {
        "one root in the middle": make_project,
        "two roots, deep": lambda: make_project(parents=(3, -1, 0, -1, 2, 1), n_frames=40, rate=59.94),
        "a single frame": lambda: make_project(n_frames=1),
        "a single limb": lambda: make_project(parents=(-1,)),
    }[request.param]()


@pytest.mark.parametrize("suffix", [".usdc", ".usda", ".usd"])
def test_joints_are_where_the_limbs_are_at_every_frame(project, tmp_path, suffix):
    assert deviation(*write_file(project, tmp_path / f"walk{suffix}"), project.motion) < POSITION_MM


def test_joints_turn_as_the_limbs_do(project, tmp_path):
    bones = bones_of_usd(*write_file(project, tmp_path / "walk.usdc"))
    for limb in range(project.skeleton.n_limbs):
        # Single precision, some bones deep.
        turned = project.motion.rotations[:, limb] @ limb_from_bone(project.skeleton)[limb]
        assert np.abs(bones[f"limb{limb}"][:, :3, :3] - turned).max() < 1e-6


def test_y_axes_point_along_the_limbs_and_those_that_carry_none_have_an_end(project, tmp_path):
    bones = bones_of_usd(*write_file(project, tmp_path / "walk.usdc"))
    for limb in range(project.skeleton.n_limbs):
        end = project.motion.rotations[:, limb] @ bone_end(project.skeleton, limb)
        along = bones[f"limb{limb}"][:, :3, 1]
        assert np.abs(along - end / np.linalg.norm(end, axis=1, keepdims=True)).max() < 1e-6
        if not (project.skeleton.parents == limb).any():
            place = bones[f"limb{limb}_end"][:, :3, 3] * 1000
            assert np.abs(place - project.motion.world_from_limb[:, limb, :3, 3] - end).max() < POSITION_MM


@pytest.mark.parametrize(("unit", "per_mm"), [("mm", 1.0), ("cm", 0.1), ("m", 0.001)])
def test_unit_is_stated_and_obeyed(small_project, tmp_path, unit, per_mm):
    (path,) = write_file(small_project, tmp_path / "walk.usdc", unit=unit)
    assert UsdGeom.GetStageMetersPerUnit(Usd.Stage.Open(str(path))) == pytest.approx(0.001 / per_mm)
    assert deviation(path, small_project.motion, per_mm) < POSITION_MM


def test_axis_that_is_up_is_that_which_is_found(standing_project, tmp_path):
    (path,) = write_file(standing_project, tmp_path / "walk.usdc")
    assert UsdGeom.GetStageUpAxis(Usd.Stage.Open(str(path))) == "Z"
    other = with_up_axis(standing_project, "z-to-y")
    (path,) = write_file(other, tmp_path / "other.usdc")
    assert UsdGeom.GetStageUpAxis(Usd.Stage.Open(str(path))) == "Y"
    assert deviation(path, other.motion) < POSITION_MM


@pytest.mark.parametrize(("axes", "up"), [("as-recorded", "Z"), ("z-to-y", "Y"), ("y-to-z", "Z")])
def test_axis_that_is_up_is_stated_and_obeyed(standing_project, tmp_path, axes, up):
    (path,) = write_file(standing_project, tmp_path / "walk.usdc", axes=axes)
    assert UsdGeom.GetStageUpAxis(Usd.Stage.Open(str(path))) == up
    assert deviation(path, with_up_axis(standing_project, axes).motion) < POSITION_MM


@pytest.mark.parametrize(("time_codes", "last"), [(24.0, 2.4), (0.0, 5.0)])
def test_rate_and_duration_are_stated_and_frames_fall_on_the_old_ones(small_project, tmp_path, time_codes, last):
    (path,) = write_file(small_project, tmp_path / "walk.usda", rate=50.0, time_codes=time_codes)
    stage = Usd.Stage.Open(str(path))
    assert (stage.GetFramesPerSecond(), stage.GetTimeCodesPerSecond()) == (50.0, time_codes or 50.0)
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0.0, pytest.approx(last))
    truth = small_project.motion.world_from_limb[::2, 1, :3, 3]
    assert np.abs(bones_of_usd(path)["limb1"][:, :3, 3] * 1000 - truth).max() < POSITION_MM


def test_markers_are_the_measured_ones_and_gaps_stay(small_project, tmp_path):
    stage = Usd.Stage.Open(str(*write_file(small_project, tmp_path / "walk.usdc")))
    points = UsdGeom.Points.Get(stage, "/body/markers")
    names = list(points.GetPrim().GetAttribute("skelgen:markerNames").Get())
    assert names == list(small_project.trajectories.names)
    for frame, code in enumerate(points.GetPointsAttr().GetTimeSamples()):
        places = np.full((len(names), 3), np.nan)
        places[list(points.GetIdsAttr().Get(code))] = np.array(points.GetPointsAttr().Get(code)) * 1000
        truth = small_project.trajectories.positions[frame]
        np.testing.assert_allclose(places, truth, rtol=0, atol=0.001, equal_nan=True)  # single precision at 4 m


def test_limbs_and_joints_are_called_beside_as_they_are_called(small_project, tmp_path):
    named = small_project.with_limb_names(("linker Fuß", "Rumpf", "rechter Fuß"))
    stage = Usd.Stage.Open(str(*write_file(named, tmp_path / "walk.usdc")))
    prim = stage.GetPrimAtPath("/body/skeleton")
    assert list(prim.GetAttribute("skelgen:limbNames").Get()) == ["Rumpf", "linker Fuß", "rechter Fuß"]
    assert list(prim.GetAttribute("skelgen:jointNames").Get()) == ["", "Rumpf-linker Fuß", "Rumpf-rechter Fuß"]


def test_kinds_and_deviations_stand_beside(small_project, tmp_path):
    stage = Usd.Stage.Open(str(*write_file(small_project, tmp_path / "walk.usdc")))
    prim = stage.GetPrimAtPath("/body/skeleton")
    assert list(UsdSkel.Skeleton(prim).GetJointsAttr().Get()) == [
        "limb1",
        "limb1/limb0",
        "limb1/limb2",
        "limb1/limb0/limb0_end",
        "limb1/limb2/limb2_end",
    ]
    assert list(prim.GetAttribute("skelgen:jointKinds").Get()) == ["root", "hinge", "ball", "end", "end"]
    root = limb_from_bone(small_project.skeleton)[1]
    axis = root @ np.array(prim.GetAttribute("skelgen:jointAxesInParents").Get()[1])
    np.testing.assert_allclose(axis, [0.6, 0, 0.8], rtol=0, atol=1e-6)
    std = np.sqrt(np.diag(root.T @ np.diag([0.09, 0.16, 0.25]) @ root))
    np.testing.assert_allclose(prim.GetAttribute("skelgen:jointStdInMillimetres").Get()[2], std, rtol=1e-6)
    limbs = list(stage.GetPrimAtPath("/body/markers").GetAttribute("skelgen:limbOfMarker").Get())
    assert limbs == small_project.skeleton.limb_of_marker.tolist()


def test_usd_s_own_checker_finds_nothing(small_project, tmp_path):
    stage = Usd.Stage.Open(str(*write_file(small_project, tmp_path / "walk.usdc")))
    validation = pytest.importorskip("pxr.UsdValidation", reason="USD before 25 validates otherwise")
    every = validation.ValidationRegistry().GetOrLoadAllValidators()
    found = validation.ValidationContext(every).Validate(stage)
    assert [error.GetMessage() for error in found] == []


def test_marker_that_is_never_seen_hinders_nothing(small_project, tmp_path):
    blind = replace(small_project.trajectories, positions=np.full_like(small_project.trajectories.positions, np.nan))
    (path,) = write_file(replace(small_project, _trajectories=blind), tmp_path / "walk.usdc")
    assert deviation(path, small_project.motion) < POSITION_MM


def test_missing_library_is_said_before_and_while_writing(small_project, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pxr", None)
    for attempt in (
        lambda: find_format("usd").check(small_project, Options()),
        lambda: write_file(small_project, tmp_path / "w.usdc"),
    ):
        with pytest.raises(WriteError, match=r"pip install 'skelgen-mocap\[usd\]'"):
            attempt()


def test_full_disk_is_said_and_leaves_nothing(make_project, full_disk, tmp_path):
    project = make_project(n_frames=400)
    for suffix in (".usda", ".usdc"):
        with full_disk(4096), pytest.raises(WriteError, match=r"walk.usd.: cannot be written"):
            write_file(project, tmp_path / f"walk{suffix}")
        assert list(tmp_path.iterdir()) == []


def test_number_beyond_single_precision_is_refused(small_project, tmp_path):
    poses = small_project.motion.world_from_limb.copy()
    poses[3, 1, 0, 3] = 1e39
    motion = replace(small_project.motion, world_from_limb=poses)
    with pytest.raises(WriteError, match="single precision"):
        write_file(replace(small_project, _motion=motion), tmp_path / "walk.usdc")


def test_axis_taken_for_up_is_said(make_project, small_project, standing_project):
    remarks = find_format("usd").remarks
    assert "does not tell which axis is up" in remarks(make_project(n_frames=1), Options())[0]
    assert not any("up" in sentence for sentence in remarks(standing_project, Options()))
    assert not any("axes" in sentence for sentence in remarks(small_project, Options(axes="z-to-y")))


def test_take_is_refused(small_project, tmp_path):
    with pytest.raises(WriteError, match="not a take"):
        write_file(small_project.trajectories, tmp_path / "walk.usdc")
