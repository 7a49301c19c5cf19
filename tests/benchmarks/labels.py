"""Identities from unlabelled clouds beside what else there is: ``python tests/benchmarks/labels.py --help``.

Simulated takes seen by few cameras, whose truth is known, and recordings whose labels are removed; each is labelled by
rigidity (the default), by the classic Marker Sets, and by trackpy and LapTrack (development extra) on the same points.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from shown import show, show_machine, verdict
from threadpoolctl import threadpool_limits

import skelgen
from skelgen.app.configuration import Settings
from skelgen.app.pipeline import run_stages
from skelgen.benchmark.speed import fifty_markers
from skelgen.evaluation import evaluate
from skelgen.model import PointCloud, Project
from skelgen.simulation import Structure, simulate
from skelgen.simulation.truth import Truth
from skelgen.stages.labels import LabelParameters
from skelgen.stages.labels.point_labels import find_points
from skelgen.stages.labels.tracking.follow import follow_points
from skelgen.stages.labels.tracking.statistics import typical_spacing

N_FRAMES = 1500
FAULTS = {"noise": 0.3, "ghosts": 0.2}  # mm, false points a frame
GAP_SECONDS, GAP_EVERY_SECONDS = 0.25, 2.0
PIECE_SECONDS, PIECES_SHARE = 0.1, 0.23  # median length of short gaps, and the part of each marker that they hide
FALSE_POINTS, FALSE_REACH, REMEASURED = 0.3, 900.0, 0.3  # a frame, mm around the body, mm of noise added
LONGEST = 1200  # frames of recorded people
APART = (3000.0, 20.0)  # mm between two people, centre to centre; and between what they come nearest with
LEAST_SEEN = 0.02  # of all frames: a marker that fewer show, hidden in the body, is not asked for
PEER_GAP_SECONDS = 0.5  # over which the peers may close gaps
PEOPLE = ("kicks", "punch", "flips")
SUIT, MOUSE = "human/nick_freeform_001.c3d", "mouse/mouse_S15.c3d"
RECORDINGS = Path(__file__).parents[3] / "shared" / "data"
COLUMNS = ("case", "method", "IDF1", "worst", "markers", "of", "tracklets", "limbs", "tree", "frames/s", "wanted", "")


@dataclass(frozen=True, eq=False)
class Take:
    """A cloud with the true marker of each point (-1 = none), and the whole truth where the take is simulated."""

    cloud: PointCloud
    marker_of_point: np.ndarray
    truth: Truth | None = None


@dataclass(frozen=True, eq=False)
class Result:
    """Marker that each point was given to, -1 = none; time [s]; limbs and tree exact, where that is known."""

    marker_of_point: np.ndarray
    seconds: float
    limbs: bool | None = None
    tree: bool | None = None


@dataclass(frozen=True)
class Case:
    """Takes by seed, and the IDF1 wanted."""

    name: str
    make: Callable[[int], Take | None]
    wanted: float | None = None
    one_seed: bool = False


def main() -> None:
    """Print one table per case."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--cases", default="", help="part of the names of the cases that are wanted")
    parser.add_argument("--methods", default=",".join(METHODS))
    parser.add_argument("--recordings", type=Path, default=RECORDINGS)
    wanted = parser.parse_args()
    show_machine()
    with threadpool_limits(limits=1):
        for case in all_cases(wanted.recordings):
            if wanted.cases in case.name:
                run_case(case, range(1 if case.one_seed else wanted.seeds), wanted.methods.split(","))


def run_case(case: Case, seeds: range, methods: list[str]) -> None:
    """Print the rows of a case, one for each method."""
    takes = [take for take in map(case.make, seeds) if take is not None]
    if not takes:
        print(f"{case.name}: the recording is not there\n")
        return
    unseen = np.mean([unseen_share(take) for take in takes if take.truth is not None] or [np.nan])
    speed = np.mean([take.cloud.n_frames / seconds_of(lambda take=take: tracks(take.cloud)) for take in takes])
    rows = [row_of(case, method, takes, [METHODS[method](take) for take in takes]) for method in methods]
    unseen_text = "" if np.isnan(unseen) else f"{100 * unseen:.0f} % unseen, "
    title = f"{case.name}: {len(takes)} takes, {unseen_text}tracklets alone {speed:.0f} frames/s"
    show(title, COLUMNS, rows)


