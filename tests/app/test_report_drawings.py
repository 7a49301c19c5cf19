"""What the report draws: curves, views of bodies, the tree, costs, and the pieces that pictures are made of."""

import base64
import io
import re
import struct
import zlib
from dataclasses import replace

import matplotlib.image
import numpy as np
import pytest

from skelgen.app.drawing import measures, svg
from skelgen.app.drawing.poses import find_views, left_side, reference_joints
from skelgen.app.drawing.scales import envelope, limb_colour, ramp_rgba, ticks
from skelgen.app.drawing.wording import as_many_as_fit, digits, duration, percent
from skelgen.app.report.pictures import cost_figure, png_uri
from skelgen.app.report.skeleton import tree_figure
from skelgen.progress import counted
from tests.app.known_project import build_project


@pytest.mark.parametrize("n_frames", [1, 7, 760, 761, 5000])
def test_envelope_loses_no_extreme_and_no_gap(n_frames):
    values = np.random.default_rng(n_frames).normal(size=n_frames)
    values[: n_frames // 3] = np.nan
    centres, low, high = envelope(values, 760)
    assert len(centres) == min(n_frames, 760)
    assert np.nanmax(high) == np.nanmax(values)
    assert np.nanmin(low) == np.nanmin(values)
    assert np.isnan(low[0]) == np.isnan(values[: max(n_frames // 760, 1)]).all()


def test_branches_stay_together_in_the_order_of_limbs():
    assert measures.branch_order(np.array([-1, 0, 0, 1, 2, -1])) == [0, 1, 3, 2, 4, 5]


def test_vertical_is_the_axis_along_which_the_lowest_marker_rests():
    rng = np.random.default_rng(1)
    body = rng.normal(size=(20, 3)) * [300, 600, 100]
    body[:, 1] -= body[:, 1].min()
    walk = np.cumsum(rng.normal(size=(200, 1, 3)) * [30, 0, 30], axis=0)
    front, side = find_views(body, body + walk)
    assert front.up.tolist() == [0.0, 1.0, 0.0]
    assert abs(front.across[0]) > abs(front.across[2])
    axes = np.stack([side.across, side.up, side.toward])
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)


def test_front_of_a_body_with_sides_is_what_faces_it_however_wide_it_is():
    """A body that reaches forward along x is wider from the side than from the front."""
    body = np.random.default_rng(1).uniform([0, -150, 0], [900, 150, 1700], (30, 3))
    walk = np.arange(50)[:, np.newaxis, np.newaxis] * [20.0, 10.0, 0.0]
    front, side = find_views(body, body + walk, np.array([0.0, 1.0, 0.0]))
    assert (front.title, front.across.tolist(), front.toward.tolist()) == ("Front view", [0, 1, 0], [1, 0, 0])
    assert front.up.tolist() == side.up.tolist() == [0, 0, 1]


def test_sides_of_a_body_are_those_of_limbs_that_hang_on_one(make_project):
    skeleton = make_project(parents=(-1, 0, 0)).skeleton
    left, right = reference_joints(skeleton)
    sides = replace(skeleton, limb_names=("pelvis", "left thigh", "right thigh"))
    np.testing.assert_allclose(left_side(sides), (left - right) / np.linalg.norm(left - right))
    assert left_side(skeleton) is None


def test_vertical_is_the_axis_along_which_nothing_lies_below_the_floor():
    """A rider who is shaken along y, 400 mm above the floor, and never leaves the place along x and z."""
    rng = np.random.default_rng(0)
    body = rng.uniform([-600, 400, -400], [600, 1000, 400], (12, 3))
    shaken = np.zeros((100, 1, 3))
    shaken[:, 0, 1] = rng.uniform(-100, 100, 100)
    assert find_views(body, body + shaken)[0].up.tolist() == [0, 1, 0]


def test_png_is_read_back_as_the_same_pixels():
    pixels = np.random.default_rng(2).integers(0, 256, size=(5, 7, 4), dtype=np.uint8)
    data = base64.b64decode(png_uri(pixels).split(",")[1])
    read = matplotlib.image.imread(io.BytesIO(data), format="png")
    np.testing.assert_array_equal(np.round(read * 255).astype(np.uint8), pixels)


def test_png_chunks_carry_right_checksums():
    data = base64.b64decode(png_uri(np.zeros((2, 3), dtype=np.uint8)).split(",")[1])[8:]
    while data:
        (length,) = struct.unpack(">I", data[:4])
        assert struct.unpack(">I", data[8 + length : 12 + length])[0] == zlib.crc32(data[4 : 8 + length])
        data = data[12 + length :]


def test_limb_colours_differ_from_each_other_and_between_pages():
    colours = [limb_colour(limb, dark=dark) for limb in range(30) for dark in (False, True)]
    assert len(set(colours)) == len(colours)
    assert all(re.fullmatch("#[0-9a-f]{6}", colour) for colour in colours)


def test_unknown_cells_are_grey_and_large_ones_fade():
    small, large, unknown = ramp_rgba(np.array([0.0, 1.0, np.nan]))
    assert small[3] > large[3]
    assert unknown[:3].tolist() == [128, 128, 128]


@pytest.mark.parametrize(
    ("low", "high", "wanted"), [(0.0, 1.0, 4), (0.0, 3e-7, 4), (0.0, 12345.0, 8), (-5.0, 5.0, 4), (2.0, 2.0, 4)]
)
def test_ticks_are_few_and_inside(low, high, wanted):
    values = ticks(low, high, wanted)
    assert 1 <= len(values) <= wanted + 1
    assert all(low - 1e-9 <= value <= high + 1e-9 for value in values)


def test_svg_attributes_are_escaped():
    assert str(svg.text(0, 0, "<b>", 'x"y')) == '<text x="0" y="0" text-anchor="start" class="x&#34;y">&lt;b&gt;</text>'


def test_numbers_read_well():
    assert [digits(value) for value in (520.703, 0.00123, -4.0, 0.0, np.nan, 2.5e-9)] == [
        *("521", "0.00123", "−4.00", "0", "–", "< 10⁻⁵")
    ]
    assert counted(1, "limb") == "1 limb"
    assert duration(59.999).endswith("s")
    assert percent(0.99999) != percent(1.0)
    assert as_many_as_fit(["LANK", "LHEE", "LTOE"], 13) == "LANK, LHEE +1"


def test_in_the_tree_the_root_names_the_body_and_other_limbs_stand_without_it():
    project = build_project()
    names = [f"body2: left thigh {limb}" for limb in range(project.limbs.n_limbs)]
    tree = str(tree_figure(project.with_limb_names(names), measures.joint_lengths(project)))
    shown = re.findall(r'class="strong"[^>]*>([^<]*)<', tree)
    assert [limb for limb, name in enumerate(shown) if ": " in name] == project.topology.roots.tolist()


def test_boxes_of_the_tree_show_the_names_of_limbs_that_have_one():
    project = build_project()
    names = ("left upper arm", *project.limbs.names[1:])
    tree = str(tree_figure(project.with_limb_names(names), measures.joint_lengths(project)))
    assert re.findall(r'<text [^>]*class="strong">([^<]*)<', tree) == ["left upper arm", *["3 markers"] * 3]


def test_joints_of_the_tree_that_motion_leaves_open_are_coloured_and_say_who_places_them():
    project = build_project()
    first, second, *others = (replace(joint, open_directions=0) for joint in project.skeleton.joints)
    placed = (replace(first, open_directions=3), replace(second, is_placed_by_marker_set=True), *others)
    skeleton = replace(project.skeleton, joints=placed)
    tree = str(tree_figure(replace(project, _skeleton=skeleton), measures.joint_lengths(project)))
    assert "<title>joint J0: its place is a choice</title>" in tree
    assert "<title>joint J1: placed by the marker set</title>" in tree
    assert tree.count('class="small doubtful"') == 2


def test_colours_of_costs_begin_at_the_dearest_joint_that_is_kept():
    project = build_project()
    parents = project.topology.parents
    costs = np.full((len(parents), len(parents)), 4e9)
    for child, parent in enumerate(parents.tolist()):
        costs[child, parent] = costs[parent, child] = 7.0
    drawn = cost_figure(replace(project, _topology=replace(project.topology, joint_costs=costs)))
    assert "≤ 7<" in drawn
