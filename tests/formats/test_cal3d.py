"""The real Cal3D library is the judge: what it makes of the files must be where the skeleton is."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lxml import etree
from skelgen_formats.registry import write_file

from skelgen.errors import WriteError
from skelgen.model import Motion

POSITION_MM = 0.01  # demanded; single precision has steps of 0.0002 mm at 2 m
ROTATION = 1e-5  # of a unit quaternion's components: single precision, three bones deep
APT = "apt-get install libcal3d12-dev g++ pkg-config"


@pytest.fixture(scope="module")
def loader(tmp_path_factory) -> Path:
    """The small loader, compiled against the installed library."""
    if not (shutil.which("g++") and shutil.which("pkg-config")):
        pytest.skip(f"no compiler: {APT}")
    flags = subprocess.run(["pkg-config", "--cflags", "--libs", "cal3d"], capture_output=True, text=True, check=False)
    if flags.returncode:
        pytest.skip(f"no Cal3D library: {APT}")
    program = tmp_path_factory.mktemp("cal3d") / "cal3d_loader"
    source = Path(__file__).with_name("cal3d_loader.cpp")
    subprocess.run(["g++", "-std=c++11", "-O1", source, "-o", program, *flags.stdout.split()], check=True)
    return program


def play(loader, files, times) -> np.ndarray:
    """Position [mm] and quaternion x y z w of each bone at each time, shape (n_times, n_bones, 7)."""
    text = "\n".join(f"{time:.9g}" for time in times)
    run = subprocess.run([loader, *files], input=text, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    return np.array([[float(word) for word in line.split()] for line in run.stdout.splitlines()]).reshape(
        len(times), -1, 7
    )


@pytest.fixture(scope="module", params=["one root in the middle", "two roots, deep", "a single frame"])
def project(request, make_project):
    return {
        "one root in the middle": make_project,
        "two roots, deep": lambda: make_project(parents=(3, -1, 0, -1, 2, 1), n_frames=40, rate=59.94),
        "a single frame": lambda: make_project(n_frames=1),
    }[request.param]()


def test_comments_on_joints_left_open_do_not_disturb_the_loader(loader, small_project, tmp_path):
    joints = tuple(replace(joint, open_directions=3, name="hip -- über") for joint in small_project.skeleton.joints)
    marked = replace(small_project, _skeleton=replace(small_project.skeleton, joints=joints))
    files = write_file(marked, tmp_path / "walk.xsf")
    assert files[0].read_text().endswith("hip - &#252;ber.-->\n")
    truth = play(loader, write_file(small_project, tmp_path / "plain.xsf"), marked.motion.times)
    np.testing.assert_array_equal(play(loader, files, marked.motion.times), truth)


def test_bones_are_where_the_limbs_are_at_every_frame(loader, project, tmp_path):
    played = play(loader, write_file(project, tmp_path / "walk.xsf"), project.motion.times)
    truth = project.motion.world_from_limb[:, project.skeleton.outward][..., :3, 3]
    assert np.abs(played[..., :3] - truth).max() < POSITION_MM


def test_bones_are_turned_as_the_limbs_are_at_every_frame(loader, project, tmp_path):
    x, y, z, w = np.moveaxis(play(loader, write_file(project, tmp_path / "walk.xsf"), project.motion.times), -1, 0)[3:]
    # Cal3D turns e_x as q* e_x q: the first column of the usual matrix of the conjugate.
    turned = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], axis=-1)
    truth = project.motion.world_from_limb[:, project.skeleton.outward][..., :3, 0]
    assert np.abs(turned - truth).max() < ROTATION


def test_root_moves_in_a_straight_line_between_the_keys(loader, small_project, tmp_path):
    times = small_project.motion.times
    played = play(loader, write_file(small_project, tmp_path / "walk.xsf"), (times[:-1] + times[1:]) / 2)
    roots = small_project.motion.world_from_limb[:, small_project.skeleton.roots[0], :3, 3]
    assert np.abs(played[:, 0, :3] - (roots[:-1] + roots[1:]) / 2).max() < POSITION_MM


def test_child_stays_on_its_joint_between_the_keys(loader, small_project, tmp_path):
    times = np.linspace(0, small_project.motion.times[-1], 50)
    played = play(loader, write_file(small_project, tmp_path / "walk.xsf"), times)[..., :3]
    for bone, joint in enumerate(small_project.skeleton.joints, start=1):  # all hang on the root, which is bone 0
        apart = np.linalg.norm(played[:, bone] - played[:, 0], axis=1)
        assert np.abs(apart - np.linalg.norm(joint.position_in_parent)).max() < POSITION_MM


def test_both_files_are_written_whichever_is_named(small_project, tmp_path):
    for name in ("walk.xsf", "walk.xaf"):
        files = write_file(small_project, tmp_path / name)
        assert files == [tmp_path / "walk.xsf", tmp_path / "walk.xaf"]
        assert sorted(tmp_path.iterdir()) == sorted(files)


def test_skeleton_has_header_bones_parents_first_and_the_inverse_bind_pose(small_project, tmp_path):
    text = write_file(small_project, tmp_path / "walk.xsf")[0].read_text()
    header, skeleton = etree.fromstring(f"<both>{text}</both>")
    assert header.attrib == {"MAGIC": "XSF", "VERSION": "910"}
    assert [bone.get("NAME") for bone in skeleton] == ["limb1", "limb0", "limb2"]
    assert [bone.findtext("PARENTID") for bone in skeleton] == ["-1", "0", "0"]
    for bone, limb in zip(skeleton, (1, 0, 2), strict=True):
        local = [float(word) for word in bone.findtext("LOCALTRANSLATION").split()]
        np.testing.assert_allclose(local, -small_project.skeleton.reference_pose[limb, :3, 3], atol=1e-5)


def test_number_beyond_single_precision_is_refused_and_leaves_nothing(small_project, tmp_path):
    poses = small_project.motion.world_from_limb.copy()
    poses[3, 1, 0, 3] = 1e39
    motion = Motion(**{**vars(small_project.motion), "world_from_limb": poses})
    with pytest.raises(WriteError, match="single precision"):
        write_file(replace(small_project, _motion=motion), tmp_path / "walk.xsf")
    assert list(tmp_path.iterdir()) == []


def test_take_is_refused(small_project, tmp_path):
    with pytest.raises(WriteError, match="not a take"):
        write_file(small_project.trajectories, tmp_path / "walk.xsf")