def row_of(case: Case, method: str, takes: list[Take], results: list[Result]) -> tuple[str, ...]:
    """One row: means over the takes, and the worst IDF1."""
    scores = [idf1(take, result) for take, result in zip(takes, results, strict=True)]
    found = "/".join(str(len(np.unique(r.marker_of_point[r.marker_of_point >= 0]))) for r in results)
    true = "/".join(str(n_to_find(take)) for take in takes)
    pieces = f"{np.mean([tracks(take.cloud).max(initial=-1) + 1 for take in takes]):.0f}"
    exact = [share([getattr(result, what) for result in results]) for what in ("limbs", "tree")]
    speed = sum(take.cloud.n_frames for take in takes) / sum(result.seconds for result in results)
    own = method == "rigidity" and case.wanted is not None
    outcome = (f">= {case.wanted:g}", verdict(np.mean(scores) >= case.wanted)) if own else ("", "")
    figures = (f"{np.mean(scores):.4f}", f"{min(scores):.4f}", found, true, pieces, *exact, f"{speed:.0f}")
    return (case.name, method, *figures, *outcome)


def n_to_find(take: Take) -> int:
    """Number of true markers that enough frames show."""
    counts = np.bincount(take.marker_of_point[take.marker_of_point >= 0])
    return int((counts >= LEAST_SEEN * take.cloud.n_frames).sum())


def share(values: list[bool | None]) -> str:
    """How many of the known ones hold."""
    known = [value for value in values if value is not None]
    return f"{sum(known)} of {len(known)}" if known else "-"


def idf1(take: Take, result: Result) -> float:
    """IDF1 of Ristani et al. (2016): twice the right points by those found and those true."""
    from scipy.optimize import linear_sum_assignment

    true, found = take.marker_of_point, result.marker_of_point
    together = np.zeros((found.max(initial=-1) + 1, true.max(initial=-1) + 1))
    both = (true >= 0) & (found >= 0)
    np.add.at(together, (found[both], true[both]), 1)
    hits = together[linear_sum_assignment(-together)].sum()
    return float(2 * hits / ((true >= 0).sum() + (found >= 0).sum()))


def unseen_share(take: Take) -> float:
    """Part of the true markers' positions that no camera saw."""
    return 1.0 - (take.marker_of_point >= 0).sum() / (take.cloud.n_frames * take.truth.n_markers)


def tracks(cloud: PointCloud) -> np.ndarray:
    """Our tracklet of each point."""
    return follow_points(cloud, LabelParameters())[0]


def seconds_of(work: Callable[[], object]) -> float:
    """Time of the second call: compiling is not counted."""
    work()
    started = time.perf_counter()
    work()
    return time.perf_counter() - started


def by_skelgen(take: Take, method: str) -> Result:
    """The labels stage, and limbs and tree after it where they can be judged."""
    settings = Settings({"labels": {"method": method, "compare": False}})  # the time is that of one method
    until = None if take.truth is not None else "labels"
    project = run_stages(Project(take.cloud), until_stage=until, settings=settings)
    exact = (None, None)
    if take.truth is not None:
        score = evaluate(project, take.truth)
        limbs, found = score.limbs, project.trajectories.n_markers
        whole = limbs.adjusted_rand == 1.0 and limbs.n_limbs_found == limbs.n_limbs_true and limbs.n_left_out == 0
        exact = (whole and found >= n_to_find(take), score.topology.is_exact)
    return Result(find_points(take.cloud, project.trajectories.positions), project.reports["labels"].seconds, *exact)


def by_trackpy(take: Take) -> Result:
    """Crocker and Grier's linking with trackpy's prediction by the nearest velocity."""
    import trackpy

    trackpy.quiet()
    warnings.filterwarnings("ignore", module="trackpy")  # before the first tracks there is nothing to predict from
    trackpy.linking.Linker.MAX_SUB_NET_SIZE = 60
    predictor = trackpy.predict.NearestVelocityPredict()
    reach, frames = peer_settings(take.cloud)
    started = time.perf_counter()
    linked = predictor.link_df(
        frame_table(take.cloud), reach, memory=frames, pos_columns=["x", "y", "z"], adaptive_stop=0.1 * reach
    )
    seconds = time.perf_counter() - started
    return Result(longest(linked.sort_values("point")["particle"].to_numpy()), seconds)


