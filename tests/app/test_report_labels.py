"""What the report says of labels: every doubt with its reason and remedy, tracklets, and bounded pictures."""

from __future__ import annotations

import re

import numpy as np
import pytest

from skelgen.app.advice import REMEDIES
from skelgen.app.report import report_html
from skelgen.app.report.contents import report_content
from skelgen.app.report.labels import lanes
from skelgen.model import Labelling, PointCloud, Project, StageReport, Trajectories
from skelgen.model.labelling import DOUBT_KINDS, FINDING_KINDS, Agreement, Doubt, Finding, Tracklets

LARGEST_REPORT = 1_500_000  # bytes: a long take with many tracks is no larger than the view of a take, which is bounded
MOST_ROWS = 40


def build(n_frames=200, n_markers=6, doubts=(), n_tracks=12, **parts):
    """A take of points that are markers in turn, with tracks of equal length that went to them one after the other."""
    rng = np.random.default_rng(1)
    positions = rng.normal(size=(n_frames, n_markers, 3))
    markers = Trajectories(positions, tuple(f"<M{index}>" for index in range(n_markers)), 100.0)
    cloud = PointCloud(positions.reshape(-1, 3), np.arange(n_frames + 1) * n_markers, np.arange(n_frames) / 100.0)
    track = np.arange(n_tracks)
    first = track // n_markers * 7 % (n_frames - 5)
    tracklets = Tracklets(track, track % (n_markers + 1) - 1, first, first + 4, np.full(n_tracks, 5))
    left_out = rng.integers(0, 3, n_frames)
    labelling = Labelling(np.full((n_frames, n_markers), 0.95), tuple(doubts), (), left_out, tracklets, **parts)
    return Project(cloud).with_trajectories(markers, StageReport({"method": "rigidity"}), labelling)


def doubts(count, kind="rival"):
    return [
        Doubt(index % 6, index % 90, index % 90 + index, kind, 0, 0.5, f"reason <{index}>") for index in range(count)
    ]


def test_section_and_its_link_are_there():
    html = report_html(build())
    assert 'id="labels"' in html
    assert 'href="#labels"' in html


def test_project_that_does_not_know_how_sure_it_is_has_no_section():
    project = build()
    assert 'id="labels"' not in report_html(project.with_trajectories(project.trajectories, StageReport()))


@pytest.mark.parametrize("kind", DOUBT_KINDS)
def test_every_kind_of_doubt_has_a_remedy(kind):
    project = build(doubts=doubts(1, kind))
    ((_, doubt, remedy),) = report_content(project).labels.rows
    assert remedy == REMEDIES[kind]
    assert doubt.reason == "reason <0>"
    assert '<td class="w">0</td>' in report_html(project)


def test_the_longest_doubts_are_shown_in_order_of_time_and_the_rest_is_counted():
    labels = report_content(build(doubts=doubts(100))).labels
    firsts = [doubt.first_frame for _, doubt, _ in labels.rows]
    assert len(labels.rows) == MOST_ROWS
    assert labels.more == 100 - MOST_ROWS
    assert firsts == sorted(firsts)
    assert any(doubt.reason == "reason <99>" for _, doubt, _ in labels.rows)


@pytest.mark.parametrize("kind", FINDING_KINDS)
def test_errors_of_labels_stand_in_one_table_with_evidence_and_outcome(kind):
    finding = Finding(kind, ("<M0>", "<M1>"), 10, 20, "evidence <1>", "outcome <1>")
    html = report_html(build(findings=(finding,)))
    for text in ("Errors in the file", "&lt;M0&gt; → &lt;M1&gt;", "10 – 20", "evidence &lt;1&gt;"):
        assert text in html
    assert "outcome &lt;1&gt;" in html
    assert "Errors of the labels" not in report_html(build())


def test_names_and_reasons_are_text():
    html = report_html(build(doubts=doubts(3)))
    assert "<M0>" not in html
    assert "reason &lt;0&gt;" in html


def test_sentence_at_the_top_tells_of_doubts():
    assert any("not sure in 2 spans" in sentence for sentence in report_content(build(doubts=doubts(2))).sentences)


def test_other_method_is_compared():
    labels = report_content(build(classic=Agreement("sets", 9, 1000, 0.875))).labels
    assert labels.classic[0][:2] == ("rigidity", "6 markers")
    assert labels.classic[1][1:3] == ("9 markers", "1000")
    assert "87.5" in labels.classic[1][3]


def test_long_takes_with_many_tracks_stay_small():
    html = report_html(build(n_frames=20_000, n_tracks=30_000, doubts=doubts(500)))
    assert len(html) < LARGEST_REPORT


def test_one_frame_has_a_report():
    markers = Trajectories(np.eye(3)[np.newaxis], tuple("abc"), 100.0)
    cloud = PointCloud(np.eye(3), [0, 3], [0.0])
    tracklets = Tracklets([0], [0], [0], [0], [1])
    labelling = Labelling(np.ones((1, 3)), (), (), np.zeros(1, dtype=int), tracklets)
    assert 'id="labels"' in report_html(Project(cloud).with_trajectories(markers, StageReport(), labelling))


def test_tracks_of_a_lane_do_not_overlap():
    rng = np.random.default_rng(0)
    first = rng.integers(0, 500, 80)
    last = first + rng.integers(0, 60, 80)
    lane, n_lanes = lanes(first, last, room=2)
    for one in range(n_lanes):
        order = np.flatnonzero(lane == one)[np.argsort(first[lane == one])]
        assert (first[order][1:] > last[order][:-1] + 2).all()
    seen = (first[:, np.newaxis] <= np.arange(600)) & (np.arange(600) <= last[:, np.newaxis] + 2)
    assert n_lanes == seen.sum(axis=0).max()  # no fewer would do


def test_very_many_tracks_at_once_share_lanes():
    lane, n_lanes = lanes(np.zeros(5000, dtype=int), np.full(5000, 9), room=1)
    assert lane.max() < n_lanes == 200


def test_pictures_are_images_not_shapes():
    html = report_html(build(n_tracks=5000))
    assert len(re.findall(r"<rect", html)) < 100
