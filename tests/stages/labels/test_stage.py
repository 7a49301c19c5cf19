"""The labels stage as a whole: unlabelled takes with known truth, and takes that cannot be labelled."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

import skelgen
from skelgen.errors import InputError, ParameterError, SkelgenError
from skelgen.model import PointCloud
from skelgen.progress import SilentMonitor
from skelgen.simulation import simulate
from skelgen.stages.labels import LabelParameters, check_labels, label_markers

DATA = Path(__file__).parents[3].parent / "shared" / "data"
DEFAULTS = LabelParameters()


class Notes(SilentMonitor):
    def __init__(self):
        self.sentences = []

    def notice(self, sentence):
        self.sentences.append(sentence)


def cloud_of(frames, times=None):
    starts = np.concatenate([[0], np.cumsum([len(frame) for frame in frames])]).astype(np.intp)
    points = np.concatenate([np.zeros((0, 3)), *(np.reshape(frame, (-1, 3)) for frame in frames)])
    return PointCloud(points, starts, np.arange(len(frames)) / 100.0 if times is None else times)


def agreement(trajectories, cloud, marker_of_point):
    """Share of all true points, and of all labelled points, that have the right identity under the best matching."""
    frames = np.repeat(np.arange(cloud.n_frames), cloud.points_per_frame)
    found = (trajectories.positions[frames] == cloud.points[:, np.newaxis]).all(axis=2)
    true = marker_of_point[:, np.newaxis] == np.arange(marker_of_point.max() + 1)
    table = found.T.astype(float) @ true.astype(float)
    right = table[linear_sum_assignment(-table)].sum()
    return right / true.sum(), right / found.sum()


@pytest.mark.parametrize("structure", ["rods", "classic-human", "quadruped"])
def test_takes_without_occlusion_are_labelled_exactly(structure):
    simulated = simulate(structure, labelled=False, n_frames=300, noise=0.5, seed=1)
    trajectories = label_markers(simulated.take, DEFAULTS)[0]
    assert agreement(trajectories, simulated.take, simulated.truth.marker_of_point) == (1.0, 1.0)
    assert trajectories.n_markers == len(simulated.truth.marker_names)
    assert trajectories.notices == ()


def test_points_that_a_model_computed_are_no_markers_unless_they_are_asked_for():
    take = simulate("rods", n_frames=50).take
    named = replace(take, names=(*take.names[:-1], "LHJC"))
    notes = Notes()
    assert check_labels(named, DEFAULTS, monitor=notes)[0].names == take.names[:-1]
    assert "computed and no markers: LHJC (`--set labels.computed_points=yes` takes them)" in notes.sentences[0]
    assert check_labels(named, LabelParameters(computed_points=True))[0].names == named.names


def test_all_points_of_a_file_stay_where_a_reader_is_asked_for_all(tmp_path):
    take = simulate("rods", n_frames=50).take
    names = (*take.names[:-1], "LHJC")
    skelgen.write(replace(take, names=names), tmp_path / "rods.trc")
    every, some = (skelgen.read(tmp_path / "rods.trc", points=wanted) for wanted in ("all", "auto"))
    assert check_labels(every, DEFAULTS)[0].names == names
    assert check_labels(some, DEFAULTS)[0].names == names[:-1]


@pytest.mark.parametrize("structure", ["rods", "classic-human", "human"])
def test_dropouts_cost_points_but_hardly_ever_identities(structure):
    simulated = simulate(structure, labelled=False, n_frames=800, noise=0.5, dropouts=0.05, seed=0)
    trajectories = label_markers(simulated.take, DEFAULTS)[0]
    labelled, right = agreement(trajectories, simulated.take, simulated.truth.marker_of_point)
    assert labelled > 0.95  # the ends of tracklets and the shortest ones are dropped on purpose
    assert right > 0.99
    assert trajectories.n_markers == len(simulated.truth.marker_names)


def test_ghosts_are_left_out_and_told():
    simulated = simulate("human", labelled=False, n_frames=500, dropouts=0.02, ghosts=1.0, seed=0)
    notes = Notes()
    trajectories = label_markers(simulated.take, DEFAULTS, monitor=notes)[0]
    _, right = agreement(trajectories, simulated.take, simulated.truth.marker_of_point)
    assert right > 0.99
    assert "belong to no marker" in notes.sentences[0]
    assert trajectories.notices == tuple(notes.sentences)


def test_a_real_arm_at_30_hz_is_labelled_exactly():
    path = DATA / "arm" / "arm-4-4-4_clean_30fps.c3d"
    if not path.exists():
        pytest.skip("the real recordings are not beside the project")
    ezc3d = pytest.importorskip("ezc3d")
    positions = ezc3d.c3d(str(path))["data"]["points"][:3].transpose(2, 1, 0).astype(float)
    random = np.random.default_rng(0)
    orders = [random.permutation(positions.shape[1]) for _ in positions]
    cloud = cloud_of([frame[order] for frame, order in zip(positions, orders, strict=True)])
    trajectories = label_markers(cloud, DEFAULTS)[0]
    assert agreement(trajectories, cloud, np.concatenate(orders)) == (1.0, 1.0)


def test_markers_are_numbered_in_the_order_of_the_first_frame():
    trajectories = label_markers(simulate("rods", labelled=False, n_frames=50, seed=0).take, DEFAULTS)[0]
    first = simulate("rods", labelled=False, n_frames=50, seed=0).take.frame(0)
    assert np.array_equal(trajectories.positions[0], first)
    assert trajectories.names[:3] == ("M000", "M001", "M002")


def test_the_given_number_of_markers_is_obeyed():
    simulated = simulate("rods", labelled=False, n_frames=200, seed=0)
    assert label_markers(simulated.take, DEFAULTS, n_markers=7)[0].n_markers == 7
    more = label_markers(simulated.take, DEFAULTS, n_markers=20)[0]
    assert "only 9" in more.notices[-1]


def test_same_seed_gives_the_same_bits():
    take = simulate("classic-human", labelled=False, n_frames=300, dropouts=0.05, seed=2).take
    parameters = LabelParameters(clustering="spectral", add_random=True, max_jitter=0.2)
    first, second = (label_markers(take, parameters, seed=4)[0].positions for _ in range(2))
    assert np.array_equal(first, second, equal_nan=True)


def test_test_jitter_stays_within_its_bound():
    take = simulate("rods", labelled=False, n_frames=50, seed=0).take
    clean = label_markers(take, DEFAULTS)[0].positions
    off = np.abs(label_markers(take, LabelParameters(add_random=True, max_jitter=0.2))[0].positions - clean)
    assert 0.15 < off.max() <= 0.2


def test_stuck_time_stamps_are_replaced_by_the_time_of_one_frame():
    take = simulate("rods", labelled=False, n_frames=50, seed=0).take
    stuck = PointCloud(take.points, take.frame_starts, np.zeros(50))
    trajectories = label_markers(stuck, LabelParameters(time_one_frame=4))[0]
    assert trajectories.rate == 250.0
    assert "do not rise" in trajectories.notices[0]


@pytest.mark.parametrize(
    ("frames", "sentence"),
    [
        ([], "holds no points"),
        ([np.empty((0, 3))] * 5, "holds no points"),
        ([np.empty((0, 3))] * 9 + [np.eye(3)], "no point can be followed"),
        ([np.full((4, 3), 1e200)] * 9, "check the unit"),
    ],
)
def test_takes_that_cannot_be_labelled_are_input_errors(frames, sentence):
    with pytest.raises(InputError, match=sentence):
        label_markers(cloud_of(frames), DEFAULTS)[0]


def test_fewer_than_one_marker_is_an_input_error():
    with pytest.raises(InputError, match="at least 1"):
        label_markers(cloud_of([np.eye(3)] * 9), DEFAULTS, n_markers=0)[0]


@pytest.mark.parametrize("n_frames", [1, 2, 3])
def test_still_takes_of_few_frames_are_labelled(n_frames):
    trajectories = label_markers(cloud_of([100.0 * np.eye(3)] * n_frames), DEFAULTS)[0]
    assert trajectories.positions.tolist() == [(100.0 * np.eye(3)).tolist()] * n_frames


def test_points_that_coincide_do_no_harm():
    assert label_markers(cloud_of([np.zeros((20, 3))] * 30), DEFAULTS)[0].n_markers == 20


@settings(max_examples=40, deadline=None)
@given(
    counts=st.lists(st.integers(0, 6), max_size=40),
    scale=st.sampled_from([0.0, 1e-6, 1.0, 1e6]),
    options=st.fixed_dictionaries(
        {
            "assignment": st.sampled_from(["greedy", "optimal"]),
            "prediction": st.sampled_from(["none", "constant_velocity", "double_exponential"]),
            "alignment": st.sampled_from(["whole", "local"]),
            "clustering": st.sampled_from(["spectral", "average", "complete"]),
            "min_range": st.integers(0, 3),
            "trim_range": st.integers(0, 2),
        }
    ),
    seed=st.integers(0, 5),
)
@example(  # whose skeleton has joints 10 km off, so that rounding leaves nothing of the errors of points
    counts=[6, 6, 3],
    scale=1e-6,
    options={
        "assignment": "greedy",
        "prediction": "none",
        "alignment": "whole",
        "clustering": "spectral",
        "min_range": 0,
        "trim_range": 0,
    },
    seed=2,
)
def test_any_cloud_is_labelled_or_refused(counts, scale, options, seed):
    random = np.random.default_rng(seed)
    cloud = cloud_of([scale * random.normal(size=(count, 3)) for count in counts])
    try:
        trajectories = label_markers(cloud, LabelParameters(**options))[0]
    except SkelgenError:
        return
    labelled = {tuple(point) for point in trajectories.positions[trajectories.seen]}
    assert labelled <= {tuple(point) for point in cloud.points}
    assert trajectories.n_frames == cloud.n_frames
    assert (trajectories.seen.sum(axis=1) <= cloud.points_per_frame).all()


def test_the_seeds_names_are_declared():
    names = {declaration.config_name for declaration in LabelParameters.declarations()} - {""}
    assert names == {"MINRANGE", "TRIMRANGE", "TIMEONEFRAME", "ADDRANDOMTC", "MAXJITTERTC", "SAMPLINGMSTC"}


def test_who_crosses_a_volume_that_is_empty_most_of_the_time_is_found_whole():
    simulated = simulate("human", labelled=False, n_frames=200, noise=0.5, dropouts=0.05, seed=0)
    take = simulated.take
    ghosts = [np.array([[0.0, 0.0, 4000.0 + frame % 7 * 300.0]]) for frame in range(250)]
    cloud = cloud_of([*ghosts, *(take.frame(frame) for frame in range(200)), *[np.zeros((0, 3))] * 250])
    trajectories = label_markers(cloud, DEFAULTS)[0]
    assert trajectories.n_markers == len(simulated.truth.marker_names)
    assert (trajectories.seen.sum(axis=1)[250:450] >= 0.99 * take.points_per_frame).all()


def test_an_unknown_choice_is_a_parameter_error():
    with pytest.raises(ParameterError, match="greedy, optimal"):
        LabelParameters(assignment="best")
