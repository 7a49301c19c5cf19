"""What a capture tries before its cameras run must reach everything that is compiled."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from skelgen.capture.bodies import find_bodies
from skelgen.capture.live import PointFinder, trial_pair, trial_points
from skelgen.capture.reference_rig import reference_rig
from skelgen.capture.simulated_rig import simulated_rig
from skelgen.model.rig import CaptureSettings

LOADED = """
from skelgen.capture.simulated_rig import simulated_rig
from skelgen.capture.live import MotionCapture
from skelgen.capture.bodies.prediction import PredictionParameters
from numba.core.dispatcher import Dispatcher
import gc
source = simulated_rig("arm", n_frames=30)
pairs = [source.render(index)[0] for index in range(0, 30, 3)]
def loaded():
    parts = [one for one in gc.get_objects() if isinstance(one, Dispatcher) and "rendering" not in one.__module__]
    return {(one.__module__, one.__name__, len(one.overloads)) for one in parts if one.overloads}
with MotionCapture(source.settings, prediction=PredictionParameters(joints=%s), threads=False) as capture:
    before = loaded()
    for pair in pairs:
        capture.see(pair)
    print(*sorted(loaded() - before), sep="\\n")
"""


@pytest.mark.parametrize("joints", [False, True])
def test_no_function_is_left_to_be_loaded_by_the_first_pairs(joints):
    ran = subprocess.run(
        [sys.executable, "-c", LOADED % joints],
        capture_output=True,
        text=True,
        check=False,
        cwd=Path(__file__).parents[2],
    )
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.strip() == ""


def test_the_trial_shows_balls_of_which_two_touch():
    left, _, points = PointFinder(CaptureSettings(reference_rig())).find(trial_pair(reference_rig()))
    assert left.touching.sum() == 2
    assert len(points) >= 2


def test_the_trial_finds_every_target():
    for target in simulated_rig("arm", n_frames=1).settings.bodies:
        (body,) = find_bodies(trial_points(target), [target])
        np.testing.assert_allclose(body.world_from_body, np.eye(4), atol=1e-6)
