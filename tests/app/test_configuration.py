"""Parameters from mappings, assignments and config.xml."""

from __future__ import annotations

import numpy as np
import pytest

import skelgen
from skelgen.app.configuration import (
    FileParameters,
    Settings,
    all_parameter_classes,
    parameter_rows,
    settings_with,
    write_defaults,
)
from skelgen.app.pipeline import run_stages
from skelgen.errors import ParameterError
from skelgen.simulation import simulate
from skelgen.stages.classic.spectral import affinities
from skelgen.stages.joints import JointParameters
from skelgen.stages.limbs import LimbParameters


def test_unmentioned_stages_have_their_defaults():
    assert Settings().joints.alpha == JointParameters().alpha


def test_mapping_changes_one_value():
    assert Settings({"joints": {"alpha": 0.3}}).of("joints").alpha == 0.3


def test_parameters_object_is_taken_as_it_is():
    mine = JointParameters(alpha=0.7)
    assert Settings({"joints": mine}).of("joints") is mine


def test_parameters_of_another_stage_are_refused():
    with pytest.raises(ParameterError, match="takes JointParameters"):
        Settings({"joints": LimbParameters()})


def test_assignments_apply_in_order():
    settings = settings_with(Settings(), ["joints.alpha=0.3", "limbs.method=spectral", "joints.alpha=0.4"])
    assert (settings.of("joints").alpha, settings.of("limbs").method) == (0.4, "spectral")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("alpha=0.3", "stage.name=value"),
        ("joints.alpha", "stage.name=value"),
        ("legs.alpha=1", "no stage 'legs'; stages are labels, limbs, joints, skeleton, files"),
        ("joints.beta=1", "no parameter 'beta'; it has .*alpha"),
        ("joints.alpha=-2", "must lie in 0 .. "),
        ("joints.alpha=big", "it must be a number"),
    ],
)
def test_wrong_assignment_says_what_is_possible(text, sentence):
    with pytest.raises(ParameterError, match=sentence):
        settings_with(Settings(), [text])


def test_file_names_of_table_4_13_are_declared():
    assert [entry.config_name for entry in FileParameters.declarations()] == [
        "tempCorFileName",
        "specCluFileName",
        "jointFinderFileName",
        "skelFitFileName",
        "saveFileName",
    ]


def test_defaults_are_written_and_read_back(tmp_path):
    pytest.importorskip("skelgen_formats.config_xml")
    write_defaults(tmp_path / "config.xml")
    settings = Settings(tmp_path / "config.xml")
    assert settings.joints == JointParameters()
    assert settings.of("files") == FileParameters()


def test_rows_cover_every_parameter():
    rows = parameter_rows(Settings({"limbs": {"method": "spectral"}}))
    declared = [(cls.stage, entry.name) for cls in all_parameter_classes() for entry in cls.declarations()]
    assert [(row["stage"], row["name"]) for row in rows] == declared
    assert [row["value"] for row in rows if (row["stage"], row["name"]) == ("limbs", "method")] == ["spectral"]


@pytest.fixture
def config(tmp_path):
    """Write elements into a config.xml and return its path."""

    def write(elements):
        path = tmp_path / "config.xml"
        path.write_text(f"<Parameters>{elements}</Parameters>", encoding="utf-8")
        return path

    return write


M = '<SpectralClustering><M value="5" type="int"/></SpectralClustering>'
OWN = '<SkeletonFitter><OUTLIER value="2" type="double"/></SkeletonFitter>'


def test_file_of_the_thesis_chooses_its_methods_for_the_stages_that_it_sets(config):
    settings = Settings(config(M))
    assert (settings.limbs.method, settings.limbs.neighbour) == ("spectral", 5)
    assert settings.joints.solver == JointParameters().solver
    assert ["--methods default keeps the usual one" in one for one in settings.notices("limbs", {})] == [True]


@pytest.mark.parametrize(("elements", "methods"), [(M, "default"), (M + OWN, None)])
def test_usual_methods_stay_where_they_are_asked_for_or_the_file_has_names_of_our_own(config, elements, methods):
    settings = Settings(config(elements), methods)
    assert settings.limbs.method == "rigidity"
    assert "neighbour = 5 has no effect: it acts with method=spectral" in settings.notices("limbs", {"n_limbs": ""})[0]


