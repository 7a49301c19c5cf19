"""On dense screens pictures are sharp and the pointer means what it points at: the same tests, with more pixels."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent
WAIT = 300  # s
SHARP = """
    import sys
    import numpy as np
    from PySide6.QtGui import QImage
    from PySide6.QtTest import QTest
    from PySide6.QtWidgets import QApplication
    from skelgen_gui.project.deriving import Deriver
    from skelgen_gui.diagrams.graph_view import GraphView
    from skelgen_gui.diagrams.matrix_view import MatrixView
    from skelgen_gui.project.session import Session
    from skelgen_gui.widgets.painting import prepare_high_dpi
    from skelgen_gui.timeline.plot_view import Curves
    from skelgen_gui.timeline.timeline import Timeline
    from skelgen_gui.view3d.view import View3D
    import skelgen
    from skelgen.simulation import simulate

    prepare_high_dpi()
    app = QApplication([])
    session = Session()
    timeline = Timeline(session)
    views = {"3-D": View3D(session), "matrix": MatrixView(session), "graph": GraphView(session),
             "timeline": timeline, "curves": Curves(session, timeline.span)}
    session.open(skelgen.reconstruct(simulate("rods", n_frames=120, noise=0.2, dropouts=0.1).take))
    for name, view in views.items():
        view.resize(500, 400)
        view.show()
        while any(one.is_busy for one in view.findChildren(Deriver)):
            QTest.qWait(5)
        image = view.grab().toImage().convertToFormat(QImage.Format.Format_RGB32)
        pixels = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), -1, 4)[..., :3].astype(int)
        blocks = pixels[: image.height() // 2 * 2, : image.width() // 2 * 2]
        blocks = blocks.reshape(image.height() // 2, 2, image.width() // 2, 2, 3)
        fine = np.ptp(blocks, axis=(1, 3)).max(axis=2) > 40  # detail within two by two pixels
        print(name, image.width() / view.width(), int(fine.sum()))
    timeline.player.pause()
    for view in views.values():
        for one in view.findChildren(Deriver):
            one.wait()
"""


def run(arguments, factor):
    environment = {name: value for name, value in os.environ.items() if name != "DISPLAY"}
    environment |= {"QT_SCALE_FACTOR": factor, "QT_QPA_PLATFORM": "offscreen", "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, *arguments]
    return subprocess.run(command, capture_output=True, text=True, env=environment, timeout=WAIT, check=False)


def test_pictures_of_every_view_have_the_pixels_of_a_dense_screen():
    done = run(["-c", textwrap.dedent(SHARP)], "2")
    assert done.returncode == 0, done.stderr
    told = [line.rsplit(" ", 2) for line in done.stdout.splitlines()]
    assert [name for name, _, _ in told] == ["3-D", "matrix", "graph", "timeline", "curves"]
    for name, ratio, fine in told:
        assert float(ratio) == 2.0, name
        assert int(fine) > 100, name  # a picture of half the pixels that is enlarged has none


@pytest.mark.parametrize(("factor", "file"), [("1.5", "view3d/test_used.py"), ("2", "diagrams/test_matrix.py")])
def test_what_is_pointed_at_is_meant_on_dense_screens(factor, file):
    options = ["-q", "-n", "0", "--no-xvfb", "-p", "no:cacheprovider"]
    done = run(["-m", "pytest", *options, str(FOLDER / file)], factor)
    assert done.returncode == 0, done.stdout
