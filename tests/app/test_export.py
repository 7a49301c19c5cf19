"""An export does what its preview says, says what is lost, and leaves everything as it was when it fails."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from skelgen_formats.registry import find_format, read_take
from skelgen_formats.writing import PARTS, choices_in

from skelgen.app.export import (
    REPORT,
    export_formats,
    export_path,
    export_project,
    obstacle_to,
    preview_export,
)
from skelgen.app.files import NamedFile, open_input
from skelgen.errors import Cancelled, ParameterError, SkelgenError, WriteError
from skelgen.model import PointCloud, Poses, Project, Trajectories

NAMES = [entry.name for entry in export_formats()]
FITTED = [name for name in NAMES if name not in {"poses-csv"}]


def entry_of(name):
    return REPORT if name == REPORT.name else find_format(name)


@pytest.fixture(scope="module")
def projects(small_project):
    """One project per kind of take, and one that is finished."""
    positions = np.random.default_rng(5).uniform(-500, 500, (4, 3, 3))
    poses = np.tile(np.eye(4), (4, 2, 1, 1))
    return {
        "finished": small_project,
        "markers": Project(Trajectories(positions, ("a", "b", "c"), 50.0, "m")),
        "points": Project(PointCloud(positions.reshape(-1, 3), np.arange(0, 13, 3), np.arange(4) / 50.0, name="p")),
        "bodies": Project(Poses(poses, ("u", "v"), 50.0, "b")),
    }


@pytest.mark.parametrize("kind", ["finished", "markers", "points", "bodies"])
@pytest.mark.parametrize("name", NAMES)
def test_an_obstacle_is_foretold_exactly_where_the_writer_refuses(projects, tmp_path, name, kind):
    entry, project = entry_of(name), projects[kind]
    foretold = obstacle_to(project, entry, {})
    try:
        export_project(project, entry, export_path(tmp_path, "x", entry), {})
        refused = ""
    except SkelgenError as error:
        refused = str(error)
    assert foretold == refused


@pytest.mark.parametrize(
    ("name", "options"),
    [*((name, {}) for name in FITTED), *((name, {"filled": True}) for name in ("c3d", "trc", "csm"))],
)
def test_the_files_are_those_of_the_preview(small_project, tmp_path, name, options):
    entry = entry_of(name)
    path = export_path(tmp_path, "walk & run", entry)
    foretold = preview_export(small_project, entry, path, options)
    assert list(tmp_path.iterdir()) == []
    files = export_project(small_project, entry, path, options)
    assert list(foretold.files) == files
    assert sorted(tmp_path.iterdir()) == sorted(files)
    assert list(preview_export(small_project, entry, path, options).files) == files


@pytest.mark.parametrize("name", NAMES)
def test_formats_keep_parts_that_there_are(name):
    keeps = entry_of(name).keeps
    assert keeps
    assert set(keeps) <= {part.name for part in PARTS}


@pytest.mark.parametrize(
    ("name", "contents"),
    [
        ("c3d", "10 markers in 12 frames at 100 Hz"),
        ("joints-csv", "2 joints in 12 frames at 100 Hz"),
        ("angles-csv", "2 joints in 12 frames at 100 Hz"),
        ("classic-xml", "10 markers, 3 limbs and 2 joints in 12 frames at 100 Hz"),
        ("summary-json", "10 markers, 3 limbs and 2 joints"),
    ],
)
def test_contents_are_counted(small_project, tmp_path, name, contents):
    entry = entry_of(name)
    assert preview_export(small_project, entry, export_path(tmp_path, "x", entry), {}).contents == contents


@pytest.mark.parametrize(
    ("kind", "name", "contents"),
    [
        ("markers", "trc", "3 markers in 4 frames at 50 Hz"),
        ("points", "mfml", "12 points in 4 frames at 50 Hz"),
        ("bodies", "poses-csv", "2 bodies in 4 frames at 50 Hz"),
    ],
)
def test_contents_of_takes_are_counted(projects, tmp_path, kind, name, contents):
    entry = entry_of(name)
    assert preview_export(projects[kind], entry, export_path(tmp_path, "x", entry), {}).contents == contents


def test_frames_are_counted_at_the_rate_wished(small_project, tmp_path):
    entry = entry_of("joints-csv")
    path = export_path(tmp_path, "x", entry)
    foretold = preview_export(small_project, entry, path, {"rate": 30.0}).contents
    assert foretold == "2 joints in 4 frames at 30 Hz"
    export_project(small_project, entry, path, {"rate": 30.0})
    assert len(path.read_text().splitlines()) == 1 + 4


def test_what_is_lost_is_said(small_project, tmp_path):
    def remarks(name, **options):
        entry = entry_of(name)
        return preview_export(small_project, entry, export_path(tmp_path, "walk", entry), options).remarks

    assert remarks("joints-csv") == (
        "Joint positions, CSV cannot hold the positions of the markers, the names of the markers, which marker is on "
        "which limb, the angles of the joints with their deviations, types and axes of the joints, how sure the joints "
        "are and how the limbs turn.",
    )
    assert remarks("classic-xml") == (
        "Skeleton and motion, XML cannot hold the angles of the joints with their deviations.",
        "Skeleton and motion, XML is written without tracked markers and joints before the fit; the detail `all` has "
        "them.",
    )
    assert remarks("report") == ()
    # Coordinates reach between 2 and 4 m; of the 24 bits of f32 that leaves 2^-12 mm.
    assert "Positions are rounded to single precision, to 0.0002 mm." in remarks("c3d")
    assert any("trc" in sentence and "walk.filled.csv" in sentence for sentence in remarks("trc", filled=True))


@pytest.mark.parametrize("name", ["bvh", "opensim", "urdf", "mjcf", "c3d-joints"])
def test_joints_whose_place_is_a_choice_are_said_and_marked(small_project, tmp_path, name):
    joints = tuple(replace(joint, open_directions=3) for joint in small_project.skeleton.joints)
    project = replace(small_project, _skeleton=replace(small_project.skeleton, joints=joints))
    entry = next(one for one in export_formats() if one.name == name)
    path = export_path(tmp_path, "open", entry)
    (said,) = [one for one in preview_export(project, entry, path, {}).remarks if "their places are a choice" in one]
    assert project.skeleton.joint_names[0] in said
    if name in {"opensim", "urdf", "mjcf"}:
        written = export_project(project, entry, path, {})
        assert f"<!--{said}-->" in written[0].read_text()


@pytest.fixture
def with_open_joint(small_project):
    """The motion does not determine where the first joint is; it determines the others."""
    first, *others = (replace(one, open_directions=0) for one in small_project.skeleton.joints)
    skeleton = replace(small_project.skeleton, joints=(replace(first, open_directions=3), *others))
    return replace(small_project, _skeleton=skeleton)


@pytest.mark.parametrize(("name", "file"), [("cal3d", 0), ("opensim", 0), ("opensim", 1), ("tree", 0)])
def test_files_with_comments_name_the_joints_that_motion_does_not_determine(with_open_joint, tmp_path, name, file):
    entry = entry_of(name)
    (sentence,) = choices_in(with_open_joint)
    assert with_open_joint.skeleton.joint_names[0] in sentence
    assert sentence in export_project(with_open_joint, entry, export_path(tmp_path, "x", entry), {})[file].read_text()


@pytest.mark.parametrize("name", ["joints-csv", "angles-csv", "urdf", "mjcf"])
def test_wide_tables_have_a_column_for_each_joint_if_motion_leaves_one_open(with_open_joint, tmp_path, name):
    entry = entry_of(name)
    path = export_project(with_open_joint, entry, export_path(tmp_path, "x", entry), {})[-1]
    header, *rows = (line.split(",")[-2:] for line in path.read_text().splitlines())
    assert header == [f"{joint}_determined" for joint in with_open_joint.skeleton.joint_names]
    assert rows == [["0", "1"]] * with_open_joint.motion.n_frames


def test_poses_have_a_column_for_the_joint_above_each_limb_which_is_not_read(with_open_joint, tmp_path):
    entry, names = entry_of("poses-csv"), with_open_joint.skeleton.limb_names
    (path,) = export_project(with_open_joint, entry, export_path(tmp_path, "x", entry), {})
    header, *rows = (line.split(",")[-2:] for line in path.read_text().splitlines()[3:])
    assert header == [f"{names[joint.child]}.determined" for joint in with_open_joint.skeleton.joints]
    assert rows == [["0", "1"]] * with_open_joint.motion.n_frames
    assert read_take(path).names == names


@pytest.mark.parametrize("name", ["poses-csv", "angles-csv", "bvh", "gltf"])
def test_exports_name_the_joints_that_motion_does_not_determine(with_open_joint, tmp_path, name):
    entry = entry_of(name)
    remarks = preview_export(with_open_joint, entry, export_path(tmp_path, "x", entry), {}).remarks
    assert set(choices_in(with_open_joint)) <= set(remarks)


def test_long_tables_have_a_column_of_joints_that_motion_determines(with_open_joint, tmp_path):
    entry = entry_of("table-csv")
    joints = export_project(with_open_joint, entry, export_path(tmp_path, "x", entry), {})[1]
    header, first, second, *_ = (line.split(",")[-1] for line in joints.read_text().splitlines())
    assert (header, first, second) == ("determined", "0", "1")


def test_bvh_says_that_it_has_no_place_for_joints_left_open(with_open_joint, tmp_path):
    remarks = preview_export(with_open_joint, entry_of("bvh"), tmp_path / "x.bvh", {}).remarks
    assert any("a summary (summary-json) beside it" in sentence for sentence in remarks)


@pytest.mark.parametrize("name", ["cal3d", "opensim", "gltf", "usd", "c3d-joints", "summary-json", "classic-xml"])
def test_joints_that_the_marker_set_places_are_marked_as_such(small_project, tmp_path, name):
    first, *others = (replace(one, open_directions=0) for one in small_project.skeleton.joints)
    skeleton = replace(small_project.skeleton, joints=(replace(first, is_placed_by_marker_set=True), *others))
    project = replace(small_project, _skeleton=skeleton)
    entry = entry_of(name)
    suffix = ".usda" if name == "usd" else entry.suffixes[0]  # the usual one is compressed
    path = export_project(project, entry, tmp_path / f"x{suffix}", {})[0]
    plain = export_project(small_project, entry, tmp_path / f"y{suffix}", {})[0]
    words = b'"is_placed_by_marker_set": true' if name == "summary-json" else b"marker set"
    assert words in path.read_bytes()
    assert words not in plain.read_bytes()


def test_every_format_with_joints_says_where_it_marks_those_left_open():
    silent = {entry.name for entry in export_formats() if "joints" in entry.keeps and not entry.marks_open}
    assert silent == {"bvh"}


def test_hinges_whose_place_along_their_axes_is_a_choice_are_said(small_project, tmp_path):
    first, *others = (replace(one, kind="ball", open_directions=0) for one in small_project.skeleton.joints)
    hinge = replace(first, kind="hinge", axis=np.array([1.0, 0.0, 0.0]), open_directions=1)
    project = replace(small_project, _skeleton=replace(small_project.skeleton, joints=(hinge, *others)))
    entry = next(one for one in export_formats() if one.name == "bvh")
    (said,) = [one for one in preview_export(project, entry, tmp_path / "x.bvh", {}).remarks if "a choice" in one]
    assert "along their axes" in said
    assert said.endswith(f": {project.skeleton.joint_names[0]}.")


def test_names_that_csm_writes_otherwise_are_said(tmp_path):
    entry = entry_of("csm")
    project = Project(Trajectories(np.zeros((2, 2, 3)), ("left hip", "knee"), 50.0))
    remarks = preview_export(project, entry, export_path(tmp_path, "x", entry), {}).remarks
    assert any("'left hip' as 'left_hip'" in sentence for sentence in remarks)


@pytest.mark.parametrize("name", ["", "  ", "a/b", "a\0b", "a\\b"])
def test_a_name_that_no_file_can_have_is_refused(tmp_path, name):
    with pytest.raises(WriteError, match="cannot be the name of a file"):
        export_path(tmp_path, name, REPORT)


@pytest.mark.parametrize("name", ["walk.1", "Gänge; ${x} & 100 %", "..."])
def test_any_other_name_is_that_of_the_file(small_project, tmp_path, name):
    entry = entry_of("cal3d")
    export_project(small_project, entry, export_path(tmp_path, name, entry), {})
    assert sorted(file.name for file in tmp_path.iterdir()) == [f"{name}.xaf", f"{name}.xsf"]


def test_a_value_that_is_not_allowed_is_an_obstacle_and_an_error(small_project, tmp_path):
    entry = entry_of("csm")
    path = export_path(tmp_path, "x", entry)
    sentence = "the format csm: dropout is 'none'; it must be one of word, zero"
    assert preview_export(small_project, entry, path, {"dropout": "none"}).obstacle == sentence
    with pytest.raises(ParameterError, match="must be one of word, zero"):
        export_project(small_project, entry, path, {"dropout": "none"})


class CancellingMonitor:
    """Cancels when it is told of progress for the n-th time."""

    def __init__(self, left):
        self.left = left

    def begin(self, name):
        pass

    def advance(self, done, total):
        self.left -= 1
        if self.left < 0:
            raise Cancelled

    def notice(self, sentence):
        pass


@pytest.mark.parametrize("left", [0, 1])
@pytest.mark.parametrize("name", ["trc", "csm", "mfml", "classic-xml", "cal3d", "joints-csv", "angles-csv"])
def test_cancelling_leaves_what_was_there(make_project, tmp_path, name, left):
    entry, project = entry_of(name), make_project(n_frames=600)
    path = export_path(tmp_path, "walk", entry)
    path.write_text("precious")
    with pytest.raises(Cancelled):
        export_project(project, entry, path, {}, CancellingMonitor(left))
    assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [(path.name, "precious")]


@pytest.mark.parametrize("name", FITTED)
def test_a_full_disk_is_a_sentence_and_leaves_what_was_there(make_project, tmp_path, name, full_disk):
    entry, project = entry_of(name), make_project(n_frames=600)
    path = export_path(tmp_path / "new", "walk", entry)
    with full_disk(100), pytest.raises(WriteError) as caught:
        export_project(project, entry, path, {})
    assert str(path.parent / "walk") in str(caught.value)
    assert ".skelgen-" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_a_file_is_a_sentence(small_project, tmp_path):
    (tmp_path / "out").write_text("")
    entry = entry_of("c3d")
    with pytest.raises(WriteError, match=r"out: cannot be created: there is a file"):
        export_project(small_project, entry, export_path(tmp_path / "out", "walk", entry), {})


def test_a_folder_without_rights_is_a_sentence(small_project, tmp_path, monkeypatch):
    def refuse(*args, **kwargs):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("pathlib.Path.mkdir", refuse)
    entry = entry_of("c3d")
    with pytest.raises(WriteError, match=r"out: cannot be (created|written): Permission denied"):
        export_project(small_project, entry, export_path(tmp_path / "out", "walk", entry), {})
    assert list(tmp_path.iterdir()) == []


def test_an_export_that_would_replace_the_recording_is_an_obstacle_before_it_begins(small_project, tmp_path):
    entry, path = entry_of("trc"), tmp_path / "walk.trc"
    export_project(small_project, entry, path, {})
    recorded = open_input(NamedFile(path))
    assert "is what is read" in preview_export(recorded, entry, path, {}).obstacle
    assert not preview_export(recorded, entry, tmp_path / "other.trc", {}).obstacle
