"""The public face."""

from __future__ import annotations

import numpy as np
import pytest

import skelgen
from skelgen.errors import FormatError, InputError, WriteError


def test_take_becomes_a_finished_project(waving):
    project = skelgen.reconstruct(waving, n_limbs=2, seed=5, parameters={"joints": {"alpha": 0.2}})
    assert project.seed == 5
    assert project.topology.alpha == 0.2
    assert project.motion.joint_positions.shape == (20, 1, 3)


def test_something_else_than_a_take_is_refused():
    with pytest.raises(InputError, match="not list"):
        skelgen.reconstruct([1, 2, 3])


def test_take_comes_back_from_a_marker_file(waving, tmp_path):
    assert skelgen.write(waving, tmp_path / "w.trc") == [tmp_path / "w.trc"]
    again = skelgen.read(tmp_path / "w.trc")
    np.testing.assert_allclose(again.positions, waving.positions, atol=1e-3)  # mm: text with fewer digits


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
