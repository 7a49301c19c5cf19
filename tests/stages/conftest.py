"""Takes with truth, made once per session, and the results of the stages on them."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from skelgen.model import Limbs, Project, StageReport, Trajectories
from skelgen.progress import SilentMonitor
from skelgen.simulation import SimulatedTake, simulate
from skelgen.stages.joints import find_joints
from skelgen.stages.limbs import find_limbs
from skelgen.stages.skeleton import fit_skeleton

DATA = Path(__file__).parents[3] / "shared" / "data"


class Notices(SilentMonitor):
    """A monitor that keeps what it is told."""

    def __init__(self) -> None:
        self.sentences: list[str] = []

    def notice(self, sentence: str) -> None:
        self.sentences.append(sentence)


@pytest.fixture
def notices() -> Notices:
    """A monitor that keeps what it is told."""
    return Notices()


@pytest.fixture(scope="session")
def simulated() -> Callable[..., SimulatedTake]:
    """`simulate`, which makes each take only once: `simulated(name, seed=0, n_frames=300, **options)`."""

    @functools.cache
    def make(name: str, seed: int = 0, n_frames: int = 300, **options: float) -> SimulatedTake:
        return simulate(name, seed=seed, n_frames=n_frames, **options)

    return make


@pytest.fixture(scope="session")
def turning_limb() -> Callable[[np.ndarray, int], np.ndarray]:
    """Markers of a limb that turns, with 0.3 mm noise: `turning_limb(places, n_frames)`, (n_frames, n_markers, 3)."""

    def make(places: np.ndarray, n_frames: int) -> np.ndarray:
        angle = np.linspace(0.0, 6.0, n_frames)
        turns = np.stack([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]).transpose(2, 0, 1)
        positions = np.tile(places, (n_frames, 1, 1))
        positions[..., :2] = places[:, :2] @ turns.transpose(0, 2, 1)
        return positions + np.random.default_rng(0).normal(0.0, 0.3, positions.shape)

    return make


@pytest.fixture(scope="session")
def true_limbs() -> Callable[[SimulatedTake], Limbs]:
    """The limbs as they truly are."""

    def make(simulated: SimulatedTake) -> Limbs:
        truth = simulated.truth
        return Limbs(truth.limb_of_marker, np.zeros((truth.n_markers, truth.n_markers)))

    return make


@pytest.fixture(scope="session")
def reconstructed() -> Callable[..., Project]:
    """Run the stages on labelled markers: `reconstructed(take, limbs=..., joints=..., skeleton=..., n_limbs=...)`."""

    def run(take: Trajectories, limbs=None, joints=None, skeleton=None, n_limbs=None, given_limbs=None) -> Project:
        report = StageReport()
        project = Project(take).with_trajectories(take, report)
        found = given_limbs or find_limbs(take, limbs, n_limbs=n_limbs)
        project = project.with_limbs(found, report)
        project = project.with_topology(find_joints(take, found, joints), report)
        return project.with_skeleton(*fit_skeleton(take, found, project.topology, skeleton), report)

    return run


@pytest.fixture(scope="session")
def recording() -> Callable[[str], Trajectories]:
    """Read a real recording, or skip."""

    def read(path: str) -> Trajectories:
        import skelgen

        if not (DATA / path).exists():
            pytest.skip(f"the real recording {path} is not here: ../shared/data is absent")
        return skelgen.read(DATA / path)

    read.folder = DATA
    return read


def partition(labels: np.ndarray) -> set[frozenset[int]]:
    """Groups of indices, whatever their numbers."""
    return {frozenset(np.flatnonzero(labels == label).tolist()) for label in np.unique(labels)}


@pytest.fixture(scope="session")
def same_partition() -> Callable[[np.ndarray, np.ndarray], bool]:
    """Whether two labellings group the same things."""
    return lambda first, second: partition(np.asarray(first)) == partition(np.asarray(second))


@pytest.fixture(scope="session")
def moved_world() -> SimpleNamespace:
    """A rigid motion of the world: `moved_world.rotation`, `.shift` [mm] and `.points(array)`."""
    from skelgen.geometry.rotations import matrix_from_vector

    rotation, shift = matrix_from_vector(np.array([0.7, -1.1, 2.0])), np.array([3000.0, -500.0, 120.0])
    return SimpleNamespace(rotation=rotation, shift=shift, points=lambda points: points @ rotation.T + shift)


FALL_FRAME = 300


@pytest.fixture
def fallen(simulated) -> Callable[..., Trajectories]:
    """`fallen("head 1", ...)`: a human; these markers fall off in `FALL_FRAME` and lie still till the end."""

    def make(*names: str) -> Trajectories:
        take = simulated("human:4", n_frames=700, noise=0.5).take
        positions, seconds = take.positions.copy(), np.arange(700 - FALL_FRAME) / take.rate
        for marker in (take.names.index(name) for name in names):
            start = positions[FALL_FRAME, marker]
            dropped = np.minimum(9807.0 / 2 * seconds**2, 900.0)
            noise = np.random.default_rng(marker).normal(0.0, 0.5, (len(seconds), 3))
            positions[FALL_FRAME:, marker] = start - dropped[:, np.newaxis] * [0.0, 0.0, 1.0] + noise
        return dataclasses.replace(take, positions=positions)

    return make
