"""One body, many takes: labels by a known skeleton, and two takes calibrated together.

``python tests/benchmarks/takes.py [folder of real recordings]``
"""

from __future__ import annotations

import importlib.util
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from shown import show, show_machine, verdict

import skelgen
from skelgen.app.several_takes import calibrate_together
from skelgen.app.subject import run_with_subject
from skelgen.evaluation import evaluate
from skelgen.simulation import find_structure, simulate
from skelgen.stages.labels import LabelParameters, label_markers

SEEDS = (1, 2, 3)
OTHER_MOTION = 100  # added to the seed of the other take
KNOWN_CASES = (
    ("human", 0.0),
    ("human", 2.0),
    ("quadruped", 2.0),
    ("classic-human", 0.0),
)  # structure, soft tissue [mm]
FAULTS = {"n_frames": 600, "noise": 0.5, "labelled": False, "n_cameras": 8, "ghosts": 0.3}
JOINT_CASES = (("human", 0.0, True), ("human", 2.0, False))  # structure, soft tissue [mm], labelled
JOINT_FRAMES = 300
RECORDINGS = (
    "human/nick_freeform_001.c3d",
    "arm/arm-4-4-4_clean_30fps.c3d",
    "rods_pendulum/pendulum_01.c3d",
    "wheelchair/walkingOptiTrack.c3d",
)
LONGEST = 1200  # frames of a half
SHOWN = 1200  # frames of a recording of a person, of which halves are labelled by each other
WANTED_IDF1 = 0.99
WANTED_RECALL = 0.9  # of a recording's labels


def main() -> None:
    """Print what is reached on simulated and on real takes."""
    show_machine()
    show_known()
    show_together()
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[3] / "shared" / "data"
    show_recordings(folder)
    show_people(folder)


def show_known() -> None:
    """IDF1 and joints of takes without names, by the skeleton of another take."""
    columns = ("structure", "tissue [mm]", "seed", "IDF1", "by itself", "joints [mm]", "by itself", "s", "")
    rows = [_known(*case, seed) for case in KNOWN_CASES for seed in SEEDS]
    show(f"Labels by the skeleton of another take (wanted IDF1: {WANTED_IDF1})", columns, rows)


def _known(name: str, soft_tissue: float, seed: int) -> tuple[str, ...]:
    body = find_structure(name, seed)
    options = FAULTS | {"soft_tissue": soft_tissue}
    rom = simulate(body, seed=seed + OTHER_MOTION, n_frames=1000, noise=0.5, soft_tissue=soft_tissue)
    known = skelgen.reconstruct(rom.take)
    new = simulate(body, seed=seed, **options)
    started = time.process_time()
    fitted = evaluate(run_with_subject(skelgen.Project(new.take), known), new.truth)
    seconds = time.process_time() - started
    alone = evaluate(skelgen.reconstruct(new.take), new.truth)
    reached = fitted.labels is not None and fitted.labels.idf1 >= WANTED_IDF1
    figures = [f"{one.labels.idf1:.4f}" for one in (fitted, alone)]
    joints = [f"{one.as_mapping()['summary']['mean_joint_error']:.2f}" for one in (fitted, alone)]
    return name, f"{soft_tissue:g}", str(seed), *figures, *joints, f"{seconds:.1f}", verdict(reached)


def show_together() -> None:
    """Errors of lengths and joints: each of two takes by itself, and both together."""
    columns = ("structure", "tissue [mm]", "seed", "lengths [mm]", "together", "joints [mm]", "together", "s", "")
    rows = [_together(*case, seed) for case in JOINT_CASES for seed in SEEDS]
    show("Two takes of 300 frames, 1 mm noise, mean of both (wanted: better together)", columns, rows)


def _together(name: str, soft_tissue: float, labelled: bool, seed: int) -> tuple[str, ...]:
    body = find_structure(name, seed)
    options = {"n_frames": JOINT_FRAMES, "noise": 1.0, "soft_tissue": soft_tissue, "labelled": labelled}
    takes = [simulate(body, seed=seed + first, **options) for first in (0, OTHER_MOTION)]
    started = time.process_time()
    both = calibrate_together([one.take for one in takes])
    seconds = time.process_time() - started
    together = [
        evaluate(project, one.truth).as_mapping()["summary"] for project, one in zip(both.takes, takes, strict=True)
    ]
    alone = [evaluate(skelgen.reconstruct(one.take), one.truth).as_mapping()["summary"] for one in takes]
    figures: list[float] = []
    for score in ("mean_length_error", "mean_joint_error"):
        figures += [float(np.mean([one[score] for one in some])) for some in (alone, together)]
    reached = figures[1] < figures[0] and figures[3] < figures[2]
    return name, f"{soft_tissue:g}", str(seed), *(f"{one:.2f}" for one in figures), f"{seconds:.1f}", verdict(reached)