def by_laptrack(take: Take) -> Result:
    """The linear assignment of Jaqaman et al. with gap closing, as LapTrack does it."""
    from laptrack import LapTrack

    reach, frames = peer_settings(take.cloud)
    tracker = LapTrack(
        cutoff=reach**2, gap_closing_cutoff=typical_spacing(take.cloud) ** 2, gap_closing_max_frame_count=frames
    )
    started = time.perf_counter()
    table = tracker.predict_dataframe(
        frame_table(take.cloud), ["x", "y", "z"], frame_col="frame", only_coordinate_cols=False
    )[0]
    seconds = time.perf_counter() - started
    return Result(longest(table.sort_values("point")["track_id"].to_numpy()), seconds)


METHODS: dict[str, Callable[[Take], Result]] = {
    "rigidity": lambda take: by_skelgen(take, "rigidity"),
    "sets": lambda take: by_skelgen(take, "sets"),
    "trackpy": by_trackpy,
    "LapTrack": by_laptrack,
}


def peer_settings(cloud: PointCloud) -> tuple[float, int]:
    """Search range [mm] and frames to bridge: our own reach, which is found from the take, and half a second."""
    return follow_points(cloud, LabelParameters())[1], round(PEER_GAP_SECONDS * cloud.rate)


def frame_table(cloud: PointCloud):
    """The points as the peers want them."""
    import pandas

    frames = np.repeat(np.arange(cloud.n_frames), cloud.points_per_frame)
    table = pandas.DataFrame(cloud.points, columns=["x", "y", "z"])
    return table.assign(frame=frames, point=np.arange(cloud.n_points))


def longest(tracks_of_points: np.ndarray) -> np.ndarray:
    """Tracks numbered from 0, without those of one point, which every peer leaves for ghosts."""
    numbers = np.unique(tracks_of_points, return_inverse=True)[1].ravel()
    counts = np.bincount(numbers)
    return np.where(counts[numbers] > 1, numbers, -1)


def simulated(structure: str | Structure, **options: float) -> Callable[[int], Take]:
    """Takes of a structure by seed."""

    def make(seed: int) -> Take:
        made = simulate(structure, n_frames=N_FRAMES, seed=seed, labelled=False, **options)
        return Take(made.take, made.truth.marker_of_point, made.truth)

    return make


def without_wrong_labels(take: skelgen.Trajectories) -> skelgen.Trajectories:
    """A take whose labels are put right where its own distances contradict them: the suit's are wrong in 313 points."""
    return run_stages(Project(take), until_stage="labels").trajectories


Hide = Callable[[np.ndarray, float, np.random.Generator], None]
"""Changes what is seen, (n_frames, n_markers), of a take with a frame rate [Hz]."""


def gaps(seen: np.ndarray, rate: float, random: np.random.Generator) -> None:
    """A gap per marker every 2 s."""
    every, gap = int(GAP_EVERY_SECONDS * rate), int(GAP_SECONDS * rate)
    for marker in range(seen.shape[1]):
        for start in range(int(random.integers(every)), len(seen), every):
            seen[start : start + gap, marker] = False


def pieces(seen: np.ndarray, rate: float, random: np.random.Generator) -> None:
    """Many short gaps, their own ones included: hundreds of pieces."""
    for marker in range(seen.shape[1]):
        while seen[:, marker].mean() > 1.0 - PIECES_SHARE:
            start, length = random.integers(len(seen)), random.exponential(PIECE_SECONDS / np.log(2.0))
            seen[start : start + 1 + int(length * rate), marker] = False


def recorded(path: Path, hide: Hide | None = None) -> Callable[[int], Take | None]:
    """A recording without its labels, its points in random order, perhaps with more gaps."""

    def make(seed: int) -> Take | None:
        if not path.exists():
            return None
        take, random = without_wrong_labels(skelgen.read(path)), np.random.default_rng(seed)
        seen = take.seen.copy()
        if hide is not None:
            hide(seen, take.rate, random)
        return unlabelled(take, seen, random)

    return make


def people(folder: Path, names: tuple[str, ...], hide: Hide, apart: float = 0.0) -> Callable[[int], Take | None]:
    """Recordings of people in one volume, measured anew with noise, gaps and false points."""

    def make(seed: int) -> Take | None:
        if not all((folder / f"{name}.c3d").exists() for name in names):
            return None
        random = np.random.default_rng(seed)
        bodies = [person(folder / f"{name}.c3d") for name in names]
        n_frames = min(len(body.positions) for body in bodies)
        positions = [body.positions[:n_frames] for body in bodies]
        if len(positions) == 2:
            positions[1] = beside(*positions, apart)
        every = np.concatenate(positions, axis=1)
        every = every + random.normal(0.0, REMEASURED, every.shape)
        take = skelgen.Trajectories(every, tuple(map(str, range(every.shape[1]))), bodies[0].rate)
        seen = take.seen.copy()
        hide(seen, take.rate, random)
        return with_false_points(unlabelled(take, seen, random), random)

    return make


