"""The declared parameters of the stage that fits a rigid skeleton."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Self

from skelgen.errors import ParameterError
from skelgen.geometry.orientation import ROTATORS, Rotator
from skelgen.kinematics.joints.joint_type import DETERMINED_TYPES
from skelgen.parameters import StageParameters, declare


@dataclass(frozen=True)
class SkeletonParameters(StageParameters):
    """How a rigid skeleton is assembled and fitted back to the take."""

    stage: ClassVar[str] = "skeleton"
    config_section: ClassVar[str] = "SkeletonFitter"
    retired: ClassVar[Mapping[str, str]] = {
        "pi": "JointFinder/PI",
        "rank_tolerance": "JointFinder/POLYEPS",
        "solve_zero": "JointFinder/SOLVEPS",
        "tiny": "JointFinder/TINYEPS",
    }
    classic: ClassVar[Mapping[str, str]] = {"fit": "root-outward"}

    rotation: str = declare(
        "horn",
        "closed form of absolute orientation: Horn's unit quaternion or Umeyama's singular value decomposition",
        choices=("horn", "umeyama"),
        config_name="RUNTESTSVAR",
        config_codes=("horn", "umeyama"),
    )
    fit: str = declare(
        "whole-chain",
        "root-outward poses one limb after the other, the classic method; whole-chain then refines limbs, joints and "
        "poses together by maximum likelihood",
        choices=("root-outward", "whole-chain"),
    )
    outlier: float = declare(
        1.0,
        "points farther from their mean place on the limb than this many standard deviations are left out of it",
        within=(0.1, 100.0),
    )
    outlier_limit: float = declare(
        20.0,
        "positions that are off their limb by more than this many typical deviations are left out of the fit",
        within=(3.0, 1e6),
        basic=True,
    )
    robust: float = declare(
        6.0,
        "positions off the fitted chain by more than this many standard deviations of the noise are left out, measured "
        "from a fit in which they have little weight",
        within=(3.0, 1e6),
        acts_with="fit=whole-chain",
    )
    joints_for_poses: bool = declare(
        False,
        "line limbs up by their joints as well, not only where they have too few markers",
        config_name="USE_JOINTS_FOR_CENTROID",
    )
    samples: int = declare(
        300,
        "frames from which limbs and joints are first estimated, and types of joints",
        unit="frames",
        within=(10, 1e6),
    )
    refine_samples: int = declare(
        2000,
        "most frames from which limbs and joints are estimated at last; outliers are sought in as many",
        unit="frames",
        within=(10, 1e6),
        acts_with="fit=whole-chain",
    )
    soft_tissue: bool = declare(
        True,
        "let markers slide on their limbs in proportion to the bends of the joint, where the take shows that they do",
        acts_with="fit=whole-chain and take=unlabelled/labelled",
        basic=True,
    )
    known_build: bool = declare(
        True,
        "weigh joints of a person against where they lie to markers on people, where soft tissue misplaces them: those "
        "of a marker set that is recognised by its shape, or at usual places, else inward of the outer side "
        "of arms and legs; never with marker_set=none",
        acts_with="fit=whole-chain and take=unlabelled/labelled",
    )
    hinge_wobble: float = declare(
        0.12,
        "a hinge or universal joint may turn in other ways by this part of its smallest own turn, noise apart",
        within=(0.0, 0.5),
    )
    flatness: float = declare(
        0.02,
        "points whose second extent is below this part of their first are on one line and fix no pose",
        within=(0.0, 0.5),
    )
    least_turn: float = declare(
        1e-4,
        "two limbs that turn less than this against each other are rigid, however exact the take",
        unit="rad",
        within=(0.0, 1.0),
    )
    kind_doubt: float = declare(
        0.001,
        "probability with which noise alone makes a joint seem to turn in more ways than it does",
        within=(1e-9, 0.5),
    )
    kinds: str = declare(
        "",
        "types of joints that are known: one for all, or by the joint's child limb such as 3=hinge,7=ball; "
        "empty finds them",
        basic=True,
    )
    loops: str = declare(
        "",
        "loops that the fit closes: found for those of the stage before, or pairs of limbs or of one marker of each as "
        "'limb0, limb3; LKNE, LANK'; empty leaves them open",
        acts_with="fit=whole-chain",
    )
    frames_per_second: float = declare(
        0.0,
        "frame rate of the motion, where the take states none or another one; 0 = that of the take",
        unit="Hz",
        within=(0.0, 1e6),
        config_name="FRAMES_PER_SEC",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        self._stated_types()

    @property
    def rotator(self) -> Rotator:
        """Closed form of absolute orientation."""
        return ROTATORS[self.rotation]

    def stated_type(self, limb: int) -> str | None:
        """Return the type that the user states for the joint above a limb, or None."""
        stated = self._stated_types()
        return stated.get(limb, stated.get(None))

    def with_joint_types(self, types: Mapping[int, str]) -> Self:
        """Return parameters that state more types of joints, by the joint's child limb; those given last count."""
        more = " ".join(f"{limb}={kind}" for limb, kind in types.items())
        return self.replace(kinds=f"{self.kinds} {more}".strip())

    def _stated_types(self) -> dict[int | None, str]:
        stated: dict[int | None, str] = {}
        for part in self.kinds.replace(",", " ").split():
            limb, _, kind = part.rpartition("=")
            if kind not in DETERMINED_TYPES or (limb and not limb.isdecimal()):
                choices = ", ".join(DETERMINED_TYPES)
                raise ParameterError(f"kinds: {part!r} is neither a type ({choices}) nor limb=type such as 3=hinge")
            stated[int(limb) if limb else None] = kind
        return stated
