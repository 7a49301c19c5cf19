"""Natural motions: joint angles follow curves over a cycle (``tables/motions.toml``), and the feet carry the body.

Curves are given for the left side; the right side follows by a part of the cycle. The ankle turns the sole as the
motion wants it in the room, so that feet on the ground lie flat. The root moves so that whatever touches the ground
stays in its place; between two contacts it flies along a parabola.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from skelgen.marker_sets import read_table
from skelgen.model.arrays import Bools, Floats
from skelgen.simulation.articulated import DEGREES_OF_FREEDOM, Structure
from skelgen.simulation.motion import smooth_curves, world_from_limbs
from skelgen.simulation.people.body import SIDES, TABLES, Person

MOTIONS = ("walk", "run", "squat", "reach", "jump")
"""Natural motions of people."""

SLOWEST = 20.0
"""Lowest frame rate [Hz] that shows steps and flights."""

_LEG = ("hip", "knee", "foot")  # first words of the curves that lag as legs do; all others lag as arms do

_SIZES, _POSTURE = 0.06, 2.0  # one standard deviation between people: of the logarithm of sizes, and in degrees
_UNLIKE = 0.02  # one standard deviation of the logarithm of one side's sizes
_TEMPO = 0.04  # part by which the cycle's length wanders
_SWAY, _SWAY_FREQUENCIES = 1.2, (0.1, 0.8)  # degrees and Hz of what nobody keeps still
_SMOOTHING = 0.012  # s: joints do not change their speed at once
_CHANGE = 8.0  # percent of the cycle in which a curve takes on the size of the next cycle
_RAMP = 2.0  # percent of the cycle in which a foot takes up the load
_MOST_TOE = 55.0  # degrees
_TOES_LAG = 6.0  # percent of the cycle for which toes stay bent after they leave the ground
_STEPS, _DAMPING, _TINY = 6, 2e3, 1e-5  # damping in mm^2: straight knees do not lengthen a leg; rad
_REACH = 200.0  # mm: what a rad of a turned foot counts
_LIFTS, _CLEARANCE, _LIFTED_BY, _LIFT_TIME = 4, 12.0, 200.0, 0.03  # rounds; mm; mm a rad of the knee; s
_INERTIA, _CUSHION = 0.03, 0.018  # s: the body changes its speed over the ground and its height no faster
_SOFT = 5.0  # mm: depth of heel pads and soles
_GRAVITY = 9810.0  # mm/s^2
_PADDING = 1.5  # cycles before and after the take, so that flights at its ends have both of theirs


@dataclass(frozen=True, eq=False)
class _Cycle:
    """Phase of the motion in every frame, sizes of its cycles, and who performs it."""

    table: dict[str, Any]
    phase: Floats
    sizes: Floats
    seconds: float
    rate: float
    rng: np.random.Generator

    def curve(self, pairs: list[list[float]], lag: float = 0.0) -> Floats:
        """Degrees of a curve that lags by percents of the cycle."""
        keys = np.asarray(pairs, dtype=np.float64)
        places = np.concatenate([keys[:, 0] - 100, keys[:, 0], keys[:, 0] + 100])
        from scipy.interpolate import PchipInterpolator  # noqa: PLC0415 - as below

        return np.asarray(PchipInterpolator(places, np.tile(keys[:, 1], 3))(100 * ((self.phase - lag / 100) % 1)))

    def personal(self, pairs: list[list[float]], lag: float, size: float, offset: float) -> Floats:
        """A curve in somebody's size about its first value, somewhat larger or smaller in every cycle."""
        phase = self.phase - lag / 100
        number = np.floor(phase).astype(int) - int(np.floor(self.phase[0] - 1))
        towards = np.clip((100 * (phase % 1) - 100 + _CHANGE) / _CHANGE, 0.0, 1.0)
        step = self.sizes[number + 1] - self.sizes[number]
        size = size * (self.sizes[number] + towards**2 * (3 - 2 * towards) * step)
        return np.asarray(pairs[0][1] + size * (self.curve(pairs, lag) - pairs[0][1]) + offset)

    def load(self, stance: list[list[float]], lag: float) -> Floats:
        """How far a foot is on the ground, 0 to 1."""
        percent = 100 * ((self.phase - lag / 100) % 1)
        found = np.zeros(len(percent))
        for start, end in stance:
            if end - start >= 100:
                return np.ones(len(percent))
            for shift in (-100, 0, 100):
                rising, falling = percent + shift - start, end - percent - shift
                found = np.maximum(found, np.clip(np.minimum(rising, falling) / _RAMP + 0.5, 0.0, 1.0))
        return found


