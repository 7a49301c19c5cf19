"""The public face."""

from __future__ import annotations

import numpy as np
import pytest

import skelgen
from skelgen.errors import FormatError, InputError, ParameterError, WriteError


def test_take_becomes_a_finished_project(waving):
    project = skelgen.reconstruct(waving, n_limbs=2, seed=5, parameters={"joints": {"alpha": 0.2}})
    assert project.seed == 5
    assert project.topology.alpha == 0.2
    assert project.motion.joint_positions.shape == (20, 1, 3)


NO_NUMBERS = ["x", "3", 0, -1, 2.5, True, [3]]


@pytest.mark.parametrize(
    ("argument", "value"),
    [
        *((name, value) for name in ("n_markers", "n_limbs", "n_jobs") for value in NO_NUMBERS),
        *(("seed", value) for value in ("x", None, -1, 2.5)),
        *(("parameters", value) for value in (5, [1], {"joints": 3}, {"limbs": {"sampling": 10**400}})),
        *(("hierarchy", value) for value in (5, ["a"], "abc")),
        *((name, value) for name in ("joined", "parted") for value in (5, [5], ["ab"], [("limb0", 5)])),
        *((name, 5) for name in ("root", "until", "identities", "monitor")),
    ],
)
def test_arguments_of_the_wrong_type_are_refused_in_a_sentence(waving, argument, value):
    with pytest.raises((InputError, ParameterError), match=argument.partition("_")[0].rstrip("s") + "|limb|stage"):
        skelgen.reconstruct(waving, **{argument: value})


@pytest.mark.parametrize(
    ("function", "arguments"),
    [
        ("read", (5,)),
        ("load", (None,)),
        ("write", (5, "a.trc")),
        ("reconstruct", ([1, 2, 3],)),
        ("apply_subject", (5, "rom.skelgen")),
        ("calibrate_together", ([1, 2],)),
        ("correct", (5, "merge", ["a", "b"])),
        ("take_back", (5, 0)),
        ("fill", (5,)),
        ("evaluate", (5, 5)),
        ("run_batch", (5, "out")),
        ("simulate", (5,)),
        ("Tracker", (5,)),
        ("LiveSkeleton", (5,)),
    ],
)
def test_what_a_function_cannot_take_is_refused_in_a_sentence(function, arguments):
    with pytest.raises((InputError, ParameterError, WriteError), match=r"5|1|None"):
        getattr(skelgen, function)(*arguments)


def test_one_name_and_one_input_need_no_list(small_project, tmp_path):
    renamed = skelgen.correct(small_project, "rename", small_project.trajectories.names[0], "LKNE")
    assert renamed.trajectories.names[0] == "LKNE"
    with pytest.raises(InputError, match="nowhere: there is no such file or folder"):
        skelgen.run_batch("nowhere", tmp_path / "out")


def test_an_argument_that_does_not_exist_is_refused_with_those_that_do(waving):
    with pytest.raises(InputError, match=r"reconstruct .*'n_limb'; its arguments are take, n_markers, n_limbs, seed"):
        skelgen.reconstruct(waving, n_limb=3)


@pytest.mark.parametrize(
    ("names", "value", "frames"), [((5,), "new", (None, None)), (("A",), 5, (None, None)), (("A", "B"), "", ("a", 3))]
)
def test_corrections_of_the_wrong_type_are_refused(small_project, names, value, frames):
    with pytest.raises((InputError, ParameterError), match=r"texts|frame"):
        skelgen.correct(small_project, "swap" if frames[0] else "rename", names, value, frames)


@pytest.mark.parametrize(
    ("positions", "rate"),
    [("x", 100.0), ([[1], [1, 2]], 100.0), (np.zeros((4, 1)), 100.0), (np.zeros((4, 1, 3), complex), 100.0)]
    + [(np.zeros((4, 1, 3)), rate) for rate in ("x", 0.0, np.nan, None)],
)
def test_values_that_are_no_numbers_of_a_shape_are_refused(positions, rate):
    with pytest.raises(InputError, match=r"positions|rate"):
        skelgen.Trajectories(positions, ("A",), rate)


def test_coordinates_beyond_all_measure_are_refused():
    positions = 1e300 * np.random.default_rng(0).normal(size=(5, 2, 3))
    with pytest.raises(InputError, match="more than a thousand kilometres"):
        skelgen.reconstruct(skelgen.Trajectories(positions, ("A", "B"), 100.0))


def test_take_comes_back_from_a_marker_file(waving, tmp_path):
    assert skelgen.write(waving, tmp_path / "w.trc") == [tmp_path / "w.trc"]
    again = skelgen.read(tmp_path / "w.trc")
    np.testing.assert_allclose(again.positions, waving.positions, atol=1e-3)  # mm: text with fewer digits


def test_an_option_that_the_format_does_not_have_is_refused(waving, tmp_path):
    skelgen.write(waving, tmp_path / "w.trc")
    with pytest.raises(WriteError, match="no option 'seed'"):
        skelgen.read(tmp_path / "w.trc", seed=3)


