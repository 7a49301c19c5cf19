"""FireWire cameras through the unmodified libdc1394 on a virtual bus."""

from __future__ import annotations

import numpy as np

LEFT, RIGHT = "00accef000001000", "00accef000001001"
READ = """
def numbers(pair):
    return [int(image[0, :4].copy().view("<u4")[0]) for image in (pair.left, pair.right)]
"""
MANY = 40  # pairs: enough for a camera that drifts by one frame to be seen


def test_both_cameras_start_on_one_frame_and_stay_together(bus):
    found = bus.run(
        READ
        + f"""
with open_source("firewire:?order=every&frames={MANY}") as source:
    found["source"] = [list(source.size), source.rate, source.n_frames]
    pairs = [(numbers(pair), pair.index, pair.dropped, pair.time) for pair in source]
found["numbers"], found["index"], found["dropped"], found["time"] = zip(*pairs)
found["skew"] = source.worst_skew
"""
    )
    assert found["source"] == [[640, 480], 60.0, MANY]
    assert found["numbers"] == [[k, k] for k in range(1, MANY + 1)]
    assert found["index"] == list(range(MANY))
    assert sum(found["dropped"]) == 0
    np.testing.assert_allclose(found["time"], np.arange(MANY) / 60, atol=130e-6)  # a cycle of the bus is 125 us
    assert found["skew"] < 1e-3
    assert found["stderr"] == ""


def test_a_rendered_scene_arrives_pixel_by_pixel(bus):
    scene = np.random.default_rng(3).integers(0, 256, (3, 2, 480, 640), np.uint8)
    bus.show(scene)
    found = bus.run(
        """
with open_source("firewire:?order=every&frames=4") as source:
    pairs = [(pair.left, pair.right) for pair in source]  # kept beyond the source's end: they are copies
    found["writeable"] = pairs[0][0].flags.writeable
np.save("IMAGES", pairs)
""".replace("IMAGES", str(bus.path.with_suffix(".npy")))
    )
    images = np.load(bus.path.with_suffix(".npy"))
    np.testing.assert_array_equal(images, scene[[1, 2, 0, 1]])  # the bus counts frames from 1
    assert not found["writeable"]


def test_a_slow_reader_gets_the_newest_pair_and_the_number_of_those_it_missed(bus):
    found = bus.run(
        READ
        + """
found["late"], found["pairs"] = [], []
with open_source("firewire:?buffers=8&frames=4") as source:
    for pair in source:
        found["late"].append(int(bus["sent"][0] + bus["lost"][0]) - numbers(pair)[0])
        found["pairs"].append([*numbers(pair), pair.index, pair.dropped])
        time.sleep(0.5)  # 30 frames: the ring of 8 is full long before
    found["n_dropped"] = source.n_dropped
"""
    )
    pairs = np.array(found["pairs"])
    np.testing.assert_array_equal(pairs[:, 0], pairs[:, 1])
    np.testing.assert_array_equal(np.diff(pairs[:, 0]), pairs[1:, 3] + 1)
    np.testing.assert_array_equal(pairs[:, 2] - pairs[0, 2], pairs[:, 0] - pairs[0, 0])
    assert found["n_dropped"] == pairs[:, 3].sum() > 60
    assert max(found["late"]) <= 5  # frames, with a computer that is busy; a full ring would be 20 and more


def test_a_frame_lost_by_one_camera_is_a_dropped_pair(bus):
    found = bus.run(
        READ
        + """
found["pairs"] = []
with open_source("firewire:?order=every&frames=30") as source:
    for pair in source:
        if pair.index == 5:
            bus["lose"] = 2
        found["pairs"].append([*numbers(pair), pair.index])
    found["n_dropped"] = source.n_dropped
"""
    )
    pairs = np.array(found["pairs"])
    np.testing.assert_array_equal(pairs[:, 0], pairs[:, 1])
    np.testing.assert_array_equal(pairs[:, 2], pairs[:, 0] - pairs[0, 0])
    assert found["n_dropped"] == 2


def test_named_cameras_are_left_and_right_as_named(bus):
    scene = np.stack([np.full((1, 480, 640), 10, np.uint8), np.full((1, 480, 640), 20, np.uint8)], 1)
    bus.show(scene)
    program = "with open_source('firewire:{},{}') as source:\n    pair = next(iter(source))\n"
    program += "    found['grey'] = [int(pair.left[0, 0]), int(pair.right[0, 0])]"
    assert bus.run(program.format(LEFT, RIGHT))["grey"] == [10, 20]
    assert bus.run(program.format(RIGHT, LEFT))["grey"] == [20, 10]


def test_shutter_and_gain_are_made_manual_and_set(bus):
    found = bus.run(
        """
from skelgen.capture.sources.firewire.library import GAIN, SHUTTER
with open_source("firewire:?shutter=300&rate=30") as source:
    camera = source.running[1]
    found["shutter"], found["gain"], found["rate"] = camera.feature(SHUTTER), camera.feature(GAIN), source.rate
"""
    )
    assert found == {"stderr": "", "shutter": [300, True], "gain": [32, True], "rate": 30.0}


