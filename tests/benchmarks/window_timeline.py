"""Timeline and curves of two hours at 100 Hz; a part of ``window.py``."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np
from PySide6.QtWidgets import QApplication
from shown import verdict
from skelgen_gui.model.selection import Selection
from skelgen_gui.project.deriving import Deriver
from skelgen_gui.project.session import Session
from skelgen_gui.timeline.plot_view import Curves
from skelgen_gui.timeline.timeline import Timeline

import skelgen
from skelgen.model import Labelling, Motion, Project, StageReport, Topology, Trajectories
from skelgen.simulation import simulate

STRUCTURE, PIECE, COPIES = "rods", 2000, 360  # a piece of a take is repeated: only its length counts here
WANTED = 100.0  # ms, in which the window must answer
WIDTH, TIMELINE_HEIGHT, CURVES_HEIGHT = 1600, 300, 320
REPEATS = 50
ZOOM, ZOOMS = 1.25, 45  # from the whole take to the fewest frames

Row = tuple[str, str, str, str]


def timeline_rows(app: QApplication, project: Project, minutes: float) -> Iterator[Row]:
    """Processor time of painting, and the longest pause of the event loop while lanes and curves are derived."""
    session = Session()
    timeline = Timeline(session)
    curves = Curves(session, timeline.span)
    timeline.resize(WIDTH, TIMELINE_HEIGHT)
    curves.resize(WIDTH, CURVES_HEIGHT)
    timeline.show()
    curves.show()
    derivers = [*timeline.findChildren(Deriver), *curves.findChildren(Deriver)]
    long = long_project()
    what = f"{long.take.n_frames} frames x {long.trajectories.n_markers} markers"
    chosen = Selection(frozenset({0, 4}), joint=1)
    yield row(f"{what}: longest pause while it is opened", longest_pause(app, lambda: session.open(long), derivers))
    yield row(f"{what}: while a joint is selected", longest_pause(app, lambda: session.select(chosen), derivers))

    def paint() -> None:
        timeline.lane_view.repaint()
        timeline.ruler.repaint()
        curves.repaint()

    def play() -> None:
        session.show_frame((session.frame + 1) % session.n_frames)
        paint()

    def zoom() -> None:
        timeline.span.zoom(ZOOM, session.n_frames / 2)
        paint()

    yield row(f"{what}: a frame on", sum(milliseconds(play) for _ in range(REPEATS)) / REPEATS)
    yield row(f"{what}: zooming, the slowest of {ZOOMS} steps", max(milliseconds(zoom) for _ in range(ZOOMS)))


def long_project() -> Project:
    """Some frames of a simulated take, and what was found in them, over and over."""
    short = skelgen.reconstruct(simulate(STRUCTURE, n_frames=PIECE, noise=0.5, dropouts=0.05).take)
    before, motion, labelling, tree = short.trajectories, short.motion, short.labelling, short.topology
    took = StageReport()
    take = Trajectories(repeated(before.positions), before.names, before.rate)
    known = Labelling(repeated(labelling.confidence), labelling.doubts, (), repeated(labelling.left_out))
    raw = repeated(tree.raw_joint_positions)
    topology = Topology(tree.parents, tree.joint_costs, raw, tree.n_iterations, tree.values, tree.alpha)
    moved = Motion(
        repeated(motion.world_from_limb),
        repeated(motion.joint_positions),
        repeated(motion.marker_positions),
        repeated(motion.residuals),
        repeated(motion.limb_seen),
        motion.rate,
        repeated(motion.joint_std),
    )
    project = Project(take).with_trajectories(take, took, known).with_limbs(short.limbs, took)
    return project.with_topology(topology, took).with_skeleton(short.skeleton, moved, took)


def repeated(values: np.ndarray) -> np.ndarray:
    """Frames over and over."""
    return np.concatenate([values] * COPIES)


def longest_pause(app: QApplication, act: Callable[[], None], derivers: list[Deriver]) -> float:
    """Longest time [ms] in which the window does not answer, until all is shown."""
    pauses = [milliseconds(act, time.monotonic)]
    while any(deriver.is_busy for deriver in derivers):
        pauses.append(milliseconds(app.processEvents, time.monotonic))
        time.sleep(0.001)
    return max(*pauses, milliseconds(app.processEvents, time.monotonic))


def milliseconds(act: Callable[[], object], clock: Callable[[], float] = time.process_time) -> float:
    """Time that something takes."""
    start = clock()
    act()
    return 1000 * (clock() - start)


def row(figure: str, reached: float) -> Row:
    """Return a row for a time."""
    return f"{figure} [ms]", f"< {WANTED:g}", f"{reached:.1f}", verdict(reached < WANTED)
