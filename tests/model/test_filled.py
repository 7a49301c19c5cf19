"""A filled take cannot pass for a measured one."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.errors import InputError
from skelgen.model import Trajectories
from skelgen.model.filled import Filled, PositionSource


@pytest.fixture
def parts():
    """A marker seen in two frames of four, filled in the third, empty in the last: the arguments of `Filled`."""
    measured = np.full((4, 1, 3), np.nan)
    measured[:2] = [[[1.0, 2.0, 3.0]], [[2.0, 3.0, 4.0]]]
    positions = measured.copy()
    positions[2] = 5.0
    source = np.array(
        [[PositionSource.MEASURED], [PositionSource.MEASURED], [PositionSource.LIMB], [PositionSource.NONE]]
    )
    return [Trajectories(measured, ("a",), 100.0), positions, source, np.array([[0.0], [0.0], [1.5], [np.nan]])]


def test_filled_positions_are_those_that_are_neither_measured_nor_empty(parts):
    assert Filled(*parts).filled[:, 0].tolist() == [False, False, True, False]


def test_complete_trajectories_say_in_a_notice_what_is_filled(parts):
    filled = Filled(*parts)
    assert filled.trajectories.notices == (filled.sentence,)
    assert filled.sentence.startswith("1 position is filled, not measured: 1 from the limb")


def test_a_changed_measurement_is_refused(parts):
    parts[1][0, 0, 0] += 1e-12
    with pytest.raises(InputError, match="changes measured positions"):
        Filled(*parts)


def test_a_filled_position_cannot_be_called_measured(parts):
    parts[2][2] = PositionSource.MEASURED
    with pytest.raises(InputError, match="only there"):
        Filled(*parts)


def test_a_position_without_source_is_refused(parts):
    parts[2][2] = PositionSource.NONE
    with pytest.raises(InputError, match="'none'"):
        Filled(*parts)
