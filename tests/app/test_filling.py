"""Filled markers as files: complete, and told apart by the table beside them."""

from __future__ import annotations

import csv

import numpy as np
import pytest

import skelgen
from skelgen.app.export import write_filled
from skelgen.app.face import fill
from skelgen.app.project_file.archive import save_project
from skelgen.app.report import report_html
from skelgen.cli import main
from skelgen.errors import MissingResultError, WriteError
from skelgen.model import Project
from skelgen.model.filled import PositionSource
from skelgen.simulation import simulate

FILE_DIGITS = 1e-3  # mm; C3D keeps 7 digits of some metres


@pytest.fixture(scope="module")
def project():
    """Three rods, 5 % of their positions lost, through all stages."""
    return skelgen.reconstruct(simulate("rods", n_frames=200, noise=0.2, dropouts=0.05).take)


def test_filled_markers_are_written_complete(project, tmp_path):
    filled = fill(project)
    write_filled(filled, tmp_path / "filled.c3d")
    written = skelgen.read(tmp_path / "filled.c3d")
    assert written.seen.all()
    assert written.positions == pytest.approx(filled.positions, abs=FILE_DIGITS)


def test_convert_fills_a_project_only_if_told_so(project, tmp_path, capsys):
    source, target = tmp_path / "take.skelgen", tmp_path / "out.c3d"
    skelgen.write(project, source)
    assert main(["convert", str(source), str(target)]) == 0
    assert np.array_equal(skelgen.read(target).seen, project.trajectories.seen)
    assert main(["convert", str(source), str(target), "--filled"]) == 0
    assert skelgen.read(target).seen.all()
    assert "filled positions have residual 0" in " ".join("".join(capsys.readouterr()).split())


def test_table_has_a_row_for_every_filled_position(project, tmp_path):
    filled = fill(project)
    (_, table), marking = write_filled(filled, tmp_path / "filled.trc")
    assert "cannot mark filled positions; filled.filled.csv" in marking
    with table.open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    names = project.trajectories.names
    assert {(int(row["frame"]), names.index(row["marker"])) for row in rows} == {
        (frame, marker) for frame, marker in np.argwhere(~project.trajectories.seen).tolist()
    }
    assert {row["source"] for row in rows} <= {source.word for source in PositionSource}


def test_a_suffix_without_markers_writes_nothing(project, tmp_path):
    with pytest.raises(WriteError, match="joints-csv holds the joints"):
        write_filled(fill(project), tmp_path / "filled.csv")
    assert list(tmp_path.iterdir()) == []


def test_project_without_skeleton_is_told_what_to_run(project):
    with pytest.raises(MissingResultError, match="run the stage 'skeleton' first"):
        fill(Project(project.take).with_trajectories(project.trajectories, None))


def test_command_fills_a_project(project, tmp_path, capsys):
    skelgen.write(project, tmp_path / "take.skelgen")
    assert main(["fill", str(tmp_path / "take.skelgen"), "-o", str(tmp_path / "filled.csm")]) == 0
    assert skelgen.read(tmp_path / "filled.csm").seen.all()
    assert (tmp_path / "filled.filled.csv").exists()
    assert "positions are filled, not measured" in "".join(capsys.readouterr())
    named = write_filled(fill(project), tmp_path / "take.filled.c3d")[0]
    assert [file.name for file in named] == ["take.filled.c3d", "take.filled.csv"]


def test_a_gap_is_filled_as_the_command_states(project, tmp_path, capsys):
    marker = int(np.flatnonzero(~project.trajectories.seen.all(axis=0))[0])
    name, first = project.trajectories.names[marker], int(np.flatnonzero(~project.trajectories.seen[:, marker])[0])
    save_project(project, tmp_path / "take.skelgen")
    source, stated = str(tmp_path / "take.skelgen"), str(tmp_path / "stated.skelgen")
    assert main(["correct", source, "fill", name, "--value", "spline", "--frames", f"{first}-", "-o", stated]) == 0
    assert "gaps of" in "".join(capsys.readouterr())
    filled = fill(skelgen.load(stated))
    assert filled.source[first, marker] == PositionSource.INTERPOLATED
    assert main(["correct", source, "fill", name, "--value", "magic", "-o", stated]) != 0
    assert main(["correct", source, "rename", name, "--value", "x"]) != 0


def test_report_says_from_what_gaps_can_be_filled(project):
    html = report_html(project)
    assert "Filled with joint" in html
    assert "<code>skelgen fill</code>" in html


def test_report_of_a_take_without_gaps_speaks_of_no_filling():
    complete = skelgen.reconstruct(simulate("rods", n_frames=100).take)
    assert "skelgen fill" not in report_html(complete)
    assert fill(complete).sentence == "no marker has a gap: nothing is filled"
