"""Four GigE Vision cameras of a room through viva-genicam; the fake ones run freely, each by its own clock."""

from __future__ import annotations

import numpy as np

FOUR = tuple(f"127.0.0.{k}" for k in range(1, 5))
READ = """
from skelgen.capture.room.sources import open_room_source
with open_room_source("gige:{names}?rate=20&skew=100&timeout=0.5&frames={frames}") as source:
    found["cameras"], found["rate"] = list(source.cameras), source.rate
    found["there"], found["shapes"], found["index"] = [], [], []
    for frame in source:
        found["there"].append([image is not None for image in frame.images])
        found["shapes"].append([list(image.shape) for image in frame.images if image is not None])
        found["index"].append(frame.index)
        if 0 <= {gone} <= frame.index:  # on a busy machine, one may be lost
            cameras[2].kill()
"""


def read(network, frames, gone=-1):
    return network(READ.format(names=",".join(FOUR), frames=frames, gone=gone), FOUR)


def test_four_cameras_send_images_of_one_moment(network):
    found = read(network, 15)
    assert found["cameras"] == list(FOUR)
    assert found["rate"] == 20.0
    assert found["index"] == sorted(set(found["index"]))
    there = [sum(row) for row in found["there"]]
    assert sum(there) > 0.7 * 4 * len(there)
    assert all(shape == [512, 512] for shapes in found["shapes"] for shape in shapes)


def test_one_of_four_that_is_switched_off_leaves_the_others(network):
    there = np.array(read(network, 30, gone=4)["there"])
    assert not there[-3:, 2].any()
    assert (
        there[-10:, [0, 1, 3]].mean(axis=0) > 0.5
    ).all()  # they run freely, so that one may fall between two moments
