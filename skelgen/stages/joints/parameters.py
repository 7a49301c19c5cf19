"""The declared parameters of the stage that finds joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from skelgen.parameters import declare
from skelgen.stages.classic.conjugate_gradient import DescentParameters


@dataclass(frozen=True)
class JointParameters(DescentParameters):
    """How joints and the tree of limbs are found (seed, tables 4.15 and 4.16)."""

    stage: ClassVar[str] = "joints"
    config_section: ClassVar[str] = "JointFinder/JC"

    solver: str = declare(
        "closed-form",
        "closed-form solves limbs with poses directly and leaves the rest to conjugate gradients; "
        "conjugate-gradient minimises the joint cost of every pair, as the seed does",
        choices=("closed-form", "conjugate-gradient"),
    )
    alpha: float = declare(
        0.1,
        "weight of the mean distance from joint to markers in the cost that decides the tree",
        unit="mm",
        low=0.0,
        high=1e3,
        config_name="ALPHA",
        basic=True,
    )
    alpha_final: float = declare(
        0.0,
        "the same weight when the joints that are kept are placed: 0 does not pull them out of place",
        unit="mm",
        low=0.0,
        high=1e3,
        config_name="ALPHAWEIGHT",
    )
    sampling: int = declare(
        0,
        "all pairs of limbs are tried on every so many frames; 0 spreads at most `samples` over the take",
        unit="frames",
        low=0,
        high=1e6,
        config_name="SAMPLING",
    )
    samples: int = declare(300, "sampled frames when `sampling` is 0", unit="frames", low=5, high=1e6)
    max_residual: float = declare(
        25.0,
        "local optimisation that ends above this cost is tried again from earlier frames",
        unit="mm^2",
        low=0.0,
        config_name="MAXFRET",
    )
    max_fallback: int = declare(
        5, "how many frames back such a start may come from", unit="frames", low=0, high=1000, config_name="MAXFALLBACK"
    )
    joined: str = declare(
        "",
        "joints that are there, as pairs of limbs or of one marker of each: 'limb0, limb3; LKNE, LANK'",
        basic=True,
    )
    parted: str = declare("", "joints that are not there, in the same form", basic=True)
    separate: bool = declare(
        True,
        "whether edges of the tree that are no joints are cut, so that separate bodies are separate trees",
        basic=True,
    )
