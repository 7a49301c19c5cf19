"""A tree that the user knows: its file, its names, its way into the pipeline."""

from __future__ import annotations

import numpy as np
import pytest

import skelgen
from skelgen.app.limb_names import read_hierarchy
from skelgen.cli import main
from skelgen.errors import FormatError, InputError
from skelgen.model import Poses
from skelgen.simulation import simulate


@pytest.fixture
def write(tmp_path):
    """`write(text)` gives the path of a file with it."""

    def put(text: str):
        path = tmp_path / "tree.csv"
        path.write_text(text, encoding="utf-8")
        return path

    return put


@pytest.fixture(scope="module")
def sensors():
    """Three rods in a chain, each with one body."""
    truth = simulate("rods", n_frames=120).truth
    return Poses(truth.world_from_limb, truth.limb_names, 100.0, "rods.poses.csv")


def test_lines_name_child_and_parent(write):
    path = write("# a tree\npelvis,\n\n left thigh , pelvis \n")
    assert read_hierarchy(path) == {"pelvis": "", "left thigh": "pelvis"}


@pytest.mark.parametrize(
    ("text", "place"), [(",pelvis\n", ":1"), ("a,b,c\n", ":1"), ("a,\nb,a\nb,\n", ":3"), ("# nothing\n", "")]
)
def test_bad_lines_are_format_errors(write, text, place):
    path = write(text)
    with pytest.raises(FormatError, match=f"{path.name}{place}"):
        read_hierarchy(path)


def test_missing_file_is_a_format_error(tmp_path):
    with pytest.raises(FormatError):
        read_hierarchy(tmp_path / "none.csv")


@pytest.mark.parametrize("name", ["human", "quadruped", "classic-human"])
def test_bodies_without_noise_hang_together_as_they_do(name):
    truth = simulate(name, seed=1, n_frames=200).truth
    found = skelgen.reconstruct(skelgen.Poses(truth.world_from_limb, truth.limb_names, 100.0), until="joints")
    edges, true = (
        {frozenset(edge) for edge in enumerate(parents.tolist()) if edge[1] >= 0}
        for parents in (found.topology.parents, truth.parents)
    )
    assert edges == true


def test_known_tree_becomes_the_skeletons(sensors):
    tree = {"middle rod": "rear rod", "front rod": "middle rod", "rear rod": ""}
    project = skelgen.reconstruct(sensors, hierarchy=tree)
    names = sensors.names
    expected = [names.index(tree[name]) if tree[name] else -1 for name in names]
    assert project.skeleton.parents.tolist() == expected
    assert "the hierarchy was given" in project.reports["joints"].notices


def test_known_root_becomes_the_skeletons(sensors):
    project = skelgen.reconstruct(sensors, root="front rod")
    assert project.skeleton.roots.tolist() == [sensors.names.index("front rod")]


def test_limbs_of_markers_are_numbered():
    take = simulate("rods", n_frames=120).take
    project = skelgen.reconstruct(take, n_limbs=3, hierarchy={"limb1": "limb0", "limb2": "limb1"})
    assert project.skeleton.parents.tolist() == [-1, 0, 1]


@pytest.mark.parametrize(
    ("hierarchy", "root"),
    [
        ({"tail": "rear rod"}, None),
        ({"rear rod": "front rod", "front rod": "rear rod"}, None),
        (None, "tail"),
        ({}, "tail"),
    ],
)
def test_impossible_trees_are_refused(sensors, hierarchy, root):
    with pytest.raises(InputError):
        skelgen.reconstruct(sensors, hierarchy=hierarchy, root=root)


def test_limbs_never_seen_together_cannot_be_joined(sensors):
    world = np.array(sensors.world_from_body)
    world[:60, 0], world[60:, 1] = np.nan, np.nan
    poses = Poses(world, sensors.names, 100.0)
    with pytest.raises(InputError, match="no 5 frames show both"):
        skelgen.reconstruct(poses, hierarchy={sensors.names[0]: sensors.names[1]})


def test_command_line_takes_poses_with_a_hierarchy(sensors, write, tmp_path):
    take = tmp_path / "rods.poses.csv"
    skelgen.write(sensors, take, "poses-csv")
    tree = write("rear rod,\nmiddle rod,rear rod\nfront rod,middle rod\n")
    assert main(["run", str(take), "-o", str(tmp_path / "out"), "--hierarchy", str(tree), "-q"]) == 0
    assert main(["run", str(take), "-o", str(tmp_path / "out"), "--root", "nobody", "-q"]) == 2
