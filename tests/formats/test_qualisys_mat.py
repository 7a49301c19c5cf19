"""MAT files as Track Manager writes them, made with scipy: two trajectories of five frames in mm."""

from __future__ import annotations

import io

import numpy as np
import pytest
from scipy.io import savemat
from skelgen_formats.registry import read_take, recognise

from skelgen.model import PointCloud, Trajectories

DATA = np.random.default_rng(0).uniform(-2000, 2000, (2, 4, 5))  # markers; x, y, z, residual; frames
LABELS = np.array(["knee", "ankle"], dtype=object)


def content(compressed: bool = False, **changes: object) -> bytes:
    trajectories = {"Labeled": {"Count": 2, "Labels": LABELS, "Data": DATA, "Type": np.ones((2, 5), dtype=np.uint8)}}
    force = [{"ForcePlateName": "plate", "Force": np.zeros((3, 50))}]
    held = {"File": "walk.qtm", "StartFrame": 1, "Frames": 5, "FrameRate": 200.0, "Trajectories": trajectories}
    stream = io.BytesIO()
    savemat(stream, {"qtm_walk": held | {"Force": force} | changes}, do_compression=compressed)
    return stream.getvalue()


@pytest.mark.parametrize("compressed", [False, True])
def test_labelled_trajectories_are_read(put, compressed):
    path = put("walk.mat", content(compressed))
    take = read_take(path)
    assert recognise(path).name == "qualisys-mat"
    assert isinstance(take, Trajectories)
    assert (take.names, take.rate) == (("knee", "ankle"), 200.0)
    np.testing.assert_array_equal(take.positions, DATA[:, :3].transpose(2, 0, 1))


def test_nan_is_unseen_and_single_precision_is_understood(put):
    data = DATA.astype(np.float32)
    data[1, :, 2:] = np.nan
    take = read_take(put("gap.mat", content(Trajectories={"Labeled": {"Labels": LABELS, "Data": data}})))
    assert take.seen[:, 1].tolist() == [True, True, False, False, False]


def test_one_label_and_one_frame_are_understood(put):
    one = {"Labeled": {"Labels": np.array(["knee"], dtype=object), "Data": DATA[:1, :, 0]}}
    take = read_take(put("one.mat", content(Trajectories=one, Frames=1)))
    assert (take.names, take.n_frames) == (("knee",), 1)


def test_unidentified_trajectories_are_left_out_or_alone_a_cloud(put):
    both = {"Labeled": {"Labels": LABELS, "Data": DATA}, "Unidentified": {"Data": DATA + 1.0}}
    assert read_take(put("both.mat", content(Trajectories=both))).names == ("knee", "ankle")
    alone = {"Labeled": {"Labels": np.zeros((1, 0)), "Data": np.zeros((0, 0))}, "Unidentified": {"Data": DATA}}
    assert isinstance(read_take(put("alone.mat", content(Trajectories=alone))), PointCloud)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"FrameRate": 0.0}, "frame rate"),
        ({"Frames": 9}, "cut off"),
        ({"Trajectories": {"Labeled": {"Labels": LABELS, "Data": DATA[:, :2]}}}, "markers, 4, frames"),
        ({"Trajectories": {"Labeled": {"Labels": LABELS[:1], "Data": DATA}}}, "1 name for 2"),
        ({"Trajectories": 3}, "not of Qualisys"),
    ],
)
def test_what_is_wrong_is_told(refused, put, changes, sentence):
    assert sentence in refused(put("odd.mat", content(**changes)))


@pytest.mark.parametrize("size", [100, 130, 200, 900])
def test_file_that_is_cut_off_is_refused(refused, put, size):
    refused(put("cut.mat", content()[:size]))


def test_numbers_that_unpack_to_far_more_than_the_file_are_refused(refused, put):
    zeros = {"Labeled": {"Labels": LABELS, "Data": np.zeros((2, 4, 500_000))}}
    assert "far more numbers" in refused(put("bomb.mat", content(compressed=True, Trajectories=zeros)))


def test_file_of_version_7_3_says_what_to_type(refused, put):
    sentence = refused(put("walk.mat", b"MATLAB 7.3 MAT-file".ljust(512) + b"\x89HDF\r\n"))
    assert "load('walk.mat'), and save('walk_7.mat', '-v7')" in sentence


TURN = np.array([[0.28, -0.96, 0], [0.96, 0.28, 0], [0, 0, 1]])  # about z, of which (0, 0, 0.6, 0.8) is the quaternion
SKELETON = {
    "SkeletonName": "Ann",
    "Reference": "Global",
    "SegmentLabels": np.array(["Hips", "Spine"], dtype=object),
    "PositionData": np.broadcast_to(np.arange(6.0).reshape(3, 2, 1), (3, 2, 5)),
    "RotationData": np.broadcast_to(np.array([0, 0, 0.6, 0.8]).reshape(4, 1, 1), (4, 2, 5)),
}
RIGID = {
    "Bodies": 2,
    "Name": np.array(["Hips", "Spine"], dtype=object),
    "Positions": np.broadcast_to(np.arange(6.0).reshape(3, 2).T[..., np.newaxis], (2, 3, 5)),
    "Rotations": np.broadcast_to(TURN.T.reshape(1, 9, 1), (2, 9, 5)),
}


@pytest.mark.parametrize("held", [{"Skeletons": SKELETON}, {"RigidBodies": RIGID}])
def test_bodies_are_read_where_there_are_no_trajectories(put, held):
    take = read_take(put("bodies.mat", content(Trajectories=[], **held)))
    assert (take.names, take.rate) == (("Hips", "Spine"), 200.0)
    np.testing.assert_allclose(take.world_from_body[3, 1, :3], np.column_stack([TURN, [1, 3, 5]]), atol=1e-12)


@pytest.mark.parametrize(
    ("held", "sentence"),
    [
        ({"Skeletons": SKELETON | {"Reference": "Local"}}, "with the reference Global"),
        ({"RigidBodies": RIGID | {"Positions": np.zeros((3, 3))}}, "export the 3D data"),
    ],
)
def test_bodies_that_cannot_be_read_say_what_to_export(refused, put, held, sentence):
    assert sentence in refused(put("bodies.mat", content(Trajectories=[], **held)))


def test_bodies_beside_trajectories_are_told(put):
    take = read_take(put("both.mat", content(RigidBodies=RIGID, Skeletons=SKELETON)))
    assert take.names == ("knee", "ankle")
    left = [f"{kind} are left out: Hips, Spine; export them alone" for kind in ("RigidBodies", "Skeletons")]
    assert take.notices == tuple(left)
