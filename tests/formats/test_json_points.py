"""JSON of points, as scripts, cameras and Track Manager write it: two points in five frames."""

from __future__ import annotations

import json

import numpy as np
import pytest
from skelgen_formats.registry import read_take, recognise, write_file

PLACES = [[[frame, 2.5, 3.5], [4.5, 5.5, frame + 0.25]] for frame in range(5)]
TIMES = [0.0, 0.02, 0.04, 0.06, 0.08]
NAMES = ["knee", "toe"]
FRAMES = [*zip(TIMES, PLACES, strict=True)]


def axes(place):
    return dict(zip("xyz", place, strict=True))


def by_name(frame):
    return dict(zip(NAMES, frame, strict=True))


def named(frame):
    return [{"name": name, "position": place} for name, place in by_name(frame).items()]


def posed(place):
    return {"position": axes(place), "orientation": {**axes([0, 0, 0]), "w": 1}}


LAYOUTS = {
    "records": [{"t": t, **by_name(frame)} for t, frame in FRAMES],
    "objects": [{"time": t, "markers": by_name(map(axes, frame))} for t, frame in FRAMES],
    "by number": {f"{n}": {"t": t, **by_name(frame)} for n, (t, frame) in enumerate(FRAMES)},
    "labels": {"frameRate": 50, "labels": [{"name": n} for n in NAMES], "frames": [{"markers": f} for f in PLACES]},
    "joints": {"fps": 50, "joints": NAMES, "frames": [{"index": 1, "keypoints3d": frame} for frame in PLACES]},
    "named in frames": {"fps": 50, "frames": [{"markers": named(f)[:: 1 - 2 * (n % 2)]} for n, f in enumerate(PLACES)]},
    "one body": {
        "joint_names": NAMES,
        "frames": [{"timestamp_usec": t * 1e6, "bodies": [{"id": 1, "joint_positions": f}]} for t, f in FRAMES],
    },
    "poses of bodies": {"fps": 50, "frames": [{n: posed(p) for n, p in by_name(f).items()} for f in PLACES]},
    "named poses": {"fps": 50, "frames": [[{"name": n, **posed(p)} for n, p in by_name(f).items()] for f in PLACES]},
    "hands": {"fps": 50, "frames": [{"hands": [{"side": "l", "joints": named(frame)}]} for frame in PLACES]},
    "tracks": {"fps": 50, "points": [{"name": n, "at": [axes(f[k]) for f in PLACES]} for k, n in enumerate(NAMES)]},
    "times in ns": {f"{10**18 + round(t * 1e9)}": {"ts": 10**18 + round(t * 1e9), **by_name(f)} for t, f in FRAMES},
    "numbers in quotes": [{"t": f"{t}", **{n: [*map(str, p)] for n, p in by_name(f).items()}} for t, f in FRAMES],
    "keys of frames": {f"frame_{n:04}": {"t": t, **by_name(frame)} for n, (t, frame) in enumerate(FRAMES)},
    "times of each track": [{"label": n, "t": TIMES, "at": [f[k] for f in PLACES]} for k, n in enumerate(NAMES)],
    "stamps of ROS": [{"stamp": {"sec": 5, "nanosec": t * 1e9}, "markers": named(frame)} for t, frame in FRAMES],
    "names of another key": [
        {"t": t, "joints": [{"type": n, "p": p} for n, p in by_name(f).items()]} for t, f in FRAMES
    ],
    "keys of times": {f"{t}": {"t": t, **by_name(frame)} for t, frame in FRAMES},
    "records of each name": {n: [{"t": t, **axes(f[k])} for t, f in FRAMES] for k, n in enumerate(NAMES)},
    "dates": [{"time": f"2024-01-02T03:04:05.{round(1e3 * t):03}Z", **by_name(frame)} for t, frame in FRAMES],
    "tidy": {"data": [{"time": t, "marker": n, **axes(p)} for t, f in FRAMES for n, p in by_name(f).items()]},
    "split": {
        "columns": [["time", ""], *([name, axis] for name in NAMES for axis in "xyz")],
        "index": [0, 1, 2, 3, 4],
        "data": [[t, *np.ravel(frame)] for t, frame in FRAMES],
    },
}


