"""The project file: exact, deterministic, whole or not at all, and never more than a `FormatError`."""

from __future__ import annotations

import dataclasses
import io
import json
import tracemalloc
import zipfile

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from skelgen_formats.summary_json import summary

from skelgen.app.outputs import OUTPUTS, write_outputs
from skelgen.app.project_file.archive import VERSION, find_result, is_project_file, open_project, save_project
from skelgen.app.report import report_html
from skelgen.app.tables import project_tables
from skelgen.errors import FormatError, WriteError
from skelgen.kinematics.inverse.motion import MotionAngles
from skelgen.model import Labelling, PointCloud, Project, StageReport
from skelgen.model.labelling import Agreement, Doubt, Tracklets

CLOUD = PointCloud(np.arange(12.0).reshape(4, 3), [0, 2, 2, 4], [0.0, 0.01, 0.03], {"n_blobs": np.ones(4)}, "c.mfml")


def values_of(value):
    """Every array and plain value inside, in order."""
    if isinstance(value, np.ndarray):
        return [value.tobytes(), value.shape]
    if hasattr(value, "__dataclass_fields__"):
        stored = [field.name for field in dataclasses.fields(value) if field.metadata.get("is_stored", True)]
        return [values_of(getattr(value, name)) for name in stored]
    if hasattr(value, "items"):
        return [(key, values_of(item)) for key, item in value.items()]
    return [values_of(item) for item in value] if isinstance(value, tuple | list) else repr(value)


@pytest.fixture
def saved(small_project, tmp_path):
    return save_project(small_project, tmp_path / "walk.skelgen")


def with_member(source, member, content):
    """A copy of an archive with one member replaced (None leaves it out)."""
    target = source.with_name("changed.skelgen")
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            data = content if name == member else old.read(name)
            if data is not None:
                new.writestr(name, data)
    return target


def structure_of(file):
    """What a project file says of its values, but for arrays."""
    with zipfile.ZipFile(file) as archive:
        return json.loads(archive.read("project.json"))


def changed_structure(saved, change):
    """The project with its structure edited by `change`."""
    structure = structure_of(saved)
    change(structure)
    return with_member(saved, "project.json", json.dumps(structure))


def as_npy(array, **options):
    """The bytes of an array's file."""
    stream = io.BytesIO()
    np.save(stream, array, **options)
    return stream.getvalue()


def test_everything_comes_back_bit_for_bit(small_project, saved):
    assert values_of(open_project(saved)) == values_of(small_project)


def test_a_cloud_without_results_comes_back(tmp_path):
    again = open_project(save_project(Project(CLOUD, seed=3), tmp_path / "c.skelgen"))
    assert values_of(again.take) == values_of(CLOUD)
    assert again.seed == 3
    assert not again.has("labels")


def test_a_file_from_before_bodies_were_told_apart_opens(saved):
    names = ("body_of_limb", "body_probability")
    older = changed_structure(saved, lambda structure: [structure["limbs"]["fields"].pop(name) for name in names])
    assert open_project(older).limbs.n_bodies == 1


@pytest.fixture
def judged(small_project):
    """A project that knows how sure its labels are, in every detail."""
    trajectories = small_project.trajectories
    confidence = np.where(trajectories.seen, 0.75, np.nan)
    doubt = Doubt(1, 2, 4, "rival", 0, 0.25, "because é")
    tracklets = Tracklets([0, 0, 1], [1, -1, 2], [0, 3, 1], [2, 4, 9], [3, 2, 9])
    left_out = np.arange(trajectories.n_frames)
    labelling = Labelling(confidence, (doubt,), ((0, 1), (2, 3)), left_out, tracklets, Agreement("sets", 7, 90, 0.75))
    return small_project.with_trajectories(trajectories, StageReport(), labelling)


def test_files_from_before_all_deviations_were_stated_are_read(saved):
    def change(structure):
        structure["version"], skeleton = 1, structure["skeleton"]["fields"]
        for name in ("offset_std", "length_std", "marker_noise"):
            del skeleton[name]
        for joint in skeleton["joints"]:
            for name in ("covariance", "covariance_in_child", "axis_std", "second_axis_std", "turn_covariance"):
                del joint["fields"][name]

    older = open_project(changed_structure(saved, change))
    assert older.skeleton.offset_std is None
    assert older.skeleton.joints[0].covariance is None
    assert project_tables(older)["joints"][0]["child_std_mm"] is None
    assert "Joint angles" in report_html(older)
    json.dumps(summary(older), allow_nan=False)


