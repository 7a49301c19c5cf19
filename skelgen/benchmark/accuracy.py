"""The suites that compare results with a known truth: labels, joints, soft tissue, the stereo rig, exports."""

import tempfile
import time
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import cast

import numpy as np

from skelgen.app.face import reconstruct
from skelgen.benchmark.judges import JUDGES
from skelgen.benchmark.page import Effort, Figure, Section, Series, draw, figure_text, table, verdict
from skelgen.benchmark.speed import fifty_markers
from skelgen.evaluation import Evaluation, evaluate
from skelgen.evaluation.joints import joint_distances
from skelgen.kinematics.rigid_bodies import fit_shape
from skelgen.model import Trajectories
from skelgen.model.arrays import Floats
from skelgen.progress import Monitor, with_progress
from skelgen.simulation import SimulationParameters, Structure, simulate
from skelgen.simulation.take import SimulatedTake

FAULTS = SimulationParameters(noise=0.5, dropouts=0.05)
WANTED_TIMES_BOUND = 1.05  # the Cramer-Rao bound of the true chain, the same dropouts given
WANTED_OF_SCORE = 0.9  # of SCoRE's error under soft tissue
WANTED_EXACT = {"marker": 0.001, "joint": 0.01}  # mm
SOFT_TISSUE = SimulationParameters(noise=0.5, soft_tissue="3.0")
LABEL_FAULTS = SimulationParameters(noise=0.3, ghosts=0.2, labelled=False)

UNKNOWN = {"limbs": {"marker_set": "none"}}
"""Nothing is known of these structures: neither names of markers nor the shape of a marker set help."""

_EXPORTED_FRAMES = 100
_TISSUE_FRAMES = 2000  # for which the share of SCoRE is wanted
_LABEL_CASES = (  # title, structure, cameras, slide of each marker [mm], wanted IDF1
    ("human of 50 markers, 8 cameras, 2 mm soft tissue", "fifty", 8, "2.0", 0.99),
    ("human of 50 markers, 6 cameras, 3 mm soft tissue", "fifty", 6, "3.0", 0.98),
    ("tree:10, 6 cameras, 1 mm soft tissue", "tree:10", 6, "1.0", 0.99),
)


def measure_labels(effort: Effort, monitor: Monitor) -> Section:
    """Points without names: are they put together to the right markers?

    Parameters
    ----------
    effort : Effort
        How many seeds and frames are measured.
    monitor : Monitor
        Receives the progress.
    """
    rows = []
    faults = LABEL_FAULTS.replace(n_frames=effort.n_label_frames)
    for name, structure, cameras, slide, wanted in with_progress(_LABEL_CASES, len(_LABEL_CASES), monitor, every=1):
        body = fifty_markers() if structure == "fifty" else structure
        seen = faults.replace(n_cameras=cameras, soft_tissue=slide)
        found = [_labelled(body, seed, seen) for seed in effort.seeds]
        scores = [score for score, _ in found if score.labels is not None]
        idf1 = [score.labels.idf1 for score in scores if score.labels is not None]
        exact = f"{sum(map(_is_exact_where_seen, scores))} of {len(scores)}"
        speed = effort.n_label_frames * len(found) / sum(seconds for _, seconds in found)
        figures = (f"{np.mean(idf1):.4f}", f"{min(idf1):.4f}", exact, f"{speed:.0f}", f">= {wanted}")
        rows.append((name, *figures, verdict(bool(np.mean(idf1) >= wanted))))
    columns = ("take", "IDF1", "worst", "limbs, tree exact", "frames/s", "wanted IDF1")
    return Section(
        "labels",
        "Labels of unlabelled points",
        f"{effort.n_label_frames} frames at 100 Hz, {len(effort.seeds)} seeds, 0.3 mm noise, 0.2 false points a frame; "
        "frames per second are those of all stages. "
        "IDF1 is twice the right points by those found and those true (Ristani et al. 2016).",
        (table("Simulated takes seen by cameras", columns, rows),),
    )


