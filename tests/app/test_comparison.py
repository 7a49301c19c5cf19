"""Two results of a take are compared by their points, whatever their markers are called."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import skelgen
from skelgen.app.comparison import compare_results, comparison_sentences
from skelgen.cli import main
from skelgen.errors import InputError
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.simulation import simulate


@pytest.fixture(scope="module")
def rods():
    return skelgen.reconstruct(simulate("rods", n_frames=120, noise=0.2).take)


def test_a_result_is_the_same_as_itself_under_other_names(rods):
    renamed = skelgen.correct(rods, "rename", [rods.trajectories.names[0]], "other")
    found = compare_results(rods, renamed)
    assert all(match.other == match.marker and match.share == 1.0 for match in found.markers)
    assert found.other_of_limb == tuple(range(rods.limbs.n_limbs))
    assert [match.median for match in found.joints] == [0.0] * len(found.joints)
    assert [match.angle for match in found.joints] == pytest.approx([0.0] * len(found.joints), abs=1e-6)
    assert "9 of 9 markers" in comparison_sentences(renamed, found)[0]


def test_exchanged_frames_and_other_limbs_are_told(rods):
    first, *_, last = rods.trajectories.names
    swapped = skelgen.correct(rods, "swap", [first, last], frames=(0, 59))
    found = compare_results(rods, swapped)
    assert found.markers[0].share == pytest.approx(0.5, abs=0.02)
    assert found.other_of_limb == ()
    fewer = skelgen.reconstruct(skelgen.correct(rods, "delete", [last]))
    found = compare_results(rods, fewer)
    assert found.markers[-1].other == -1
    assert -1 in found.other_of_limb
    assert any(np.isnan(match.median) for match in found.joints)


def test_results_of_two_takes_are_refused(rods):
    with pytest.raises(InputError, match="two takes"):
        compare_results(rods, skelgen.reconstruct(simulate("rods", n_frames=60).take, until="labels"))


def test_the_turn_of_a_joint_does_not_hang_on_the_frames_of_its_limbs(rods):
    """One limb bends by 0.1 rad more in half of the frames; another's frame lies otherwise, which is no difference."""
    poses, edge = np.array(rods.motion.world_from_limb), rods.topology.edges[0]
    other = int(rods.topology.edges[1][1])
    poses[:, other, :3, :3] = poses[:, other, :3, :3] @ matrix_from_vector(np.array([0.4, 0.2, 0.0]))
    poses[::2, edge[1], :3, :3] = poses[::2, edge[1], :3, :3] @ matrix_from_vector(np.array([0.1, 0.0, 0.0]))
    found = compare_results(rods, replace(rods, _motion=replace(rods.motion, world_from_limb=poses)))
    assert [match.angle for match in found.joints] == pytest.approx([0.05, 0.0], abs=1e-5)


def test_the_command_says_the_same_in_tables_and_as_json(rods, tmp_path, capsys):
    one, other = tmp_path / "one.skelgen", tmp_path / "other.skelgen"
    skelgen.write(rods, one)
    skelgen.write(skelgen.reconstruct(skelgen.correct(rods, "delete", [rods.trajectories.names[-1]])), other)
    assert main(["compare", str(one), str(other)]) == 0
    assert "8 of 9 markers" in capsys.readouterr().out
    assert main(["compare", str(one), str(other), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [row["result"] for row in told["bodies"]] == ["first", "second"]
    assert told["markers"][-1]["other"] is None
    assert any(row["other"] is None for row in told["joints"])
