"""The 3-D view of strange takes, of every stage, of recordings, and of nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF
from PySide6.QtGui import QColor
from skelgen_gui.model.view_state import Shown
from skelgen_gui.project.session import Session
from skelgen_gui.view3d.colours import Sprites

from skelgen.model import PointCloud, Poses, Project, Trajectories


def cloud(n_frames):
    """An unlabelled take: two points a frame, none in every third."""
    counts = [0 if frame % 3 == 2 else 2 for frame in range(n_frames)]
    starts = np.concatenate([[0], np.cumsum(counts)])
    return PointCloud(np.arange(3.0 * starts[-1]).reshape(-1, 3), starts, np.arange(n_frames) / 100)


def labelled(positions):
    positions = np.asarray(positions, dtype=float)
    return Trajectories(positions, tuple(f"m{index}" for index in range(positions.shape[1])), 100.0)


def bodies():
    poses = np.broadcast_to(np.eye(4), (4, 2, 4, 4)).copy()
    poses[:, 1, 0, 3] = 300
    poses[1, 0] = np.nan
    return Poses(poses, ("left", "right"), 60.0)


STRANGE = {
    "a cloud": cloud(7),
    "a cloud without points": PointCloud(np.zeros((0, 3)), np.zeros(4, dtype=int), np.arange(3.0)),
    "a take without frames": labelled(np.zeros((0, 3, 3))),
    "one frame": labelled([[[0, 0, 0], [100, 0, 0], [0, 50, 900]]]),
    "one marker that rests": labelled(np.zeros((5, 1, 3))),
    "no marker": labelled(np.zeros((5, 0, 3))),
    "all unseen in a frame": labelled([[[0, 0, 0], [9, 0, 0]], [[np.nan] * 3] * 2]),
    "never anything seen": labelled(np.full((3, 2, 3), np.nan)),
    "markers far apart": labelled([[[0, 0, 0], [1e7, 0, 0], [0, -1e7, 1e-3]]]),
    "bodies": bodies(),
}


@pytest.mark.parametrize("take", STRANGE.values(), ids=STRANGE.keys())
def test_strange_takes_are_drawn_without_error_or_warning(qtlog, take, eye, hand, make_view):
    session = Session()
    view = make_view(session)
    session.open(Project(take))
    view.set_shown(Shown(names=True, follow=True, trail_seconds=2.0))
    session.compare_with(Project(cloud(2)))
    for frame in range(take.n_frames):
        session.show_frame(frame)
        eye.picture_of(view)
        hand.move(view, QPoint(450, 350))
        view.fit()
    for act in (view.fit_take, view.look_from_top, view.look_from_side):
        act()
        assert not eye.picture_of(view).isNull()
    assert [record.message for record in qtlog.records] == []


@pytest.mark.parametrize("stage", ["labels", "limbs", "joints", "skeleton"])
def test_every_stage_is_drawn(qtlog, walked, stage, eye, make_view):
    project, later = walked[0], ("limbs", "topology", "skeleton", "motion")
    first = {"labels": 0, "limbs": 1, "joints": 2, "skeleton": 4}[stage]
    session = Session()
    view = make_view(session)
    session.open(replace(project, **{f"_{name}": None for name in later[first:]}))
    assert session.project.has(stage)
    view.set_shown(eye.BARE)
    bare = eye.picture_of(view)
    view.set_shown(Shown())
    assert eye.changed(bare, eye.picture_of(view)) > 2000
    assert [record.message for record in qtlog.records] == []


@pytest.mark.parametrize(
    "path",
    ["arm/arm-4-4-4_clean_30fps.c3d", "human/markers_Squat2.trc", "wheelchair/racing_full.c3d", "hand/recording.tsv"],
)
def test_recordings_are_seen_whole_at_the_first_look(qtlog, recording, path, eye, make_view):
    session, take = Session(), recording(path)
    view = make_view(session)
    session.open(Project(take))
    for frame in np.linspace(0, take.n_frames - 1, 5).astype(int).tolist():
        session.show_frame(frame)
        eye.picture_of(view)
        seen = np.flatnonzero(take.seen[frame]).tolist()
        inside = [view.rect().contains(view.place_of_marker(marker).toPoint()) for marker in seen]
        assert np.mean(inside) > 0.9  # strays may lie outside
    assert [record.message for record in qtlog.records] == []


def test_without_a_project_the_view_is_empty(qtlog, eye, hand, make_view):
    view = make_view(Session())
    for act in (view.fit, view.fit_take, view.look_from_front):
        act()
    hand.click(view, QPointF(300, 300))
    assert eye.pixels(eye.picture_of(view))[300, 100].min() > 200
    assert [record.message for record in qtlog.records] == []


def test_a_small_window_is_painted(session, eye, make_view):
    view = make_view(session, size=(1, 1))
    assert not eye.picture_of(view).isNull()


def test_sprites_do_not_pile_up():
    from PySide6.QtGui import QImage, QPainter
    from skelgen_gui.view3d.colours import MOST_SPRITES, Style

    image = QImage(40, 40, QImage.Format.Format_RGB32)
    sprites, painter = Sprites(1.0), QPainter(image)
    for number in range(MOST_SPRITES + 50):
        sprites.draw(painter, (20.0, 20.0), 4.0, Style.RING, QColor(number % 256, number // 256, 0))
    painter.end()
    assert len(sprites._kept) <= MOST_SPRITES