def measure_exact(effort: Effort, monitor: Monitor) -> Section:
    """Takes without any fault: only rounding is left.

    Parameters
    ----------
    effort : Effort
        How many seeds and frames are measured.
    monitor : Monitor
        Receives the progress.
    """
    rows, exact = [], SimulationParameters(n_frames=effort.n_frames)
    for name in with_progress(effort.structures, len(effort.structures), monitor, every=1):
        scores = [reconstructed(name, seed, exact) for seed in effort.seeds]
        marker = max((deviation or 0.0) for score in scores for deviation in score.limb_deviations.values())
        joint = max(score.worst_joint_error or 0.0 for score in scores)
        reached = all(map(is_exact, scores)) and marker <= WANTED_EXACT["marker"] and joint <= WANTED_EXACT["joint"]
        rows.append((name, *_counts(scores), f"{marker:.2g}", f"{joint:.2g}", verdict(reached)))
    columns = ("structure", "limbs exact", "tree exact", "worst limb [mm]", "worst joint [mm]")
    title = f"Wanted: all exact, markers of a limb <= {WANTED_EXACT['marker']} mm, joints <= {WANTED_EXACT['joint']} mm"
    text = f"{effort.n_frames} frames, {len(effort.seeds)} seeds, nothing given; hinges across their axis."
    return Section("exact", "Exact takes", text, (table(title, columns, rows),))


def measure_joints(effort: Effort, monitor: Monitor) -> Section:
    """Noise and dropouts: limbs, tree, and joints beside the bound and beside SCoRE.

    Parameters
    ----------
    effort : Effort
        How many seeds and frames are measured.
    monitor : Monitor
        Receives the progress.
    """
    rows, points, faults = [], [], FAULTS.replace(n_frames=effort.n_frames)
    for name in with_progress(effort.structures, len(effort.structures), monitor, every=1):
        scores, peers = zip(*(_beside_score(name, seed, faults) for seed in effort.seeds), strict=True)
        times = [score.times_bound or np.inf for score in scores]
        means = [float(np.mean([getattr(one, what) or np.nan for one in scores])) for what in _JOINT_FIGURES]
        reached = all(map(is_exact, scores)) and max(times) <= WANTED_TIMES_BOUND
        figures = (*(f"{mean:.3f}" for mean in means), f"{max(times):.3f}", f"{np.mean(peers):.3f}")
        rows.append((name, *_counts(scores), *figures, verdict(reached)))
        points.append((means[1], means[0], float(np.mean(peers))))
    columns = ("structure", "limbs exact", "tree exact", "joint error [mm]", "bound [mm]", "coverage")
    bounds, ours, theirs = zip(*points, strict=True)
    most = max(bounds)
    series = (
        Series("the bound", (0.0, most), (0.0, most), has_points=False),
        Series("skelgen, nothing given", bounds, ours, is_line=False),
        Series("SCoRE, limbs and tree given", bounds, theirs, is_line=False),
    )
    drawing = draw("Joint errors beside the bound", "bound [mm]", "mean joint error [mm]", series)
    return Section(
        "joints",
        "Limbs, tree and joints under noise",
        f"0.5 mm noise, 5 % dropouts, {effort.n_frames} frames, {len(effort.seeds)} seeds. The bound is that of Cramer "
        "and Rao for the true chain, the same dropouts given: one seed may lie a little below. Coverage is the part of "
        "the stated 95 % intervals that hold the truth. SCoRE (Ehrig et al. 2006) is given limbs and tree; joints of "
        "limbs with fewer than three markers are beyond it and not in its mean (classic-human).",
        (
            table(
                f"Wanted: all exact, at most {WANTED_TIMES_BOUND} times the bound with every seed",
                (*columns, "most times the bound", "SCoRE [mm]"),
                rows,
            ),
        ),
        (Figure("One point a structure; the line is the bound.", drawing),),
    )


_JOINT_FIGURES = ("mean_joint_error", "mean_joint_bound", "coverage")


def measure_tissue(effort: Effort, monitor: Monitor) -> Section:
    """Soft tissue: joints beside SCoRE, which is given limbs and tree.

    Parameters
    ----------
    effort : Effort
        How many seeds and frames are measured.
    monitor : Monitor
        Receives the progress.
    """
    rows = []
    for seed in with_progress(effort.seeds, len(effort.seeds), monitor, every=1):
        score, peer = _beside_score("human", seed, SOFT_TISSUE.replace(n_frames=_TISSUE_FRAMES))
        share = (score.mean_joint_error or np.inf) / peer
        figures = (figure_text(score.mean_joint_error), f"{peer:.3f}", f"{share:.3f}", figure_text(score.coverage))
        rows.append((f"human, seed {seed}", *figures, verdict(is_exact(score) and share <= WANTED_OF_SCORE)))
    columns = ("take", "joint error [mm]", "SCoRE [mm]", "of SCoRE", "coverage")
    text = f"3 mm of soft tissue and 0.5 mm noise, {_TISSUE_FRAMES} frames."
    title = f"Wanted: limbs and tree exact, at most {WANTED_OF_SCORE} of SCoRE's error"
    return Section("tissue", "Soft tissue", text, (table(title, columns, rows),))


