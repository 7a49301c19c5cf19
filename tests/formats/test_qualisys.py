from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import read_take

from skelgen.model import Trajectories

FIRST = [[1.5, 2.5, 3.5], [4.5, 5.5, 6.5]]


def test_export_reads_with_its_gap(put, qualisys_text):
    take = read_take(put("hip.tsv", qualisys_text))
    assert isinstance(take, Trajectories)
    assert (take.names, take.rate) == (("hip", "knee"), 100.0)
    np.testing.assert_array_equal(take.positions[0], FIRST)
    assert take.seen[:, 1].tolist() == [True, True, False]


@pytest.mark.parametrize("gap", ["\t\t\t", "\tNULL\tNULL\tNULL", "\tNaN\tNaN\tNaN"])
def test_other_ways_to_write_a_gap(edited, qualisys_text, gap):
    take = read_take(edited("gap.tsv", qualisys_text, "\t0.000\t0.000\t0.000", gap))
    assert take.seen[:, 1].tolist() == [True, True, False]


def test_decimal_commas_are_understood(put, qualisys_text):
    head, data = qualisys_text.split("knee Z")
    take = read_take(put("comma.tsv", head + "knee Z" + data.replace(".", ",")))
    np.testing.assert_array_equal(take.positions[0], FIRST)


@pytest.mark.parametrize("n_leading", [0, 1, 2])
def test_older_files_without_titles_and_with_fewer_columns_read(put, qualisys_text, n_leading):
    lines = [line for line in qualisys_text.split("\r\n") if not line.startswith("Frame")]
    data = ["\t".join(line.split("\t")[2 - n_leading :]) if line[:1].isdigit() else line for line in lines]
    take = read_take(put("old.tsv", "\n".join(data)))
    np.testing.assert_array_equal(take.positions[0], FIRST)


def test_6dof_export_is_refused_with_advice(refused, edited, qualisys_text):
    assert "export the 3D data" in refused(edited("6d.tsv", qualisys_text, "INCLUDED\t3D", "INCLUDED\t6D"))


@pytest.mark.parametrize("key", ["MARKER_NAMES", "FREQUENCY"])
def test_missing_header_line_is_named(refused, edited, qualisys_text, key):
    assert key in refused(edited("no.tsv", qualisys_text, key, "NOTHING"))


def test_duplicate_label_is_named(refused, edited, qualisys_text):
    assert "'hip'" in refused(edited("two.tsv", qualisys_text, "\tknee\r\n", "\thip\r\n"))


def test_missing_frames_are_an_error(refused, put, qualisys_text):
    cut = qualisys_text[: qualisys_text.index("3\t0.02")]
    assert ":1: 3 frames are announced and 2" in refused(put("cut.tsv", cut))


def test_latin1_names_read(put, qualisys_text):
    content = qualisys_text.replace("knee", "hüfte").encode("latin-1")
    assert read_take(put("umlaut.tsv", content)).names == ("hip", "hüfte")


def test_real_recording_is_a_hand_in_millimetres(recording):
    take = read_take(recording("hand/recording.tsv"))
    assert take.positions.shape == (6000, 21, 3)
    assert 300 < np.nanmax(np.abs(take.positions)) < 1500
