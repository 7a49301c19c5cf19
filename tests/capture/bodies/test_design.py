from __future__ import annotations

import numpy as np
import pytest

from skelgen.capture.bodies import BodyFinder
from skelgen.capture.bodies.design import (
    AmbiguousTargetError,
    check_targets,
    find_confusions,
    propose_move,
    propose_targets,
)
from skelgen.capture.parameters import BodyParameters
from skelgen.errors import InputError
from skelgen.model.rig import BodyTarget

PYRAMID = np.array([[0.0, 0, 0], [80, 0, 0], [80, 80, 0], [0, 80, 0], [40, 40, 50]])


def test_good_targets_are_accepted(targets):
    check_targets(targets)


def test_regular_target_is_refused_with_the_near_equal_distances():
    with pytest.raises(InputError) as error:
        BodyFinder([BodyTarget("pyramid", PYRAMID)])
    said = str(error.value)
    assert said.startswith("body 'pyramid' is ambiguous: its balls 1 2 3 4 can be taken for its balls ")
    assert "distances are near equal: 1-2 (80.0 mm) and 1-4 (80.0 mm)" in said


def test_targets_that_share_four_balls_are_refused(targets):
    other = targets[1].points.copy()
    other[:4] = targets[0].points[:4] + np.array([0.3, -0.2, 0.1])
    with pytest.raises(
        InputError, match="body 'twin' can be taken for 'hand': its balls 1 2 3 4 for the balls 1 2 3 4"
    ):
        check_targets([targets[0], BodyTarget("twin", other)])


def test_mirrored_target_is_another_one(targets):
    mirrored = BodyTarget("left hand", targets[0].points * [1, 1, -1])
    found = list(find_confusions(mirrored, [targets[0]], BodyParameters(distinct=0.5)))
    assert found == []


def test_confusion_tells_how_far_apart(targets):
    swapped = targets[0].points[[1, 0, 2, 3, 4]]
    (found,) = find_confusions(BodyTarget("same", swapped), [targets[0]])
    assert found.distance == pytest.approx(0.0, abs=1e-6)
    assert (found.balls, found.others) == ((0, 1, 2, 3), (1, 0, 2, 3))


def test_three_balls_are_refused():
    with pytest.raises(InputError, match="body 'few' has 3 balls; 4 must be seen"):
        check_targets([BodyTarget("few", np.eye(3) * 50)])


def test_balls_on_a_line_are_refused():
    line = np.array([[0.0, 0, 0], [30, 1, 0], [75, 0, 0], [140, 0, 1], [20, 60, 0]])
    with pytest.raises(InputError, match="the balls 1 2 3 4 of body 'wand' lie on one line"):
        check_targets([BodyTarget("wand", line)])


def test_proposed_targets_can_be_told_apart_and_are_near_the_wanted_ones():
    wanted = [BodyTarget(name, PYRAMID) for name in ("one", "two")]
    proposed = propose_targets(wanted, seed=1)
    check_targets(proposed)
    assert [target.name for target in proposed] == ["one", "two"]
    assert max(np.abs(target.points - PYRAMID).max() for target in proposed) < 8.1
    again = propose_targets(wanted, seed=1)
    np.testing.assert_array_equal(proposed[1].points, again[1].points)


def test_good_targets_are_kept(targets):
    assert propose_targets(targets) == targets


def test_target_that_cannot_be_helped_is_refused():
    with pytest.raises(InputError, match="no design for body 'few'"):
        propose_targets([BodyTarget("few", np.eye(3) * 50)])


def test_one_ball_moved_as_proposed_makes_a_target_good():
    square = BodyTarget("square", np.array([[0.0, 0, 0], [80, 0, 0], [80, 80, 0], [0, 80, 0], [40, 40, 50]]))
    with pytest.raises(AmbiguousTargetError) as caught:
        check_targets([square])
    assert caught.value.target is square
    move = propose_move(square)
    assert f"move ball {move.ball + 1}, which is" in move.sentence
    assert f"by {move.by:.0f} mm" in move.sentence
    others = np.delete(square.points, move.ball, axis=0)
    np.testing.assert_allclose(np.linalg.norm(others - square.points[move.ball], axis=1), move.before)
    from scipy.optimize import least_squares

    place = least_squares(  # where a ruler puts it
        lambda place: np.linalg.norm(others - place, axis=1) - move.after, square.points[move.ball] + [0, 0, 1.0]
    )
    assert place.cost < 1e-12
    moved = square.points.copy()
    moved[move.ball] = place.x
    check_targets([BodyTarget("square", moved)])


def test_a_move_heeds_the_targets_beside():
    old = np.array([[0.0, 0, 0], [61, 0, 0], [17, 72, 0], [-33, 25, 40], [40, 38, -52]])
    new = old.copy()
    new[4] = [-20.0, -55.0, 21.0]  # four balls are alike, which is all that may be seen
    check_targets([BodyTarget("new", new)])
    move = propose_move(BodyTarget("new", new), [BodyTarget("old", old)])
    assert move.ball < 4
    assert move.by >= 2.0


def test_a_cross_is_mended_by_no_single_move():
    cross = BodyTarget("cross", 50.0 * np.array([[0.0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]]))
    assert propose_move(cross) is None
