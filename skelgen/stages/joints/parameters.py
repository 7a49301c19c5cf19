"""The declared parameters of the stage that finds joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from skelgen.parameters import StageParameters, declare

_NLCG = "JointFinder/NLCG"


@dataclass(frozen=True)
class DescentParameters(StageParameters):
    """The nonlinear conjugate gradient method (seed, table 4.16)."""

    stage: ClassVar[str] = "descent"
    seed_section: ClassVar[str] = _NLCG

    method: str = declare(
        "polak-ribiere",
        "how the next search direction is made conjugate",
        choices=("fletcher-reeves", "polak-ribiere"),
        seed_name="METHOD",
        seed_section=_NLCG,
        seed_codes=("fletcher-reeves", "polak-ribiere"),
    )
    tolerance: float = declare(
        1e-6,
        "stop when a step lowers the cost by less than this part",
        low=0.0,
        high=0.1,
        seed_name="FTOL",
        seed_section=_NLCG,
    )
    absolute_tolerance: float = declare(
        1e-10,
        "stop when a step lowers the cost by less than this",
        unit="mm^2",
        low=0.0,
        seed_name="EPSBREAK",
        seed_section=_NLCG,
    )
    max_iterations: int = declare(
        200, "stop after so many iterations", low=1, high=100000, seed_name="ITMAX", seed_section=_NLCG
    )
    step_limit: float = declare(
        100.0,
        "a bracket grows at most by this factor at once",
        low=1.1,
        high=1e6,
        seed_name="GLIMIT",
        seed_section=_NLCG,
    )
    line_iterations: int = declare(
        100, "iterations of a line search", low=1, high=100000, seed_name="ITMAXDBRENT", seed_section=_NLCG
    )
    line_tolerance: float = declare(
        1e-3,
        "relative width at which a line search stops",
        low=1e-15,
        high=0.5,
        seed_name="TOLBRENT",
        seed_section=_NLCG,
    )
    line_zero: float = declare(
        1e-12, "absolute width at which a line search stops", low=0.0, seed_name="ZEPS", seed_section=_NLCG
    )
    smallest: float = declare(
        1e-20, "a denominator below this counts as zero", low=0.0, high=1e-3, seed_name="EPS", seed_section=_NLCG
    )
    anneal: bool = declare(
        False, "shake the joint while it is optimised, less and less", seed_name="ADDRANDOM", seed_section=_NLCG
    )
    max_jitter: float = declare(
        1.0,
        "largest shake in the first iteration",
        unit="mm",
        low=0.0,
        high=1e3,
        seed_name="MAXJITTER",
        seed_section=_NLCG,
    )


@dataclass(frozen=True)
class JointParameters(DescentParameters):
    """How joints and the tree of limbs are found (seed, tables 4.15 and 4.16)."""

    stage: ClassVar[str] = "joints"
    seed_section: ClassVar[str] = "JointFinder/JC"

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
        seed_name="ALPHA",
        basic=True,
    )
    alpha_final: float = declare(
        0.0,
        "the same weight when the joints that are kept are placed: 0 does not pull them out of place",
        unit="mm",
        low=0.0,
        high=1e3,
        seed_name="ALPHAWEIGHT",
    )
    sampling: int = declare(
        0,
        "all pairs of limbs are tried on every so many frames; 0 spreads at most `samples` over the take",
        unit="frames",
        low=0,
        high=1e6,
        seed_name="SAMPLING",
    )
    samples: int = declare(300, "sampled frames when `sampling` is 0", unit="frames", low=5, high=1e6)
    max_residual: float = declare(
        25.0,
        "local optimisation that ends above this cost is tried again from earlier frames",
        unit="mm^2",
        low=0.0,
        seed_name="MAXFRET",
    )
    max_fallback: int = declare(
        5, "how many frames back such a start may come from", unit="frames", low=0, high=1000, seed_name="MAXFALLBACK"
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