def measure_stereo(effort: Effort, monitor: Monitor) -> Section:
    """The stereo rig: errors of poses and joint angles beside what is predicted.

    Parameters
    ----------
    effort : Effort
        How many seeds and frames are measured.
    monitor : Monitor
        Receives the progress.
    """
    if find_spec("cv2") is None:
        text = "Not measured: it needs OpenCV, pip install 'skelgen-mocap[capture]'."
        return Section("stereo", "Two cameras", text, ())
    from skelgen.benchmark import stereo  # noqa: PLC0415 - needs the extra `capture`

    chance = 2 / np.sqrt(2 * effort.n_trials)  # two standard deviations of a root mean square
    rows = []
    curves: dict[str, list[float]] = {name: [] for name in stereo.WANTED}
    for distance in with_progress(effort.distances, len(effort.distances), monitor, every=1):
        for name, errors in stereo.rig_errors(distance, effort.n_trials).items():
            found, predicted, covered = errors.row()
            limit = stereo.WANTED[name] if distance == stereo.WANTED_AT else np.inf
            reached = abs(found / predicted - 1) <= stereo.WITHIN + chance and found <= limit
            wanted = f"<= {limit}" if np.isfinite(limit) else ""
            figures = (f"{found:.3f}", wanted, f"{predicted:.3f}", f"{found / predicted:.3f}", f"{100 * covered:.1f} %")
            rows.append((f"{distance:g}", name, *figures, verdict(reached)))
            curves[name].append(found)
    columns = (
        "distance [mm]",
        "what [mm, degrees]",
        "error",
        "wanted",
        "predicted",
        "error by predicted",
        "within stated 95 %",
    )
    title = f"{100 * stereo.WITHIN:.0f} %, and {100 * chance:.0f} % that are chance,"
    series = [Series(name, effort.distances, found) for name, found in curves.items()]
    drawing = draw("Errors of the rig", "distance [mm]", "root mean square error [mm, degrees]", series)
    return Section(
        "stereo",
        "Two cameras",
        f"The simulated rig of Gaschler (2011), {effort.n_trials} poses by chance of two targets and their joint, with "
        "the noise of the balls' centres that the rig states. Predicted is what the error propagation says beforehand.",
        (table(f"Wanted: errors within {title} of those predicted", columns, rows),),
        (Figure("Errors grow with the distance.", drawing),),
    )


def measure_exports(effort: Effort, monitor: Monitor) -> Section:
    """Exports: what the programs that own the formats pose, beside our motion.

    Parameters
    ----------
    effort : Effort
        How many seeds and frames are measured.
    monitor : Monitor
        Receives the progress.
    """
    del effort  # files are the same at any effort
    case = simulate("human", seed=0, n_frames=_EXPORTED_FRAMES, noise=0.5)
    project, rows = reconstruct(case.take), []
    with tempfile.TemporaryDirectory() as folder:
        for judge in with_progress(JUDGES, len(JUDGES), monitor, every=1):
            wanted = f"<= {judge.tolerance}"
            if find_spec(judge.name) is None:
                rows.append((judge.suffix, f"{judge.name} is not installed", "-", wanted, ""))
                continue
            files = judge.write(project, Path(folder))
            apart = judge.deviation(files, project)
            rows.append((judge.suffix, judge.name, f"{apart:.2g}", wanted, verdict(apart <= judge.tolerance)))
    columns = ("file", "posed by", "largest deviation [mm]", "wanted [mm]")
    text = (
        f"A reconstructed human of 15 limbs, {_EXPORTED_FRAMES} frames, written and posed by the library that owns the "
        "format. Judges come with pip install 'skelgen-mocap[dev]'. Cal3D's library is C++: the tests pose its files."
    )
    return Section("exports", "Exports", text, (table("Places of limbs (C3D: of joints)", columns, rows),))


