"""Questions that labels leave open: one per pair of markers, what settles most first."""

import numpy as np

from skelgen.model.labelling import Doubt, Labelling, Tracklets
from skelgen.model.questions import questions_on

NAMES = ("LKNE", "LANK", "M7")


def labelling(*doubts, tracklets=None):
    confidence = np.ones((200, 3))
    for doubt in doubts:
        confidence[doubt.first_frame : doubt.last_frame + 1, doubt.marker] = doubt.confidence
    return Labelling(confidence, doubts, (), np.zeros(200, dtype=np.intp), tracklets)


def doubt(marker, frames, kind, rival=-1):
    return Doubt(marker, *frames, kind, rival, 0.5, "the place of the other fits as well")


def test_what_settles_most_is_asked_first():
    found = questions_on(labelling(doubt(0, (10, 49), "rival", 1), doubt(2, (0, 199), "piece", 0)))
    assert [(one.kind, one.markers, one.settles) for one in found] == [("same", (2, 0), 100.0), ("which", (0, 1), 20.0)]
    assert found[0].sentence(NAMES) == "are LKNE and M7 one marker? That settles about 100 positions"


def test_spans_of_one_doubtful_marker_are_one_question_that_points_to_the_longest():
    both = doubt(0, (10, 49), "rival", 1), doubt(0, (100, 159), "rival", 1)
    (found,) = questions_on(labelling(*both))
    assert (found.settles, found.first_frame, found.last_frame) == (50.0, 100, 159)
    assert found.spans == ((10, 49), (100, 159))
    assert "is LKNE in frames 10 to 49 and 100 to 159 not LANK?" in found.sentence(NAMES)


def test_of_two_markers_that_doubt_each_other_each_has_its_question():
    both = doubt(0, (10, 49), "rival", 1), doubt(1, (10, 109), "rival", 0)
    first, second = questions_on(labelling(*both))
    assert (first.markers, first.settles, first.last_frame) == ((1, 0), 50.0, 109)
    assert (second.markers, second.settles, second.last_frame) == ((0, 1), 20.0, 49)


def test_doubts_that_no_answer_settles_and_short_ones_are_not_asked():
    assert questions_on(labelling(doubt(0, (0, 99), "misfit"), doubt(1, (0, 9), "rival", 0))) == ()


def test_a_track_without_a_marker_is_asked_for():
    one = Tracklets(*(np.array(values) for values in ([0, 1], [0, -1], [0, 50], [199, 149], [200, 100])))
    (found,) = questions_on(labelling(tracklets=one))
    assert found.sentence(NAMES) == (
        "which marker is the point that is left out in frames 50 to 149? That settles about 50 positions"
    )


def test_a_track_without_a_marker_is_asked_for_by_its_first_point():
    parts = [np.array(values) for values in ([0, 1], [-1, -1], [0, 50], [99, 149], [100, 100])]
    places = np.array([[1.0, 2.0, 3.0], [4.25, 5.0, -6.0]])
    first, second = questions_on(labelling(tracklets=Tracklets(*parts, np.array([7, 3]), places)))
    assert (second.point, second.position) == (3, (4.25, 5.0, -6.0))
    assert "point 3 of frame 50 at (4.2, 5.0, -6.0) mm?" in second.sentence(NAMES)
    assert first.sentence(NAMES) != second.sentence(NAMES)