def person(path: Path) -> skelgen.Trajectories:
    """The markers that a person wears, not those that a program computed, from a recording's first seconds."""
    take = skelgen.read(path)
    worn = {str(name).split(":")[-1].lower() for name in np.load(path.with_suffix(".truth.npz"))["labels"]}
    kept = [marker for marker, name in enumerate(take.names) if name.split(":")[-1].strip().lower() in worn]
    names = tuple(take.names[marker] for marker in kept)
    return skelgen.Trajectories(take.positions[:LONGEST, kept], names, take.rate)


def beside(one: np.ndarray, other: np.ndarray, apart: float) -> np.ndarray:
    """The other person, its centre so far from the first's, or the two nearest points where that is less than 1 m."""
    moved = other + np.nanmean(one, axis=(0, 1)) - np.nanmean(other, axis=(0, 1))
    if apart < 1000.0:
        apart += float((np.nanmax(one[..., 0], axis=1) - np.nanmin(moved[..., 0], axis=1)).max())
    return moved + np.array([apart, 0.0, 0.0])


def with_false_points(take: Take, random: np.random.Generator) -> Take:
    """A take with points of no marker around the body, the first of their frame."""
    cloud = take.cloud
    counts = np.where(cloud.points_per_frame > 0, random.poisson(FALSE_POINTS, cloud.n_frames), 0)
    frames = np.repeat(np.arange(cloud.n_frames), counts)
    sums = np.cumsum(np.append(np.zeros((1, 3)), cloud.points, axis=0), axis=0)[cloud.frame_starts]
    centre = np.diff(sums, axis=0) / np.maximum(cloud.points_per_frame, 1)[:, np.newaxis]
    false = centre[frames] + random.uniform(-FALSE_REACH, FALSE_REACH, (len(frames), 3))
    where = cloud.frame_starts[frames]
    starts = cloud.frame_starts + np.concatenate([[0], np.cumsum(counts)])
    points = np.insert(cloud.points, where, false, axis=0)
    return Take(PointCloud(points, starts, cloud.times), np.insert(take.marker_of_point, where, -1))


def unlabelled(take: skelgen.Trajectories, seen: np.ndarray, random: np.random.Generator) -> Take:
    """The seen markers of each frame as points in random order."""
    markers = [random.permutation(np.flatnonzero(row)) for row in seen]
    starts = np.concatenate([[0], np.cumsum([len(each) for each in markers])]).astype(np.intp)
    frames = np.repeat(np.arange(take.n_frames), np.diff(starts))
    which = np.concatenate(markers).astype(np.intp)
    return Take(PointCloud(take.positions[frames, which], starts, take.times, name=take.name), which)


def all_cases(folder: Path) -> Iterator[Case]:
    """The cases, the human with 50 markers first."""
    for name, structure in (("human of 50", fifty_markers()), ("human of 45", "human")):
        for cameras, tissue, wanted in ((8, 2.0, 0.99), (6, 3.0, 0.98)):
            options = {"n_cameras": cameras, "soft_tissue": tissue, **FAULTS}
            yield Case(f"{name}, {cameras} cameras, {tissue:g} mm", simulated(structure, **options), wanted)
    tree = {"n_cameras": 6, "soft_tissue": 1.0, **FAULTS}
    yield Case("tree:10, 6 cameras, 1 mm", simulated("tree:10", **tree), 0.99)
    yield Case("human of 45, 4 cameras, 2 mm", simulated("human", **tree | {"n_cameras": 4, "soft_tissue": 2.0}))
    yield Case("suit of 53, own gaps", recorded(folder / SUIT), one_seed=True)
    yield Case("suit of 53, more gaps", recorded(folder / SUIT, gaps), 0.95)
    yield Case("suit of 53, in pieces", recorded(folder / SUIT, pieces))
    yield Case("mouse of 11, own gaps", recorded(folder / MOUSE), one_seed=True)
    bodies = folder / "bodies"
    for name in PEOPLE:
        for hide in (gaps, pieces):
            yield Case(f"{name} of 41, {hide.__name__}", people(bodies, (name,), hide))
    for apart in APART:
        yield Case(f"two people, {apart:g} mm apart", people(bodies, ("kicks", "punch"), gaps, apart), 0.985)


if __name__ == "__main__":
    main()
