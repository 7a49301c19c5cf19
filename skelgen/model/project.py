"""A project: the immutable chain from a take to its skeleton in motion, the recording it comes from, and its bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from skelgen.errors import MissingResultError
from skelgen.model import tables
from skelgen.model.arrays import Ints, check_whole, set_fields
from skelgen.model.corrections import Correction, Identities
from skelgen.model.labelling import Labelling
from skelgen.model.limbs import Limbs, names_of_bodies
from skelgen.model.renaming import with_other_names, with_renamed_markers
from skelgen.model.skeleton import Motion, Skeleton
from skelgen.model.takes import Take, Trajectories
from skelgen.model.topology import Topology
from skelgen.parameters import ParameterValue

if TYPE_CHECKING:
    from pandas import DataFrame

_T = TypeVar("_T")

STAGES = ("labels", "limbs", "joints", "skeleton")


@dataclass(frozen=True)
class Source:
    """A recording on disk, from which a take was read: a project may refer to it instead of holding the take.

    Attributes
    ----------
    path : str
        Absolute path of the file.
    format : str
        Name of the format that it was read as.
    options : mapping of str to value
        Options that the reader was given.
    size : int
        Bytes of the file when it was read.
    modified : int
        When it was last changed before that, in ns since 1970.
    sha256 : str
        Hash of its content; empty until a project refers to it.
    """

    path: str
    format: str
    options: Mapping[str, ParameterValue] = field(default_factory=dict)
    size: int = 0
    modified: int = 0
    sha256: str = ""


@dataclass(frozen=True, eq=False)
class StageReport:
    """How one stage went.

    Attributes
    ----------
    parameters : mapping of str to value
        The parameters it ran with.
    seconds : float
        Wall time.
    notices : tuple of str
        What the user should know.
    """

    parameters: Mapping[str, ParameterValue] = field(default_factory=dict)
    seconds: float = 0.0
    notices: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Project:
    """A take and what was computed from it; replacing one result drops those that were computed from it.

    Attributes
    ----------
    take : PointCloud, Trajectories or Poses
        The input.
    seed : int
        Seed of every random choice.
    reports : mapping of str to StageReport
        One per stage that has run, in order.
    identities : Identities or None
        What the user states of some points; the labels obey it.
    corrections : tuple of Correction
        What the user corrected by hand; every run obeys it.
    view : mapping of str to value
        What the window shows and what its forms hold, as plain JSON values; no stage looks at it.
    source : Source or None
        The recording that the take was read from.

    Notes
    -----
    `trajectories`, `limbs`, `topology`, `skeleton` and `motion` raise `MissingResultError` before their stage has run;
    ask `has` first.

    Examples
    --------
    >>> import skelgen
    >>> take = skelgen.simulate("rods", n_frames=50).take
    >>> project = Project(take).with_trajectories(take, StageReport())
    >>> project.has("labels"), project.has("limbs")
    (True, False)
    """

    take: Take
    seed: int = 0
    reports: Mapping[str, StageReport] = field(default_factory=dict)
    identities: Identities | None = None
    corrections: tuple[Correction, ...] = ()
    view: Mapping[str, Any] = field(default_factory=dict)
    source: Source | None = None
    _trajectories: Trajectories | None = None
    _labelling: Labelling | None = None
    _limbs: Limbs | None = None
    _topology: Topology | None = None
    _skeleton: Skeleton | None = None
    _motion: Motion | None = None

    def __post_init__(self) -> None:
        set_fields(self, seed=check_whole(self.seed, 0, "the seed"))

    @property
    def name(self) -> str:
        """Name of the take."""
        return self.take.name

    @property
    def trajectories(self) -> Trajectories:
        """Labelled markers, the result of stage 1."""
        return _present(self._trajectories, "labelled markers", "labels")

    @property
    def labelling(self) -> Labelling:
        """How sure the labels are, beside the trajectories; ask `has_labelling` first."""
        return _present(self._labelling, "account of its labels", "labels")

    @property
    def has_labelling(self) -> bool:
        """Whether it is known how sure the labels are: not for bodies with orientation, nor in older files."""
        return self._labelling is not None

    @property
    def limbs(self) -> Limbs:
        """Markers grouped into limbs, the result of stage 2."""
        return _present(self._limbs, "limbs", "limbs")

    @property
    def topology(self) -> Topology:
        """The tree of limbs with raw joints, the result of stage 3."""
        return _present(self._topology, "joints", "joints")

    @property
    def bodies(self) -> tuple[Body, ...]:
        """The bodies that no joint connects, each a tree of limbs; the one with most limbs first."""
        return bodies_of(self)

    @property
    def skeleton(self) -> Skeleton:
        """The rigid skeleton, a result of stage 4."""
        return _present(self._skeleton, "skeleton", "skeleton")

    @property
    def motion(self) -> Motion:
        """The skeleton's motion, a result of stage 4."""
        return _present(self._motion, "motion", "skeleton")

    def angles_table(self) -> DataFrame:
        """Return the joint angles with standard deviations as a pandas table; see `skelgen.model.tables.angles_table`.

        Raises
        ------
        MissingPackageError
            If pandas is not installed.
        """
        return tables.angles_table(self.skeleton, self.motion)

    def joints_table(self) -> DataFrame:
        """Return the joint positions with standard deviations as a pandas table; see `skelgen.model.tables`."""
        return tables.joints_table(self.skeleton, self.motion)

    def limb_poses(self) -> DataFrame:
        """Return the poses of the limbs as a pandas table; see `skelgen.model.tables.limb_poses`."""
        return tables.limb_poses(self.skeleton, self.motion)

    def has(self, stage: str) -> bool:
        """Whether the result of ``labels``, ``limbs``, ``joints`` or ``skeleton`` is there."""
        results = (self._trajectories, self._limbs, self._topology, self._motion)
        return dict(zip(STAGES, results, strict=True))[stage] is not None

    def with_trajectories(
        self, trajectories: Trajectories, report: StageReport, labelling: Labelling | None = None
    ) -> Project:
        """Return a project with the labels replaced and everything after them dropped.

        Parameters
        ----------
        trajectories : Trajectories
            Labelled markers.
        report : StageReport
            How the stage went.
        labelling : Labelling, optional
            How sure the labels are.
        """
        return replace(self._until("labels", report), _trajectories=trajectories, _labelling=labelling)

    def with_limbs(self, limbs: Limbs, report: StageReport) -> Project:
        """Return a project with the limbs replaced and everything after them dropped.

        Parameters
        ----------
        limbs : Limbs
            The limbs.
        report : StageReport
            How the stage went.
        """
        return replace(self._until("limbs", report), _limbs=limbs)

    def with_topology(self, topology: Topology, report: StageReport) -> Project:
        """Return a project with the joints replaced and everything after them dropped.

        Parameters
        ----------
        topology : Topology
            The tree of limbs.
        report : StageReport
            How the stage went.
        """
        return replace(self._until("joints", report), _topology=topology)

    def with_skeleton(self, skeleton: Skeleton, motion: Motion, report: StageReport) -> Project:
        """Return a project with skeleton and motion replaced.

        Parameters
        ----------
        skeleton, motion : Skeleton and Motion
            What was fitted.
        report : StageReport
            How the stage went.
        """
        return replace(self._until("skeleton", report), _skeleton=skeleton, _motion=motion)

    def before(self, stage: str) -> Project:
        """Return a project without the result of a stage and of all after it."""
        later = STAGES[STAGES.index(stage) :]
        kept = {name: report for name, report in self.reports.items() if name not in later}
        return replace(
            self,
            reports=kept,
            _trajectories=None if "labels" in later else self._trajectories,
            _labelling=None if "labels" in later else self._labelling,
            _limbs=None if "limbs" in later else self._limbs,
            _topology=None if "joints" in later else self._topology,
            _skeleton=None,
            _motion=None,
        )

    def renamed(self, names: Sequence[str]) -> Project:
        """Return a project whose markers have other names, in what is said of them, too; nothing else depends on these.

        Parameters
        ----------
        names : sequence of str
            Of all markers.
        """
        before, limbs = self.trajectories.names, () if self._limbs is None else self._limbs.names
        renamed = dict(zip(before, names, strict=True))
        reports = {
            stage: replace(report, notices=with_renamed_markers(report.notices, renamed, limbs))
            for stage, report in self.reports.items()
        }
        labelling = self._labelling
        if labelling is not None:
            labelling = replace(labelling, doubts=tuple(doubt.renamed(before, names) for doubt in labelling.doubts))
        trajectories = replace(self.trajectories, names=tuple(names))
        return replace(self, _trajectories=trajectories, _labelling=labelling, reports=reports)

    def with_limb_names(self, names: Sequence[str]) -> Project:
        """Return a project whose limbs are called otherwise, in notices, too; nothing else depends on their names."""
        limbs = replace(self.limbs, names=tuple(names))
        skeleton = None if self._skeleton is None else replace(self._skeleton, limb_names=limbs.names)
        return replace(self, _limbs=limbs, _skeleton=skeleton, reports=self._reports_with(limbs))

    def _reports_with(self, limbs: Limbs) -> Mapping[str, StageReport]:
        """The reports with other names of limbs; notices that give limbs their numbers stay."""
        pairs = [(self.limbs.called(limb), limbs.called(limb)) for limb in range(limbs.n_limbs)]
        named = {old: new for limb, (old, new) in enumerate(pairs) if old != f"limb {limb}"}
        if all(old == new for old, new in named.items()):
            return self.reports
        return {
            stage: replace(report, notices=with_other_names(report.notices, named, self.trajectories.names))
            for stage, report in self.reports.items()
        }

    def check_before(self, stage: str) -> None:
        """Raise `MissingResultError` unless all stages before one have run."""
        for earlier in STAGES[: STAGES.index(stage)]:
            if not self.has(earlier):
                raise MissingResultError(f"the stage {stage!r} needs the result of {earlier!r}; run that first")

    def _until(self, stage: str, report: StageReport) -> Project:
        self.check_before(stage)
        bare = self.before(stage)
        return replace(bare, reports={**bare.reports, stage: report})


