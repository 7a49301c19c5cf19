"""Random parts of recordings as clouds with many hidden pieces: ``python tests/benchmarks/draws.py --help``.

Each draw takes a recording, a part of it, how much of it is hidden and in which pieces; labels are removed, noise and
false points added. What a change does to identities shows in draws, where single takes say little: compare with a file
that ``--save`` wrote before the change (``--against``).
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from labels import RECORDINGS, REMEASURED, Result, Take, idf1, n_to_find, unlabelled, with_false_points
from shown import show, show_machine
from threadpoolctl import threadpool_limits

import skelgen
from skelgen.app.pipeline import run_stages
from skelgen.app.subject import run_with_subject
from skelgen.model import Project, Trajectories
from skelgen.stages.labels.point_labels import find_points

NAMES = {
    "people": ("bodies/kicks.c3d", "bodies/punch.c3d", "bodies/flips.c3d", "bodies/walk.trc", "bodies/treadmill.trc"),
    "suits": ("human/nick_freeform_001.c3d", "human/markers_Squat2.trc", "bodies/landing.trc"),
    "others": ("wheelchair/racing_full.c3d", "mouse/mouse_S15.c3d", "wheelchair/walkingOptiTrack.c3d"),
}
HIDDEN = (0.1, 0.2, 0.3)  # of all points, at most: what the recording hides counts
PIECE_SECONDS = (0.1, 0.2, 0.35)  # median
SECONDS = (1.5, 10.0)
STILL = "M"  # names that are taken away begin with it


@dataclass(frozen=True)
class Draw:
    """A part of a recording from a frame on, and what is hidden of it, perhaps neighbours together."""

    name: str
    seed: int
    first: int
    seconds: float
    hidden: float
    piece_seconds: float
    together: float = 0.0

    def __str__(self) -> str:
        what = f"{self.seconds:.1f} s from frame {self.first}, {100 * self.hidden:.0f} % in {self.piece_seconds:g} s"
        if self.together:
            what += f", {100 * self.together:.0f} % of the markers at once"
        return f"{Path(self.name).stem} {self.seed}: {what}"


def main() -> None:
    """Print a row per draw, their mean, and what changed against a file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kind", choices=(*NAMES, "all"), default="people")
    parser.add_argument("--draws", type=int, default=4, help="for each recording")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--together", type=float, default=0.0, help="part of the markers that is hidden at once")
    parser.add_argument("--known", action="store_true", help="label by the skeleton of the whole recording instead")
    parser.add_argument("--save", type=Path, help="where the figures are written")
    parser.add_argument("--against", type=Path, help="figures of another run")
    wanted = parser.parse_args()
    show_machine()
    names = sum(NAMES.values(), ()) if wanted.kind == "all" else NAMES[wanted.kind]
    found: dict[str, dict[str, float]] = {}
    with threadpool_limits(limits=1):
        for name in names:
            if not (RECORDINGS / name).exists():
                print(f"{name} is absent")
                continue
            take = worn(RECORDINGS / name)
            known = skelgen.reconstruct(take, seed=0) if wanted.known else None
            for draw in draws_of(name, take, range(wanted.seed, wanted.seed + wanted.draws), wanted.together):
                cloud = cloud_of(take, draw)
                if not found:
                    score_of(cloud, known)  # compiles
                found[str(draw)] = score_of(cloud, known)
    show_all(found, json.loads(wanted.against.read_text()) if wanted.against else {})
    if wanted.save:
        wanted.save.write_text(json.dumps(found, indent=1))