FAR = json.dumps(
    {
        "Timebase": {"Frequency": 9},
        "Markers": [{"Name": n, "Parts": [{"Range": {"Start": n * 10**9}, "Values": [[1, 2, 3]]}]} for n in (0, 1)],
    }
)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_points_are_found(put, layout):
    path = put("points.json", json.dumps(LAYOUTS[layout]))
    take = read_take(path, recorded_unit="mm")
    assert recognise(path).name == "json"
    assert take.names == tuple(NAMES)
    np.testing.assert_allclose(take.positions, PLACES)
    assert take.rate == pytest.approx(50.0) or layout == "split"


def test_a_value_may_stand_in_each_line(put):
    take = read_take(put("points.ndjson", "\n".join(map(json.dumps, LAYOUTS["records"]))), recorded_unit="mm")
    np.testing.assert_allclose(take.positions, PLACES)


def test_all_may_stand_in_one_line_however_long_it_is(put):
    text = json.dumps(LAYOUTS["records"]).replace("[", "[" + " " * (1 << 23), 1)
    np.testing.assert_array_equal(read_take(put("a.json", text), recorded_unit="mm").positions, PLACES)


def test_points_that_frames_do_not_list_are_unseen(put):
    frames = [{"markers": named(frame)[: 1 + n % 2]} for n, frame in enumerate(PLACES)]
    take = read_take(put("some.json", json.dumps({"frames": frames})))
    assert take.names == tuple(NAMES)
    assert take.seen[:, 1].tolist() == [False, True, False, True, False]


@pytest.mark.parametrize(
    ("flag", "seen", "hidden"),
    [
        *[("visible", True, False), ("isOccluded", False, True), ("confidence", 0.7, 0.0)],
        *[("visible", "yes", "no"), ("occluded", "F", "T"), ("status", "OK", "lost"), ("visible", "true", None)],
        *[("occluded", "visible", "occluded"), ("trackingState", "Tracked", "NotTracked")],
    ],
)
def test_points_are_unseen_where_flags_say_so(put, flag, seen, hidden):
    frames = [
        {"markers": [{**one, flag: hidden if n == 1 else seen} for one in named(f)]} for n, f in enumerate(PLACES)
    ]
    take = read_take(put("flags.json", json.dumps({"fps": 50, "frames": frames})))
    assert take.names == tuple(NAMES)
    assert take.seen[:, 1].tolist() == [True, False, True, True, True]


def test_words_that_say_nothing_are_of_points_that_are_seen(put):
    words = ["ok", "interpolated", "lost", "", "ok"]
    frames = [{"markers": [{**one, "status": word} for one in named(f)]} for word, f in zip(words, PLACES, strict=True)]
    take = read_take(put("words.json", json.dumps({"fps": 50, "frames": frames})))
    assert take.names == tuple(NAMES)
    assert take.seen[:, 1].tolist() == [True, True, False, True, True]


def test_a_state_speaks_beside_a_flag(put):
    frames = [
        {"markers": [{**one, "tracked": n != 1, "status": "lost" if n == 3 else "ok"} for one in named(f)]}
        for n, f in enumerate(PLACES)
    ]
    take = read_take(put("both.json", json.dumps({"fps": 50, "frames": frames})))
    assert take.seen[:, 1].tolist() == [True, False, True, False, True]


def test_numbers_of_a_status_are_codes(put):
    frames = [{"markers": [{**one, "status": "0"} for one in named(frame)]} for frame in PLACES]
    assert read_take(put("codes.json", json.dumps({"fps": 50, "frames": frames}))).seen.all()


