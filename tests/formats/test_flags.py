"""Flags, states and confidences of points mean the same in wide and tidy tables, in JSON and in arrays."""

from __future__ import annotations

import json
from itertools import chain
from pathlib import Path

import numpy as np
import pytest
from skelgen_formats.registry import read_take

NAMES = ("hip", "knee", "toe")
PLACES = np.array([[[100.0 * k + n, 200 + 3 * n, 900 - 300 * k] for k in range(3)] for n in range(4)]).tolist()


def wide(title: str, flags: list[list[str]]) -> str:
    titles = [f"{name}_{end}" for name in NAMES for end in ("x", "y", "z", title)]
    rows = [chain(*([*xyz, flag] for xyz, flag in zip(*row, strict=True))) for row in zip(PLACES, flags, strict=True)]
    return "\n".join(",".join(map(str, row)) for row in [titles, *rows])


def tidy(title: str, flags: list[list[str]]) -> str:
    rows = [
        [n, name, *xyz, flag]
        for n in range(len(PLACES))
        for name, xyz, flag in zip(NAMES, PLACES[n], flags[n], strict=True)
    ]
    return "\n".join(",".join(map(str, row)) for row in [["frame", "marker", "x", "y", "z", title], *rows])


def records(title: str, flags: list[list[str]]) -> str:
    frames = [
        [{"name": name, "position": xyz, title: flag or None} for name, xyz, flag in zip(NAMES, *row, strict=True)]
        for row in zip(PLACES, flags, strict=True)
    ]
    return json.dumps({"frames": [{"markers": markers} for markers in frames]})


def arrays(path: Path, title: str, flags: list[list[str]]) -> Path:
    np.savez(path, positions=PLACES, names=NAMES, **{title: flags})
    return path


@pytest.mark.parametrize("kind", ["wide", "tidy", "json", "npz"])
@pytest.mark.parametrize(
    ("title", "cells", "seen"),
    [
        ("valid", ["1", "1", "0", ""], [True, True, False, False]),
        ("visible", ["True", "", "False", "True"], [True, False, False, True]),
        ("occluded", ["", "1", "0", ""], [True, False, True, True]),
        ("hidden", ["", "true", "", ""], [True, False, True, True]),
        ("status", ["ok", "lost", "", "interpolated"], [True, False, True, True]),
        ("status", ["1", "0", "3", "1"], [True] * 4),
        ("tracking_state", ["2", "1", "0", "2"], [True, True, False, True]),
        ("confidence", ["0.9", "nan", "0", "0.4"], [True, False, False, True]),
        ("score", ["-1", "", "0.2", "1"], [False, False, True, True]),
        ("cond", ["3.2", "-1.0", "2.5", "3.1"], [True, False, True, True]),
        ("residual", ["0.3", "-1", "", "0"], [True, False, True, True]),
        ("likelihood", [""] * 4, [True] * 4),
        ("tracking_valid", ["1", "0", "1", "1"], [True, False, True, True]),
        (
            "tracking_state",
            ["STATE.OK", "STATE.SEARCHING", "TrackingState_NotTracked", "Inferred"],
            [True, False, False, True],
        ),
        ("confidence", ["JOINT_CONFIDENCE_LOW", "JOINT_CONFIDENCE_NONE", "HIGH", "1"], [True, False, True, True]),
    ],
)
def test_flags_mean_the_same_in_every_format(put, tmp_path, kind, title, cells, seen):
    """Those of the knee; nothing says that the others are hidden."""
    others = "0" if title in ("occluded", "hidden") else "ok" if "ok" in cells else "1"
    flags = [[others, cell, others] for cell in cells]
    if kind == "npz":
        path = arrays(tmp_path / "points.npz", title, flags)
    else:
        write = {"wide": wide, "tidy": tidy, "json": records}[kind]
        path = put("points.json" if kind == "json" else "points.csv", write(title, flags))
    take = read_take(path, points="markers")
    assert take.seen.tolist() == [[True, one, True] for one in seen]


def test_fractions_beside_points_are_no_flags(put):
    """Speeds are called v, too."""
    speeds = [[one] * 3 for one in ("0", "0.5", "0.25", "0")]
    assert read_take(put("speeds.csv", wide("v", speeds)), points="markers").seen.all()


def test_what_is_unseen_by_its_coordinates_is_not_counted_as_flagged(put):
    text = wide("valid", [["1", "1", "1"]] * 2 + [["1", "0", "1"]] * 2)
    empty = text.replace(",".join(map(str, PLACES[3][1])), ",,")
    assert any("1 position is unseen" in notice for notice in read_take(put("some.csv", empty)).notices)


def test_flag_without_a_name_is_of_all_points_of_its_row(put):
    rows = "".join(f"{n},{valid},1,2,{n},4,5,{n}\n" for n, valid in enumerate(("1", "0", "True", "no")))
    take = read_take(put("tracked.csv", f"frame,Tracked,a_x,a_y,a_z,b_x,b_y,b_z\n{rows}"))
    assert take.seen.tolist() == [[True] * 2, [False] * 2, [True] * 2, [False] * 2]
