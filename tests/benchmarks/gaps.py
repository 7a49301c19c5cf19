"""Gaps filled, against the positions that were hidden: ``python tests/benchmarks/gaps.py [folder]``.

A gap of 0.5 s is made in every marker, two draws of each; limbs and tree are kept and the skeleton is fitted again
without the hidden positions. A cubic spline and the rigid skeleton stand beside. Recordings are looked for in
``../shared/data`` beside the project unless a folder is named; those that are absent are left out, which is said.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from shown import show, show_machine, verdict

import skelgen
from skelgen.kinematics.gap_filling.filling import fill_gaps
from skelgen.model import Trajectories
from skelgen.model.filled import PositionSource
from skelgen.simulation import simulate
from skelgen.stages.skeleton import fit_skeleton

USUAL_PLACE = Path(__file__).parents[3] / "shared" / "data"
RECORDINGS = (
    "human/nick_freeform_001.c3d",
    "wheelchair/walkingOptiTrack.c3d",
    "arm/arm-4-4-4_clean_30fps.c3d",
    "hand/recording.tsv",
)
GAP_SECONDS = 0.5
DRAWS = (0, 1)
WANTED = 2.5  # mm, median
SECONDS = 2.0  # of one core, for about a thousand gaps
MOST_TRIES = 60
APART = 3  # frames between gaps on one limb


def main() -> None:
    """Print one row per take and number of markers of a limb that are hidden at once, and the time per take."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else USUAL_PLACE
    show_machine()
    rows = [row for name, project in projects(folder) for row in rows_of(name, project)]
    columns = ("take", "at once", "positions", "spline", "rigid", "filled", "limb", "joint", "interpolated")
    columns += ("within 1, 2 std", f"<= {WANTED} mm")
    show("Gaps of 0.5 s: median distance [mm], of all and by source; coverage of the stated deviation", columns, rows)
    show_speed()


def projects(folder: Path) -> Iterator[tuple[str, skelgen.Project]]:
    """Simulated and recorded takes, through all stages."""
    simulated = simulate("human", seed=0, n_frames=1500, noise=0.5, soft_tissue=2.0).take
    yield "human, 2 mm soft tissue, 0.5 mm noise", skelgen.reconstruct(simulated)
    for path in RECORDINGS:
        if (folder / path).exists():
            yield path, skelgen.reconstruct(skelgen.read(folder / path))
        else:
            print(f"{path} is absent")


def rows_of(name: str, project: skelgen.Project) -> Iterator[tuple[str, ...]]:
    """Rows for one and two markers of a limb at once."""
    whole = project.trajectories
    for at_once in (1, 2):
        found = [compare(project, hidden_positions(project, at_once, draw)) for draw in DRAWS]
        spline, rigid, filled, deviation = (np.concatenate([each[column] for each in found]) for column in range(4))
        source = np.concatenate([each[4] for each in found])
        size = np.linalg.norm(filled, axis=1)
        by_source = [
            middle(size[source == kind])
            for kind in (PositionSource.LIMB, PositionSource.JOINT, PositionSource.INTERPOLATED)
        ]
        off = np.abs(filled) / np.maximum(deviation, np.finfo(float).tiny)[:, np.newaxis]
        coverage = f"{100 * (off < 1).mean():.0f} %, {100 * (off < 2).mean():.0f} %"
        plain = [middle(np.linalg.norm(each, axis=1)) for each in (spline, rigid, filled)]
        reached = verdict(float(np.median(size)) <= WANTED)
        title = f"{name} ({whole.n_frames} x {whole.n_markers})"
        yield (title, str(at_once), str(len(size)), *plain, *by_source, coverage, reached)


def middle(distances: np.ndarray) -> str:
    """Return the median as text."""
    return f"{np.nanmedian(distances):.2f}" if len(distances) else "-"


def hidden_positions(project: skelgen.Project, at_once: int, draw: int) -> np.ndarray:
    """One gap per marker; gaps on one limb do not overlap but for those of `at_once` markers, which coincide."""
    random, take = np.random.default_rng(draw), project.trajectories
    length = max(round(GAP_SECONDS * take.rate), 1)
    hide = np.zeros(take.seen.shape, dtype=bool)
    for limb in range(project.limbs.n_limbs):
        markers = random.permutation(project.limbs.markers_of(limb))
        for first in range(0, len(markers), at_once):
            chosen = markers[first : first + at_once]
            for _ in range(MOST_TRIES):
                start = int(random.integers(length // 2 + 1, take.n_frames - 2 * length))
                stop = start + length
                ends_seen = take.seen[start - 1, chosen].all() and take.seen[stop, chosen].all()
                free = not hide[max(start - APART, 0) : stop + APART, markers].any()
                if ends_seen and free and (take.seen[start:stop, chosen].mean(axis=0) > 0.5).all():
                    hide[start:stop, chosen] = True
                    break
    return hide & take.seen


def compare(project: skelgen.Project, hide: np.ndarray) -> tuple[np.ndarray, ...]:
    """Errors [mm] of spline, rigid skeleton and filled positions, stated deviation and source, where hidden."""
    whole = project.trajectories
    take = Trajectories(np.where(hide[..., np.newaxis], np.nan, whole.positions), whole.names, whole.rate)
    skeleton, motion = fit_skeleton(take, project.limbs, project.topology)
    filled = fill_gaps(take, skeleton, motion)
    errors = [(each - whole.positions)[hide] for each in (spline(take), motion.marker_positions, filled.positions)]
    return (*errors, filled.std[hide], filled.source[hide])


def spline(take: Trajectories) -> np.ndarray:
    """A cubic spline through each coordinate's seen frames."""
    positions = take.positions.copy()
    for marker in range(take.n_markers):
        seen = np.flatnonzero(take.seen[:, marker])
        gaps = np.flatnonzero(~take.seen[:, marker])
        if len(seen) > 1:
            positions[gaps, marker] = CubicSpline(seen, positions[seen, marker])(gaps)
    return positions


def show_speed() -> None:
    """Time to fill 2000 frames of 45 markers with 5 % lost."""
    project = skelgen.reconstruct(simulate("human", n_frames=2000, noise=0.5, dropouts=0.05).take)
    started = time.process_time()  # other programs on the machine do not count
    fill_gaps(project.trajectories, project.skeleton, project.motion)
    seconds = time.process_time() - started
    row = ("human, 5 % lost (2000 x 45)", f"{seconds:.2f}", verdict(seconds < SECONDS))
    show("Speed", ("take", "seconds", f"< {SECONDS:.0f} s"), [row])


if __name__ == "__main__":
    main()
