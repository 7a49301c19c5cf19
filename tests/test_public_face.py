"""The public face, word for word as the architecture promises it to other programs."""

from __future__ import annotations

import inspect
import subprocess
import sys

import numpy as np
import pytest

import skelgen
from skelgen.simulation import simulate

ROUNDING = 1e-3  # mm: C3D keeps single precision


@pytest.fixture(scope="module")
def simulated():
    """Rods of 9 markers on 3 limbs with two ball joints, 200 frames."""
    return simulate("rods", n_frames=200)


@pytest.fixture(scope="module")
def path(simulated, tmp_path_factory):
    file = tmp_path_factory.mktemp("take") / "take.c3d"
    skelgen.write(simulated.take, file)
    return file


@pytest.fixture(scope="module")
def take(path):
    return skelgen.read(path)


@pytest.fixture(scope="module")
def project(take):
    return skelgen.reconstruct(take, n_markers=None, n_limbs=None, seed=0, parameters=None, monitor=None)


def test_marker_file_is_read_as_trajectories(take, simulated):
    assert isinstance(take, skelgen.Trajectories)
    np.testing.assert_allclose(take.positions, simulated.take.positions, atol=ROUNDING)


def test_reconstruct_takes_the_promised_arguments():
    promised = ["take", "n_markers", "n_limbs", "seed", "parameters", "monitor"]
    signature = inspect.signature(skelgen.reconstruct)
    assert list(signature.parameters)[: len(promised)] == promised
    defaults = [signature.parameters[name].default for name in promised[1:]]
    assert defaults == [None, None, 0, None, None]


def test_trajectories_hold_positions_in_mm(project, simulated):
    assert project.trajectories.positions.shape == (200, 9, 3)
    np.testing.assert_allclose(project.trajectories.positions, simulated.take.positions, atol=ROUNDING)


def test_limbs_hold_the_limb_of_every_marker(project, simulated):
    labels = project.limbs.limb_of_marker
    assert labels.shape == (9,)
    assert len({*zip(labels.tolist(), simulated.truth.limb_of_marker.tolist(), strict=True)}) == 3


def test_joints_are_a_tuple_with_the_promised_attributes(project):
    joints = project.skeleton.joints
    assert isinstance(joints, tuple)
    assert len(joints) == 2
    for joint in joints:
        assert {joint.parent, joint.child} < {0, 1, 2}
        assert joint.kind == "ball"
        assert joint.axis is None
        assert joint.std.shape == (3,)


def test_joint_positions_are_columns_in_the_order_of_the_joints(project, simulated):
    positions = project.motion.joint_positions
    assert positions.shape == (200, 2, 3)
    truth = simulated.truth
    for column, joint in enumerate(project.skeleton.joints):
        limbs = {labels_of_true_limb(project, truth, limb) for limb in (joint.parent, joint.child)}
        true_column = [set(edge) for edge in truth.edges.tolist()].index(limbs)
        np.testing.assert_allclose(positions[:, column], truth.joint_positions[:, true_column], atol=0.01)


def labels_of_true_limb(project, truth, limb):
    """The true limb on which the first marker of a found limb sits."""
    return int(truth.limb_of_marker[project.limbs.markers_of(limb)[0]])


@pytest.mark.parametrize("name", ["walk.xml", "walk.trc", "walk.c3d", "walk.csv", "walk.json", "walk.skelgen"])
def test_projects_are_written_by_suffix(project, tmp_path, name):
    written = skelgen.write(project, tmp_path / name)
    assert written == [tmp_path / name]
    assert written[0].stat().st_size > 100


def test_unlabelled_take_is_reconstructed_too():
    case = simulate("rods", n_frames=200, labelled=False)
    project = skelgen.reconstruct(case.take, n_markers=9, n_limbs=3, seed=1)
    assert isinstance(case.take, skelgen.PointCloud)
    assert project.trajectories.positions.shape == (200, 9, 3)
    assert project.motion.joint_positions.shape == (200, 2, 3)


def test_same_take_and_seed_give_the_same_bits(take, project):
    again = skelgen.reconstruct(take)
    np.testing.assert_array_equal(again.motion.world_from_limb, project.motion.world_from_limb)


def test_errors_share_one_root():
    from skelgen import errors

    kinds = [kind for kind in vars(errors).values() if inspect.isclass(kind) and kind.__module__ == errors.__name__]
    assert len(kinds) > 4
    assert all(issubclass(kind, skelgen.SkelgenError) for kind in kinds)


@pytest.mark.parametrize("broken", [np.full((50, 4, 3), np.nan), np.zeros((50, 1, 3)), np.zeros((2, 6, 3))])
def test_takes_that_hold_no_skeleton_are_refused(broken):
    names = tuple(map(str, range(broken.shape[1])))
    with pytest.raises(skelgen.SkelgenError):
        skelgen.reconstruct(skelgen.Trajectories(broken, names, 100.0))


def test_names_promised_are_there_and_no_others_are():
    assert set(skelgen.__all__) <= set(dir(skelgen))
    assert all(getattr(skelgen, name) is not None for name in skelgen.__all__)
    with pytest.raises(AttributeError, match="no attribute 'rubbish'"):
        skelgen.rubbish  # noqa: B018 - the access is the test


def test_importing_the_package_loads_nothing_heavy():
    heavy = "numba sklearn scipy matplotlib PySide6 ezc3d lxml"
    code = f"import sys, skelgen; print([name for name in {heavy.split()} if name in sys.modules])"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"
