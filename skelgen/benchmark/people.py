"""The suite of simulated people and animals: how often their tree is right, and how well joints are found.

Everything is drawn by a seed: sizes, proportions, marker set, motion, and soft tissue as measured. Joints are compared
with SCoRE, which is given limbs and tree, where that can be computed: between limbs of three markers and more.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from skelgen.app.face import reconstruct
from skelgen.benchmark.accuracy import score_distances
from skelgen.benchmark.page import Effort, Section, figure_text, table, verdict
from skelgen.evaluation import evaluate
from skelgen.marker_sets import MARKER_SETS
from skelgen.model import Trajectories
from skelgen.progress import Monitor, with_progress
from skelgen.simulation import SimulationParameters, Structure, find_structure, resized, simulate
from skelgen.simulation.people import MOTIONS
from skelgen.simulation.take import SimulatedTake

WANTED_TREES = 0.9
"""Part of the people, and of the animals, whose tree is the true one."""

WANTED_OF_SCORE = 0.7
"""Mean error of joints in units of SCoRE's, which is given limbs and tree."""

HIDDEN_EVERY = 3
"""Of so many people one is measured again without the names of the markers: all sets, in all motions."""

_N_FRAMES = 600
_FAULTS = SimulationParameters(n_frames=_N_FRAMES, soft_tissue="realistic", noise=0.3, dropouts=0.02)
_ANIMAL_SIZES, _PROPORTIONS = (0.35, 1.8), 0.08  # of the quadruped; one standard deviation of the logarithm of lengths
_ANIMAL_RANGE = 0.7  # of the quadruped's amplitudes


@dataclass(frozen=True)
class FoundBody:
    """What was found of one body.

    Attributes
    ----------
    motion, marker_set : str
        How it moved, and what it wore.
    has_tree, has_limbs : bool
        Whether the tree is the true one, and whether the limbs are.
    edges : float
        Part of the true joints that the tree holds.
    error, score : float, mm
        Mean error of the joints that are found and that SCoRE can place, and SCoRE's of the same; NaN where none is.
    """

    motion: str
    marker_set: str
    has_tree: bool
    has_limbs: bool
    edges: float
    error: float
    score: float


def measure_people(effort: Effort, monitor: Monitor) -> Section:
    """People of all sizes in all marker sets and natural motions, and animals: trees and joints.

    Parameters
    ----------
    effort : Effort
        How many people and animals are measured.
    monitor : Monitor
        Receives the progress.
    """
    cases = [(simulated_person, index, False) for index in range(effort.n_people)]
    cases += [(simulated_animal, index, False) for index in range(effort.n_animals)]
    cases += [(simulated_person, index, True) for index in range(0, effort.n_people, HIDDEN_EVERY)]
    bodies = []
    for simulated, index, is_hidden in with_progress(cases, len(cases), monitor, every=1):
        case, motion, marker_set = simulated(index)
        bodies.append(_scored(without_names(case) if is_hidden else case, motion, marker_set, index))
    people, animals = bodies[: effort.n_people], bodies[effort.n_people : effort.n_people + effort.n_animals]
    hidden = bodies[effort.n_people + effort.n_animals :]
    by_motion = [(motion, [one for one in people if one.motion == motion]) for motion in MOTIONS]
    by_set = [(name, [one for one in people if one.marker_set == name]) for name in MARKER_SETS]
    columns = ("who", "bodies", "limbs exact", "tree exact", "edges", "joint error [mm]", "SCoRE [mm]", "of SCoRE")
    wanted = f"tree exact in {100 * WANTED_TREES:.0f} %, joints at most {WANTED_OF_SCORE} of SCoRE's error"
    rows = [*_rows(by_motion), *_rows([("all people", people), ("animals", animals)], has_verdict=True)]
    rows += _rows([(f"every {HIDDEN_EVERY}rd person, names hidden", hidden)])
    return Section(
        "people",
        "People and animals",
        f"{len(people)} people and {len(animals)} quadrupeds, with sizes, proportions and soft tissue of their own, "
        f"{_N_FRAMES} frames at 100 Hz, 0.3 mm noise, 2 % dropouts, markers named but in the last row. "
        "SCoRE (Ehrig et al. 2006) is given "
        "limbs and tree; joints are compared where it can place them, between limbs of three markers and more. "
        "Edges are the true joints that the tree holds.",
        (table(f"Wanted: {wanted}", columns, rows), table("The same people by marker set", columns, _rows(by_set))),
    )


