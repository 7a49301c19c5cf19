"""Structures are trees of rigid limbs with enough markers to be found."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from skelgen.errors import InputError, ParameterError
from skelgen.simulation import Structure, find_structure, random_tree, rods_chain

NAMES = ["rods", "human", "human:4", "classic-human", "quadruped", "tree:8", "tree:25"]
SMALLEST_TRIANGLE = 100.0  # mm^2: three markers 10 mm off a line, well above the noise of any tracker


def widest_triangle(points: np.ndarray) -> float:
    """Twice the largest area that three of the points span."""
    edges = points - points[0]
    return float(np.linalg.norm(np.cross(edges[:, None], edges[None]), axis=2).max())


@pytest.mark.parametrize("name", NAMES)
def test_no_limb_has_all_its_markers_on_one_line_through_its_joint(name: str) -> None:
    for limb in find_structure(name, seed=1).limbs:
        points = np.vstack([np.zeros(3), limb.markers]) if len(limb.markers) == 2 else limb.markers
        assert widest_triangle(points) > SMALLEST_TRIANGLE, limb.name


@pytest.mark.parametrize("name", NAMES)
def test_joints_of_one_limb_lie_apart(name: str) -> None:
    structure = find_structure(name, seed=1)
    for index in range(structure.n_limbs):
        joints = [
            limb.joint for limb, parent in zip(structure.limbs, structure.parents, strict=True) if parent == index
        ]
        joints += [] if structure.parents[index] < 0 else [np.zeros(3)]
        gaps = [np.linalg.norm(a - b) for i, a in enumerate(joints) for b in joints[:i]]
        assert min(gaps, default=np.inf) > 40, structure.limb_names[index]


def test_the_rods_are_the_seeds_chain() -> None:
    rods = rods_chain()
    assert rods.parents.tolist() == [-1, 0, 0]
    assert [len(limb.markers) for limb in rods.limbs] == [3, 3, 3]
    assert np.allclose([np.linalg.norm(np.diff(limb.segment, axis=0)) for limb in rods.limbs], 350)


def test_a_human_has_fifteen_limbs_with_hinges_in_elbows_and_knees() -> None:
    body = find_structure("human:4")
    hinges = {limb.name for limb in body.limbs if limb.kind == "hinge"}
    assert (body.n_limbs, body.n_markers) == (15, 60)
    assert hinges == {"left forearm", "right forearm", "left shank", "right shank"}


def test_the_seeds_human_has_the_markers_of_its_tables() -> None:
    body = find_structure("classic-human")
    assert (body.n_limbs, body.n_markers) == (13, 31)
    assert Counter(len(limb.markers) for limb in body.limbs) == {2: 8, 3: 5}


def test_a_quadruped_has_at_least_fourteen_limbs() -> None:
    assert find_structure("quadruped").n_limbs >= 14


def test_a_random_tree_has_joints_of_all_kinds() -> None:
    assert {limb.kind for limb in random_tree(20, seed=0).limbs} == {"free", "ball", "universal", "hinge"}


def test_a_random_tree_depends_on_its_seed_alone() -> None:
    first, again, other = random_tree(6, 1), random_tree(6, 1), random_tree(6, 2)
    assert np.array_equal(first.marker_offsets, again.marker_offsets)
    assert first.n_markers != other.n_markers or not np.array_equal(first.marker_offsets, other.marker_offsets)


@pytest.mark.parametrize("name", ["", "cow", "tree:", "tree:x", "tree:1", "tree:999", "human:9", "rods:2"])
def test_an_unknown_structure_is_a_parameter_error(name: str) -> None:
    with pytest.raises(ParameterError):
        find_structure(name)


def test_a_child_before_its_parent_is_an_input_error() -> None:
    limbs = rods_chain().limbs
    with pytest.raises(InputError):
        Structure("upside down", limbs[::-1])