def natural_motion(
    someone: Person, motion: str, n_frames: int, rate: float, rng: np.random.Generator
) -> tuple[list[Floats], Floats]:
    """Let a person move.

    Parameters
    ----------
    someone : Person
        Who moves.
    motion : str
        One of `MOTIONS`.
    n_frames : int
        Number of frames.
    rate : float, Hz
        Frame rate, at least `SLOWEST`.
    rng : numpy.random.Generator
        Source of tempo, sizes, posture and way.

    Returns
    -------
    angles : list of ndarray, shape (n_frames, n_angles), rad
        Angles of all limbs of `someone.body`.
    world_from_limb : ndarray, shape (n_frames, n_limbs, 4, 4), translations in mm
        Their poses; the ground is at z = 0.
    """
    table = read_table("motions", TABLES)[motion]
    seconds = rng.uniform(*table["seconds"])
    padding = int(np.ceil(_PADDING * seconds * rate))
    n_padded = n_frames + 2 * padding
    tempo = 1 + _TEMPO * smooth_curves(rng, n_padded, rate, 1, _SWAY_FREQUENCIES)[:, 0]
    phase = np.cumsum(tempo / (seconds * rate)) + rng.uniform()
    sizes = np.clip(1 + table["variation"] * rng.normal(size=int(phase[-1] - phase[0]) + 5), 0.3, 1.7)
    cycle = _Cycle(table, phase, sizes, seconds, rate, rng)
    body, angles = someone.body, _joint_angles(someone.body, cycle)
    soles = _turn_on_the_way(body, angles, cycle)
    if not table["legs_lag"]:
        _keep_stance(body, angles, soles)
    for _ in range(_LIFTS):
        _set_feet(body, angles, cycle, soles)
        still = world_from_limbs(body, angles, np.zeros((n_padded, 3)))
        points, loads = _ground_points(someone, still, cycle)
        root = _carried_root(points, loads, rate)
        _lift_swinging(body, angles, points[..., 2] + root[:, 2:], loads, rate)
    take = slice(padding, padding + n_frames)
    root -= [*root[take, :2].mean(axis=0), 0.0]
    poses = still[take].copy()
    poses[..., :3, 3] += root[take, np.newaxis]
    return [one[take] for one in angles], poses


def _joint_angles(body: Structure, cycle: _Cycle) -> list[Floats]:
    """Angles [rad] of all joints but ankles and toes."""
    rng, table, n_frames = cycle.rng, cycle.table, len(cycle.phase)
    moved = read_table("motions", TABLES)["curves"]
    angles = [np.zeros((n_frames, DEGREES_OF_FREEDOM[one.kind])) for one in body.limbs]
    index_of = {name: index for index, name in enumerate(body.limb_names)}
    depth = np.exp(_SIZES * rng.normal())  # of legs that bend together
    for name, pairs in table["middle"].items():
        degrees = cycle.personal(pairs, 0.0, np.exp(_SIZES * rng.normal()), _POSTURE * rng.normal())
        if name == "sway":
            for side in SIDES:
                angles[index_of[f"{side} thigh"]][:, 0] -= np.deg2rad(degrees)
            continue
        limb, column, sign = moved["middle"][name]
        angles[index_of[limb]][:, column] += np.deg2rad(sign * degrees)
    for name, pairs in table["left"].items():
        if name not in moved["left"]:
            continue
        of_legs = name.startswith(_LEG)
        size, offset = np.exp(_SIZES * rng.normal()), 0.0 if of_legs else _POSTURE * rng.normal()
        size = size if not of_legs or table["legs_lag"] else depth
        segment, column, sign, is_mirrored = moved["left"][name]
        late = table["legs_lag" if of_legs else "arms_lag"]
        unlike = _UNLIKE if late or not of_legs else 0.0  # legs that work together stay on the ground together
        for side, s in SIDES.items():
            lag = 0.0 if s > 0 else late
            degrees = cycle.personal(pairs, lag, size * np.exp(unlike * rng.normal()), offset)
            angles[index_of[f"{side} {segment}"]][:, column] += np.deg2rad(sign * (s if is_mirrored else 1) * degrees)
    for index, one in enumerate(body.limbs):
        if one.kind == "ball" and not one.name.endswith("thigh"):
            angles[index] += np.deg2rad(_SWAY) * smooth_curves(rng, n_frames, cycle.rate, 3, _SWAY_FREQUENCIES)
    return [_smoothed(found, _SMOOTHING * cycle.rate, axis=0) for found in angles]


