from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import read_take, recognise

HEAD = (
    "BTS ASCII format\n\nType:         \t3D point tracks\nMeasure unit: \tm\n\nTracks:       \t2\n"
    "Frequency:    \t100 Hz\nFrames:       \t3\nStart time:   \t0.000\n\n"
    " Frame\t  Time\tc7.X\tc7.Y\tc7.Z\tl knee 1.X\tl knee 1.Y\tl knee 1.Z\t\n"
)
ROWS = (
    "     0\t   0.000\t 0.1\t 0.2\t 0.3\t 0.4\t 0.5\t 0.6\t\n     1\t   0.010\t 0.1\t 0.2\t 0.3\t    \t    \t    \t\n"
    "     2\t   0.020\t 0.1\t 0.2\t 0.4\t 0.4\t 0.5\t 0.7\t\n"
)


@pytest.mark.parametrize("text", [HEAD + ROWS, (HEAD + ROWS + "\n\n").replace("\n", "\r\n"), HEAD + ROWS.strip("\n")])
def test_tracks_are_read_in_the_unit_of_the_file(put, text):
    path = put("walk.emt", text)
    take = read_take(path)
    assert recognise(path).name == "emt"
    assert (take.names, take.rate, take.notices) == (("c7", "l knee 1"), 100.0, ())
    np.testing.assert_allclose(take.positions[0], [[100, 200, 300], [400, 500, 600]])
    assert take.seen.tolist() == [[True, True], [True, False], [True, True]]


def test_decimal_commas_and_millimetres(put):
    text = (HEAD + ROWS.replace(".", ",")).replace("unit: \tm\n", "unit: \tmm\n")
    np.testing.assert_allclose(read_take(put("comma.emt", text)).positions[0, 0], [0.1, 0.2, 0.3])


def test_what_is_cut_off_is_left_out(put):
    take = read_take(put("cut.emt", HEAD + ROWS[:-12]))
    assert take.n_frames == 2
    assert any("is cut off" in notice for notice in take.notices)


@pytest.mark.parametrize("kind", ["Emg tracks", "Angle cycles"])
def test_other_tracks_say_what_to_export(refused, put, kind):
    text = HEAD.replace("3D point tracks", kind).replace(".X", ".M").replace(".Y", ".S").replace(".Z", "")
    assert f"holds {kind}, no points; export the 3D tracks" in refused(put("emg.emt", text + ROWS))


def test_header_that_lacks_the_unit_is_refused(refused, put):
    assert "no measure unit" in refused(put("none.emt", (HEAD + ROWS).replace("Measure unit: \tm\n", "")))