def test_project_file_is_written_and_its_take_read(small_project, tmp_path):
    (path,) = skelgen.write(small_project, tmp_path / "w.skelgen")
    with pytest.warns(UserWarning, match=r"results \(labels, limbs, joints, skeleton\).*skelgen.load"):
        assert skelgen.read(path).names == small_project.take.names
    assert skelgen.load(path).skeleton.n_limbs == small_project.skeleton.n_limbs


def test_loaded_project_goes_on_where_it_ended(waving, tmp_path):
    (path,) = skelgen.write(skelgen.reconstruct(waving, seed=4, until="limbs"), tmp_path / "w.skelgen")
    half = skelgen.load(path)
    assert not half.has("joints")
    whole = skelgen.reconstruct(half)
    assert whole.limbs is half.limbs
    assert (whole.seed, whole.has("skeleton")) == (4, True)


def test_joints_that_are_stated_are_found_and_others_are_not():
    take = skelgen.simulate("rods", n_frames=100).take
    found = {frozenset(edge) for edge in skelgen.reconstruct(take, until="joints").topology.edges.tolist()}
    (other,) = {frozenset(pair) for pair in ((0, 1), (1, 2), (0, 2))} - found
    wanted, refused = tuple(f"limb{limb}" for limb in other), tuple(f"limb{limb}" for limb in min(found, key=sorted))
    project = skelgen.reconstruct(take, until="joints", joined=[wanted], parted=[refused])
    edges = {frozenset(edge) for edge in project.topology.edges.tolist()}
    assert other in edges
    assert min(found, key=sorted) not in edges


def test_a_joint_is_between_two_limbs(waving):
    with pytest.raises(InputError, match="two limbs"):
        skelgen.reconstruct(waving, joined=["ab"])
    with pytest.raises(InputError, match="the same limb"):
        skelgen.reconstruct(waving, joined=[("a", "b")])
    with pytest.raises(InputError, match="there is no limb 'tail'"):
        skelgen.reconstruct(waving, parted=[("a", "tail")])


def test_correction_is_obeyed_by_the_next_run(waving):
    project = skelgen.correct(skelgen.reconstruct(waving), "root", ["f"])
    assert not project.has("joints")
    again = skelgen.reconstruct(project)
    assert again.topology.roots.tolist() == [again.limbs.limb_of_marker[waving.names.index("f")]]


def test_correction_of_a_marker_that_does_not_exist_is_refused(waving):
    with pytest.raises(InputError, match="'tail'"):
        skelgen.correct(skelgen.reconstruct(waving), "root", ["tail"])


def test_filled_markers_are_written_without_gaps(tmp_path):
    project = skelgen.reconstruct(skelgen.simulate("rods", n_frames=100, dropouts=0.1).take)
    files = skelgen.write(skelgen.fill(project), tmp_path / "w.trc")
    assert np.isfinite(skelgen.read(files[0]).positions).all()


def test_subject_is_applied_from_its_file(tmp_path):
    skelgen.write(skelgen.reconstruct(skelgen.simulate("rods", seed=1, n_frames=200).take), tmp_path / "rom.skelgen")
    walk = skelgen.apply_subject(skelgen.simulate("rods", seed=1, n_frames=60).take, tmp_path / "rom.skelgen")
    assert walk.skeleton.lengths == skelgen.load(tmp_path / "rom.skelgen").skeleton.lengths
    assert walk.motion.n_frames == 60


def test_truth_may_be_a_file(tmp_path):
    from skelgen.simulation import write_truth

    simulated = skelgen.simulate("rods", n_frames=100)
    write_truth(simulated.truth, tmp_path / "rods.truth.npz")
    project = skelgen.reconstruct(simulated.take)
    assert skelgen.evaluate(project, tmp_path / "rods.truth.npz") == skelgen.evaluate(project, simulated.truth)


def test_batch_gives_each_take_a_folder(waving, tmp_path):
    skelgen.write(waving, tmp_path / "in" / "wave.csm")
    result = skelgen.run_batch([tmp_path / "in"], tmp_path / "out", skelgen.Job(formats=("bvh",)))
    assert result.n_done == 1
    assert (tmp_path / "out" / "wave" / "wave.bvh").exists()


def test_bare_take_fits_into_a_project_file(waving, tmp_path):
    skelgen.write(waving, tmp_path / "w.skelgen")
    assert skelgen.read(tmp_path / "w.skelgen", format="skelgen").rate == waving.rate


def test_project_file_knows_no_options(waving, tmp_path):
    with pytest.raises(WriteError, match="without options"):
        skelgen.write(waving, tmp_path / "w.skelgen", digits=3)
    skelgen.write(waving, tmp_path / "w.skelgen")
    with pytest.raises(InputError, match="without options"):
        skelgen.read(tmp_path / "w.skelgen", timestamp_unit="ms")


def test_absent_file_is_a_format_error(tmp_path):
    with pytest.raises(FormatError, match=r"absent.c3d"):
        skelgen.read(tmp_path / "absent.c3d")
