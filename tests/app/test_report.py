"""The report: complete in itself, honest about what is there, and safe against what files contain."""

import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from skelgen.app.drawing import measures
from skelgen.app.drawing.graph import find_cost_graph
from skelgen.app.report import report_html, write_report
from skelgen.app.report.contents import report_content
from skelgen.errors import WriteError
from skelgen.model import Limbs, PointCloud, Poses, Project, StageReport, Topology, Trajectories
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


def test_report_says_what_limbs_are_called_where_it_says_what_motion_does_not_determine(make_project):
    project = make_project(parents=(-1, 0, 0)).with_limb_names(("pelvis", "left thigh", "right thigh"))
    placed = tuple(replace(joint, is_placed_by_marker_set=True) for joint in project.skeleton.joints)
    project = replace(project, _skeleton=replace(project.skeleton, joints=placed))
    sentence = report_content(project).angles.sentences[0]
    assert sentence.startswith("the joint between pelvis and left thigh is placed by the marker set")


def test_the_curve_of_a_wheel_goes_on_over_full_turns(wheel_project):
    _, figure = report_content(wheel_project).angles.figures[0]
    assert ">3000<" in re.sub("[ ,\u2009\u202f\xa0]", "", figure)


def test_joints_and_limbs_are_called_by_their_names():
    project = build_project()
    names = tuple(f"<part {limb}>" for limb in range(project.limbs.n_limbs))
    text = report_html(project.with_limb_names(names))
    first, second = project.topology.edges[0].tolist()
    assert f"J0 &lt;part {first}&gt;-&lt;part {second}&gt;" in text
    assert not re.search("between limb [0-9]", text)
    half = project.with_limb_names([f"limb{limb}" if limb == second else name for limb, name in enumerate(names)])
    assert measures.joint_called(half, 0) == f"<part {first}>-limb{second}"