def _present(value: _T | None, what: str, stage: str) -> _T:
    if value is None:
        raise MissingResultError(f"this project has no {what} yet: run the stage {stage!r} first")
    return value


@dataclass(frozen=True, eq=False)
class Body:
    """One tree of limbs.

    Attributes
    ----------
    name : str
        That of its calibrated skeleton, or ``body1``, ``body2`` and so on: the one with most limbs first.
    root : int
        The limb without a parent.
    limbs, markers : ndarray of intp
        Indices into the limbs and the markers of the project, rising.
    probability : float or None
        That it is a body of its own and no part of another one; None where that was not estimated, as for things that
        the joints part.
    """

    name: str
    root: int
    limbs: Ints
    markers: Ints
    probability: float | None


def bodies_of(project: Project) -> tuple[Body, ...]:
    """Return the bodies of a project whose joints have been found, the one with most limbs first.

    Parameters
    ----------
    project : Project
        With joints.

    Raises
    ------
    MissingResultError
        If joints have not been found yet.
    """
    limbs, topology = project.limbs, project.topology
    found = []
    bodies = topology.bodies
    for name, members in zip(names_of_bodies(bodies, limbs.names), bodies, strict=True):
        body = int(limbs.body_of_limb[members[0]])
        is_one_body = limbs.n_bodies > 1 and np.array_equal(np.flatnonzero(limbs.body_of_limb == body), members)
        markers = np.flatnonzero(np.isin(limbs.limb_of_marker, members))
        root = int(members[topology.parents[members] < 0][0])
        sure = float(limbs.body_probability[body]) if is_one_body else None
        found.append(Body(name, root, members, markers, sure))
    return tuple(found)
