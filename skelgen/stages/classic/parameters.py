"""What can be set of the conjugate gradients that place joints (Schönauer 2007, table 4.16)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from skelgen.parameters import StageParameters, declare

_NLCG = "JointFinder/NLCG"


@dataclass(frozen=True)
class DescentParameters(StageParameters):
    """The nonlinear conjugate gradient method (Schönauer 2007, table 4.16)."""

    stage: ClassVar[str] = "descent"
    config_section: ClassVar[str] = _NLCG
    retired: ClassVar[Mapping[str, str]] = {"line_zero": f"{_NLCG}/ZEPS", "smallest": f"{_NLCG}/EPS"}
    acts_with: ClassVar[str] = "solver=conjugate-gradient or limbs=small"

    method: str = declare(
        "polak-ribiere",
        "how the next search direction is made conjugate",
        choices=("fletcher-reeves", "polak-ribiere"),
        config_name="METHOD",
        config_codes=("fletcher-reeves", "polak-ribiere"),
    )
    tolerance: float = declare(
        1e-6, "stop when a step lowers the cost by less than this part", within=(0.0, 0.1), config_name="FTOL"
    )
    absolute_tolerance: float = declare(
        1e-10,
        "stop when a step lowers the cost by less than this",
        unit="mm^2",
        within=(0.0, 1e6),
        config_name="EPSBREAK",
    )
    max_iterations: int = declare(200, "stop after so many iterations", within=(1, 100000), config_name="ITMAX")
    step_limit: float = declare(
        100.0, "a bracket grows at most by this factor at once", within=(1.1, 1e6), config_name="GLIMIT"
    )
    line_iterations: int = declare(100, "iterations of a line search", within=(1, 100000), config_name="ITMAXDBRENT")
    line_tolerance: float = declare(
        1e-3, "relative width at which a line search stops", within=(1e-15, 0.5), config_name="TOLBRENT"
    )
    anneal: bool = declare(False, "shake the joint while it is optimised, less and less", config_name="ADDRANDOM")
    max_jitter: float = declare(
        1.0,
        "largest shake in the first iteration",
        unit="mm",
        within=(0.0, 1e3),
        config_name="MAXJITTER",
        acts_with="solver=conjugate-gradient and anneal=yes or limbs=small and anneal=yes",
    )
