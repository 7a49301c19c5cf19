"""Several people in one table or list: by numbers before names, or above them."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import read_take

JOINTS = ("hip", "knee", "toe")
PLACES = np.array([[[[900.0 * p + n, 10.0 * k, 5.5 + p] for k in range(3)] for p in range(2)] for n in range(4)])
"""Of three joints of two people in four frames, in mm."""

NAMES = tuple(f"{person}:{joint}" for person in (1, 2) for joint in JOINTS)


def cells(numbers) -> str:
    return ",".join(f"{x:g}" for x in np.ravel(numbers))


def wide(head: str) -> str:
    return head + "".join(f"{n},{cells(place)}\n" for n, place in enumerate(PLACES))


ABOVE = (
    "person" + ",1" * 9 + ",2" * 9 + "\nframe," + ",".join(f"{name}_{axis}" for name in JOINTS * 2 for axis in "xyz")
)
MERGED = (
    ",1" + "," * 9 + "2" + "," * 8 + "\nframe," + ",".join(f"{name}_{axis}" for name in JOINTS * 2 for axis in "xyz")
)
THREE = "," + ",".join(["1"] * 9 + ["2"] * 9) + "\n," + ",".join(name for name in JOINTS * 2 for _ in "xyz")
THREE += "\nframe" + ",x,y,z" * 6
LOG = "\n".join(
    f"{person + 1}:{joint} {cells(PLACES[n, person, k]).replace(',', ' ')}"
    for n in range(4)
    for person in range(2)
    for k, joint in enumerate(JOINTS)
)


@pytest.mark.parametrize("content", [*(wide(f"{head}\n") for head in (ABOVE, MERGED, THREE)), LOG])
def test_numbers_of_people_are_parts_of_names(put, content):
    take = read_take(put("people.csv", content), recorded_unit="mm")
    assert take.names == NAMES
    np.testing.assert_array_equal(take.positions, PLACES.reshape(4, -1, 3))


@pytest.mark.parametrize("title", ["Sub Frame", "subframe", "sample", "trial", "half", "step", "plate"])
def test_parts_of_frames_are_no_people(put, title):
    titles = f"Frame,{title}," + ",".join(f"{joint}_{axis}" for joint in JOINTS for axis in "xyz")
    rows = "".join(f"{n},{part},{cells(PLACES[n, part])}\n" for n in range(4) for part in range(2))
    assert read_take(put("parts.csv", f"{titles}\n{rows}")).names == JOINTS


def test_rows_that_repeat_frame_numbers_are_told(put):
    titles = "frame," + ",".join(f"{joint}_{axis}" for joint in JOINTS for axis in "xyz")
    rows = "".join(f"{n},{cells(PLACES[n, p])}\n" for n in range(4) for p in range(2))
    take = read_take(put("again.csv", f"{titles}\n{rows}"))
    assert any("4 rows have the frame number of the one before" in notice for notice in take.notices)