FIELDS_OF_0_1_0 = {
    "Trajectories": "name names notices positions rate",
    "PointCloud": "attributes frame_starts name notices points times",
    "Correction": "first_frame kind last_frame names places value",
    "Place": "frame position",
    "Labelling": "confidence doubts findings left_out seed_method tracklets twins",
    "Tracklets": "first last marker n_points track",
    "Agreement": "method n_markers n_points share",
    "Doubt": "marker first_frame last_frame kind rival confidence reason",
    "Finding": "kind names first_frame last_frame evidence outcome",
    "Limbs": "distance_deviation limb_of_marker",
    "Topology": "alpha joint_costs loops n_iterations parents raw_joint_positions values",
    "Skeleton": "joints length_std limb_of_marker loops marker_noise marker_offsets marker_std offset_std parents "
    "reference_pose",
    "Joint": "axis axis_std child covariance covariance_in_child kind parent position_in_child position_in_parent "
    "second_axis second_axis_std std turn_covariance",
    "Motion": "joint_positions joint_std limb_seen marker_positions rate residuals world_from_limb",
}
"""What version 0.1.0 wrote of every value, by its type."""

CALLED_NOW = {"seed_method": "classic"}
"""Fields of 0.1.0 that have another name now."""


def as_0_1_0(data):
    """The structure of a project file with the fields of 0.1.0 alone, under their names of then."""
    if isinstance(data, list):
        return [as_0_1_0(item) for item in data]
    if not isinstance(data, dict):
        return data
    if set(data) == {"type", "fields"}:
        fields = FIELDS_OF_0_1_0[data["type"]].split()
        return {
            "type": data["type"],
            "fields": {name: as_0_1_0(data["fields"][CALLED_NOW.get(name, name)]) for name in fields},
        }
    return {key: as_0_1_0(item) for key, item in data.items()}


def test_files_of_version_0_1_0_are_read(judged, tmp_path):
    structure = as_0_1_0(structure_of(save_project(judged, tmp_path / "j.skelgen")))
    assert structure["version"] == 2
    older = with_member(tmp_path / "j.skelgen", "project.json", json.dumps(structure))
    assert values_of(open_project(older)) == values_of(judged)


def test_how_sure_labels_are_comes_back_bit_for_bit(judged, tmp_path):
    assert values_of(open_project(save_project(judged, tmp_path / "j.skelgen"))) == values_of(judged)


def test_files_from_before_first_points_were_stored_are_read(judged, tmp_path):
    def change(structure):
        fields = structure["labelling"]["fields"]["tracklets"]["fields"]
        del fields["first_point"], fields["first_position"]

    older = open_project(changed_structure(save_project(judged, tmp_path / "j.skelgen"), change))
    assert older.labelling.tracklets.first_point is None
    assert older.labelling.tracklets.n_left_out == judged.labelling.tracklets.n_left_out


def test_files_from_before_labels_were_judged_are_read(saved):
    project = open_project(changed_structure(saved, lambda structure: structure.pop("labelling")))
    assert not project.has_labelling
    assert project.has("skeleton")


def test_files_from_before_joints_had_a_second_axis_are_read(saved):
    older = changed_structure(
        saved, lambda old: [joint["fields"].pop("second_axis") for joint in old["skeleton"]["fields"]["joints"]]
    )
    project = open_project(older)
    assert [joint.second_axis for joint in project.skeleton.joints] == [None] * project.skeleton.n_joints


def test_account_of_other_labels_is_refused(judged, tmp_path):
    saved = save_project(judged, tmp_path / "j.skelgen")
    with pytest.raises(FormatError, match=r"changed.skelgen:project.json"):
        open_project(with_member(saved, "arrays/labelling/confidence.npy", as_npy(np.zeros((3, 10)))))


