"""Takes that are small enough for all stages to run on them at once."""

from __future__ import annotations

import numpy as np
import pytest

import skelgen
from skelgen.model import Trajectories


@pytest.fixture
def waving():
    """Six markers on two limbs: the second swings about the z axis by a radian; 20 frames at 50 Hz."""
    arm = np.array([[100.0, 0, 0], [200, 30, 0], [300, 0, 40]])
    angles = np.sin(np.linspace(0, 6, 20))
    turned = np.stack([np.stack([np.cos(a) * arm[:, 0], np.sin(a) * arm[:, 0], arm[:, 2]], 1) for a in angles])
    still = np.tile(-arm, (20, 1, 1))
    return Trajectories(np.concatenate([still, turned], axis=1), tuple("abcdef"), 50.0, name="wave.csm")


@pytest.fixture
def wave(waving, tmp_path, monkeypatch):
    """The path of a take in an otherwise empty current folder."""
    monkeypatch.chdir(tmp_path)
    skelgen.write(waving, tmp_path / "wave.csm")
    return "wave.csm"
