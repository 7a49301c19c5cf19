from __future__ import annotations

import dataclasses
from xml.etree.ElementTree import Element, fromstring, tostring

import numpy as np
from skelgen_formats.articulated import add_choices, links_of, plain_names, posed, remarks_on_joints
from skelgen_formats.options import AS_FOUND, AS_MOVED, Options

from skelgen.geometry.rotations import matrix_from_vector
from skelgen.model import Joint

ROUNDING_MM = 1e-9


def test_names_become_plain_and_stay_distinct():
    names = plain_names(("LKNE", "a b", "a/b", "a_b_1", "a_b"))
    assert names[0] == "LKNE"
    assert len(set(names)) == 5
    assert all(set(name) <= set("LKNEab_0123456789") for name in names)


def test_links_put_every_limb_where_the_motion_has_it(jointed_project):
    apart = posed(links_of(jointed_project, "as-moved")) - jointed_project.motion.world_from_limb
    assert np.abs(apart).max() < ROUNDING_MM


def test_names_that_files_cannot_hold_are_kept_in_comments(jointed_project):
    names = ["left ---- hand", "Fuß", *jointed_project.skeleton.limb_names[2:]]
    document = Element("model")
    add_choices(document, jointed_project.with_limb_names(tuple(names)))
    text = tostring(document, encoding="unicode")
    assert "<!--Fu_ is 'Fuß'-->" in text
    assert "is 'left - hand'-->" in text
    assert len(fromstring(text)) == 0  # well-formed


def test_angles_are_0_in_the_reference_pose(jointed_project):
    motion = jointed_project.motion
    poses = np.tile(jointed_project.skeleton.reference_pose, (motion.n_frames, 1, 1, 1))
    still = dataclasses.replace(jointed_project, _motion=dataclasses.replace(motion, world_from_limb=poses))
    assert all((np.abs(link.angles) < 1e-12).all() for link in links_of(still, "as-moved"))


def test_loops_and_gimbal_positions_are_said(jointed_project):
    project = jointed_project
    ring = Joint(0, 4, np.zeros(3), np.zeros(3), "ball", None, np.ones(3))
    poses = project.motion.world_from_limb.copy()
    poses[3, 8, :3, :3] = poses[3, 3, :3, :3] @ matrix_from_vector(np.array([0, np.pi / 2, 0]))
    changed = dataclasses.replace(
        project,
        _skeleton=dataclasses.replace(project.skeleton, loops=(ring,)),
        _motion=dataclasses.replace(project.motion, world_from_limb=poses),
    )
    assert remarks_on_joints(project, Options(), by_three_angles=True) == ()
    loops, gimbal = remarks_on_joints(changed, Options(), by_three_angles=True)
    assert "loops are left out" in loops
    assert "limb3-limb8" in gimbal
    assert remarks_on_joints(changed, Options(), by_three_angles=False) == (loops,)


def test_where_types_are_kept_all_limbs_give_way_the_root_among_them(small_project):
    """Its hinge leaves its type by far; joint by joint, what lies behind would bear all of that."""
    root = next(link for link in links_of(small_project, AS_FOUND) if link.parent < 0)
    assert np.abs(root.translations - small_project.motion.world_from_limb[:, root.limb, :3, 3]).max() > 1.0
    free = next(link for link in links_of(small_project, AS_MOVED) if link.parent < 0)
    np.testing.assert_array_equal(free.translations, small_project.motion.world_from_limb[:, free.limb, :3, 3])
