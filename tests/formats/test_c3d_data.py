"""Frames behind the first one: byte for byte what ezc3d writes, without what it never gives back."""

from __future__ import annotations

import resource

import numpy as np
import pytest
from skelgen_formats.c3d.reader import write_points
from skelgen_formats.c3d.writer import write_frames

from skelgen.model import Trajectories
from skelgen.model.filled import Source

ezc3d = pytest.importorskip("ezc3d", reason="ezc3d is not installed")


def made(n_frames, n_markers, seed=0):
    rng = np.random.default_rng(seed)
    positions = rng.uniform(-2000, 2000, (n_frames, n_markers, 3))
    source = rng.integers(0, len(Source), (n_frames, n_markers))
    positions[source == Source.NONE] = np.nan
    return Trajectories(positions, tuple(f"m{index}" for index in range(n_markers)), 100.0), source


def written_by_ezc3d(take, source, path):
    """The whole file by ezc3d."""
    content = ezc3d.c3d()
    content["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    content["parameters"]["POINT"]["RATE"]["value"] = [take.rate]
    content["parameters"]["POINT"]["LABELS"]["value"] = list(take.names)
    content["data"]["points"] = np.concatenate([take.positions.T, np.ones((1, take.n_markers, take.n_frames))])
    if source is not None:
        masks = np.zeros((7, take.n_markers, take.n_frames), dtype=bool)
        masks[0] = source.T == Source.MEASURED
        residuals = np.where(masks[0], 1.0, np.where(source.T == Source.NONE, -1.0, 0.0))[np.newaxis]
        content["data"]["meta_points"] = {"residuals": residuals, "camera_masks": masks}
    content.write(str(path))
    return path.read_bytes()


@pytest.mark.parametrize(("n_frames", "n_markers"), [(1, 3), (2, 1), (32, 1), (64, 2), (997, 7)])
@pytest.mark.parametrize("is_told_apart", [True, False])
def test_files_are_those_of_ezc3d(tmp_path, n_frames, n_markers, is_told_apart):
    take, source = made(n_frames, n_markers)
    source = source if is_told_apart else None
    write_points(take, tmp_path / "ours.c3d", "mm", source)
    assert (tmp_path / "ours.c3d").read_bytes() == written_by_ezc3d(take, source, tmp_path / "whole.c3d")


def test_many_files_take_no_memory(tmp_path):
    take, source = made(4000, 30)
    write_points(take, tmp_path / "one.c3d", "mm", source)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(10):
        write_points(take, tmp_path / "one.c3d", "mm", source)
    grown = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
    assert grown < 2 * take.positions.nbytes  # ezc3d alone keeps twice as much of each file


def test_a_file_that_is_cut_off_is_refused(tmp_path):
    path = tmp_path / "cut.c3d"
    path.write_bytes(bytes(100))
    with pytest.raises(ValueError, match="cut off"):
        write_frames(path, np.zeros((2, 1, 3)), None)
