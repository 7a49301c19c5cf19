"""What a user can set about labelling (names of Schönauer 2007, tables 4.13-4.16)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from skelgen.parameters import StageParameters, declare
from skelgen.stages.repair import RepairParameters

_SETS = "take=unlabelled and method=sets or take=unlabelled and compare=yes"
"""When Marker Sets are joined."""

_REPAIR = "take=labelled and repair=yes"
_SLIPS = f"{_REPAIR} and slips=yes"


@dataclass(frozen=True)
class LabelParameters(StageParameters):
    """Parameters of the labels stage; 0 means "found from the data" where the help says so.

    Attributes
    ----------
    assignment, prediction, smoothing, max_jump, mute, max_gap, link_evidence
        How points are followed from frame to frame.
    min_range, trim_range, remove_distance, stand_alone, least_seen
        Which tracklets and frames are good enough to be used.
    alignment, n_neighbours, misfit_weight, sampling
        How the classic method finds the distance between two Marker Sets.
    clustering, sigma
        How the classic method groups Marker Sets into markers.
    method, rounds, compare
        How tracklets become markers, and whether the classic method is compared.
    computed_points
        Whether points that a model computed are markers.
    repair, fills, swap_evidence, slips, slip_seconds, slip_evidence
        How errors are searched for in takes that are labelled already.
    add_random, max_jitter, time_one_frame
        Test jitter, and the clock of takes whose time stamps do not rise.
    """

    stage: ClassVar[str] = "labels"
    config_section: ClassVar[str] = "TemporalCorrespondence"
    acts_with: ClassVar[str] = "take=unlabelled"
    classic: ClassVar[Mapping[str, str]] = {"method": "sets"}

    assignment: str = declare(
        "optimal",
        "How points of successive frames are matched: smallest distance first, or least sum of squared distances.",
        choices=("greedy", "optimal"),
    )
    prediction: str = declare(
        "double_exponential",
        "Where a marker is expected next: where it was, moved on by its last step, or by its smoothed trend.",
        choices=("none", "constant_velocity", "double_exponential"),
    )
    smoothing: float = declare(
        0.8,
        "Smoothing of the double exponential prediction; 1 trusts the last point alone.",
        within=(0.05, 1.0),
        acts_with="take=unlabelled and prediction=double_exponential",
    )
    max_jump: float = declare(
        0.0,
        "Farthest that a point may lie from where its marker was expected; 0 = found from the take.",
        unit="mm",
        within=(0.0, 1e6),
        basic=True,
    )
    mute: int = declare(2, "How long a marker that jumped farther is ignored.", unit="frames", within=(0, 1000))
    max_gap: int = declare(
        5, "Longest gap over which a marker is followed by prediction alone.", unit="frames", within=(0, 50), basic=True
    )
    link_evidence: float = declare(
        5.0,
        "A track is cut where its next point is not more probable than any other explanation by this evidence.",
        unit="nats",
        within=(0.0, 100.0),
    )
    min_range: int = declare(
        0,
        "Tracklets with fewer frames are removed; 0 = half a second, at most a quarter of the take.",
        unit="frames",
        within=(0, 1e6),
        config_name="MINRANGE",
    )
    trim_range: int = declare(
        2,
        "Frames cut off at both ends of every tracklet, except where the take itself begins or ends.",
        unit="frames",
        within=(0, 1e6),
        config_name="TRIMRANGE",
    )
    remove_distance: float = declare(
        0.0,
        "Classic method: Marker Sets farther apart than this are never joined, and those that are so far from all "
        "others go first where there are too many; 0 = the median distance between neighbouring markers.",
        unit="mm",
        within=(0.0, 1e6),
        acts_with=_SETS,
    )
    least_seen: float = declare(
        0.0,
        "Frames that show a smaller part of the markers than this are cleaned: nothing in them counts.",
        within=(0.0, 1.0),
        acts_with="take=unlabelled/labelled",
    )
    stand_alone: float = declare(
        3.0, "Tracklets at least this long need no partner to be trusted.", unit="s", within=(0.0, 1e6)
    )
    alignment: str = declare(
        "local",
        "Classic method: what is aligned before two Marker Sets are compared: all markers, or those next to the "
        "compared one.",
        choices=("whole", "local"),
        acts_with=_SETS,
    )
    n_neighbours: int = declare(
        5,
        "Classic method: markers that the local alignment rests on.",
        unit="markers",
        within=(3, 50),
        acts_with=" or ".join(f"{one} and alignment=local" for one in _SETS.split(" or ")),
    )
    misfit_weight: float = declare(
        1.0,
        "Classic method: how much the misfit of the aligned poses counts in the distance of two Marker Sets; 0 = not, "
        "as in the thesis.",
        within=(0.0, 100.0),
        acts_with=_SETS,
    )
    sampling: int = declare(
        0,
        "Classic method: interval of the frames that are picked to compare Marker Sets; 0 = 10, and wider in takes of "
        "more than 1000 frames.",
        unit="frames",
        within=(0, 1e6),
        config_name="SAMPLINGMSTC",
        acts_with=_SETS,
    )
    method: str = declare(
        "rigidity",
        "rigidity merges tracklets by the likelihood of their distances, and then labels all points by the skeleton "
        "that this implies; sets, the classic method of the thesis, joins them over aligned poses.",
        choices=("sets", "rigidity"),
    )
    rounds: int = declare(
        4,
        "Most turns in which a skeleton is fitted and all points are labelled by it.",
        within=(1, 100),
        acts_with="take=unlabelled and method=rigidity",
    )
    compare: bool = declare(
        False,
        "Whether the classic method runs too, and the report compares what it gives; not for takes of many tracklets.",
        acts_with="take=unlabelled and method=rigidity",
    )
    clustering: str = declare(
        "average",
        "Classic method: how Marker Sets are grouped into markers: spectral clustering with local scaling or with one "
        "global sigma, k-means++ with a list of sets that exclude each other, or joining the nearest two groups by "
        "their average or largest distance; sets that overlap in time are never joined.",
        choices=("spectral", "global-spectral", "k-means", "average", "complete"),
        acts_with=_SETS,
    )
    sigma: float = declare(
        0.0,
        "Classic method, global-spectral: the one sigma; 0 tries several and takes the best clustering.",
        unit="mm",
        within=(0.0, 1e6),
        acts_with=" or ".join(f"{one} and clustering=global-spectral" for one in _SETS.split(" or ")),
    )
    computed_points: bool = declare(
        False,
        "Whether points whose names say that a model computed them (LHJC, COM, PELO) are taken for markers, too, "
        "as they are where all points of a file were asked for.",
        acts_with="take=labelled",
    )
    repair: bool = declare(
        RepairParameters.repair,
        "Whether takes that are labelled already are searched for exchanged labels and for slips.",
        basic=True,
        acts_with="take=labelled",
    )
    fills: bool = declare(
        RepairParameters.fills,
        "Whether gaps that were filled by straight lines or smooth curves are gaps again.",
        basic=True,
        acts_with=_REPAIR,
    )
    swap_evidence: float = declare(
        RepairParameters.swap_evidence,
        "An exchange of labels is repaired when the evidence of distances within limbs exceeds this.",
        unit="nats",
        within=(0.0, 1000.0),
        acts_with=_REPAIR,
    )
    slips: bool = declare(
        RepairParameters.slips,
        "Whether labelled takes are searched for markers that slip on their limb; those that surely do are split.",
        basic=True,
        acts_with=_REPAIR,
    )
    slip_seconds: float = declare(
        RepairParameters.slip_seconds,
        "A marker has slipped when its new place on the limb lasts this long.",
        unit="s",
        within=(0.05, 100.0),
        acts_with=_SLIPS,
    )
    slip_evidence: float = declare(
        RepairParameters.slip_evidence,
        "A marker may have slipped where it jumps by this many times its usual step against its neighbours.",
        within=(3.0, 1000.0),
        acts_with=_SLIPS,
    )
    add_random: bool = declare(
        False,
        "Add jitter to the points or markers, to test with clean data.",
        config_name="ADDRANDOMTC",
        acts_with="take=unlabelled/labelled",
    )
    max_jitter: float = declare(
        0.5,
        "Largest jitter added to each coordinate.",
        unit="mm",
        within=(0.0, 1e6),
        config_name="MAXJITTERTC",
        acts_with="take=unlabelled/labelled and add_random=yes",
    )
    time_one_frame: int = declare(
        5,
        "Time between two frames where the take's time stamps do not rise.",
        unit="ms",
        within=(1, 1e6),
        config_name="TIMEONEFRAME",
    )

    @property
    def update_gains(self) -> tuple[float, float]:
        """Share of an innovation that goes into a track's level and slope."""
        if self.prediction == "double_exponential":
            return 1.0 - (1.0 - self.smoothing) ** 2, self.smoothing**2
        return 1.0, float(self.prediction == "constant_velocity")

    @property
    def repair_parameters(self) -> RepairParameters:
        """What the search for errors of given labels needs."""
        evidence = (self.swap_evidence, self.slips, self.slip_seconds, self.slip_evidence)
        return RepairParameters(self.repair, self.fills, *evidence)
