"""The report: complete in itself, honest about what is there, and safe against what files contain."""

import base64
import io
import re
import struct
import zlib
from dataclasses import replace
from html.parser import HTMLParser

import matplotlib.image
import numpy as np
import pytest

from skelgen.app.drawing import measures, svg
from skelgen.app.drawing.graph import find_cost_graph
from skelgen.app.drawing.poses import find_views, left_side, reference_joints
from skelgen.app.drawing.scales import envelope, limb_colour, ramp_rgba, ticks
from skelgen.app.drawing.wording import as_many_as_fit, digits, duration, percent
from skelgen.app.report import report_html, write_report
from skelgen.app.report.contents import report_content
from skelgen.app.report.pictures import cost_figure, png_uri
from skelgen.app.report.skeleton import tree_figure
from skelgen.errors import WriteError
from skelgen.model import Limbs, PointCloud, Poses, Project, StageReport, Topology, Trajectories
from skelgen.progress import counted
from tests.app.known_project import N_FRAMES, NAMES, RATE, build_project

SECTIONS = {
    "labels": {"play", "input", "gaps", "run"},
    "limbs": {"play", "input", "gaps", "run", "limbs"},
    "joints": {"play", "input", "gaps", "run", "limbs", "tree", "joints", "lengths"},
    "skeleton": {
        *("play", "input", "gaps", "run", "limbs", "tree", "joints", "lengths"),
        *("pose", "residual", "deviations", "angles"),
    },
}


@pytest.fixture(scope="module")
def project():
    return build_project()


@pytest.fixture(scope="module")
def html(project):
    return report_html(project)


class Reader(HTMLParser):
    """Collects elements, ids and addresses, and checks that elements close in order."""

    EMPTY = frozenset({"meta", "col", "img", "br", "link", "input"})

    def __init__(self, html):
        super().__init__()
        self.open, self.tags, self.ids, self.addresses, self.texts = [], [], [], [], []
        self.feed(html)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.open += [] if tag in self.EMPTY else [tag]
        self.note(dict(attributes))

    def handle_startendtag(self, tag, attributes):
        self.tags.append(tag)
        self.note(dict(attributes))

    def note(self, attributes):
        self.ids += [attributes["id"]] if "id" in attributes else []
        self.addresses += [attributes[key] for key in ("href", "src") if key in attributes]
        assert not [key for key in attributes if key.startswith("on")]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)


def test_elements_close_in_order(html):
    assert Reader(html).open == []


def test_ids_are_unique(html):
    ids = Reader(html).ids
    assert len(ids) == len(set(ids))


def test_nothing_is_loaded_from_elsewhere(html):
    addresses = Reader(html).addresses
    assert addresses
    assert all(address.startswith(("#", "data:image/png;base64,")) for address in addresses)
    assert "@import" not in html
    assert set(re.findall(r"url\(([^)]*)\)", html)) <= {"#seen-mask"}


def test_navigation_leads_to_sections_that_exist(html):
    reader = Reader(html)
    links = {address[1:] for address in reader.addresses if address.startswith("#")}
    assert links == SECTIONS["skeleton"]
    assert links <= set(reader.ids)


def test_marker_named_script_is_text(html):
    reader = Reader(html)
    assert reader.tags.count("script") == 2  # those of the view that plays: its data, and what draws them
    assert any("<script>alert(1)</script>" in text for text in reader.texts)


def test_hostile_take_name_and_notice_are_text(html):
    texts = "".join(Reader(html).texts)
    assert "walk <1>.c3d" in texts
    assert "one marker was <empty>" in texts


@pytest.mark.parametrize("until", SECTIONS)
def test_only_sections_of_stages_that_ran_are_shown(until):
    html = report_html(build_project(until))
    sections = set(re.findall(r'<section id="(\w+)"', html))
    assert sections == SECTIONS[until]


@pytest.mark.parametrize(
    ("take", "is_played"),
    [
        (PointCloud(np.arange(12.0).reshape(4, 3), np.array([0, 1, 4]), np.array([0.0, 0.1])), True),
        (PointCloud(np.zeros((0, 3)), np.array([0]), np.zeros(0)), False),
        (Poses(np.tile(np.eye(4), (3, 2, 1, 1)), ("a", "b"), RATE), True),
        (Trajectories(np.full((3, 2, 3), np.nan), ("a", "b"), RATE), False),
        (Trajectories(np.zeros((0, 2, 3)), ("a", "b"), RATE), False),
    ],
    ids=["points", "no points", "poses", "all unseen", "no frames"],
)
def test_bare_take_has_a_report(take, is_played):
    wanted = {"input", "run", "play"} if is_played else {"input", "run"}
    assert set(re.findall(r'<section id="(\w+)"', report_html(Project(take)))) == wanted


def test_a_constant_number_of_points_is_told_once_and_many_notices_are_folded():
    cloud = PointCloud(np.arange(12.0).reshape(4, 3), np.array([0, 2, 4]), np.array([0.0, 0.1]))
    few, many = (replace(cloud, notices=tuple(map(str, range(number)))) for number in (12, 13))
    assert ("Points per frame", "2") in report_content(Project(cloud)).input.facts
    assert "<details open><summary>Notices of all stages (12)" in report_html(Project(few))
    assert "<details><summary>Notices of all stages (13)" in report_html(Project(many))


def test_take_without_frames_has_no_timeline():
    take = Trajectories(np.zeros((0, 2, 3)), ("a", "b"), RATE)
    project = Project(take).with_trajectories(take, StageReport())
    assert 'id="gaps"' not in report_html(project)