def _turn_on_the_way(body: Structure, angles: list[Floats], cycle: _Cycle) -> dict[str, Rotation]:
    """Turn the root along a circle, and hips so that feet on the ground keep their heading; return how soles lie."""
    table, n_frames = cycle.table, len(cycle.phase)
    radius = cycle.rng.uniform(*table["turn_radius"])
    turning = cycle.rng.choice([-1.0, 1.0]) * table["speed"] / radius  # rad/s
    heading = cycle.rng.uniform(0, 2 * np.pi) + turning * np.arange(n_frames) / cycle.rate
    rotation = angles[0][:, 0].copy()
    angles[0][:, 0] += heading
    found = {}
    for side, s in SIDES.items():
        end = table["stance"][0][1]
        half = turning * cycle.seconds * end / 200
        pairs = [[0.0, half], [end / 2, 0.0], [end, -half]] if turning else [[0.0, 0.0], [50.0, 0.0]]
        back = cycle.curve(pairs, 0.0 if s > 0 else table["legs_lag"])
        toe_out = s * np.deg2rad(table["toe_out"])
        thigh = body.limb_names.index(f"{side} thigh")
        angles[thigh][:, 2] += back - rotation + toe_out / 2
        curve = cycle.curve(table["left"]["foot pitch"], 0.0 if s > 0 else table["legs_lag"])
        pitch = np.deg2rad(_smoothed(curve, _SMOOTHING * cycle.rate))
        found[side] = Rotation.from_euler("ZY", np.stack([heading + back + toe_out, pitch], axis=1))
    return found


def _ankle_angles(body: Structure, side: str, poses: Floats, sole: Rotation) -> Floats:
    """Angles [rad] about both axes of an ankle that bring the sole where it is wanted, and that which no ankle can."""
    foot, shank = (body.limb_names.index(f"{side} {name}") for name in ("foot", "shank"))
    first, second = body.limbs[foot].axes
    basis = Rotation.from_matrix(np.stack([first, second, np.cross(first, second)], axis=1))
    turn = Rotation.from_matrix(poses[:, shank, :3, :3]).inv() * sole
    return np.asarray((basis.inv() * turn * basis).as_euler("XYZ"))


def _keep_stance(body: Structure, angles: list[Floats], soles: dict[str, Rotation]) -> None:
    """Change hips and knees so that both feet stay in their places on the ground (damped Gauss-Newton steps)."""
    thighs, shanks, feet = (
        [body.limb_names.index(f"{side} {name}") for side in SIDES] for name in ("thigh", "shank", "foot")
    )
    n_frames, still = len(angles[0]), np.zeros((len(angles[0]), 3))
    ahead = sum(sole.apply([1.0, 0.0, 0.0]) for sole in soles.values())
    heading = Rotation.from_euler("z", np.arctan2(ahead[:, 1:2], ahead[:, :1]))

    def places() -> Floats:
        """Ankles [mm] in the heading of the body, and by how much its sole turns away; shape (n_frames, 2, 4)."""
        poses = world_from_limbs(body, angles, still)
        ankles = np.stack([heading.inv().apply(poses[:, foot, :3, 3]) for foot in feet], axis=1)
        aside = [_ankle_angles(body, side, poses, soles[side])[:, 2:] for side in SIDES]
        return np.concatenate([ankles, _REACH * np.stack(aside, axis=1)], axis=2)

    unknowns = [
        [(thigh, column) for column in range(3)] + [(shank, 0)] for thigh, shank in zip(thighs, shanks, strict=True)
    ]
    upright = int(np.argmin(angles[shanks[0]][:, 0]))
    width = places()[upright, 0, 1] - places()[upright, 1, 1]
    for _ in range(_STEPS):
        now = places()
        wanted = np.zeros_like(now)
        wanted[..., :3] = now[..., :3].mean(axis=1, keepdims=True) + np.array([[0, width / 2, 0], [0, -width / 2, 0]])
        slopes = np.empty((n_frames, 2, 4, 4))
        for column in range(4):
            for leg in unknowns:
                angles[leg[column][0]][:, leg[column][1]] += _TINY
            slopes[..., column] = (places() - now) / _TINY
            for leg in unknowns:
                angles[leg[column][0]][:, leg[column][1]] -= _TINY
        back = slopes.swapaxes(-1, -2)
        normal = back @ slopes + _DAMPING * np.eye(4)
        steps = np.linalg.solve(normal, back @ (wanted - now)[..., np.newaxis])[..., 0]
        for side, leg in enumerate(unknowns):
            for column, (limb, angle) in enumerate(leg):
                angles[limb][:, angle] += steps[:, side, column]


