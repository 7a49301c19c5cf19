"""How fast and how hidden an unlabelled body may be: ``python tests/benchmarks/frontier.py --picture frontier.svg``.

Random trees of ten limbs whose markers are 25 mm apart are simulated at several speeds with several parts of them
hidden, in pieces of 0.35 s, with 0.3 mm noise and false points; each is labelled from nothing. Beside it stands IDF1
when the skeleton of a labelled take of the same tree is known.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
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

SPEEDS, HIDDEN = (0.5, 1.0, 2.0, 3.0), (0.05, 0.1, 0.2, 0.3, 0.4)
PIECE = 0.35  # s, mean length of what is lost
OPTIONS = {"n_frames": 1000, "spacing": 25.0, "noise": 0.3, "ghosts": 0.2, "labelled": False}
CELL, MARGIN = 90, 60  # px


def main() -> None:
    """Print both tables, and draw them if asked to."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--speeds", type=float, nargs="+", default=SPEEDS)
    parser.add_argument("--hidden", type=float, nargs="+", default=HIDDEN)
    parser.add_argument("--picture", type=Path, help="SVG to write")
    wanted = parser.parse_args()
    show_machine()
    speeds, parts = wanted.speeds, wanted.hidden
    scores = np.empty((2, len(speeds), len(parts)))
    with threadpool_limits(limits=1):
        for row, speed in enumerate(speeds):
            for column, hidden in enumerate(parts):
                scores[:, row, column] = np.mean(
                    [scores_of(speed, hidden, seed) for seed in range(wanted.seeds)], axis=0
                )
    for title, table in zip(("from nothing", "skeleton known"), scores, strict=True):
        rows = [(f"{speed:g}", *(f"{value:.3f}" for value in line)) for speed, line in zip(speeds, table, strict=True)]
        show(f"IDF1, {title}", ("speed", *(f"{100 * part:.0f} % hidden" for part in parts)), rows)
    if wanted.picture:
        wanted.picture.write_text(picture(scores, speeds, parts), encoding="utf-8")


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
    """Two maps of IDF1 over speed and hidden part as SVG; the redder, the worse; at or above 0.95 a frame."""
    parts = []
    for panel, (title, table) in enumerate(zip(("from nothing", "skeleton known"), scores, strict=True)):
        left = MARGIN + panel * (CELL * len(hidden) + MARGIN)
        parts.append(f'<text x="{left}" y="30">IDF1, {title}</text>')
        for (row, column), value in np.ndenumerate(table):
            x, y, bad = left + column * CELL, MARGIN + row * CELL, round(255 * min(1.0, max(0.0, (1.0 - value) / 0.4)))
            frame = "black" if value >= 0.95 else "none"
            colour = f"rgb(255,{255 - bad},{255 - bad})"
            box = f'width="{CELL - 4}" height="{CELL - 4}" fill="{colour}" stroke="{frame}"'
            parts += [f'<rect x="{x}" y="{y}" {box}/>', f'<text x="{x + 20}" y="{y + 50}">{value:.3f}</text>']
        for column, share in enumerate(hidden):
            parts.append(f'<text x="{left + column * CELL + 10}" y="50">{100 * share:.0f} %</text>')
    parts += [f'<text x="5" y="{MARGIN + row * CELL + 50}">x {speed:g}</text>' for row, speed in enumerate(speeds)]
    width, height = 2 * (MARGIN + CELL * len(hidden)) + MARGIN, MARGIN + CELL * len(speeds) + 10
    body = "\n".join(parts)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" font-size="16">\n{body}\n</svg>\n'
    )


if __name__ == "__main__":
    main()
