"""JSON of records, people and points with frames or numbers of their own, and of several takes."""

from __future__ import annotations

import json

import numpy as np
import pytest
from skelgen_formats.registry import read_take

PLACES = [[[frame, 2.5, 3.5], [4.5, 5.5, frame + 0.25]] for frame in range(5)]
NAMES = ["knee", "toe"]


def took(number, n_frames):
    return {"trial": f"walk {number}", "fps": 50, "markers": NAMES, "positions": PLACES * n_frames}


@pytest.mark.parametrize(
    "value", [[took(1, 2), took(2, 2)], {"trials": [took(1, 2), took(2, 3)]}, {"a": took(1, 2), "b": took(2, 3)}]
)
def test_several_takes_are_not_joined(put, refused, value):
    assert "2 takes in one file" in refused(put("takes.json", json.dumps(value)))


def test_a_rate_in_each_frame_makes_no_takes(put):
    frames = [{"fps": 50 + n % 2, "time": n / 50, "people": [frame] * 9} for n, frame in enumerate(PLACES * 2)]
    assert read_take(put("frames.json", json.dumps(frames))).n_frames == len(frames)


@pytest.mark.parametrize("told", [{"fps": 50}, {"id": 0, "fps": 50}, {"header": {"seq": 0}, "rate": 50}])
def test_frames_with_a_rate_and_no_time_are_no_takes(put, told):
    points = [{"name": f"{n}", "position": [n, 2.5, 3.5]} for n in range(9)]
    frames = [{**told, "joints": points} for _ in range(5)]
    assert read_take(put("frames.json", json.dumps(frames)), recorded_unit="mm").positions.shape == (5, 9, 3)


def test_people_and_points_with_a_rate_each_are_no_takes(put):
    people = [{"person_id": n, "fps": 50, "positions": np.add(PLACES * 2, n).tolist()} for n in range(2)]
    assert read_take(put("people.json", json.dumps(people))).positions.shape == (10, 4, 3)
    points = [{"name": n, "rate": 50, "samples": [{"pos": one[k]} for one in PLACES * 2]} for k, n in enumerate(NAMES)]
    assert read_take(put("points.json", json.dumps(points))).names == ("knee", "toe")


@pytest.mark.parametrize("key", ["frame_ids", "frames"])
def test_people_with_frames_of_their_own_stand_on_those_of_all(put, key):
    people = {"1": {"joints3d": PLACES, key: [*range(5)]}, "7": {"joints3d": PLACES[:3], key: [3, 4, 6]}}
    take = read_take(put("vibe.json", json.dumps(people)))
    assert (take.n_frames, take.n_markers) == (6, 4)
    np.testing.assert_allclose(take.positions[3:, 2:], np.array(PLACES[:3]) * 1000)
    assert np.isnan(take.positions[:3, 2:]).all()
    assert np.isnan(take.positions[5, :2]).all()


def test_a_second_person_in_few_images_is_not_the_first_who_jumps(put):
    def record(n, person):
        return {"image_id": f"{n}.jpg", "idx": person, "pred_xyz_jts": np.add(PLACES[n], 9 * person).tolist()}

    records = [record(n, person) for n in range(5) for person in (1, 2) if person == 1 or n == 3]
    take = read_take(put("alphapose.json", json.dumps(records)))
    assert (take.n_frames, take.n_markers) == (5, 4)
    assert np.isfinite(take.positions[:, 2:]).all(axis=(1, 2)).tolist() == [False, False, False, True, False]


@pytest.mark.parametrize("key", ["joint_valid", "keypoint_scores", "keypointsVisible"])
def test_flags_of_points_hide_them(put, key):
    told = [[1 if n != 2 else 0, 1] for n in range(5)]
    records = [{"joint_positions": place, key: flags} for place, flags in zip(PLACES, told, strict=True)]
    take = read_take(put("valid.json", json.dumps(records)))
    assert np.isnan(take.positions).all(axis=2).tolist() == [[n == 2, False] for n in range(5)]


def test_scores_of_several_people_hide_their_points(put):
    def person(n, at):
        return {
            "keypoints": np.add(PLACES[n], at).tolist(),
            "keypoint_scores": [0.9, 0.0 if (n, at) == (3, 7) else 0.8],
        }

    frames = [{"frame_id": n + 1, "instances": [person(n, 0), person(n, 7)]} for n in range(5)]
    take = read_take(put("mmpose.json", json.dumps({"instance_info": frames})))
    assert np.argwhere(np.isnan(take.positions).all(axis=2)).tolist() == [[3, 3]]


