"""Marker lists as public recordings have them: sets are recognised, limbs called rightly, no side is exchanged."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from skelgen.model import Limbs
from skelgen.stages.names import name_limbs, recognised_set, segments_of_markers

LISTS = tomllib.loads(Path(__file__).with_name("public_marker_lists.toml").read_text(encoding="utf-8"))


def worn(row):
    """The markers on each limb, by its name, and those on none."""
    written = dict(zip(("left", "right"), row.get("sides", "LR"), strict=True))
    limbs = {}
    for limb, markers in row.items():
        if limb not in {"source", "set", "sides"}:
            for side, letter in written.items():
                found = limbs.setdefault(limb.replace("@", side), [])
                either = [marker.replace("@", letter) for marker in markers if "@" in marker or side == "left"]
                found += either if "@" not in limb else [marker.replace("@", letter) for marker in markers]
    return limbs, limbs.pop("none", [])


@pytest.mark.parametrize("take", LISTS)
def test_every_limb_of_a_public_list_has_its_name(take):
    limbs, others = worn(LISTS[take])
    names = [marker for markers in limbs.values() for marker in markers] + others
    labels = np.repeat(np.arange(len(limbs)), [len(markers) for markers in limbs.values()])
    labels = np.append(labels, np.full(len(others), -1))
    found = recognised_set(names)
    assert (found.name if found else "") == LISTS[take].get("set", "")
    called = name_limbs(Limbs(labels, np.zeros((len(names), len(names)))), names, found)
    wanted = [limb if limb != "unnamed" else f"limb{number}" for number, limb in enumerate(limbs)]
    assert called == tuple(wanted)


@pytest.mark.parametrize("take", LISTS)
def test_no_marker_of_a_public_list_changes_sides(take):
    limbs, _ = worn(LISTS[take])
    said = segments_of_markers([marker for markers in limbs.values() for marker in markers])
    for limb, markers in limbs.items():
        side = limb.partition(" ")[0]
        told = {marker: said[marker][0].partition(" ")[0] for marker in markers if marker in said}
        assert not {marker for marker, other in told.items() if other in {"left", "right"} and other != side}
