"""A marker that falls off is left out from then on; what comes to rest with its limb is not."""

from __future__ import annotations

import numpy as np

from skelgen.geometry.falling import find_fall
from skelgen.stages.repair import repair_take
from tests.stages.conftest import FALL_FRAME

NEAR = 10  # frames; air and noise do not tell sooner that something falls


def test_a_marker_that_falls_off_is_left_out_from_then_on(fallen):
    take = fallen("head 1")
    marker = take.names.index("head 1")
    repair = repair_take(take)
    (finding,) = repair.findings
    assert (finding.kind, finding.names, finding.last_frame) == ("fallen", ("head 1",), take.n_frames - 1)
    assert abs(finding.first_frame - FALL_FRAME) < NEAR
    last_seen = np.flatnonzero(repair.trajectories.seen[:, marker])[-1]
    assert last_seen == finding.first_frame - 1
    assert "head 1 falls off" in " ".join(repair.trajectories.notices)


def test_markers_that_fall_together_are_a_body_that_does(fallen):
    take = fallen(*(name for name in fallen().names if name.startswith("head")))
    assert all(finding.kind != "fallen" for finding in repair_take(take).findings)


def test_what_stops_without_falling_has_not_fallen():
    seconds = np.linspace(0.0, 10.0, 1000)
    moved = 500.0 * np.clip(seconds - 5.0, 0.0, 0.5)
    path = np.stack([moved, moved, 0 * moved], axis=1) + np.random.default_rng(0).normal(0.0, 0.3, (1000, 3))
    assert find_fall(path, 100.0) is None