def test_what_is_stated_stays_beside_classic_methods():
    stated = {"limbs": {"method": "greedy"}}
    assert Settings(stated, "classic").limbs.method == "greedy"
    assert Settings(stated, "classic").joints.solver == Settings(None, "classic").joints.solver


def test_a_script_chooses_the_methods_of_the_thesis_with_one_word():
    take = skelgen.simulate("rods", n_frames=60).take
    classic = Settings(None, "classic")
    values = {stage: classic.of(stage) for stage in ("labels", "limbs", "joints", "skeleton")}
    by_word, by_name = (
        skelgen.reconstruct(take, n_markers=9, n_limbs=3, **how)
        for how in ({"methods": "classic"}, {"parameters": values})
    )
    np.testing.assert_array_equal(by_word.motion.joint_positions, by_name.motion.joint_positions)
    usual = skelgen.reconstruct(take, n_markers=9, n_limbs=3)
    assert not np.array_equal(usual.motion.joint_positions, by_word.motion.joint_positions)
    with pytest.raises(skelgen.ParameterError, match="methods are 'best'; they must be"):
        skelgen.reconstruct(take, methods="best")


def test_classic_methods_need_no_file():
    settings = Settings(None, "classic")
    chosen = (settings.labels.method, settings.limbs.method, settings.joints.solver, settings.skeleton.fit)
    assert chosen == ("sets", "spectral", "conjugate-gradient", "root-outward")
    with pytest.raises(ParameterError, match="must be default or classic"):
        Settings(None, "best")


@pytest.mark.parametrize("name", ["POLYEPS", "SOLVEPS", "TINYEPS", "PI"])
def test_numbers_that_no_method_needs_are_told_as_without_effect(config, name):
    element = f'<JointFinder><{name} value="1e-9" type="double"/></JointFinder>'
    settings = Settings(config(element), "default")
    assert settings.skeleton == Settings().skeleton
    assert settings.notices("skeleton", {}) == [f"{name} has no effect: the methods used here need no such number"]


def test_sampling_of_zero_takes_all_frames(config):
    from skelgen.stages.joints.segments import sample_frames
    from skelgen.stages.limbs.distances import sample_frames as sample_distances

    zero = '<SAMPLING value="0" type="int"/>'
    text = f"<TemporalCorrespondence>{zero}</TemporalCorrespondence><JointFinder><JC>{zero}</JC></JointFinder>"
    settings = Settings(config(text))
    assert len(sample_frames(5000, settings.joints)) == len(sample_distances(5000, settings.limbs, 0)) == 5000
    assert len(sample_frames(5000, JointParameters())) == 300


def test_parameters_without_an_effect_are_told_in_the_report():
    take = simulate("rods", n_frames=60, noise=0.1).take
    parameters = {"labels": {"min_range": 9}, "skeleton": {"fit": "root-outward", "robust": 9.0}}
    project = skelgen.reconstruct(take, parameters=parameters)
    assert "min_range = 9 has no effect: it acts with take=unlabelled" in project.reports["labels"].notices
    assert "robust = 9.0 has no effect: it acts with fit=whole-chain" in project.reports["skeleton"].notices


def test_defaults_tell_nothing_of_parameters():
    project = skelgen.reconstruct(simulate("rods", n_frames=60, noise=0.1).take)
    assert not [one for report in project.reports.values() for one in report.notices if "has no effect" in one]


def test_frames_per_second_are_the_rate_of_the_motion(config):
    element = '<SkeletonFitter><FRAMES_PER_SEC value="25" type="double"/></SkeletonFitter>'
    project = skelgen.reconstruct(simulate("rods", n_frames=60, noise=0.1).take, parameters=config(element))
    assert project.motion.rate == 25.0


def test_jitter_is_added_to_labelled_takes():
    take = simulate("rods", n_frames=60).take
    jittered = skelgen.reconstruct(
        take, until="labels", parameters={"labels": {"add_random": True, "max_jitter": 2.0, "repair": False}}
    )
    moved = np.abs(jittered.trajectories.positions - take.positions)
    assert 1.8 < np.nanmax(moved) <= 2.0


