"""How fast and how hidden an unlabelled body may be: ``python tests/benchmarks/frontier.py --picture frontier.svg``.

Random trees of ten limbs whose markers are 25 mm apart are simulated at several speeds with several parts of them
hidden, in pieces of 0.35 s, with 0.3 mm noise and false points; each is labelled from nothing. Beside it stands IDF1
when the skeleton of a labelled take of the same tree is known. A line runs where IDF1 first falls below 0.97,
which is how much may be hidden at each speed. A seed takes some two minutes on one core.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from labels import Result, Take, idf1
from shown import show, show_machine
from threadpoolctl import threadpool_limits

import skelgen
from skelgen.app.pipeline import run_stages
from skelgen.model import Project
from skelgen.simulation import simulate
from skelgen.stages.labels.point_labels import find_points
from skelgen.stages.subject.labels import label_by_subject

SPEEDS, HIDDEN = (0.5, 1.0, 2.0, 3.0), (0.05, 0.1, 0.2, 0.3, 0.4, 0.5)
PIECE = 0.35  # s, mean length of what is lost
OPTIONS = {"n_frames": 1000, "spacing": 25.0, "noise": 0.3, "ghosts": 0.2, "labelled": False}
WANTED = 0.97  # IDF1
TITLES = ("from nothing", "skeleton known")
CELL, MARGIN = 90, 100  # px


def main() -> None:
    """Print both tables, and draw them if asked to."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--speeds", type=float, nargs="+", default=SPEEDS)
    parser.add_argument("--hidden", type=float, nargs="+", default=HIDDEN)
    parser.add_argument("--picture", type=Path, help="SVG to write")
    wanted = parser.parse_args()
    show_machine()
    begin = time.perf_counter()
    with threadpool_limits(limits=1):
        speeds = [median_speed(speed) for speed in wanted.speeds]
        scores = np.moveaxis([[mean_scores(s, h, wanted.seeds) for h in wanted.hidden] for s in wanted.speeds], 2, 0)
    for title, table in zip(TITLES, scores, strict=True):
        most = frontier(table, wanted.hidden)
        rows = [
            (f"{speed:.1f}", *(f"{value:.3f}" for value in line), share_text(share, wanted.hidden))
            for speed, line, share in zip(speeds, table, most, strict=True)
        ]
        columns = ("speed [m/s]", *(f"{100 * part:.0f} % hidden" for part in wanted.hidden), f"{WANTED:g} up to")
        show(f"IDF1, {title}", columns, rows)
    print(f"{time.perf_counter() - begin:.0f} s")
    if wanted.picture:
        wanted.picture.write_text(picture(scores, speeds, wanted.hidden), encoding="utf-8")


def median_speed(speed: float) -> float:
    """Median speed [m/s] of the markers of a tree that moves so many times as fast as usual."""
    take = simulate("tree:10", seed=0, speed=speed, **OPTIONS | {"ghosts": 0.0, "noise": 0.0, "labelled": True}).take
    return float(np.median(np.linalg.norm(np.diff(take.positions, axis=0), axis=2)) * take.rate / 1000)


def mean_scores(speed: float, hidden: float, n_seeds: int) -> np.ndarray:
    """What `scores_of` gives in the mean over seeds."""
    return np.mean([scores_of(speed, hidden, seed) for seed in range(n_seeds)], axis=0)


def frontier(table: np.ndarray, hidden: Sequence[float]) -> list[float]:
    """Part that may be hidden at each speed, straight between the parts tried.

    It is infinite where IDF1 stays at `WANTED`, and 0 where it never gets there.
    """
    found = []
    for line in table:
        below = np.flatnonzero(line < WANTED)
        if not len(below):
            found.append(np.inf)
        elif below[0] == 0:
            found.append(0.0)
        else:
            ends = slice(below[0] - 1, below[0] + 1)
            found.append(float(np.interp(WANTED, line[ends][::-1], np.asarray(hidden)[ends][::-1])))
    return found


