"""Frame rates of times: slow ones, ones in other units, ones with gaps and repetitions."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import read_take
from skelgen_formats.time_stamps import since_first

from skelgen.geometry.frame_rate import AS_RECORDED_RATE


@pytest.mark.parametrize("titles", ["time,a_x,a_y,a_z,b_x,b_y,b_z", "time,marker,x,y,z"])
def test_dates_that_are_seconds_apart_are_no_milliseconds(put, titles):
    cells = ["1,2,3,4,5,6"] if "a_x" in titles else ["a,1,2,3", "b,4,5,6"]
    rows = "".join(f"2025-12-11T10:30:{5 * frame:02},{cell}\n" for frame in range(4) for cell in cells)
    assert read_take(put("slow.csv", f"{titles}\n{rows}")).rate == pytest.approx(0.2)


def test_times_of_a_stated_unit_may_be_slow():
    assert since_first(np.arange(5) * 2.0, 1.0).rate([]) == pytest.approx(0.5)


def test_times_of_no_stated_unit_are_those_of_a_camera():
    notices: list[str] = []
    assert since_first(np.arange(5) * 20.0, 0.0).rate(notices) == pytest.approx(50.0)
    assert "taken as ms" in notices[0]


@pytest.mark.parametrize("start", [0.0, 129_627.0, 638_000_000_000_000_000.0, 133_000_000_000_000_000.0])
def test_ticks_of_windows_tell_the_rate(start):
    """As .NET writes them: of a Kinect since it was started, of a clock since the year 1, or 1601."""
    notices: list[str] = []
    assert since_first(start + np.arange(5) * 333_333.0, 0.0).rate(notices) == pytest.approx(30.0, rel=1e-3)
    assert ("ticks of 100 ns" in "".join(notices)) == (start < 1e9)


@pytest.mark.parametrize(("unit", "name"), [(1e3, "ms"), (1e6, "µs"), (1e9, "ns")])
def test_times_since_a_device_was_started_may_be_as_large_as_seconds_since_1970(unit, name):
    notices: list[str] = []
    assert since_first(1.6e9 + np.arange(50) * unit / 60, 0.0).rate(notices) == pytest.approx(60.0)
    assert f"taken as {name}" in notices[0]


def test_some_times_may_be_missing_or_stand_twice():
    times = 5.0 + np.arange(40) / 50
    times[[7, 20]] = 0.0, np.nan  # NOKOV writes 0 where nothing is seen
    times[30] = times[29]
    assert since_first(times, 1.0).rate([]) == pytest.approx(50.0)


def test_times_that_count_seconds_of_many_rows_tell_no_rate():
    assert since_first(np.repeat(np.arange(4.0), 30), 1.0).rate([]) == AS_RECORDED_RATE