def test_people_and_points_by_numbers_may_be_missing(put):
    """Those of a frame that has one of two are not taken for the first."""
    there = [("3", "7"), ("7",), ("3", "7"), ("7", "3"), ("3",)]
    frames = [{"poses": {k: {"xyz": np.add(PLACES[n], int(k)).tolist()} for k in keys}} for n, keys in enumerate(there)]
    take = read_take(put("people.json", json.dumps(frames)), recorded_unit="mm")
    for at, key in enumerate(("3", "7")):
        seen = [key in keys for keys in there]
        positions = take.positions[:, 2 * at : 2 * at + 2]
        assert np.isfinite(positions).all(axis=(1, 2)).tolist() == seen
        np.testing.assert_allclose(positions[seen], np.add(PLACES, int(key))[seen])
    points = [{"t": n / 50, "joints": {k: PLACES[n][int(k) > 3] for k in keys}} for n, keys in enumerate(there)]
    take = read_take(put("points.json", json.dumps(points)), recorded_unit="mm")
    assert take.names == ("point 3", "point 7")
    assert take.seen.tolist() == [["3" in keys, "7" in keys] for keys in there]


def test_numbers_of_frames_are_no_ids_of_people_or_points(put, refused):
    there = {"knee": [0, 1, 2, 3, 4], "toe": [0, 1, 3, 4]}
    markers = [{"name": n, "frames": {f"{f}": PLACES[f][0] for f in frames}} for n, frames in there.items()]
    assert "JSON" in refused(put("markers.json", json.dumps({"markers": markers})))
    people = {key: {f"{n + start}": {"joints": PLACES[n]} for n in range(5)} for key, start in (("1", 0), ("7", 3))}
    assert read_take(put("people.json", json.dumps(people))).positions.shape == (5, 4, 3)


def test_images_of_two_films_are_no_people(put):
    records = [{"file_name": f"{n}.mp4", "index": f, "joints": PLACES[f]} for n in "ab" for f in range(5)]
    assert read_take(put("films.json", json.dumps(records))).positions.shape == (10, 2, 3)


@pytest.mark.parametrize("n_people", [1, 2])
def test_a_state_of_a_person_is_that_of_all_its_points(put, n_people):
    """Of ZED, whose skeletons are guessed while it searches for them."""
    states = [["OK", "OK"], ["OK", "SEARCHING"], ["SEARCHING", "OK"], ["OK", "OK"]]
    points = np.random.default_rng(0).normal(size=(n_people, 4, 4, 3)).tolist()
    frames = [
        {"body_list": [{"id": k, "tracking_state": row[k], "keypoint": points[k][n]} for k in range(n_people)]}
        for n, row in enumerate(states)
    ]
    take = read_take(put("zed.json", json.dumps({f"{n}": frame for n, frame in enumerate(frames)})))
    expected = np.repeat(np.array(states) == "OK", 4, axis=1)[:, : 4 * n_people]
    np.testing.assert_array_equal(take.seen, expected)


@pytest.mark.parametrize("key", ["name", "joint"])
def test_points_of_people_are_told_by_their_names_in_any_order(put, key):
    names = ["hip", "knee", "toe", "heel"]
    points = np.random.default_rng(1).normal(size=(6, 2, 4, 3))
    orders = [
        [0, 1, 2, 3],
        [3, 1, 0],
        [2, 1, 3, 0],
        [0, 2, 3, 1],
        [1, 0, 2, 3],
        [3, 2, 1, 0],
    ]  # the second without a toe

    def person(frame, k):
        listed = [{key: names[at], "pos": points[frame, k, at].tolist()} for at in orders[(frame + k) % 6]]
        return {"id": k, "joints": listed}

    frames = [{"people": [person(n, k) for k in ((0, 1) if n > 1 else (1,))]} for n in range(6)]
    take = read_take(put("people.json", json.dumps(frames)), recorded_unit="mm")
    assert {*take.names} == {f"{k + 1}:{name}" for k in range(2) for name in names}
    for k, at in np.ndindex(2, 4):
        expected = points[:, k, at].copy()
        expected[[at not in orders[(n + k) % 6] or (k == 0 and n < 2) for n in range(6)]] = np.nan
        np.testing.assert_array_equal(take.positions[:, take.names.index(f"{k + 1}:{names[at]}")], expected)


