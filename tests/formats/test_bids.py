"""BIDS motion: a table whose titles and rate stand in the files beside it."""

from __future__ import annotations

import json

import numpy as np
import pytest
from skelgen_formats.registry import read_take, recognise

from tests.formats.wide_rows import POSITIONS, rows

POINTS = [(f"{name}_{axis}", axis, "POS", name, "mm") for name in ("hip", "toe") for axis in "xyz"]
TURNS = [("head_quat_" + axis, "quat_" + axis, "ORNT", "head", "n/a") for axis in "wxyz"]


@pytest.fixture
def recorded(put):
    def write(channels, content, rate=50):
        table = "".join("\t".join(channel) + "\n" for channel in channels)
        put("sub-1_task-walk_channels.tsv", "name\tcomponent\ttype\ttracked_point\tunits\n" + table)
        put("sub-1_task-walk_motion.json", json.dumps({"SamplingFrequency": rate} if rate else {}))
        return put("sub-1_task-walk_motion.tsv", content)

    return write


@pytest.mark.parametrize("titles", ["", "\t".join(name for name, *_ in POINTS) + "\n"])
def test_channels_name_the_columns(recorded, titles):
    path = recorded(POINTS, titles + rows(delimiter="\t"))
    take = read_take(path)
    assert recognise(path).name == "bids-motion"
    assert (take.names, take.rate, take.notices) == (("hip", "toe"), 50.0, ())
    np.testing.assert_allclose(take.positions, POSITIONS)


def test_channels_of_orientations_make_bodies(recorded):
    channels = [("latency", "n/a", "LATENCY", "n/a", "s")]
    channels += [(f"head_{axis}", axis, "POS", "head", "m") for axis in "xyz"] + TURNS
    cells = "\t1\t2\t3\t0.6\t0\t0\t0.8\t9\n"
    take = read_take(recorded([*channels, ("a_x", "x", "ACCEL", "a", "g")], f"0.0{cells}0.1{cells}", None))
    assert (take.names, take.rate) == (("head",), pytest.approx(10.0))
    np.testing.assert_allclose(take.world_from_body[0, 0, :3, 3], [1000, 2000, 3000])


def test_channels_that_are_missing_or_too_few_are_told(refused, recorded, put):
    assert "5 channels in sub-1_task-walk_channels.tsv" in refused(recorded(POINTS[:5], rows(delimiter="\t")))
    assert "which names its columns, is not beside it" in refused(put("alone_motion.tsv", rows(delimiter="\t")))