@pytest.mark.parametrize(
    "unit", [{"units": {"time": "s", "length": "cm"}}, {"position_units": "cm"}, {"lengthUnit": "cm"}]
)
def test_units_of_length_have_several_names(put, unit):
    take = read_take(put("cm.json", json.dumps({"fps": 50, **unit, "names": NAMES, "positions": PLACES})))
    np.testing.assert_allclose(take.positions, 10.0 * np.array(PLACES))


def test_what_is_null_is_unseen(put):
    records = [{**record, "toe": None} if n == 1 else record for n, record in enumerate(LAYOUTS["records"])]
    assert read_take(put("null.json", json.dumps(records))).seen[:, 1].tolist() == [True, False, True, True, True]


def test_parts_of_track_manager_are_put_where_they_belong(put):
    def part(first, frames, marker):
        return {
            "Range": {"Start": first, "End": first + len(frames)},
            "Values": [[*one[marker], 0.5] for one in frames],
        }

    parts = [[part(10, PLACES, 0)], [part(10, PLACES[:1], 1), part(12, PLACES[2:], 1)]]
    markers = [{"Name": name, "Parts": some} for name, some in zip(NAMES, parts, strict=True)]
    take = read_take(put("walk.json", json.dumps({"Timebase": {"Frequency": 120}, "Markers": markers})))
    assert (take.names, take.rate) == (tuple(NAMES), 120.0)
    assert take.seen[:, 1].tolist() == [True, False, True, True, True]
    np.testing.assert_allclose(take.positions[2], PLACES[2])


@pytest.mark.parametrize(
    "content",
    ['{"', '{"a": 1}', "[[]]", '{"a": ' * 3000, '{"Markers": [{"Parts": [1], "Name": 2}]}', '[{"x": 1}, 2]', FAR],
)
def test_json_without_points_is_refused(refused, put, content):
    assert "JSON" in refused(put("other.json", content))


def test_summary_of_a_project_is_told(refused, tmp_path, small_project):
    write_file(small_project, tmp_path / "walk.summary.json")
    assert "this is a summary of skelgen, without positions" in refused(tmp_path / "walk.summary.json")


JOINTS = [
    [[[100.0 * person + joint, frame + 0.5, 2.0] for joint in range(5)] for frame in range(4)] for person in (0, 1)
]
NAMED = [[{f"j{n}": axes(place) for n, place in enumerate(frame)} for frame in person] for person in JOINTS]
FLAT = [[[x for place in frame for x in (*place, 0.9)] for frame in person] for person in JOINTS]
PEOPLE = {
    "lists": [{"instances": [{"keypoints": JOINTS[k][n]} for k in (0, 1)]} for n in range(4)],
    "ids in any order": [{"people": [{"id": k, **NAMED[k][n]} for k in ((0, 1), (1, 0))[n % 2]]} for n in range(4)],
    "flat, with confidence": [{"bodies": [{"id": k, "joints5": FLAT[k][n]} for k in (0, 1)]} for n in range(4)],
    "by person": {"people": [{"joints": [NAMED[k][n] for n in range(4)]} for k in (0, 1)]},
}


@pytest.mark.parametrize("layout", PEOPLE)
def test_people_of_a_frame_are_parted(put, layout):
    take = read_take(put("people.json", json.dumps(PEOPLE[layout])))
    assert {name.partition(":")[0] for name in take.names} == {"1", "2"}
    np.testing.assert_allclose(take.positions, np.concatenate(JOINTS, axis=1))


@pytest.mark.parametrize("ids", [False, True])
def test_person_who_is_missing_is_unseen(put, ids):
    ids = [{"track_id": k} if ids else {} for k in (0, 1)]
    frames = [[{**ids[k], "keypoints": JOINTS[k][n]} for k in range(1 + n % 2)] for n in range(4)]
    take = read_take(put("people.json", json.dumps({"fps": 50, "frames": [{"people": frame} for frame in frames]})))
    assert take.seen.sum(axis=1).tolist() == [5, 10, 5, 10]


PAIR = np.add.outer([0.0, 900.0], np.concatenate([PLACES, np.add(PLACES, 40)], axis=1)).swapaxes(0, 1)
"""Four points of each of two people in each frame."""


