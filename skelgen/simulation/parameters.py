"""Parameters of a simulated take: its motion, who moves, and the faults of the tracker."""

from dataclasses import dataclass
from typing import ClassVar

from skelgen.errors import ParameterError
from skelgen.marker_sets import LABORATORY_SETS, MARKER_SETS
from skelgen.parameters import Declaration, StageParameters, declare
from skelgen.simulation.people import HEIGHTS, MOTIONS

OF_PEOPLE = ("motion", "marker_set", "height")
"""Parameters that only the simulated human has."""

REALISTIC, NONE = "realistic", "none"

_OF_MARKERS = ("soft_tissue", "n_cameras", "ghosts", "merged", "duplicates", "edge_jumps", "labelled", "spacing")
_SLIDE = Declaration("soft_tissue", float, 0.0, "", unit="mm", low=0.0, high=1000.0)


@dataclass(frozen=True)
class SimulationParameters(StageParameters):
    """Parameters of the motion, and of the faults of the tracker."""

    stage: ClassVar[str] = "simulate"

    n_frames: int = declare(1000, "Length of the take.", unit="frames", within=(1, 1_000_000))
    rate: float = declare(100.0, "Frame rate.", unit="Hz", within=(1e-3, 1e5))
    noise: float = declare(0.0, "Standard deviation of each measured coordinate.", unit="mm", within=(0.0, 1000.0))
    soft_tissue: str = declare(
        NONE,
        "How soft tissue moves markers: realistic, as measured on people; none; or the standard deviation of each "
        "marker's displacement on its limb, per coordinate, in mm.",
    )
    dropouts: float = declare(0.0, "Part of all marker positions that is lost, mostly in bursts.", within=(0.0, 0.95))
    dropout_seconds: float = declare(
        0.0,
        "Mean length of a dropout; lengths are distributed exponentially; needs dropouts. 0: bursts of 5 to "
        "40 frames, and single ones.",
        unit="s",
        within=(0.0, 100.0),
    )
    n_cameras: int = declare(0, "Cameras around the volume that limbs can block; 0 sees everything.", within=(0, 64))
    ghosts: float = declare(0.0, "Mean number of false points per frame; needs labelled = false.", within=(0.0, 1000.0))
    merged: float = declare(
        0.0,
        "Markers nearer than this become one point, their mean, which is no marker's in the truth; needs labelled = "
        "false.",
        unit="mm",
        within=(0.0, 1000.0),
    )
    duplicates: float = declare(
        0.0, "Mean number of markers per frame that are seen as two points; needs labelled = false.", within=(0.0, 1e3)
    )
    edge_jumps: float = declare(
        0.0,
        "Standard deviation of each coordinate in the first and last frames in which a marker is seen.",
        unit="mm",
        within=(0.0, 1000.0),
    )
    labelled: bool = declare(True, "Whether markers carry names; otherwise they are points in random order.")
    motion_range: float = declare(1.0, "Factor on the amplitude of all joint angles.", within=(0.0, 3.0))
    walk: float = declare(1000.0, "How far the root walks from the centre along x and y.", unit="mm", within=(0.0, 1e5))
    speed: float = declare(1.0, "How many times as fast as usual limbs and root move at random.", within=(0.01, 100.0))
    spacing: float = declare(
        0.0,
        "Median distance of markers from the nearest one on their limb, which are drawn together; 0: as they are worn.",
        unit="mm",
        within=(0.0, 1000.0),
    )
    subjects: int = declare(1, "How many bodies there are, each with a motion of its own.", within=(1, 20))
    apart: float = declare(
        3000.0, "How far neighbouring bodies are apart; needs several.", unit="mm", within=(0.0, 1e5)
    )
    hold: str = declare(
        NONE,
        "Whether two bodies hold on to each other for a part of the take: two partners at the ends of a limb each "
        "(needs subjects = 2), or a limb that takes a tool, which lies still before and afterwards.",
        choices=(NONE, "partners", "tool"),
    )
    sensors: bool = declare(
        False, "Whether each limb carries a sensor with position and orientation, put on anywhere, and no markers."
    )
    turn_noise: float = declare(
        0.0, "Standard deviation of a sensor's rotation about each axis.", unit="deg", within=(0.0, 90.0)
    )
    motion: str = declare("random", "How a human moves.", choices=("random", *MOTIONS))
    marker_set: str = declare(
        NONE,
        "Markers as people wear them, on a human; none: markers that wind around all limbs. A human who walks, runs or "
        "the like wears plug-in-gait if nothing else is stated.",
        choices=(NONE, *MARKER_SETS, *LABORATORY_SETS),
    )
    height: float = declare(
        0.0, "Height of a human who wears a marker set; 0: drawn by the seed.", unit="mm", within=(0.0, HEIGHTS[1])
    )

    def __post_init__(self) -> None:
        object.__setattr__(self, "soft_tissue", str(self.soft_tissue))
        super().__post_init__()
        if 0 < self.height < HEIGHTS[0]:
            raise ParameterError(f"{self.stage}: height is {self.height:g}; it must be 0 or at least {HEIGHTS[0]:g} mm")
        if self.soft_tissue not in {REALISTIC, NONE}:
            try:
                _SLIDE.check(self.soft_tissue, self.stage)
            except ParameterError as error:
                raise ParameterError(f"{error}, or be {REALISTIC} or {NONE}") from error
        if self.hold == "partners" and self.subjects != 2:
            there = "there is 1 subject" if self.subjects == 1 else f"there are {self.subjects} subjects"
            raise ParameterError(f"{self.stage}: partners who hold hands are two; {there}")
        if self.hold == "tool" and self.subjects != 1:
            raise ParameterError(f"{self.stage}: one subject takes the tool; there are {self.subjects}")
        odd = [name for name in _OF_MARKERS if getattr(self, name) != getattr(type(self), name)]
        if self.sensors and odd:
            raise ParameterError(
                f"{self.stage}: {odd[0]} belongs to markers; sensors have noise, turn_noise and dropouts"
            )
        if self.turn_noise and not self.sensors:
            raise ParameterError(f"{self.stage}: turn_noise belongs to sensors")

    @property
    def slide(self) -> float:
        """Standard deviation [mm] that `soft_tissue` states; 0 where it is realistic or none."""
        return 0.0 if self.soft_tissue in {REALISTIC, NONE} else float(self.soft_tissue)

    @property
    def is_of_person(self) -> bool:
        """Whether somebody with a size, a marker set and a natural motion is simulated."""
        return any(getattr(self, option) != getattr(type(self), option) for option in OF_PEOPLE)