def test_words_as_ids_are_names(put):
    frames = [
        {"t": n / 50, "markers": [{"id": NAMES[at], "position": PLACES[n][at]} for at in ((0, 1), (1, 0))[n % 2]]}
        for n in range(5)
    ]
    take = read_take(put("ids.json", json.dumps(frames)), recorded_unit="mm")
    assert take.names == tuple(NAMES)
    np.testing.assert_array_equal(take.positions, PLACES)


def test_quaternions_of_three_bodies_are_no_points(put):
    turn = [0.0, 0.0, 0.6, 0.8]
    bodies = [{"id": k + 10, "position": [k, 2.5, 3.5], "rotation": turn} for k in range(3)]
    take = read_take(put("bodies.json", json.dumps([{"t": n / 50, "bodies": bodies} for n in range(5)])))
    assert take.positions.shape == (5, 3, 3)
    assert "arrays left out: rotation" in take.notices


def test_ids_of_people_are_no_names_of_their_points(put):
    people = [{"id": word, "keypoints": np.add(PLACES[0], at).tolist()} for at, word in enumerate(("Ann", "Bob"))]
    value = {"keypoint_names": NAMES, "frames": [{"t": n / 50, "people": people} for n in range(5)]}
    assert read_take(put("ids.json", json.dumps(value))).names == ("1:knee", "1:toe", "2:knee", "2:toe")
    for frame in value["frames"]:
        del frame["people"][1:]
    assert read_take(put("one.json", json.dumps(value))).names == tuple(NAMES)


def test_ids_of_what_has_no_places_are_no_names_of_points(put):
    cameras = [{"id": word, "exposure": 2} for word in ("left", "right")]
    frames = [{"t": n / 50, "cameras": cameras, "positions": places} for n, places in enumerate(PLACES)]
    assert read_take(put("cameras.json", json.dumps(frames))).names == ("point 1", "point 2")


@pytest.mark.parametrize("others", [[0, 1], [4], [0, 1, 1, 2], []])
def test_states_that_differ_by_chance_are_no_names(put, others):
    """Of Kinect, whose joints have a state each; few of a person are listed, or one twice."""
    names, points = ["hip", "knee", "toe", "heel", "tail"], np.random.default_rng(2).normal(size=(6, 2, 5, 3))

    def person(n, k):
        listed = others if (n, k) == (0, 0) else range(4)
        state = ("Tracked", "Inferred")
        return [{"state": state[at % 2], "joint": names[at], "pos": points[n, k, at].tolist()} for at in listed]

    frames = [{"people": [{"id": k, "joints": person(n, k)} for k in range(2)]} for n in range(6)]
    take = read_take(put("people.json", json.dumps(frames)), recorded_unit="mm")
    for k, at in np.ndindex(2, 4):
        name = f"{k + 1}:{names[at] if others else f'point {at + 1}'}"
        is_seen = [(n, k) != (0, 0) or others.count(at) == 1 for n in range(6)]
        expected = np.where(np.reshape(is_seen, (6, 1)), points[:, k, at], np.nan)
        np.testing.assert_array_equal(take.positions[:, take.names.index(name)], expected)


def test_one_word_for_all_points_is_no_name(put):
    joints = [{"label": "joint", "position": place} for place in PLACES[0]]
    frames = [{"people": [{"id": k, "joints": joints} for k in range(2)]} for _ in range(5)]
    names = read_take(put("labels.json", json.dumps(frames))).names
    assert names == tuple(f"{k}:point {n}" for k in (1, 2) for n in (1, 2))


def test_words_deep_in_people_are_left_alone(put):
    people = [{"id": k, "keypoints": PLACES[k], "hands": [{"signs": ["a", "b"]}]} for k in range(2)]
    frames = [{"t": n / 50, "people": people} for n in range(5)]
    assert read_take(put("signs.json", json.dumps(frames))).positions.shape == (5, 4, 3)


@pytest.mark.parametrize(("owner", "n_seen"), [("gaze", 10), ("body", 8)])
def test_flags_of_something_else_hide_no_points(put, owner, n_seen):
    frames = [{"body": {"joints": places}, "gaze": {"ray": 1}} for places in PLACES]
    for n, frame in enumerate(frames):
        frame[owner]["valid"] = n != 2
    assert read_take(put("gaze.json", json.dumps(frames))).seen.sum() == n_seen