@pytest.mark.parametrize("labelled", [True, False])
def test_frames_with_too_few_markers_are_cleaned(labelled):
    take = simulate("rods", n_frames=80, dropouts=0.3, labelled=labelled).take
    project = skelgen.reconstruct(take, until="labels", parameters={"labels": {"least_seen": 0.8}})
    shown = project.trajectories.seen.mean(axis=1)
    assert ((shown == 0) | (shown >= 0.8)).all()
    assert 0 < (shown == 0).sum() < 80
    assert [one for one in project.reports["labels"].notices if "of the markers: cleaned" in one]


def test_labels_of_a_jittered_take_are_judged_by_their_points():
    simulated = simulate("rods", n_frames=120, dropouts=0.05, labelled=False)
    parameters = {"labels": {"add_random": True, "max_jitter": 3.0}}
    project = skelgen.reconstruct(simulated.take, until="labels", parameters=parameters)
    assert skelgen.evaluate(project, simulated.truth).labels.idf1 > 0.95


LABELS = {"min_range": 150, "trim_range": 9, "add_random": True}
LIMBS = {"local_scaling": False, "neighbour": 1, "sigma_squared": 4.0}
JOINTS = {
    **{"method": "fletcher-reeves", "tolerance": 1e-2, "absolute_tolerance": 1.0, "max_iterations": 2},
    **{"step_limit": 1.1, "line_iterations": 1, "line_tolerance": 0.5, "anneal": True, "max_jitter": 9.0},
    **{"alpha": 5.0, "alpha_final": 5.0, "sampling": 7, "max_residual": 0.0, "max_fallback": 0},
}
SKELETON = {"rotation": "umeyama", "joints_for_poses": True}
NEEDED = {
    "max_jitter": {"anneal": True},
    "max_fallback": {"max_residual": 0.0},
    "sigma_squared": {"local_scaling": False},
}
"""What must be chosen beside a parameter for it to act."""


@pytest.fixture(scope="module")
def classic():
    """A noisy unlabelled take of three rods with gaps, its settings the thesis' and its project finished."""
    take = simulate("rods", n_frames=240, noise=0.3, dropouts=0.05, labelled=False).take
    settings = Settings(None, "classic")
    return run_stages(skelgen.Project(take), settings=settings), settings


def outcome(classic, stage, values):
    """Numbers that a stage gives, from the same results before it."""
    project, settings = classic
    again = run_stages(project, stage, stage, settings=settings.changed(stage, values))
    if stage == "labels":
        return again.trajectories.positions
    if stage == "joints":
        return np.append(again.topology.raw_joint_positions, again.topology.joint_costs)
    return again.motion.marker_positions


@pytest.mark.parametrize(
    ("stage", "name"),
    [
        (stage, name)
        for stage, names in (("labels", LABELS), ("joints", JOINTS), ("skeleton", SKELETON))
        for name in names
    ],
)
def test_parameters_of_the_thesis_act_with_its_methods(classic, stage, name):
    value = {"labels": LABELS, "joints": JOINTS, "skeleton": SKELETON}[stage][name]
    needed = NEEDED.get(name, {})
    one, other = (outcome(classic, stage, values) for values in (needed, {**needed, name: value}))
    assert not np.array_equal(one, other, equal_nan=True)


@pytest.mark.parametrize("name", LIMBS)
def test_scales_of_the_spectral_clustering_act(name):
    needed = LimbParameters(method="spectral", **NEEDED.get(name, {}))
    deviation = np.abs(np.subtract.outer(np.arange(8.0), np.arange(8.0) ** 1.5)) + 0.1
    one, other = (affinities(deviation, how.spectral)[0] for how in (needed, needed.replace(**{name: LIMBS[name]})))
    assert not np.array_equal(one, other)


def test_names_of_the_thesis_are_all_tried():
    tried = {"labels": LABELS, "limbs": LIMBS, "joints": JOINTS, "skeleton": SKELETON}
    elsewhere = {"max_jitter", "time_one_frame", "sampling", "kmeans", "frames_per_second"}  # tests of their own
    for stage, names in tried.items():
        declared = {entry.name for entry in Settings().of(stage).declarations() if entry.config_name}
        assert declared <= {*names, *elsewhere}
