"""Takes of given sizes, and structures that only benchmarks use."""

from __future__ import annotations

import dataclasses
from typing import Any, cast

import numpy as np

from skelgen.model import Trajectories
from skelgen.simulation import Structure, find_structure, simulate

LONG_TAKE_MARKERS = 40

_FOUR_MARKERS = ("pelvis", "chest", "head", "left thigh", "right thigh")
_LEFT_OUT = ("head", "hand", "foot")
_TWO_MARKERS = "forearm"
_FIFTH_MARKERS = 7  # limbs of the tree of 30 that get a marker more: 127 in all
_LONG: dict[str, Any] = {"n_frames": 6000, "rate": 200.0, "noise": 0.3, "soft_tissue": 2.0, "n_cameras": 8}
_FRESH_NOISE = 0.2  # mm
_CHUNK = 10_000  # frames


def fifty_markers() -> Structure:
    """Return the human with a fourth marker on five limbs: 50 in all."""
    more = {limb.name: limb for limb in find_structure("human:4").limbs}
    limbs = tuple(more[limb.name] if limb.name in _FOUR_MARKERS else limb for limb in find_structure("human").limbs)
    return Structure("human-50", limbs)


def ten_limbs() -> Structure:
    """Return a human without head, hands and feet, with two markers on the forearms: 28 markers on 10 limbs."""
    limbs = [limb for limb in find_structure("human").limbs if not limb.name.endswith(_LEFT_OUT)]
    fewer = [
        dataclasses.replace(limb, markers=limb.markers[:2]) if limb.name.endswith(_TWO_MARKERS) else limb
        for limb in limbs
    ]
    return Structure("ten-limbs", tuple(fewer))


def thirty_limbs() -> Structure:
    """Return the random tree of 30 limbs, some with a fifth marker amid the others: 127 markers."""
    limbs = list(find_structure("tree:30").limbs)
    for index, limb in enumerate(limbs[:_FIFTH_MARKERS]):
        markers = np.concatenate([limb.markers, limb.markers[:2].mean(axis=0, keepdims=True)])
        limbs[index] = dataclasses.replace(limb, markers=markers)
    return Structure("thirty-limbs", tuple(limbs))


def long_take(n_frames: int, seed: int = 0) -> Trajectories:
    """Return a short simulated take forth and back until it is long enough, with fresh noise, so that it is soon made.

    Parameters
    ----------
    n_frames : int
        Any number; an hour at 200 Hz is 720 000.
    seed : int
        Seed of motion and noise.
    """
    short = cast(Trajectories, simulate("human", seed=seed, **_LONG).take)
    turn = 2 * short.n_frames - 2
    frames = np.arange(n_frames) % turn
    frames = np.where(frames < short.n_frames, frames, turn - frames)
    positions, random = np.empty((n_frames, LONG_TAKE_MARKERS, 3)), np.random.default_rng(seed)
    for first in range(0, n_frames, _CHUNK):
        part = short.positions[frames[first : first + _CHUNK], :LONG_TAKE_MARKERS]
        positions[first : first + _CHUNK] = part + random.normal(0.0, _FRESH_NOISE, part.shape)
    positions.flags.writeable = False
    return Trajectories(positions, short.names[:LONG_TAKE_MARKERS], short.rate)
