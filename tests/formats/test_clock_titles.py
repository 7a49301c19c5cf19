"""Columns of times: seconds beside their fraction, titles with words before them, images instead of frames."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import read_take

STAMPS = [(7, 990_000_000), (8, 0), (8, 10_000_000)]  # s and ns: 100 Hz over a whole second
POINTS = "a_x,a_y,a_z,b_x,b_y,b_z"


@pytest.mark.parametrize("titles", ["header.stamp.sec,header.stamp.nanosec", "sec,nanosec", "stamp_secs,stamp_nsecs"])
def test_seconds_and_nanoseconds_in_two_columns_tell_the_rate(put, titles):
    rows = "".join(f"{second},{rest},1,2,3,4,5,6\n" for second, rest in STAMPS)
    take = read_take(put("wide.csv", f"{titles},{POINTS}\n{rows}"))
    assert (take.n_frames, take.rate) == (3, pytest.approx(100.0))
    assert not any("100 Hz is assumed" in notice for notice in take.notices)


def test_seconds_and_nanoseconds_part_the_rows_of_tidy_tables_into_frames(put):
    rows = "".join(f"{second},{rest},{name},1,2,3\n" for second, rest in STAMPS for name in "ab")
    take = read_take(put("tidy.csv", f"sec,nanosec,name,x,y,z\n{rows}"))
    assert (take.n_frames, take.names, take.rate) == (3, ("a", "b"), pytest.approx(100.0))


@pytest.mark.parametrize(
    "title", ["CaptureTime", "Vicon_Recv_Timestamp", "ros_time [ms]", "device timestamp (us)", "timestamp_unix_ms"]
)
def test_words_may_stand_before_the_title_of_times(put, title):
    unit = 1000 if "ms" in title else 1e6 if "us" in title else 1
    rows = "".join(f"{frame / 50 * unit:.9g},1,2,3,4,5,6\n" for frame in range(1, 4))
    assert read_take(put("times.csv", f"{title},{POINTS}\n{rows}")).rate == pytest.approx(50.0)


def test_plain_title_of_times_counts_before_others(put):
    rows = "".join(f"{frame / 50},{frame / 20},1,2,3,4,5,6\n" for frame in range(3))
    assert read_take(put("both.csv", f"receive_time,time,{POINTS}\n{rows}")).rate == pytest.approx(20.0)


@pytest.mark.parametrize(("every_row", "rate"), [(0, 50.0), (20, 100.0)])
def test_times_since_the_first_row_tell_the_rate_and_steps_of_time_do_not(put, every_row, rate):
    rows = "".join(f"{every_row or 3076 + 20 * frame},1,2,3,4,5,6\n" for frame in range(5))
    assert read_take(put("delta.csv", f"delta_time_ms,{POINTS}\n{rows}")).rate == pytest.approx(rate)


def test_frames_that_are_names_of_images_give_way_to_times(put):
    rows = "".join(f"{frame / 50},{frame:03}.jpg,{name},1,2,3\n" for frame in range(3) for name in "ab")
    take = read_take(put("images.csv", f"time,frame,name,x,y,z\n{rows}"))
    assert (take.n_frames, take.rate) == (3, pytest.approx(50.0))


@pytest.mark.parametrize("unit", [1, 1e3, 1e6, 1e9])
def test_times_since_1970_tell_their_unit_by_their_size(put, unit):
    rows = "".join(f"{(1518661897 + frame / 2) * unit:.1f},1,2,3,4,5,6\n" for frame in range(3))
    assert read_take(put("slow.csv", f"Time Stamp,{POINTS}\n{rows}")).rate == pytest.approx(2.0)


@pytest.mark.parametrize(
    "titles", ["帧,时间", "フレーム,時間", "Bild,Zeit", "Trame,Temps", "Klatka,Czas", "Beeld,Tijd"]
)
def test_titles_of_times_and_frames_may_be_in_other_languages(put, titles):
    rows = "".join(f"{frame},{frame / 50},1,2,3,4,5,6\n" for frame in range(3))
    assert read_take(put("times.csv", f"{titles},{POINTS}\n{rows}")).rate == pytest.approx(50.0)


@pytest.mark.parametrize(
    ("title", "unit"),
    [("HostTimeNs", 1e9), ("msec", 1e3), ("Time (min)", 1 / 60), ("epoch_ms", 1e3), ("Time Stamp (100ns)", 1e7)],
)
def test_units_of_times_may_be_written_in_many_ways(put, title, unit):
    rows = "".join(f"{(100 + frame / 50) * unit:.9f},1,2,3,4,5,6\n" for frame in range(5))
    assert read_take(put("times.csv", f"{title},{POINTS}\n{rows}")).rate == pytest.approx(50.0)


@pytest.mark.parametrize("title", ["Header", "", "Unnamed: 0", "index"])
def test_first_column_that_rises_evenly_by_a_fraction_is_taken_as_times(put, title):
    rows = "".join(f"{frame / 200:.3f},1,2,3,4,5,6\n" for frame in range(5))
    take = read_take(put("first.csv", f"{title},{POINTS}\n{rows}"))
    assert take.rate == pytest.approx(200.0)
    assert any("column 1 is taken as times" in notice for notice in take.notices)


def test_dates_and_times_of_day_need_no_title_of_times(put):
    rows = "".join(f"1,2,3,4,5,6,2023-05-12T10:41:03.{20 * frame:03}+02:00\n" for frame in range(5))
    assert read_take(put("iso.csv", f"{POINTS},Aufnahme\n{rows}")).rate == pytest.approx(50.0)


def test_numbers_of_days_as_matlab_writes_dates_tell_the_rate(put):
    rows = "".join(f"{738000 + frame / 50 / 86400:.10f},1,2,3,4,5,6\n" for frame in range(5))
    assert read_take(put("days.csv", f"datenum,{POINTS}\n{rows}")).rate == pytest.approx(50.0, rel=1e-3)


@pytest.mark.parametrize("per_second", [25, 30])
@pytest.mark.parametrize("repeated", [1, 4])
def test_timecodes_of_films_tell_the_rate(put, per_second, repeated):
    codes = [f"01:02:{n // per_second:02}:{n % per_second:02}" for n in range(3 * per_second) for _ in range(repeated)]
    rows = "".join(f"{code},1,2,3,4,5,6\n" for code in codes)
    assert read_take(put("code.csv", f"Timecode,{POINTS}\n{rows}")).rate == pytest.approx(per_second * repeated)


@pytest.mark.parametrize(
    ("titles", "parts"),
    [("Hour,Minute,Second", 1), ("hh,mm,ss,ms", 1000), ("[hours],[minutes],[seconds],[milliseconds]", 1000)],
)
def test_hours_minutes_and_seconds_in_columns_tell_the_rate(put, titles, parts):
    cells = ["10,59,59.96", "10,59,59.98", "11,0,0.0"] if parts == 1 else ["10,59,59,960", "10,59,59,980", "11,0,0,0"]
    take = read_take(put("clock.csv", f"{titles},{POINTS}\n" + "".join(f"{cell},1,2,3,4,5,6\n" for cell in cells)))
    assert (take.n_frames, take.rate) == (3, pytest.approx(50.0))


@pytest.mark.parametrize("parts", ["hour,minute,second", "hh,mm,ss"])
@pytest.mark.parametrize("is_tidy", [False, True])
def test_a_time_beside_hours_minutes_and_seconds_is_the_finer_one(put, is_tidy, parts):
    moments = [f"{n / 50},11,59,{n // 50}" for n in range(100)]
    wide = "".join(f"{moment},1,2,3,4,5,6\n" for moment in moments)
    tidy = "".join(f"{moment},{name},1,2,3\n" for moment in moments for name in "ab")
    text = f"time,{parts},name,x,y,z\n{tidy}" if is_tidy else f"time,{parts},{POINTS}\n{wide}"
    take = read_take(put("clock.csv", text))
    assert (take.n_frames, take.rate) == (100, pytest.approx(50.0))


@pytest.mark.parametrize("start", [0.0, 59.98, 3599.98, 50000.0])
@pytest.mark.parametrize("digits", [7, 0])
def test_hours_minutes_and_seconds_may_each_be_the_whole_time(put, start, digits):
    times = [start + frame / 50 for frame in range(5)]
    totals = ([second / 3600, second / 60] for second in times)
    cells = (",".join(f"{one if digits else one // 1:.{digits}f}" for one in row) for row in totals)
    rows = "".join(f"{row},{second:.2f},1,2,3,4,5,6\n" for row, second in zip(cells, times, strict=True))
    assert read_take(put("totals.csv", f"hours,minutes,seconds,{POINTS}\n{rows}")).rate == pytest.approx(50.0)


def test_seconds_that_begin_a_new_minute_do_not_go_back(put):
    rows = "".join(f"9,{59 + (frame > 1)},{(59.98 + frame / 100) % 60:.2f},1,2,3,4,5,6\n" for frame in range(4))
    rows = rows.replace("9,60,", "10,0,")
    take = read_take(put("parts.csv", f"hour,minute,second,{POINTS}\n{rows}"))
    assert take.rate == pytest.approx(100.0)
    assert not any("go back" in notice for notice in take.notices)


def test_times_that_leave_frames_out_are_told(put):
    rows = "".join(f"{frame / 50},1,2,3,4,5,6\n" for frame in range(20) if frame not in (5, 6, 11))
    take = read_take(put("gaps.csv", f"time,{POINTS}\n{rows}"))
    assert (take.n_frames, take.rate) == (17, pytest.approx(50.0))
    assert "times leave some out in 2 places; rows are taken as if they followed each other" in take.notices


def test_minutes_that_count_on_behind_an_hour_are_added(put):
    rows = "".join(f"0,{75 + frame // 4},{frame % 4 * 15},1,2,3,4,5,6\n" for frame in range(12))
    take = read_take(put("timer.csv", f"hour,minute,second,{POINTS}\n{rows}"))
    assert not any("go back" in notice for notice in take.notices)


@pytest.mark.filterwarnings("error")
def test_infinite_times_in_arrays_warn_of_nothing(tmp_path):
    times = np.append(np.arange(19) / 50, np.inf)
    np.savez(tmp_path / "times.npz", positions=np.arange(300.0).reshape(20, 5, 3), time=times)
    assert read_take(tmp_path / "times.npz").rate == pytest.approx(50.0)


@pytest.mark.parametrize("lost", ["", "0"])
def test_a_row_without_its_time_is_no_frame_left_out(put, lost):
    rows = "".join(f"{lost if frame == 5 else 10 + frame / 50},1,2,3,4,5,6\n" for frame in range(20))
    take = read_take(put("lost.csv", f"time,{POINTS}\n{rows}"))
    assert (take.n_frames, take.rate) == (20, pytest.approx(50.0))
    assert not any("times leave some out" in notice for notice in take.notices)