def test_markers_left_out_and_pairs_never_seen_together_are_shown():
    project = build_project("labels")
    deviation = np.full((12, 12), np.nan)
    limbs = Limbs(np.array([0, 0, 0, -1, 1, 1, 1, 1, 1, 1, 1, 1]), deviation)
    content = report_content(project.with_limbs(limbs, StageReport()))
    assert content.limbs.left_out == ["a&b"]
    assert content.sentences[-1] == "11 markers sit on 2 rigid limbs, 1 marker left out."


def test_a_section_is_there_once_its_stage_has_run():
    names = ("gaps", "limbs", "tree", "joints", "lengths", "angles", "pose", "deviations")
    found = {until: report_content(build_project(until)) for until in ("labels", "limbs", "joints", "skeleton")}
    n_found = {until: sum(getattr(content, name) is not None for name in names) for until, content in found.items()}
    assert n_found == {"labels": 1, "limbs": 2, "joints": 5, "skeleton": 8}
    assert found["joints"].joints.fitted == []


def test_single_limb_without_joints_has_a_report():
    project = build_project("labels")
    project = project.with_limbs(Limbs(np.zeros(12, dtype=int), np.zeros((12, 12))), StageReport())
    topology = Topology(
        np.array([-1]), np.zeros((1, 1)), np.zeros((N_FRAMES, 0, 3)), np.zeros(0, dtype=int), np.zeros(0), 0.0
    )
    html = report_html(project.with_topology(topology, StageReport()))
    assert 'id="tree"' not in html
    assert 'id="limbs"' in html


def test_perfect_fit_has_a_report():
    html = report_html(build_project(noise=0.0))
    assert "within 0\N{NO-BREAK SPACE}mm on average" in html
    assert "nan" not in re.sub("<script.*?</script>", "", html, flags=re.DOTALL)


def test_same_project_gives_same_bytes(html):
    assert report_html(build_project()) == html


def test_long_take_stays_small(tmp_path):
    names = tuple(f"marker {index}" for index in range(12))
    path = write_report(build_project(n_frames=20_000, names=names), tmp_path / "long.html")
    assert path.stat().st_size < 1_500_000  # below what mail and browsers mind; the curves alone would be megabytes


def test_report_that_cannot_be_written_is_an_error(project, tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(WriteError):
        write_report(project, tmp_path / "file" / "report.html")


def test_half_characters_in_names_do_not_stop_the_report(tmp_path):
    names = ("bad\udce9name", *NAMES[1:])
    path = write_report(build_project("labels", names=names), tmp_path / "report.html")
    assert "bad?name" in path.read_text(encoding="utf-8")


def test_changed_parameters_are_marked_and_defaults_are_not():
    from skelgen.app.configuration import parameters_class

    declared = parameters_class("limbs")()
    number = next(each for each in declared.declarations() if each.kind is int and not each.choices)
    values = declared.as_mapping() | {number.name: number.default + 1}
    project = build_project("limbs")
    project = project.with_limbs(project.limbs, StageReport(values))
    assert report_content(project).stages[1].changed == [number.name]


def test_spread_is_the_deviation_of_the_raw_distance(project):
    lengths = {(each.first, each.second): each for each in measures.joint_lengths(project)}
    assert lengths[0, 2].rigid == pytest.approx(250.0)
    assert lengths[0, 2].raw_mean == pytest.approx(250.0)
    assert lengths[0, 2].spread == pytest.approx(1.0)
    assert set(lengths) == {(0, 1), (0, 2)}


def test_deviations_are_those_of_the_residuals(project):
    rows = measures.marker_deviations(project.trajectories, project.limbs, project.motion, np.arange(12))
    known = project.motion.residuals[:, 3][~np.isnan(project.motion.residuals[:, 3])]
    assert rows[3].mean == pytest.approx(known.mean())
    assert rows[3].rms == pytest.approx(np.sqrt((known**2).mean()))
    assert rows[3].largest == known.max()
    assert rows[3].seen == pytest.approx(110 / 120)


def test_rival_of_a_joint_is_the_cheapest_other_edge_across_its_cut(project):
    joints = find_cost_graph(project).joints
    assert [joint.rival for joint in joints] == [(0, 2), (1, 3), (0, 2)]
    assert [joint.cost + joint.margin for joint in joints] == [50.0, 60.0, 50.0]


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


def test_report_says_what_limbs_are_called_where_it_says_what_motion_does_not_determine(make_project):
    project = make_project(parents=(-1, 0, 0)).with_limb_names(("pelvis", "left thigh", "right thigh"))
    placed = tuple(replace(joint, is_placed_by_marker_set=True) for joint in project.skeleton.joints)
    project = replace(project, _skeleton=replace(project.skeleton, joints=placed))
    sentence = report_content(project).angles.sentences[0]
    assert sentence.startswith("the joint between pelvis and left thigh is placed by the marker set")


def test_the_curve_of_a_wheel_goes_on_over_full_turns(wheel_project):
    _, figure = report_content(wheel_project).angles.figures[0]
    assert ">3000<" in re.sub("[ ,\u2009\u202f\xa0]", "", figure)


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


def test_joints_and_limbs_are_called_by_their_names():
    project = build_project()
    names = tuple(f"<part {limb}>" for limb in range(project.limbs.n_limbs))
    text = report_html(project.with_limb_names(names))
    first, second = project.topology.edges[0].tolist()
    assert f"J0 &lt;part {first}&gt;-&lt;part {second}&gt;" in text
    assert not re.search("between limb [0-9]", text)
    half = project.with_limb_names([f"limb{limb}" if limb == second else name for limb, name in enumerate(names)])
    assert measures.joint_called(half, 0) == f"<part {first}>-limb{second}"


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
