"""Samples: each can be opened and is of the kind that its words say."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.app.samples import SAMPLES, compile_ahead, open_sample
from skelgen.errors import InputError
from skelgen.model import PointCloud, Trajectories


@pytest.mark.parametrize("sample", SAMPLES, ids=[sample.key for sample in SAMPLES])
def test_sample_is_a_take_that_moves(sample):
    project = open_sample(sample.key)
    assert isinstance(project.take, PointCloud if sample.key == "unlabelled" else Trajectories)
    assert project.name == f"{sample.title} (sample)"
    points = project.take.points if sample.key == "unlabelled" else project.take.positions.reshape(-1, 3)
    assert np.nanmax(np.ptp(points[~np.isnan(points[:, 0])], axis=0)) > 500  # mm


def test_unknown_sample_is_an_error_that_lists_them():
    with pytest.raises(InputError, match="there is no sample 'dog'; there are person, machine, animal, unlabelled"):
        open_sample("dog")


def test_what_is_compiled_ahead_runs_all_stages():
    compile_ahead()  # on takes of 60 frames: raises if a stage cannot work on them