@pytest.mark.parametrize(
    "frames",
    [
        [{"image_id": f"{n}.jpg", "idx": k, "keypoints": PAIR[n, k]} for n in range(5) for k in (0, 1)],
        [{"frame": n, "person_id": k, "keypoints": PAIR[n, k]} for k in (0, 1) for n in range(5)],
        [
            {"frame": n, "person": k, "joints": dict(zip("abcd", PAIR[n, k], strict=True))}
            for n in range(5)
            for k in (0, 1)
        ],
        {"annotations": [{"id": 2 * n + k, "image_id": n, "keypoints": PAIR[n, k]} for n in range(5) for k in (0, 1)]},
        [{"time": n / 50, "skeletonId": k, "points": PAIR[n, k]} for n in range(5) for k in (0, 1)],
    ],
    ids=("AlphaPose", "by person", "joints by name", "COCO", "times"),
)
def test_records_of_several_people_in_a_frame_are_no_frames_of_one(put, frames):
    text = json.dumps(frames, default=lambda array: array.tolist())
    take = read_take(put("people.json", text), recorded_unit="mm")
    np.testing.assert_allclose(take.positions, PAIR.reshape(5, -1, 3))
    assert any("5 frames of 2 people" in notice for notice in take.notices)


def test_records_that_repeat_a_time_of_one_person_are_frames(put):
    """Whole seconds."""
    records = [{"time": n // 2, "id": 1, "points": place} for n, place in enumerate(np.array(PLACES).tolist())]
    take = read_take(put("coarse.json", json.dumps(records)), recorded_unit="mm")
    np.testing.assert_allclose(take.positions, PLACES)


def test_indices_of_frames_in_a_second_are_no_people(put):
    records = [{"time": n // 2, "index": n % 2, "points": pair[0].tolist()} for n, pair in enumerate([*PAIR, *PAIR])]
    take = read_take(put("seconds.json", json.dumps(records)), recorded_unit="mm")
    np.testing.assert_allclose(take.positions, np.tile(PAIR[:, 0], (2, 1, 1)))


def test_joints_of_the_only_actor_keep_their_names(put):
    """A list of actors in each frame."""
    joints = dict(zip("abcd", PAIR[0, 0].tolist(), strict=True))
    actor = {
        "name": "Ann",
        "body": {
            name: {"position": axes(place), "rotation": posed(place)["orientation"]} for name, place in joints.items()
        },
    }
    frames = [{"fps": 30.0, "scene": {"timestamp": n / 30, "actors": [actor]}} for n in range(5)]
    take = read_take(put("actor.json", json.dumps(frames)), recorded_unit="mm")
    assert (take.names, take.rate) == (("a", "b", "c", "d"), 30.0)
    np.testing.assert_allclose(take.positions[4], PAIR[0, 0])


AGAIN = (0, 1, 2, 2, 3)
"""Numbers of frames, of which one is repeated."""


@pytest.mark.parametrize(
    "parts",
    [
        [dict(zip("abcd", pair[0].tolist(), strict=True)) for pair in PAIR],
        [{"joints": dict(zip("abcd", pair[0].tolist(), strict=True))} for pair in PAIR],
        [{"person_id": 7, "joints": dict(zip("abcd", pair[0].tolist(), strict=True))} for pair in PAIR],
        [
            {"markers": [{"name": k, "position": p} for k, p in zip("abcd", pair[0].tolist(), strict=True)]}
            for pair in PAIR
        ],
    ],
    ids=("keys", "joints", "one person", "markers"),
)
def test_repeated_frame_is_no_second_person(put, parts):
    frames = [{"frame": n, **part} for n, part in zip(AGAIN, parts, strict=True)]
    take = read_take(put("again.json", json.dumps(frames)), recorded_unit="mm")
    assert take.names == ("a", "b", "c", "d")
    np.testing.assert_allclose(take.positions, PAIR[:, 0])


@pytest.mark.parametrize("own", [{}, {"id": None}, {"subject": None}])
@pytest.mark.parametrize("moment", ["frame", "image_id"])
def test_takes_one_after_the_other_are_no_people(put, own, moment):
    """Without ids, with one for each record, or with subjects."""
    ids = {"id": lambda take, n: 5 * take + n, "subject": lambda take, n: f"S{take}"}
    records = [
        {moment: n, **{key: ids[key](take, n) for key in own}, "hip": hip, "knee": knee}
        for take in (0, 1)
        for n, (hip, knee, *_) in enumerate(PAIR[:, take].tolist())
    ]
    take = read_take(put("takes.json", json.dumps(records)), recorded_unit="mm")
    assert take.names == ("hip", "knee")
    np.testing.assert_allclose(take.positions, np.concatenate([PAIR[:, 0, :2], PAIR[:, 1, :2]]))


@pytest.mark.parametrize("where", [lambda places: places, lambda places: {"joints": places}])
def test_points_of_people_may_be_keys(put, where):
    records = [
        {"frame": n, "person_id": k, **where(dict(zip(("hip", "knee"), PAIR[n, k, :2].tolist(), strict=True)))}
        for n in range(5)
        for k in (0, 1)
    ]
    take = read_take(put("keys.json", json.dumps(records)), recorded_unit="mm")
    assert take.names == ("1:hip", "1:knee", "2:hip", "2:knee")
    np.testing.assert_allclose(take.positions, PAIR[:, :, :2].reshape(5, 4, 3))


@pytest.mark.parametrize("own", ["name", "id"])
@pytest.mark.parametrize(
    ("key", "frames"), [("frame", ("world", "base")), ("frame_id", (0, 1)), ("image", ("1.png", "2.png"))]
)
def test_frames_of_reference_and_images_of_trajectories_are_no_moments(put, own, key, frames):
    for n_markers in (3, 4):
        whole = [{own: f"m{k}", key: frames[k // 2], "positions": PAIR[:, 0, k].tolist()} for k in range(n_markers)]
        take = read_take(put("whole.json", json.dumps(whole)), recorded_unit="mm")
        np.testing.assert_allclose(take.positions, PAIR[:, 0, :n_markers])


def test_records_of_a_named_point_each_are_points(put):
    records = [{"frame": n, "name": "abcd"[k], "position": PAIR[n, 0, k].tolist()} for n in range(5) for k in range(4)]
    take = read_take(put("named.json", json.dumps(records)), recorded_unit="mm")
    assert take.names == ("a", "b", "c", "d")
    np.testing.assert_allclose(take.positions, PAIR[:, 0])


@pytest.mark.parametrize("beside", ["velocity", "normal"])
def test_velocities_beside_positions_of_points_with_ids_are_left_out(put, beside):
    records = [
        {"frame": n, "id": k, "position": PAIR[n, 0, k].tolist(), beside: [1, 2, n]} for n in range(5) for k in range(4)
    ]
    take = read_take(put("moving.json", json.dumps(records)), recorded_unit="mm")
    np.testing.assert_allclose(take.positions, PAIR[:, 0])


@pytest.mark.parametrize(("key", "no", "yes"), [("occluded", 0, 1), ("hidden", "no", "yes"), ("valid", 1, 0)])
def test_point_that_is_hidden_throughout_is_dropped(put, key, no, yes):
    points = {
        name: {"position": PAIR[:, 0, k].tolist(), key: [yes if name == "d" else no] * 5}
        for k, name in enumerate("abcd")
    }
    take = read_take(put("hidden.json", json.dumps({"rate": 50, **points})), recorded_unit="mm")
    assert take.names == ("a", "b", "c")
    assert "5 positions are unseen, as flags or confidences say" in take.notices


def test_flags_by_which_nothing_is_seen_say_nothing(put):
    points = {name: {"position": PAIR[:, 0, k].tolist(), "confidence": [0] * 5} for k, name in enumerate("abcd")}
    assert read_take(put("unsure.json", json.dumps({"rate": 50, **points})), recorded_unit="mm").seen.all()