def test_names_that_no_encoding_knows_come_back(tmp_path):
    cloud = PointCloud(CLOUD.points, CLOUD.frame_starts, CLOUD.times, {"\ud800/..": np.ones(4)}, name="\udcff")
    again = open_project(save_project(Project(cloud), tmp_path / "c.skelgen")).take
    assert values_of(again) == values_of(cloud)


def test_labelled_take_stays_one_object(saved):
    project = open_project(saved)
    assert project.trajectories is project.take


def test_same_project_gives_the_same_bytes(small_project, tmp_path):
    first, second = (save_project(small_project, tmp_path / name).read_bytes() for name in ("a.skelgen", "b.skelgen"))
    assert first == second


def test_times_and_versions_are_in_a_member_of_their_own(saved):
    with zipfile.ZipFile(saved) as archive:
        assert set(json.loads(archive.read("run.json"))) == {"seconds", "source", "versions"}
        assert "seconds" not in archive.read("project.json").decode()


def test_project_is_recognised_by_its_content(saved, tmp_path):
    assert is_project_file(saved.rename(tmp_path / "renamed.dat"))
    assert not is_project_file(tmp_path / "absent.c3d")


@pytest.mark.parametrize("first", ["[Content_Types].xml", "take.c3d", "positions.npy"])
def test_other_archives_are_no_projects(tmp_path, first):
    """Of spreadsheets, of files to be unpacked, and of numpy."""
    with zipfile.ZipFile(tmp_path / "table.xlsx", "w") as archive:
        archive.writestr(first, "")
    assert not is_project_file(tmp_path / "table.xlsx")


@pytest.mark.parametrize("member", ["project.json", "run.json", "arrays/motion/residuals.npy"])
def test_missing_member_is_named(saved, member):
    with pytest.raises(FormatError, match=f"changed.skelgen:{member}: .*missing"):
        open_project(with_member(saved, member, None))


def test_newer_version_asks_for_an_update(saved):
    newer = changed_structure(saved, lambda structure: structure.update(version=VERSION + 1))
    with pytest.raises(FormatError, match=rf"changed.skelgen:project.json: version {VERSION + 1}.*update"):
        open_project(newer)


def test_compressed_bomb_is_refused_before_it_unfolds(tmp_path):
    path = tmp_path / "bomb.skelgen"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("project.json", b" " * 10**7)
    with pytest.raises(FormatError, match="declare 10000000 bytes"):
        open_project(path)


def test_member_of_more_bytes_than_the_file_is_refused_before_it_is_read(saved, tmp_path):
    content = bytearray(saved.read_bytes())
    entry = content.rindex(b"PK\x01\x02")
    content[entry + 20 : entry + 24] = (2**31).to_bytes(4, "little")  # what it takes in the archive
    (tmp_path / "b.skelgen").write_bytes(content)
    with pytest.raises(FormatError, match="declare 21"):
        open_project(tmp_path / "b.skelgen")


def test_array_that_claims_more_than_it_holds_is_named(saved):
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": "<f8", "fortran_order": False, "shape": (10**12, 3)})
    member = "arrays/take/positions.npy"
    with pytest.raises(FormatError, match=member):
        open_project(with_member(saved, member, stream.getvalue()))


def test_pickled_array_is_refused(saved):
    pickled = as_npy(np.array([{}], dtype=object), allow_pickle=True)
    with pytest.raises(FormatError, match=r"arrays/take/positions.npy"):
        open_project(with_member(saved, "arrays/take/positions.npy", pickled))


def test_parts_that_do_not_fit_are_refused(saved):
    with pytest.raises(FormatError, match=r"changed.skelgen:project.json"):
        open_project(with_member(saved, "arrays/motion/residuals.npy", as_npy(np.zeros((3, 5)))))


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_cut_or_changed_files_raise_only_format_errors(saved, tmp_path, data):
    content = bytearray(saved.read_bytes())
    if data.draw(st.booleans()):
        content = content[: data.draw(st.integers(0, len(content) - 1))]
    else:
        for place in data.draw(st.lists(st.integers(0, len(content) - 1), min_size=1, max_size=8)):
            content[place] = data.draw(st.integers(0, 255))
    (tmp_path / "odd.skelgen").write_bytes(content)
    try:
        open_project(tmp_path / "odd.skelgen")
    except FormatError as error:
        assert "odd.skelgen" in str(error)


