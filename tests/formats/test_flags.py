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


@pytest.mark.parametrize(
    ("title", "knee", "toe"),
    [
        ("v", ["0", "12", "35", "-4"], ["0", "12", "35", "-4"]),
        ("v", ["0"] * 4, ["0.5", "0.25", "0", "0"]),
        ("lost", ["0", "1", "2", "3"], ["0"] * 4),
    ],
)
def test_speeds_and_counts_are_no_flags(put, title, knee, toe):
    """Of a marker that stands still, too."""
    flags = [["0", *row] for row in zip(knee, toe, strict=True)]
    assert read_take(put("speeds.csv", wide(title, flags)), points="markers").seen.all()


def test_visibility_of_coco_is_a_flag(put):
    take = read_take(put("coco.csv", wide("v", [["2", one, "2"] for one in "1202"])), points="markers")
    assert take.seen[:, 1].tolist() == [True, True, False, True]


@pytest.mark.parametrize(
    "title",
    ["lost_frames", "missing markers", "hidden_target", "score_task", "visible light", "task_cond", "trial_state"],
)
def test_columns_behind_the_last_point_that_begin_as_flags_are_nobodys(put, title):
    head, *rows = wide("valid", [["1"] * 3] * 4).splitlines()
    text = "\n".join([f"{head},{title}", *(f"{row},{n % 2}" for n, row in enumerate(rows))])
    bare = text.replace("toe_valid", "toe_w")
    for content in (text, bare, bare.replace("_valid", "_w")):
        assert read_take(put("more.csv", content), points="markers").seen.all()


@pytest.mark.parametrize("write", [wide, tidy])
def test_logits_have_no_lowest_grade(put, write):
    scores = [["2.5", one, "-0.7"] for one in ("-3.1", "0.4", "0", "-1")]
    take = read_take(put("logits.csv", write("score", scores)), points="markers")
    assert take.seen.tolist() == [[True, one, True] for one in (True, True, False, True)]


@pytest.mark.parametrize("write", [wide, tidy])
def test_confidence_of_a_few_frames_does_not_tell_of_others(put, write):
    flags = [[one] * 3 for one in ("0.9", "", "", "")]
    assert read_take(put("sparse.csv", write("confidence", flags)), points="markers").seen.all()


@pytest.mark.parametrize("no", ["False", "no", "lost"])
def test_rows_of_flags_alone_are_frames(put, no):
    """Without a column of frames, and with flags before the points, or one of all."""
    rows = [[f"{no},,,,{no},,,"] if n in (3, 4) else [f"True,1,2,{n},True,4,5,{n}"] for n in range(9)]
    titles = "a_valid,a_x,a_y,a_z,b_valid,b_x,b_y,b_z"
    take = read_take(put("own.csv", "\n".join([titles, *(row for (row,) in rows), titles])))
    assert take.seen[:, 0].tolist() == [n not in (3, 4) for n in range(9)]
    rows = [f"{no},,,,,,".rstrip() if n in (3, 4) else f"True,1,2,{n},4,5,{n}" for n in range(9)]
    titles = "tracked,a_x,a_y,a_z,b_x,b_y,b_z"
    take = read_take(put("all.csv", "\n".join([titles, *rows, titles])))
    assert take.seen[:, 0].tolist() == [n not in (3, 4) for n in range(9)]