def reconstructed(structure: str | Structure, seed: int, parameters: SimulationParameters) -> Evaluation:
    """Simulate a take, reconstruct it with nothing given, and compare it with its truth.

    Parameters
    ----------
    structure : str or Structure
        What moves.
    seed : int
        Of the simulation and of the stages.
    parameters : SimulationParameters
        Length and faults of the take.
    """
    case = simulate(structure, seed=seed, parameters=parameters)
    return evaluate(reconstruct(case.take, seed=seed, parameters=UNKNOWN), case.truth)


def is_exact(score: Evaluation) -> bool:
    """Return whether limbs and tree are the true ones."""
    return score.limbs is not None and score.topology is not None and score.limbs.is_exact and score.topology.is_exact


def _labelled(structure: str | Structure, seed: int, parameters: SimulationParameters) -> tuple[Evaluation, float]:
    """Evaluation of an unlabelled take, and the processor time [s] of all stages."""
    case = simulate(structure, seed=seed, parameters=parameters)
    started = time.process_time()
    project = reconstruct(case.take, seed=seed, parameters=UNKNOWN)
    return evaluate(project, case.truth), time.process_time() - started


def _is_exact_where_seen(score: Evaluation) -> bool:
    """Whether limbs and tree of the markers that were found are the true ones: cameras may never see some marker."""
    limbs, tree = score.limbs, score.topology
    if limbs is None or tree is None:
        return False
    same = limbs.adjusted_rand == 1.0 and limbs.n_limbs_found == limbs.n_limbs_true and limbs.n_left_out == 0
    return same and tree.is_exact


def _beside_score(structure: str, seed: int, parameters: SimulationParameters) -> tuple[Evaluation, float]:
    """Evaluation of a take with nothing given, and SCoRE's mean joint error [mm] with limbs and tree given."""
    case = simulate(structure, seed=seed, parameters=parameters)
    return evaluate(reconstruct(case.take, seed=seed, parameters=UNKNOWN), case.truth), score_error(case)


def _counts(scores: Sequence[Evaluation]) -> tuple[str, str]:
    """How many takes have the true limbs and the true tree."""
    limbs = sum(score.limbs is not None and score.limbs.is_exact for score in scores)
    trees = sum(score.topology is not None and score.topology.is_exact for score in scores)
    return f"{limbs} of {len(scores)}", f"{trees} of {len(scores)}"


def score_error(case: SimulatedTake) -> float:
    """Return the mean joint error [mm] of SCoRE with the true limbs and tree, hinges across their axes.

    Parameters
    ----------
    case : SimulatedTake
        A labelled take and its truth.
    """
    return float(np.nanmean(score_distances(case)))


def score_distances(case: SimulatedTake) -> Floats:
    """Return the distances of SCoRE's joints from the true ones, NaN where a limb has fewer than three markers.

    Parameters
    ----------
    case : SimulatedTake
        A labelled take and its truth: limbs and tree are given.

    Returns
    -------
    ndarray, shape (n_frames, n_joints), mm
        For hinges across their axes.
    """
    truth, positions = case.truth, cast(Trajectories, case.take).positions
    frames = np.arange(truth.n_frames)
    poses = [
        fit_shape(positions[:, truth.limb_of_marker == limb], frames).world_from_limb for limb in range(truth.n_limbs)
    ]
    joints = np.stack([rotation_centre(poses[one], poses[other]) for one, other in truth.edges.tolist()], axis=1)
    return joint_distances(joints, np.arange(truth.n_joints), truth)


def rotation_centre(first: Floats, second: Floats) -> Floats:
    """Return the centre of rotation of two bodies by SCoRE.

    With poses R, t of both, p and q minimise the sum of |R_1 p + t_1 - R_2 q - t_2|^2 over the frames.

    Parameters
    ----------
    first, second : ndarray, shape (n_frames, 4, 4)
        Poses of the bodies, NaN where they are not known.

    Returns
    -------
    ndarray, shape (n_frames, 3), mm
        The mean of both bodies' points.
    """
    both = ~np.isnan(first[:, 0, 0]) & ~np.isnan(second[:, 0, 0])
    rows = np.concatenate([first[both, :3, :3], -second[both, :3, :3]], axis=2).reshape(-1, 6)
    right = (second[both, :3, 3] - first[both, :3, 3]).ravel()
    place = np.linalg.lstsq(rows, right, rcond=None)[0]
    ends = (first[:, :3, :3] @ place[:3] + first[:, :3, 3], second[:, :3, :3] @ place[3:] + second[:, :3, 3])
    return np.asarray((ends[0] + ends[1]) / 2)