JSON_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-5, 5) | st.text(max_size=3), lambda inner: st.lists(inner, max_size=2)
)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_changed_structure_raises_only_format_errors(saved, data):
    structure = structure_of(saved)
    node = structure
    while True:
        key = data.draw(st.sampled_from(sorted(node) if isinstance(node, dict) else range(len(node))))
        if not isinstance(node[key], dict | list) or not node[key] or data.draw(st.booleans()):
            break
        node = node[key]
    node[key] = data.draw(JSON_VALUES)
    try:
        open_project(with_member(saved, "project.json", json.dumps(structure)))
    except FormatError as error:
        assert "changed.skelgen" in str(error)


def test_unwritable_place_leaves_nothing(small_project, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(WriteError):
        save_project(small_project, tmp_path / "file" / "walk.skelgen")


def test_absent_file_is_a_format_error(tmp_path):
    with pytest.raises(FormatError, match="no such file"):
        open_project(tmp_path / "absent.skelgen")


def test_folder_with_one_project_is_enough(saved):
    assert find_result(saved.parent) == saved


def test_folder_without_project_is_an_error(tmp_path):
    with pytest.raises(FormatError, match="none"):
        find_result(tmp_path)


def test_motion_of_a_file_has_its_joint_angles(small_project, saved):
    angles = MotionAngles(small_project.skeleton, small_project.trajectories.positions)(small_project.motion)
    for wanted, found in zip(angles, open_project(saved).motion.joint_angles, strict=True):
        np.testing.assert_array_equal(found.values, wanted.values)
        np.testing.assert_array_equal(found.std, wanted.std)


@pytest.mark.parametrize(
    "change",
    [
        lambda structure: structure["take"]["fields"].update(name=5),
        lambda structure: structure["take"]["fields"].update(notices=[1]),
        lambda structure: structure["motion"]["fields"].update(compute_angles="now"),
        lambda structure: structure["skeleton"]["fields"]["joints"][0]["fields"].update(parent=0.5),
        lambda structure: structure.update(seed="0"),
        lambda structure: structure.update(seed=-1),
        lambda structure: structure.update(view={"zoom": float("nan")}),
        lambda structure: next(iter(structure["reports"].values())).update(notices=[["two"]]),
        lambda structure: next(iter(structure["reports"].values()))["parameters"]["mapping"].update(
            rounds={"array": "take/positions"}
        ),
    ],
)
def test_value_of_another_type_is_refused_on_reading(saved, change):
    with pytest.raises(FormatError, match=r"changed.skelgen:project.json: "):
        open_project(changed_structure(saved, change))


def test_half_a_character_in_a_name_is_read_so_that_it_can_be_written(saved, tmp_path):
    def change(structure):
        structure["take"]["fields"].update(name="walk\ud800.trc")
        structure["take"]["fields"]["names"][0] = "L\udc80"

    project = open_project(changed_structure(saved, change))
    assert (project.take.name, project.take.names[0]) == ("walk?.trc", "L?")
    assert len(write_outputs(project, tmp_path / "out", "walk")) >= len(OUTPUTS)


def test_array_whose_header_never_closes_is_refused(saved):
    content = b"\x93NUMPY\x01\x00\x12\x00{'descr': '<f8', \n"
    with pytest.raises(FormatError, match="not a valid array"):
        open_project(with_member(saved, "arrays/take/positions.npy", content))


def test_more_values_than_belong_to_a_file_are_refused_before_they_are_parsed(saved):
    damaged = with_member(saved, "project.json", "[" + "[],[],[]," * 2_000_000 + "[]]")
    tracemalloc.start()
    with pytest.raises(FormatError, match="holds 12000002 values, far more"):
        open_project(damaged)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 4 * damaged.stat().st_size


def test_numbers_that_nothing_measured_is_are_refused(saved):
    with pytest.raises(FormatError, match=r"residuals.npy: .*numbers beyond 1e\+60"):
        open_project(with_member(saved, "arrays/motion/residuals.npy", as_npy(np.full((12, 10), 1e300))))