def test_values_out_of_the_cameras_boundaries_are_refused(bus):
    assert "shutter is 0; camera 00accef000001000 (skelgen test virtual IIDC) takes 1 .. 4095" in bus.error(
        "firewire:?shutter=0"
    )
    assert "gain is 800; camera" in bus.error("firewire:?gain=800")
    assert "takes 16 .. 767" in bus.error("firewire:?gain=800")


def test_a_rate_or_size_that_no_camera_has_lists_what_there_is(bus):
    said = bus.error("firewire:?rate=50")
    assert "share no grey image size at 50 Hz: camera 00accef000001000" in said
    assert "has 640x480 at 15 30 60 120 Hz" in said
    assert "no grey image size 800x600: camera" in bus.error("firewire:?size=800x600")
    assert "speed is 500; it must be one of 100, 200, 400, 800 Mb/s" in bus.error("firewire:?speed=500")


def test_cameras_of_different_sizes_are_refused(bus):
    said = bus.error("firewire:", formats="0,1")
    assert "share no grey image size" in said
    assert "640x480 at 15" in said
    assert "800x600 at 15" in said


def test_one_camera_missing_is_said(bus):
    assert f"one camera is missing: only {LEFT} is on the IEEE 1394 bus" in bus.error("firewire:", nodes=1)
    assert "no FireWire camera 00accef000001005 can be opened" in bus.error(f"firewire:{LEFT},00accef000001005")


def test_three_cameras_must_be_chosen_from(bus):
    said = bus.error("firewire:", nodes=3)
    assert "3 cameras are on the IEEE 1394 bus" in said
    assert "name left and right" in said


def test_exhausted_bandwidth_is_told_in_the_bus_units(bus):
    assert "bandwidth exhausted: 2 x 1286 of 4915 units at 60 fps and 800 Mb/s" in bus.error(
        "firewire:", bandwidth=2000
    )
    said = bus.error("firewire:?speed=400")  # 2 x 2572 do not go into 4915
    assert "bandwidth exhausted: 2 x 2572 of 4915 units at 60 fps and 400 Mb/s" in said
    assert "or 800 Mb/s if the cameras know 1394b" in said


def test_after_a_failure_to_open_the_bus_is_free_again(bus):
    found = bus.run(
        """
for text in ("firewire:?speed=400", "firewire:?gain=800", "firewire:?frames=2"):
    try:
        with open_source(text) as source:
            found[text] = len(list(source))
    except SkelgenError as error:
        found[text] = "refused"
"""
    )
    assert found["firewire:?speed=400"] == found["firewire:?gain=800"] == "refused"
    assert found["firewire:?frames=2"] == 2


def test_cameras_without_1394b_run_at_400(bus):
    assert "does not know 1394b, which 800 Mb/s needs" in bus.error("firewire:?speed=800&rate=30", legacy=1)
    assert bus.error("firewire:?rate=30", legacy=1) == "no error"


def test_a_camera_unplugged_while_running_ends_cleanly_after_the_pairs_before(bus):
    found = bus.run(
        """
import os
found["n"], files = 0, len(os.listdir("/proc/self/fd"))
for turn in range(3):
    bus["unplugged"] = 0
    try:
        with open_source("firewire:?order=every") as source:
            for pair in source:
                found["n"] += 1
                if pair.index == 9:
                    bus["unplugged"] = 2
    except SkelgenError as error:
        found["error"] = str(error)
found["left open"] = len(os.listdir("/proc/self/fd")) - files
"""
    )
    assert found["error"] == "camera 00accef000001001 (skelgen test virtual IIDC) was unplugged"
    assert found["n"] >= 30
    assert found["left open"] == 0


def test_a_camera_that_falls_silent_is_told_after_the_time_out(bus):
    found = bus.run(
        """
try:
    with open_source("firewire:?order=every&timeout=0.4") as source:
        for pair in source:
            if pair.index == 4:
                bus["silent"], start = 1, time.monotonic()
except SkelgenError as error:
    found["error"], found["after"] = str(error), time.monotonic() - start
"""
    )
    assert "has sent no image for 0.4 s; check its cable and its trigger" in found["error"]
    assert found["after"] < 10  # it does not wait for ever, as the library would


def test_cameras_that_are_not_synchronous_are_refused_unless_allowed(bus):
    assert "are 4 ms apart, and 1 ms are allowed" in bus.error("firewire:", skew_us="0,4000")
    assert bus.error("firewire:?skew=5", skew_us="0,4000") == "no error"


def test_memory_does_not_grow_with_the_pairs(bus):
    found = bus.run(
        """
def resident():
    return int(open("/proc/self/statm").read().split()[1]) * 4096
with open_source("firewire:?order=every&frames=240") as source:
    sizes = [resident() for pair in source]
found["grown"] = max(sizes[-60:]) - max(sizes[60:120])
"""
    )
    assert found["grown"] < 4 * 640 * 480  # less than the images of two pairs
