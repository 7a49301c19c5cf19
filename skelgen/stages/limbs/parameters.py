"""The declared parameters of the stage that finds limbs."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from skelgen.parameters import StageParameters, declare
from skelgen.stages.classic.spectral import SpectralMethod

_CLUSTERS = (
    "method=spectral",
    "method=greedy and n_limbs=found and count=rising/rotation/eigengap",
    "method=rigidity/distances and n_limbs=given",
)
"""When eigenvectors are clustered: by the methods of the thesis, and for limbs that rigidity does not find."""


def _clusters(scaling: str = "") -> str:
    return " or ".join(f"{one} and local_scaling={scaling}" if scaling else one for one in _CLUSTERS)


@dataclass(frozen=True)
class LimbParameters(StageParameters):
    """How markers are grouped into limbs."""

    stage: ClassVar[str] = "limbs"
    config_section: ClassVar[str] = "SpectralClustering"
    retired: ClassVar[Mapping[str, str]] = {"zero": "SpectralClustering/SPECCLUEPS"}
    classic: ClassVar[Mapping[str, str]] = {"method": "spectral"}

    method: str = declare(
        "rigidity",
        "rigidity fits rigid bodies to groups of markers and merges those that move as one (a given number of limbs "
        "that is more than it finds is left to spectral); distances does the same by the variances of distances alone; "
        "spectral is the clustering of the thesis, greedy its simple one",
        choices=("rigidity", "distances", "spectral", "greedy"),
    )
    count: str = declare(
        "rigidity",
        "how the number of limbs is found for the methods spectral and greedy when the user does not give it: by "
        "rigidity as the method distances does, by rotation of the eigenvectors, by the eigengap of their values, or "
        "rising until all limbs are rigid",
        choices=("rigidity", "rotation", "eigengap", "rising"),
        acts_with="method=spectral/greedy and n_limbs=found",
    )
    together: str = declare("", "names of markers that share a limb, as in 'a, b; c, d, e'", basic=True)
    apart: str = declare("", "names of markers no two of which share a limb, as in 'a, b; c, d, e'", basic=True)
    n_bodies: int = declare(
        0,
        "number of bodies that nothing joins, each of which gets a tree of its own; 0 finds it",
        unit="bodies",
        within=(0, 100),
        basic=True,
    )
    marker_set: str = declare(
        "auto",
        "auto names limbs by their markers or shape, and takes a recognised marker set for a prior; none gives them "
        "numbers; the name of a marker set puts its markers on its limbs, and these into its tree",
        basic=True,
    )
    samplings: int = declare(
        3,
        "rigidity: jittered samplings that vote on which markers share a limb; most takes are decided after two",
        within=(1, 99),
        acts_with="method=rigidity",
    )
    sampling: int = declare(
        -1,
        "a distance is sampled every so many frames, with jitter; 0 takes all frames, -1 spreads at most `samples` "
        "over the take",
        unit="frames",
        within=(-1, 1e6),
        config_name="SAMPLING",
        config_section="TemporalCorrespondence",
    )
    samples: int = declare(
        600, "sampled frames when `sampling` is -1", unit="frames", within=(3, 1e6), acts_with="sampling=-1"
    )
    jitter: float = declare(0.5, "each sample is displaced by up to this part of a sampling interval", within=(0, 1))
    motion_factor: float = declare(
        1.5,
        "two groups are separate limbs when describing their relative motion, of this many times its observed size, "
        "costs less than the deviations it explains",
        within=(1.0, 20.0),
    )
    pair_limit: float = declare(
        4.0,
        "markers are not paired up when their distance varies more than this many times the take's noise",
        within=(1.0, 1000.0),
    )
    flexibility: float = declare(
        0.02,
        "rigidity: a limb may bend by this part of its size; groups that move less against each other are one limb; "
        "0: no limb bends, and what is known of soft bodies is not used",
        within=(0.0, 1.0),
        acts_with="method=rigidity",
        basic=True,
    )
    local_scaling: bool = declare(
        True,
        "spectral: scale each marker by its M-th neighbour instead of one sigma",
        config_name="LOCALSIGMA",
        acts_with=_clusters(),
    )
    neighbour: int = declare(
        3,
        "spectral: neighbour that sets the local scale",
        within=(1, 100),
        config_name="M",
        acts_with=_clusters("yes"),
    )
    sigma_squared: float = declare(
        0.0,
        "spectral: square of the global sigma; 0 scans for the best one",
        unit="mm^2",
        within=(0.0, 1e6),
        config_name="SIGMAQUAD",
        acts_with=_clusters("no"),
    )
    measure: str = declare(
        "deviation",
        "spectral: cluster the standard deviation of distances, or their variance",
        choices=("deviation", "variance"),
        acts_with=_clusters(),
    )
    kmeans: str = declare(
        "k-means++",
        "spectral: k-means by Lloyd's steps from k-means++ or random starts; by swaps of centres for markers; or by "
        "swaps and Lloyd's steps, where hybrid accepts worse ones at first",
        choices=("random", "swap", "hybrid", "local-hybrid", "k-means++"),
        config_name="ALG",
        acts_with=_clusters(),
        config_codes=("random", "swap", "hybrid", "local-hybrid"),
    )
    rigid_limit: float = declare(
        0.0,
        "rising count: limbs are added until no distance within one varies more; 0 takes 8 times the take's noise",
        unit="mm",
        within=(0.0, 1e6),
        acts_with="method=spectral/greedy and n_limbs=found and count=rising",
    )

    @property
    def spectral(self) -> SpectralMethod:
        """How the methods that cluster eigenvectors do it."""
        return SpectralMethod(self.measure, self.local_scaling, self.neighbour, self.sigma_squared, self.kmeans)
