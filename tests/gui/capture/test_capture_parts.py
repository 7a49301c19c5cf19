"""Parts of the Capture page: what is handed over, drawn, listed and numbered."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from skelgen_gui.capture.page import free_path
from skelgen_gui.capture.pictures import BOARD, LOOSE, Pictures, group_colour
from skelgen_gui.capture.results import MOST_NOTICES, Notices
from skelgen_gui.capture.space import Space
from skelgen_gui.model.viewpoint import cameras_of

from skelgen.app.capture_jobs.images import CameraImage
from skelgen.app.capture_jobs.messages import FoundInSpace
from skelgen.capture.calibration.chessboard import BoardView
from skelgen.capture.optics import project
from skelgen.capture.reference_rig import reference_rig
from skelgen.capture.values import Balls, FoundBody

BLACK = np.zeros((480, 640), np.uint8)


def balls_at(*centres):
    n = len(centres)
    return Balls(np.array(centres, float), np.ones(n), np.ones(n), np.ones(n), np.zeros(n, bool))


def body_of(points, name="wand"):
    return FoundBody(name, np.eye(4), np.eye(6), np.array(points), 0.1)


def test_pictures_show_balls_bodies_and_boards_in_their_colours(shown, has_colour):
    pair = shown(Pictures())
    corners = np.stack(np.meshgrid(np.arange(100.0, 500, 50), np.arange(100.0, 400, 50)), axis=-1).reshape(-1, 2)
    balls = CameraImage.of_balls(BLACK, balls_at((100, 100), (300, 200)), {0: body_of([0])}, np.array([0]))
    pair.show_images((balls, CameraImage.of_board(BLACK, BoardView(corners, 3.0))))
    for colour in (LOOSE, group_colour(0), BOARD):
        assert has_colour(pair, colour, least=5)


def test_a_bright_pixel_is_painted_at_its_place(shown):
    image = BLACK.copy()
    image[235:245, 315:325] = 255
    pair = shown(Pictures())
    pair.show_images((CameraImage(BLACK), CameraImage(image)))
    place = pair.place_of(1, 319.5, 239.5).toPoint()
    assert pair.grab().toImage().pixelColor(place).lightness() > 200
    assert pair.grab().toImage().pixelColor(pair.place_of(0, 319.5, 239.5).toPoint()).lightness() < 50


def test_frustums_end_at_the_corners_of_the_images():
    rig = reference_rig()
    for seeing, camera in zip(cameras_of(rig), (rig.left, rig.right), strict=True):
        lines = seeing.lines(500.0)
        bare = type(camera)(camera.width, camera.height, camera.matrix, camera_from_world=camera.camera_from_world)
        seen = project(bare, lines[:4, 1])
        offset = camera.matrix[:2, 2] - np.array(camera.size) / 2  # frustums have the principal point in the middle
        corners = np.array([[0, 0], [640, 0], [640, 480], [0, 480]]) + offset
        np.testing.assert_allclose(seen, corners, atol=0.01)
        np.testing.assert_allclose(lines[0, 0], np.linalg.inv(camera.camera_from_world)[:3, 3], atol=1e-9)


def test_space_shows_cameras_points_and_axes_of_bodies(qtbot, shown, has_colour):
    space = shown(Space(), 600, 400)
    space.show_rig(reference_rig())
    before = space.grab().toImage()
    pose = np.eye(4)
    pose[:3, 3] = (200, 0, 1000)
    body = FoundBody("wand", pose, np.eye(6), np.array([0]), 0.1)
    space.show_found(FoundInSpace(np.array([[200.0, 0, 1000], [300, 50, 900]]), np.array([0, -1]), {"wand": body}))
    assert space.grab().toImage() != before
    x_axis = next(iter(_axes(space)))
    assert has_colour(space, x_axis, least=5)


def _axes(space):
    from skelgen_gui.view3d.colours import Colours

    return Colours(space.palette()).axes


@pytest.mark.parametrize("key", [Qt.Key.Key_Left, Qt.Key.Key_Plus, Qt.Key.Key_1])
def test_space_is_moved_by_keys_and_fitted_again(qtbot, shown, key):
    space = shown(Space(), 600, 400)
    space.show_rig(reference_rig())
    before = space.grab().toImage()
    qtbot.keyClick(space, key)
    assert space.grab().toImage() != before


def test_space_is_turned_by_dragging(qtbot, shown):
    space = shown(Space(), 600, 400)
    space.show_rig(reference_rig())
    before = space.grab().toImage()
    qtbot.mousePress(space, Qt.MouseButton.LeftButton, pos=QPoint(300, 200))
    qtbot.mouseMove(space, QPoint(340, 220))
    qtbot.mouseMove(space, QPoint(380, 240))
    qtbot.mouseRelease(space, Qt.MouseButton.LeftButton, pos=QPoint(380, 240))
    assert space.grab().toImage() != before


def test_a_recording_gets_a_name_that_is_free(tmp_path):
    path = tmp_path / "take.mfml"
    assert free_path(path) == path
    path.touch()
    (tmp_path / "take-2.mfml").touch()
    assert free_path(path) == tmp_path / "take-3.mfml"


def test_notices_are_not_repeated_and_do_not_grow_for_ever(qtbot, shown):
    listed = shown(Notices())
    for _ in range(3):
        listed.add("the left image is black")
    assert listed.count() == 1
    for number in range(2 * MOST_NOTICES):
        listed.add(f"sentence {number}")
    assert listed.count() == MOST_NOTICES
    assert listed.item(0).text() == f"sentence {2 * MOST_NOTICES - 1}"


def test_a_picture_is_placed_within_the_widget(shown):
    pair = shown(Pictures(), 800, 300)
    pair.show_images((CameraImage(BLACK), CameraImage(BLACK)))
    for side in (0, 1):
        for corner in ((0, 0), (639, 479)):
            place = pair.place_of(side, *corner)
            assert pair.rect().toRectF().contains(QPointF(place))