def show_recordings(folder: Path) -> None:
    """Second halves of recordings, names taken away, labelled and posed by the skeletons of the first halves."""
    columns = ("recording", "markers", "right", "wrong", "residual [mm]", "of its own", "moved", "s", "")
    rows = [_recording(folder, name) for name in RECORDINGS if (folder / name).exists()]
    show(f"Recordings cut in two (wanted: {WANTED_RECALL} of the positions with their name)", columns, rows)


def _recording(folder: Path, name: str) -> tuple[str, ...]:
    take = skelgen.read(folder / name)
    half = take.n_frames // 2
    first = replace(take, positions=take.positions[max(0, half - LONGEST) : half])
    second = replace(take, positions=take.positions[half : half + LONGEST])
    known = skelgen.reconstruct(first)
    started = time.process_time()
    fitted = run_with_subject(skelgen.Project(_without_names(second)), known)
    seconds = time.process_time() - started
    carried = np.isin(np.arange(take.n_markers), np.flatnonzero(known.limbs.limb_of_marker >= 0))
    names = [fitted.trajectories.names.index(marker) for marker in known.trajectories.names]
    found = fitted.trajectories.positions[:, names][:, carried]
    truth = second.positions[:, carried]
    given = ~np.isnan(found[:, :, 0])
    right = given & (np.linalg.norm(found - truth, axis=2) < 1e-6)
    n_seen = int((~np.isnan(truth[:, :, 0])).sum())
    n_moved = sum("moved on their limbs" in sentence for sentence in fitted.reports["labels"].notices)
    residuals = [float(np.nanmean(project.motion.residuals)) for project in (fitted, known)]
    shares = right.sum() / n_seen, (given & ~right).sum() / n_seen
    return (
        name,
        str(int(carried.sum())),
        *(f"{share:.3f}" for share in shares),
        *(f"{residual:.2f}" for residual in residuals),
        "yes" if n_moved else "no",
        f"{seconds:.1f}",
        verdict(shares[0] >= WANTED_RECALL),
    )


def show_people(folder: Path) -> None:
    """Halves of recordings of people as clouds with gaps and ghosts, labelled by the skeletons of the other halves."""
    path = folder.parent / "tools" / "score_bodies.py"
    names = sorted(one.name.removesuffix(".truth.npz") for one in (folder / "bodies").glob("*.truth.npz"))
    if not path.exists() or not names:
        print(f"{path} or recordings of bodies are absent")
        return
    spec = importlib.util.spec_from_file_location("score_bodies", path)
    score = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(score)
    rows = [_half(score, name, is_first) for name in names for is_first in (True, False)]
    columns = ("recording", "labelled half", "s of it", "IDF1", "by itself", "s", "")
    show(f"People cut in two, names taken away (wanted IDF1: {WANTED_IDF1})", columns, rows)


def _half(score, name: str, is_first: bool) -> tuple[str, ...]:
    positions, rate, _ = score.load(name)
    halves = np.array_split(positions[:SHOWN], 2)
    new, other = halves if is_first else halves[::-1]
    names = [f"M{marker:03d}" for marker in range(positions.shape[1])]
    known = skelgen.reconstruct(skelgen.Trajectories(other, names, rate), seed=0)
    cloud, who = score.scattered(new, rate, np.random.default_rng(0))
    with tempfile.TemporaryDirectory() as scratch:
        score.write_mfml(cloud, rate, Path(scratch) / "cloud.mfml")
        take = skelgen.read(Path(scratch) / "cloud.mfml")
    started = time.process_time()
    fitted = run_with_subject(skelgen.Project(take), known)
    seconds = time.process_time() - started
    both = fitted.trajectories, label_markers(take, LabelParameters())[0]
    figures = [score.identity(np.asarray(one.positions), cloud, who, len(names))[0] for one in both]
    half = "first" if is_first else "second"
    idf1 = (f"{figure:.4f}" for figure in figures)
    return name, half, f"{len(new) / rate:.1f}", *idf1, f"{seconds:.1f}", verdict(figures[0] >= WANTED_IDF1)


def _without_names(take: skelgen.Trajectories) -> skelgen.PointCloud:
    """The points of a take in random order."""
    rng = np.random.default_rng(0)
    frames, markers = np.nonzero(~np.isnan(take.positions[:, :, 0]))
    order = np.lexsort((rng.random(len(frames)), frames))
    starts = np.searchsorted(frames, np.arange(take.n_frames + 1))
    points = take.positions[frames[order], markers[order]]
    return skelgen.PointCloud(points, starts, np.arange(take.n_frames) / take.rate, name=take.name)


if __name__ == "__main__":
    main()