def worn_and_moved(index: int) -> tuple[str, str]:
    """Return motion and marker set of a person; fifty in a row wear all sets in all motions."""
    of_motion = index % len(MOTIONS)
    return MOTIONS[of_motion], MARKER_SETS[(index // len(MOTIONS) + 2 * of_motion) % len(MARKER_SETS)]


def simulated_person(index: int) -> tuple[SimulatedTake, str, str]:
    """Return the take of a person, the motion and the marker set."""
    motion, marker_set = worn_and_moved(index)
    case = simulate("human", seed=index, parameters=_FAULTS.replace(motion=motion, marker_set=marker_set))
    return case, motion, marker_set


def without_names(case: SimulatedTake) -> SimulatedTake:
    """Return a take whose markers have numbers for names, here and in the truth."""
    take = cast(Trajectories, case.take)
    names = tuple(f"M{marker:03}" for marker in range(take.n_markers))
    hidden = Trajectories(take.positions, names, take.rate)
    return replace(case, take=hidden, truth=replace(case.truth, marker_names=names))


def simulated_animal(index: int) -> tuple[SimulatedTake, str, str]:
    """Return the take of an animal that moves at random, and how it moves and what it wears."""
    case = simulate(_animal(index), seed=index, parameters=_FAULTS.replace(motion_range=_ANIMAL_RANGE))
    return case, "random", "three on each limb"


def _animal(seed: int) -> Structure:
    """A quadruped of some size, alike on both sides."""
    rng, animal = np.random.default_rng(seed), find_structure("quadruped")
    size = rng.uniform(*_ANIMAL_SIZES)
    segments = [name.removeprefix("left ").removeprefix("right ") for name in animal.limb_names]
    factors = {segment: size * np.exp(_PROPORTIONS * rng.normal()) for segment in sorted(set(segments))}
    return resized(animal, {name: factors[segment] for name, segment in zip(animal.limb_names, segments, strict=True)})


def _scored(case: SimulatedTake, motion: str, marker_set: str, seed: int) -> FoundBody:
    found = evaluate(reconstruct(case.take, seed=seed), case.truth)
    limbs, tree = found.limbs, found.topology
    peers = dict(zip(case.truth.joint_names, _means(score_distances(case)), strict=True))
    both = [(joint.mean, peers[joint.name]) for joint in found.joints if joint.mean and np.isfinite(peers[joint.name])]
    error, score = np.mean(both, axis=0) if both else (np.nan, np.nan)
    return FoundBody(
        motion=motion,
        marker_set=marker_set,
        has_tree=tree is not None and tree.is_exact,
        has_limbs=limbs is not None and limbs.is_exact,
        edges=len(tree.found) / case.truth.n_joints if tree is not None else 0.0,
        error=float(error),
        score=float(score),
    )


def _means(distances: np.ndarray) -> list[float]:
    """Mean over the frames [mm] of each joint that has any; else NaN."""
    return [float(np.nanmean(column)) if np.isfinite(column).any() else np.nan for column in distances.T]


def _rows(groups: Iterable[tuple[str, Sequence[FoundBody]]], *, has_verdict: bool = False) -> list[tuple[str, ...]]:
    """A row of every group that somebody belongs to."""
    rows = []
    for name, bodies in groups:
        if not bodies:
            continue
        known = [one for one in bodies if np.isfinite(one.error)]
        error, score = np.mean([(one.error, one.score) for one in known], axis=0) if known else (np.nan, np.nan)
        trees, limbs = sum(one.has_tree for one in bodies), sum(one.has_limbs for one in bodies)
        figures = (f"{limbs} of {len(bodies)}", f"{trees} of {len(bodies)}")
        edges = f"{100 * np.mean([one.edges for one in bodies]):.0f} %"
        is_reached = trees >= WANTED_TREES * len(bodies) and error <= WANTED_OF_SCORE * score
        shown = [figure_text(float(value) if np.isfinite(value) else None, 1) for value in (error, score)]
        share = figure_text(float(error / score) if np.isfinite(error) else None, 2)
        rows.append(
            (name, str(len(bodies)), *figures, edges, *shown, share, verdict(is_reached) if has_verdict else "")
        )
    return rows
