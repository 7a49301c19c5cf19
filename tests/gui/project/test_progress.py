"""One bar for a whole run: it never runs back, and ends when the run does."""

from __future__ import annotations

import pytest
from skelgen_gui.project.jobs import WholeProgress, seconds_left

PLAN = {"labels": 4.0, "limbs": 1.0, "joints": 1.0, "skeleton": 2.0}


def run(whole):
    """What a run tells: stages, parts within them that advance more than once; the shares."""
    shares = []
    for stage in PLAN:
        shares.append(whole.begin(stage))
        for part in (stage, "a part", "another"):
            shares.append(whole.begin(part))
            shares += [whole.advance(done) for done in (0.2, 0.9, 0.1, 1.0)]
    return shares


def test_the_share_never_falls_and_stays_below_all_until_the_end():
    shares = run(WholeProgress(PLAN))
    assert shares == sorted(shares)
    assert 0.9 < shares[-1] < 1.0


def test_each_stage_begins_where_the_weights_say():
    whole = WholeProgress(PLAN)
    assert [whole.begin(stage) for stage in PLAN] == [0.0, 0.5, 0.625, 0.75]


def test_a_job_without_a_plan_has_the_whole_bar():
    whole = WholeProgress()
    whole.begin("reading")
    assert whole.advance(0.5) == 0.5
    assert whole.advance(1.0) == 1.0


@pytest.mark.parametrize(("share", "elapsed", "left"), [(0.5, 10, 10), (0.8, 8, 2), (0.0, 10, None), (0.5, 1, None)])
def test_the_time_left_is_what_the_rest_takes_at_this_pace(share, elapsed, left):
    assert seconds_left(share, elapsed) == (None if left is None else pytest.approx(left))