def _set_feet(body: Structure, angles: list[Floats], cycle: _Cycle, soles: dict[str, Rotation]) -> None:
    """Turn ankles and toes so that soles lie as they are wanted, and toes stay on the ground."""
    table, poses = cycle.table, world_from_limbs(body, angles, np.zeros((len(cycle.phase), 3)))
    for side, s in SIDES.items():
        lag = 0.0 if s > 0 else table["legs_lag"]
        foot, toes = (body.limb_names.index(f"{side} {name}") for name in ("foot", "toes"))
        angles[foot][:] = _ankle_angles(body, side, poses, soles[side])[:, :2]
        pitch = soles[side].as_euler("ZYX")[:, 1]
        late = [[start, end + _TOES_LAG] for start, end in table["stance"]]
        angles[toes][:, 0] = np.clip(pitch, 0.0, np.deg2rad(_MOST_TOE)) * _smoothed(
            cycle.load(late, lag), _TOES_LAG / 300 * cycle.seconds * cycle.rate
        )


def _ground_points(someone: Person, still: Floats, cycle: _Cycle) -> tuple[Floats, Floats]:
    """Points [mm] that may touch the ground, (n_frames, n_points, 3), the left's first, and the load on their feet."""
    points, loads = [], []
    for name, offsets in sorted(someone.contacts.items()):
        pose = still[:, someone.body.limb_names.index(name)]
        points.append(pose[:, np.newaxis, :3, 3] + offsets @ pose[:, :3, :3].swapaxes(1, 2))
        lag = 0.0 if name.startswith("left") else cycle.table["legs_lag"]
        loads.append(np.repeat(cycle.load(cycle.table["stance"], lag)[:, np.newaxis], len(offsets), axis=1))
    return np.concatenate(points, axis=1), np.concatenate(loads, axis=1)


def _lift_swinging(body: Structure, angles: list[Floats], heights: Floats, loads: Floats, rate: float) -> None:
    """Bend knees and hips where a foot without load is nearer to the ground [mm] than feet that swing through."""
    half = heights.shape[1] // 2
    for side, points in zip(SIDES, (slice(None, half), slice(half, None)), strict=True):
        missing = np.maximum(_CLEARANCE - heights[:, points].min(axis=1), 0.0) * (1 - loads[:, points].max(axis=1))
        bent = _smoothed(missing, _LIFT_TIME * rate) / _LIFTED_BY
        angles[body.limb_names.index(f"{side} shank")][:, 0] += bent
        angles[body.limb_names.index(f"{side} thigh")][:, 1] -= bent / 2


def _carried_root(every: Floats, load: Floats, rate: float) -> Floats:
    """Places [mm] of the root that keep what touches the ground where it is, shape (n_frames, 3).

    Parameters
    ----------
    every : ndarray, shape (n_frames, n_points, 3), mm
        Points of feet with the root at the origin.
    load : ndarray, shape (n_frames, n_points)
        Load on their feet, 0 to 1.
    rate : float, Hz
        Frame rate.
    """
    flying = load.max(axis=1) < 0.5
    depth = every[..., 2] - np.where(load > 0, every[..., 2], np.inf).min(axis=1, keepdims=True, initial=1e9)
    weights = load * np.exp(-np.maximum(depth, 0.0) / _SOFT)
    weights /= np.maximum(weights.sum(axis=1, keepdims=True), 1e-9)
    height = -(weights * every[..., 2]).sum(axis=1)
    speed = -(weights[..., np.newaxis] * np.gradient(every[..., :2], axis=0)).sum(axis=1)
    for start, end in _runs(flying):
        frames = np.arange(end - start + 2)
        share = frames[1:-1] / frames[-1]
        line = height[start - 1] + share * (height[end] - height[start - 1])
        seconds = frames[1:-1] / rate
        height[start:end] = line + _GRAVITY / 2 * seconds * (frames[-1] / rate - seconds)
        speed[start:end] = speed[start - 1] + share[:, np.newaxis] * (speed[end] - speed[start - 1])
    way = np.cumsum(_smoothed(speed, _INERTIA * rate, axis=0), axis=0)
    return np.column_stack([way, _smoothed(height, _CUSHION * rate)])


def _runs(flying: Bools) -> list[tuple[int, int]]:
    """First frame, and that after the last, of flights that begin and end within the frames."""
    steps = np.diff(flying.astype(int))
    starts, ends = np.flatnonzero(steps == 1) + 1, np.flatnonzero(steps == -1) + 1
    return [(int(start), int(ends[ends > start][0])) for start in starts if (ends > start).any()]


def _smoothed(values: Floats, deviation: float, axis: int = -1) -> Floats:
    from scipy.ndimage import gaussian_filter1d  # noqa: PLC0415 - slow to load, and who asks for tables needs it not

    return np.asarray(gaussian_filter1d(values, deviation, axis=axis, mode="nearest"))