def show_all(found: dict[str, dict[str, float]], before: dict[str, dict[str, float]]) -> None:
    """Print the rows, beside what was found before."""
    rows = []
    for name, score in found.items():
        was = before.get(name)
        change = f"{score['idf1'] - was['idf1']:+.4f}" if was else ""
        speed = f"{was['seconds'] / score['seconds']:.2f}" if was else ""
        row = (
            f"{100 * score['hidden']:.0f} %",
            f"{score['idf1']:.4f}",
            change,
            f"{score['found']}",
            f"{score['markers']}",
        )
        rows.append((name, *row, f"{score['seconds']:.2f}", f"{score['real_time']:.1f}", speed))
    show("Draws", ("draw", "hidden", "IDF1", "change", "found", "of", "s", "x real time", "x before"), rows)
    values = [score["idf1"] for score in found.values()]
    off = sum(abs(score["found"] - score["markers"]) for score in found.values())
    total = sum(score["seconds"] for score in found.values())
    print(f"{len(found)} draws: IDF1 {np.mean(values):.4f}, worst {min(values):.4f}; markers off {off}; {total:.1f} s")
    both = [name for name in found if name in before]
    if both:
        was = [before[name] for name in both]
        ratio = sum(each["seconds"] for each in was) / sum(found[name]["seconds"] for name in both)
        off = sum(abs(each["found"] - each["markers"]) for each in was)
        mean = np.mean([each["idf1"] for each in was])
        print(f"before: IDF1 {mean:.4f}, worst {min(e['idf1'] for e in was):.4f}; markers off {off}; x {ratio:.2f} s")


def worn(path: Path) -> Trajectories:
    """A recording's markers, not the points that a program computed where an expert tells them apart."""
    take, told = skelgen.read(path), path.with_name(f"{path.stem}.truth.npz")
    kept = np.arange(take.n_markers)
    if told.exists():
        labels = {str(name).split(":")[-1].strip().lower() for name in np.load(told)["labels"]}
        kept = np.array([m for m in kept if take.names[m].split(":")[-1].strip().lower() in labels])
    kept = kept[take.seen[:, kept].any(axis=0)]
    return Trajectories(take.positions[:, kept], tuple(f"{STILL}{m:03d}" for m in kept), take.rate)


def draws_of(name: str, take: Trajectories, seeds: range, together: float) -> list[Draw]:
    """The draws of a recording."""
    found = []
    for seed in seeds:
        random = np.random.default_rng([seed, len(name), take.n_frames])
        seconds = min(float(random.uniform(*SECONDS)), take.n_frames / take.rate)
        first = int(random.integers(take.n_frames - int(seconds * take.rate) + 1))
        found.append(Draw(name, seed, first, seconds, random.choice(HIDDEN), random.choice(PIECE_SECONDS), together))
    return found


def cloud_of(take: Trajectories, draw: Draw) -> Take:
    """The points of a draw."""
    random = np.random.default_rng([draw.seed, draw.first])
    part = take.positions[draw.first : draw.first + max(int(draw.seconds * take.rate), 2)]
    part = part + random.normal(0.0, REMEASURED, part.shape)
    part = Trajectories(part, take.names, take.rate)
    seen = part.seen.copy()
    n_together = max(int(draw.together * seen.shape[1]), 1)
    for marker in np.flatnonzero(seen.any(axis=0)):
        while seen[:, marker].mean() > 1.0 - draw.hidden:
            start, length = random.integers(len(seen)), random.exponential(draw.piece_seconds / np.log(2.0))
            far = np.linalg.norm(part.positions[start] - part.positions[start, marker], axis=1)
            hidden = np.argsort(far)[:n_together] if not np.isnan(far[marker]) else [marker]
            seen[start : start + 1 + int(length * take.rate), hidden] = False
    return with_false_points(unlabelled(part, seen, random), random)


def score_of(take: Take, known: Project | None) -> dict[str, float]:
    """IDF1, markers found and true, and seconds of one core of the labels, perhaps by a known skeleton."""
    started, project = time.process_time(), Project(take.cloud)
    project = run_with_subject(project, known) if known else run_stages(project, until_stage="labels")
    seconds = time.process_time() - started
    points = find_points(take.cloud, project.trajectories.positions)
    lasted = float(take.cloud.times[-1] - take.cloud.times[0])
    return {
        "idf1": idf1(take, Result(points, seconds)),
        "found": project.trajectories.n_markers,
        "markers": n_to_find(take),
        "hidden": 1.0 - float((take.marker_of_point >= 0).sum()) / (take.cloud.n_frames * n_to_find(take)),
        "seconds": seconds,
        "real_time": lasted / seconds,
    }


if __name__ == "__main__":
    main()
