"""What places a joint is decided once, by what the motion and what is usual of bodies leave open."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.errors import InputError
from skelgen.model import Joint
from skelgen.model.placed_joints import Place, count_places, place_of


def joint(kind, **facts):
    axis = [1.0, 0.0, 0.0] if kind == "hinge" else None
    return Joint(0, 1, np.zeros(3), np.zeros(3), kind, axis, np.ones(3), **facts)


@pytest.mark.parametrize(
    ("kind", "n_open", "n_usual", "place"),
    [
        ("ball", 0, 0, Place.MOTION),
        ("ball", 1, 0, Place.IN_PART),
        ("ball", 3, 2, Place.IN_PART),
        ("ball", 2, 2, Place.USUAL),
        ("ball", 3, 0, Place.CHOICE),
        ("hinge", 0, 0, Place.MOTION),
        ("hinge", 1, 0, Place.CHOICE_ALONG_AXIS),
        ("hinge", 1, 1, Place.USUAL_ALONG_AXIS),
        ("hinge", 2, 0, Place.IN_PART),
        ("hinge", 2, 1, Place.USUAL),
        ("hinge", 3, 0, Place.CHOICE),
    ],
)
def test_what_is_left_open_decides_what_places_a_joint(kind, n_open, n_usual, place):
    found = joint(kind, open_directions=n_open, usual_directions=n_usual)
    assert place_of(found) is place
    assert bool(place.words) != found.is_fully_determined
    assert place_of(joint(kind, open_directions=n_open, is_placed_by_marker_set=True)) is Place.MARKER_SET
    assert count_places([found, found])[place] == 2


def test_what_is_usual_tells_no_more_than_motion_leaves_open():
    with pytest.raises(InputError, match="usual in 2 of 1 open directions"):
        joint("ball", open_directions=1, usual_directions=2)