def share_text(share: float, hidden: Sequence[float]) -> str:
    """A part of the frontier in words."""
    if np.isinf(share):
        return f"over {100 * hidden[-1]:.0f} %"
    return f"{100 * share:.0f} %" if share else f"under {100 * hidden[0]:.0f} %"


def scores_of(speed: float, hidden: float, seed: int) -> tuple[float, float]:
    """IDF1 from nothing, and with the skeleton of a labelled take in which the same tree moves otherwise."""
    lost = {"dropouts": hidden, "dropout_seconds": PIECE} if hidden else {}
    made = simulate("tree:10", seed=seed, speed=speed, **lost, **OPTIONS)
    take = Take(made.take, made.truth.marker_of_point, made.truth)
    blind = run_stages(Project(made.take), until_stage="labels").trajectories
    other = simulate("tree:10", seed=seed, **OPTIONS | {"ghosts": 0.0, "labelled": True, "n_frames": 600})
    skeleton = skelgen.reconstruct(other.take).skeleton
    known = label_by_subject(made.take, skeleton, other.take).marker_of_point
    found = (find_points(made.take, blind.positions), known)
    return tuple(idf1(take, Result(marker_of_point, 0.0)) for marker_of_point in found)


def picture(scores: np.ndarray, speeds: Sequence[float], hidden: Sequence[float]) -> str:
    """Two maps of IDF1 over speed and hidden part as SVG: the redder, the worse; a line where `WANTED` is missed."""
    step = MARGIN + CELL * len(hidden)
    height = MARGIN + CELL * len(speeds)
    parts = ['<rect width="100%" height="100%" fill="white"/>']
    for panel, (title, table) in enumerate(zip(TITLES, scores, strict=True)):
        parts += panel_parts(MARGIN + panel * step, f"IDF1, {title}", table, hidden)
    for row, speed in enumerate(speeds):
        parts.append(f'<text x="{MARGIN - 15}" y="{MARGIN + row * CELL + 50}" text-anchor="end">{speed:.1f}</text>')
    middle = MARGIN + CELL * len(speeds) / 2
    turned = f'x="25" y="{middle}" text-anchor="middle" transform="rotate(-90 25 {middle})"'
    parts.append(f"<text {turned}>median speed of the markers [m/s]</text>")
    parts.append(f'<text x="{MARGIN}" y="{height + 30}">blue: to the right IDF1 falls below {WANTED:g}</text>')
    size = f'width="{2 * step + 20}" height="{height + 45}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-size="16">\n' + "\n".join(parts) + "\n</svg>\n"


def panel_parts(left: float, title: str, table: np.ndarray, hidden: Sequence[float]) -> Iterator[str]:
    """One map, whose first cell begins `left` px from the left."""
    yield f'<text x="{left}" y="25" font-weight="bold">{title}</text>'
    yield f'<text x="{left}" y="55">hidden part of all positions [%]</text>'
    for column, share in enumerate(hidden):
        yield f'<text x="{left + (column + 0.5) * CELL}" y="85" text-anchor="middle">{100 * share:.0f}</text>'
    for (row, column), value in np.ndenumerate(table):
        x, y, bad = left + column * CELL, MARGIN + row * CELL, round(255 * min(1.0, max(0.0, (1.0 - value) / 0.4)))
        yield f'<rect x="{x}" y="{y}" width="{CELL}" height="{CELL}" fill="rgb(255,{255 - bad},{255 - bad})"/>'
        yield f'<text x="{x + CELL / 2}" y="{y + 50}" text-anchor="middle">{value:.3f}</text>'
    columns = np.arange(len(hidden)) + 0.5  # a part stands in the middle of its cell
    ends = [0.0, *hidden, 1.0], [0.0, *columns, len(hidden)]
    corners = []
    for row, share in enumerate(frontier(table, hidden)):
        x = left + CELL * (len(hidden) if np.isinf(share) else float(np.interp(share, *ends)))
        corners += [f"{x:.0f},{MARGIN + row * CELL}", f"{x:.0f},{MARGIN + (row + 1) * CELL}"]
    yield f'<polyline points="{" ".join(corners)}" fill="none" stroke="blue" stroke-width="3"/>'


if __name__ == "__main__":
    main()
