"""`skelgen benchmark`: what it measures is right on cases whose answer is known, and its page says so."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from functools import partial
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from markupsafe import Markup

import skelgen
from skelgen.app.face import reconstruct
from skelgen.benchmark import SUITES, Section, measure_page, run_benchmark, write_benchmark_page
from skelgen.benchmark.accuracy import measure_exports, measure_joints, reconstructed, rotation_centre, score_error
from skelgen.benchmark.judges import JUDGES
from skelgen.benchmark.page import MISSED, QUICK, REACHED, Effort, Figure, Series, draw, machine_line, table
from skelgen.benchmark.people import worn_and_moved
from skelgen.benchmark.speed import (
    Run,
    fifty_markers,
    in_own_process,
    long_take,
    measure_runs,
    measure_speed,
    peak_gigabytes,
    time_stages,
)
from skelgen.benchmark.suites import SECONDS, load_state, save_state
from skelgen.cli import main
from skelgen.errors import InputError, SkelgenError, WriteError
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.marker_sets import MARKER_SETS
from skelgen.progress import SILENT
from skelgen.simulation import SimulationParameters, simulate
from skelgen.simulation.people import MOTIONS


def test_help_names_every_suite(capsys):
    assert main(["benchmark", "--help"]) == 0
    shown = capsys.readouterr().out
    assert [name for name in SUITES if name not in shown] == []


SMALL = Effort(
    structures=("rods",),
    seeds=(0,),
    n_frames=200,
    n_label_frames=200,
    n_trials=20,
    distances=(1000.0,),
    frames=(200,),
    cloud_frames=(200,),
    limbs=(3,),
    n_people=1,
    n_animals=1,
)


def rods():
    return simulate("rods", n_frames=100).take


def held_by(megabytes):
    block = np.ones(megabytes * 125_000)
    return peak_gigabytes() + 0.0 * block[0]


def ended_without_answer():
    raise SystemExit(3)


def test_score_finds_the_centre_about_which_two_bodies_turn():
    random = np.random.default_rng(0)
    first, second = (np.tile(np.eye(4), (50, 1, 1)) for _ in range(2))
    first[:, :3, :3], second[:, :3, :3] = (matrix_from_vector(random.normal(size=(50, 3))) for _ in range(2))
    first[:, :3, 3] = random.normal(size=(50, 3))
    centre = first[:, :3, :3] @ [1.0, 2.0, 3.0] + first[:, :3, 3]
    second[:, :3, 3] = centre - second[:, :3, :3] @ [4.0, 5.0, 6.0]
    np.testing.assert_allclose(rotation_centre(first, second), centre, atol=1e-9)  # rounding


def test_score_is_exact_without_noise_and_never_below_our_error_by_much_with_it():
    assert score_error(simulate("rods", n_frames=200)) < 1e-6  # mm, rounding
    peer = score_error(simulate("human", n_frames=300, noise=0.5))
    ours = reconstructed("human", 0, SimulationParameters(n_frames=300, noise=0.5)).mean_joint_error
    assert ours < 1.05 * peer


def test_fifty_markers_are_fifty_on_all_limbs_of_a_human():
    limbs = fifty_markers().limbs
    assert (sum(len(limb.markers) for limb in limbs), len(limbs)) == (50, 15)


def test_long_take_has_any_length_and_fresh_noise():
    take = long_take(13_000)
    assert take.positions.shape == (13_000, 40, 3)
    there, back = take.positions[5990], take.positions[2 * 6000 - 2 - 5990]
    assert 0 < np.nanmax(np.abs(there - back)) < 5  # mm: the same frame of the short take, noise of 0.2 mm twice


def test_runs_are_measured_in_a_process_of_their_own_whose_memory_is_its_own():
    [run] = measure_runs(rods)
    assert min(run.limbs, run.joints, run.skeleton) > 0
    assert run.labels < 0.1  # s: names are there
    ballast = np.ones(40_000_000)  # 0.32 GB here, which the other process does not hold
    assert in_own_process(held_by, 100) + 0.15 < peak_gigabytes() + 0.0 * ballast[0]


def test_stages_are_timed_in_this_process_too():
    assert time_stages(rods(), "conjugate-gradient").joints > 0


def test_labels_are_timed_where_there_are_no_names():
    run = time_stages(simulate("rods", n_frames=100, labelled=False).take)
    assert run.labels > 0
    assert run.seconds == pytest.approx(run.labels + run.limbs + run.joints + run.skeleton)
    assert time_stages(rods()).labels < run.labels


def test_process_that_ends_without_an_answer_is_an_error():
    with pytest.raises(SkelgenError, match="exit code 3"):
        in_own_process(ended_without_answer)


@pytest.mark.parametrize("judge", JUDGES, ids=lambda judge: judge.suffix)
def test_judges_see_a_motion_that_is_not_ours(judge, tmp_path):
    pytest.importorskip(judge.name, reason=f"{judge.name} is not installed")
    project = reconstruct(simulate("rods", n_frames=30).take)
    files = judge.write(project, tmp_path)
    other = reconstruct(simulate("rods", n_frames=30, seed=1).take)
    assert judge.deviation(files, project) <= judge.tolerance
    assert judge.deviation(files, other) > 1.0


def test_exports_without_their_judge_are_not_judged(monkeypatch):
    for judge in JUDGES:
        monkeypatch.setitem(sys.modules, judge.name, None)  # as if it were not installed
    [judged] = measure_exports(QUICK, SILENT).tables
    assert all("not installed" in row[1] and row[-1] == "" for row in judged.rows)


def test_joints_are_laid_beside_the_bound_and_score():
    section = measure_joints(SMALL, SILENT)
    [row] = section.tables[0].rows
    assert row[:3] == ("rods", "1 of 1", "1 of 1")
    ours, bound = float(row[3]), float(row[4])
    assert 0.8 * bound < ours < 1.2 * bound
    assert "SCoRE" in section.figures[0].drawing


def measured_at_once():
    """The suite of time and memory with figures that need no measuring."""
    return measure_speed(SMALL, SILENT, lambda *given: [Run(1.0, 2.0, 3.0, 0.4, 5.0)])


@pytest.mark.parametrize("name", ["stereo", "speed"])
def test_rows_have_a_text_for_every_column(name):
    if name == "stereo":
        pytest.importorskip("cv2", reason="OpenCV is not installed: pip install 'skelgen-mocap[capture]'")
    section = measured_at_once() if name == "speed" else SUITES[name](SMALL, SILENT)
    for measured in section.tables:
        assert {len(row) for row in measured.rows} == {len(measured.columns)}
        assert len(set(measured.columns)) == len(measured.columns)
    assert section.figures


def test_people_and_animals_are_counted_and_compared_with_score():
    section = SUITES["people"](SMALL, SILENT)
    people = [("walk", "1"), ("all people", "1"), ("animals", "1"), ("every 3rd person, names hidden", "1")]
    assert [row[:2] for row in section.tables[0].rows] == people
    assert [row[0] for row in section.tables[1].rows] == ["plug-in-gait"]
    assert {len(row) for one in section.tables for row in one.rows} == {len(one.columns) for one in section.tables}
    assert all(float(row[5]) > 0 and float(row[6]) > 0 for row in section.tables[0].rows)


def test_fifty_people_wear_all_sets_in_all_motions():
    worn = {worn_and_moved(index) for index in range(len(MOTIONS) * len(MARKER_SETS))}
    assert worn == set(product(MOTIONS, MARKER_SETS))


def test_suite_that_does_not_exist_is_refused_before_anything_runs():
    with pytest.raises(InputError, match="there is no suite 'speeed'; suites are labels, exact"):
        run_benchmark(["speeed"])


def test_page_of_an_earlier_benchmark_stays_where_a_suite_does_not_exist(tmp_path):
    (tmp_path / "b.html").write_text("measured")
    with pytest.raises(InputError, match="no suite"):
        measure_page(tmp_path / "b.html", ["speeed"])
    assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [("b.html", "measured")]


@pytest.fixture
def begun():
    """Notes which suites run."""
    return []


@pytest.fixture
def noting(begun):
    """Suites that only note that they run, and report half of their way."""

    def suite(effort, monitor, name):
        begun.append((name, effort))
        monitor.advance(1, 2)
        return Section(name, name, "", ())

    return {name: partial(suite, name=name) for name in SUITES}


def test_suites_run_by_name_in_the_order_of_the_page(begun, noting):
    run_benchmark(["speed", "labels"], quick=True, suites=noting)
    assert begun == [("labels", QUICK), ("speed", QUICK)]


def test_suites_that_are_known_are_not_measured_again(begun, noting):
    arrived = []
    known = [Section("labels", "", "", ())]
    names = ["labels", "exact", "speed"]
    sections = run_benchmark(
        names, known=known, arrived=lambda done: arrived.append([one.name for one in done]), suites=noting
    )
    assert [name for name, _ in begun] == ["exact", "speed"]
    assert [section.name for section in sections] == ["labels", "exact", "speed"]
    assert arrived == [["labels", "exact"], ["labels", "exact", "speed"]]


def test_progress_is_that_of_the_whole_by_what_suites_take(noting):
    told = []
    monitor = SimpleNamespace(begin=lambda name: None, advance=lambda *given: told.append(given))
    run_benchmark(["exact", "joints"], monitor=monitor, suites=noting)
    whole = SECONDS["exact"] + SECONDS["joints"]
    wanted = [SECONDS["exact"] / 2 / whole, (SECONDS["exact"] + SECONDS["joints"] / 2) / whole]
    assert told == [(pytest.approx(100 * part, abs=0.5), 100) for part in wanted]


def test_suite_that_cannot_be_measured_says_why_and_stops_nothing(noting):
    def broken(effort, monitor):
        raise SkelgenError("memory is short")

    notices = []
    monitor = SimpleNamespace(begin=lambda name: None, advance=lambda *given: None, notice=notices.append)
    first, second = run_benchmark(["exact", "joints"], monitor=monitor, suites=noting | {"exact": broken})
    assert first.text == "Not measured: memory is short."
    assert second.name == "joints"
    assert notices == ["exact: memory is short"]


@pytest.fixture
def sections():
    rows = [("a<b", "1", REACHED), ("c", "2", MISSED), ("d", "3", "")]
    figure = Figure("Time.", draw("t", "frames", "s", [Series("all", [1, 2, 3], [1.0, 2.0, 4.0])]))
    return [Section("speed", "Speed", "How fast.", (table("Times", ("case", "s"), rows),), (figure,))]


def test_page_counts_what_is_reached_and_escapes_what_it_shows(sections, tmp_path):
    text = write_benchmark_page(sections, tmp_path / "b.html", measured="now", command="skelgen").read_text()
    assert "1 of 2 wanted figures reached" in text
    assert "a&lt;b" in text
    assert text.count('class="missed"') == 1
    assert "<svg" in text
    assert machine_line().partition(",")[0] in text
    assert "http" not in text.replace("http://www.w3.org/2000/svg", "")


def test_what_is_measured_is_kept_beside_the_page(sections, tmp_path):
    page = tmp_path / "b.html"
    save_state(sections, page, quick=True, seconds=12.5)
    assert load_state(page, quick=True) == (sections, 12.5)
    assert load_state(page, quick=False) == ([], 0.0)  # another effort
    state = (tmp_path / "b.json").read_text().replace(f'"version": "{skelgen.__version__}"', '"version": "0.0"')
    (tmp_path / "b.json").write_text(state)
    assert load_state(page, quick=True) == ([], 0.0)  # another version


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"sections": 3}'])
def test_what_is_damaged_is_measured_anew(tmp_path, text):
    (tmp_path / "b.json").write_text(text)
    assert load_state(tmp_path / "b.html", quick=False) == ([], 0.0)


def test_page_that_cannot_be_written_is_an_error(sections, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(WriteError, match="cannot be written"):
        write_benchmark_page(sections, tmp_path / "file" / "b.html")


def test_drawing_joins_points_and_names_series():
    drawing = draw("t", "x", "y", [Series("line", [0, 1], [0, 1], has_points=False), Series("dots", [1], [2], False)])
    assert isinstance(drawing, Markup)
    assert drawing.count("<path") == 1
    assert "line" in drawing
    assert drawing.count("<circle") == 2  # one point, and its sign in the legend


@pytest.fixture
def run(capsys):
    """Exit code, stdout and stderr of a command."""

    def call(*words):
        code = main(words)
        return code, *capsys.readouterr()

    return call


def test_command_writes_the_page_and_prints_json(run, tmp_path):
    code, output, _ = run("benchmark", "--quick", "--json", "--suite", "exports", "-o", str(tmp_path / "b.html"))
    told = json.loads(output)
    assert code == 0
    assert told["sections"]["exports"][0]["rows"][0][-1] == REACHED
    assert "skelgen benchmark --quick --suite exports" in (tmp_path / "b.html").read_text()


def refused(effort, monitor):
    pytest.fail("it measured")


def test_interrupted_benchmark_leaves_a_page_of_what_is_done_and_goes_on(tmp_path, sections, begun, noting):
    def interrupted(effort, monitor):
        raise KeyboardInterrupt

    page = tmp_path / "b.html"
    done = {"labels": lambda effort, monitor: replace(sections[0], name="labels")}
    with pytest.raises(KeyboardInterrupt):
        measure_page(page, suites=noting | done | {"joints": interrupted})
    text = page.read_text()
    assert "1 of 2 wanted figures reached" in text
    assert "joints, tissue, people, stereo, exports, speed not measured yet" in text
    assert "skelgen benchmark --resume" in text
    measure_page(page, resume=True, suites=noting | {"labels": refused})
    assert "not measured yet" not in page.read_text()
    assert [name for name, _ in begun] == ["exact", "joints", "tissue", "people", "stereo", "exports", "speed"]


def test_page_that_cannot_be_written_is_refused_before_anything_is_measured(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(WriteError, match="cannot be written"):
        measure_page(tmp_path / "file" / "b.html", ["labels"], suites={"labels": refused})


def test_time_and_memory_are_drawn_against_frames_and_markers():
    section = measured_at_once()
    named, cloud, trees = section.tables
    assert (named.columns[0], cloud.columns[:2], trees.columns[0]) == ("frames", ("frames", "labels [s]"), "markers")
    assert cloud.rows[0] == ("200", "5.00", "1.00", "2.00", "3.00", "11.00", "0.40", "")
    drawn = [figure.drawing for figure in section.figures]
    assert ["memory" in figure.caption for figure in section.figures] == [False, True] * 3
    assert sum("Memory against markers" in one for one in drawn) == 1
