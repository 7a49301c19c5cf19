"""The public face: functions that scripts call as ``skelgen.read``, ``skelgen.reconstruct`` and so on.

Each turns paths, mappings and names into values of the application layer, and calls one function of it. `reconstruct`
is the main one:

>>> import skelgen
>>> take = skelgen.simulate("rods", n_frames=100).take
>>> project = skelgen.reconstruct(take, n_limbs=3, parameters={"joints": {"alpha": 0.1}})
>>> project.motion.joint_positions.shape  # frames, joints, xyz
(100, 2, 3)
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from skelgen.app.configuration import ParameterValues, Settings
from skelgen.app.constraints import RunOptions
from skelgen.app.corrections import with_correction, with_identities, with_places
from skelgen.app.files import NamedFile, open_input
from skelgen.app.inputs import with_checked_arguments
from skelgen.app.pipeline import run_stages
from skelgen.app.project_file.archive import find_result, open_project
from skelgen.errors import InputError
from skelgen.model import Identities, Project, Take
from skelgen.model.corrections import Correction
from skelgen.model.filled import Filled
from skelgen.model.project import STAGES
from skelgen.parameters import ParameterValue
from skelgen.progress import SILENT, Monitor

if TYPE_CHECKING:
    from skelgen.app.batch.run import BatchResult
    from skelgen.app.batch.work import Job
    from skelgen.app.several_takes import SharedSkeleton
    from skelgen.evaluation import Evaluation
    from skelgen.simulation import Truth


@with_checked_arguments
def read(path: Path | str, format: str | None = None, **options: ParameterValue) -> Take:
    """Read a take from a file.

    Parameters
    ----------
    path : Path or str
        The file; its format is found by content first and suffix second. Of a project file only the take is read,
        with a warning if it holds results; `load` reads all of it.
    format : str, optional
        Read as this format; ``skelgen formats`` lists them.
    **options
        Options of the format's reader, e.g. ``timestamp_unit``.

    Returns
    -------
    PointCloud, Trajectories or Poses
        Positions in mm; NaN where unseen.

    Raises
    ------
    FormatError
        If the file is not what its format demands.

    Examples
    --------
    >>> import skelgen
    >>> files = skelgen.write(skelgen.simulate("rods", n_frames=100).take, "rods.c3d")
    >>> take = skelgen.read("rods.c3d")
    >>> take.n_frames, take.n_markers
    (100, 9)
    """
    project = open_input(NamedFile(Path(path), format, options))
    results = [name for name in STAGES if project.has(name)]
    if results:
        what = f"{path} is a project with results ({', '.join(results)})"
        warnings.warn(f"{what}; skelgen.read returns its take alone, skelgen.load the whole project", stacklevel=3)
    return project.take


@with_checked_arguments
def load(path: Path | str) -> Project:
    """Open a project file with all results.

    Parameters
    ----------
    path : Path or str
        A ``.skelgen`` file, or the folder of a run.

    Returns
    -------
    Project
        As it was written.

    Raises
    ------
    FormatError
        If it is no project file, or a damaged one.

    Examples
    --------
    >>> import skelgen
    >>> take = skelgen.simulate("rods", n_frames=100).take
    >>> files = skelgen.write(skelgen.reconstruct(take, until="limbs"), "rods.skelgen")
    >>> skelgen.load("rods.skelgen").limbs.n_limbs
    3
    """
    return open_project(find_result(Path(path)))


@with_checked_arguments
def reconstruct(  # noqa: PLR0913 - what users name: most leave most of it out
    take: Take | Project,
    n_markers: int | None = None,
    n_limbs: int | None = None,
    seed: int = 0,
    parameters: ParameterValues = None,
    monitor: Monitor | None = None,
    *,
    until: str | None = None,
    n_jobs: int = 1,
    identities: Identities | Path | str | None = None,
    hierarchy: Mapping[str, str] | None = None,
    root: str | None = None,
    joined: Iterable[tuple[str, str]] = (),
    parted: Iterable[tuple[str, str]] = (),
    methods: str | None = None,
) -> Project:
    """Find limbs, joints and skeleton of a take, and the skeleton's motion.

    Parameters
    ----------
    take : PointCloud, Trajectories, Poses or Project
        A project keeps its seed and goes on after its last result; a finished one runs again from the start.
    n_markers, n_limbs : int, optional
        Numbers of physical markers in an unlabelled take, and of rigid limbs; found if left out.
    seed, n_jobs : int
        Seed of every random choice (same take and seed, same result); processes for work that can be shared.
    parameters : mapping, Path or str, optional
        Per stage (``labels``, ``limbs`` ...) its parameters or names with values; or the path of a ``config.xml``.
    monitor : Monitor, optional
        Receives progress and notices; may cancel.
    until : str, optional
        Last stage to run; all run if left out.
    identities : Identities, Path or str, optional
        What you state of some points, or the file that states it; the labels obey.
    hierarchy : mapping of str to str, optional
        Parent of every limb by name, empty for a root: names of bodies, or limb0, limb1, ...; found if left out.
    root : str, optional
        Name of the limb that is the root of a tree that is found, or of a marker on it.
    joined, parted : iterable of pairs of str
        Limbs between which there is a joint, and between which there is none, by their names or by markers on them.
    methods : str, optional
        ``classic``: the methods of Schönauer (2007), but for what `parameters` states; ``default``: the usual ones.

    Returns
    -------
    Project
        With trajectories, limbs, topology, skeleton and motion, as far as the stages have run.

    Raises
    ------
    InputError or ParameterError
        If nothing can be found in the take (one marker, two frames, no motion); for an unknown or bad parameter.
    """
    project = with_identities(take if isinstance(take, Project) else Project(take, seed), identities)
    settings = Settings(parameters, methods)
    options = RunOptions(n_markers, n_limbs, n_jobs, hierarchy, root, tuple(joined), tuple(parted))
    return run_stages(project, until_stage=until, settings=settings, options=options, monitor=monitor or SILENT)


def calibrate_together(
    takes: Sequence[Take], seed: int = 0, parameters: ParameterValues = None, monitor: Monitor | None = None
) -> SharedSkeleton:
    """Find one skeleton from several takes of a body, and the motion of each.

    Parameters
    ----------
    takes : sequence of PointCloud or Trajectories
        At least two.
    seed : int
        Seed of every random choice.
    parameters : mapping, Path or str, optional
        As for `reconstruct`.
    monitor : Monitor, optional
        Receives progress and notices; may cancel.

    Returns
    -------
    SharedSkeleton
        Its ``skeleton`` is a project to give to `skelgen.apply_subject`, its ``takes`` are a project per take.

    Raises
    ------
    InputError
        If there are fewer than two takes, one shows another body, or one is of bodies with orientation.

    Examples
    --------
    >>> import skelgen
    >>> takes = [skelgen.simulate("rods", seed=1, n_frames=n_frames).take for n_frames in (200, 100)]
    >>> [project.motion.n_frames for project in skelgen.calibrate_together(takes).takes]
    [200, 100]
    """
    from skelgen.app import several_takes  # noqa: PLC0415 - loads the stages

    return several_takes.calibrate_together(takes, settings=Settings(parameters), seed=seed, monitor=monitor or SILENT)


@with_checked_arguments
def correct(
    project: Project,
    kind: str,
    names: Sequence[str] = (),
    value: str = "",
    frames: tuple[int | None, int | None] = (None, None),
) -> Project:
    """State something that you know better; every later run obeys it.

    Parameters
    ----------
    project : Project
        With the labels that the markers are named by.
    kind : str
        ``merge``, ``split``, ``rename``, ``delete``, ``swap``, ``confirm``, ``smooth``, ``fill`` (markers),
        ``together``, ``apart``, ``move`` (markers on limbs), ``join``, ``part``, ``root``, ``name``, ``name-joint``
        (limbs by their markers), ``kind`` (type of a joint), ``n_markers``, ``n_limbs``.
    names : sequence of str, or str
        Markers that it is about, the one that keeps its name first.
    value : str
        The new name, the type of the joint, the number, the cutoff of ``smooth`` [Hz], or the way to ``fill`` gaps:
        ``skeleton``, ``spline``, or by markers named behind the first: ``rigid`` (three or more), ``pattern`` (one).
    frames : tuple of int or None
        First and last frame for which it holds; None for the ends of the take.

    Returns
    -------
    Project
        Labels are corrected at once; other results that contradict are dropped. `reconstruct` finds them anew.

    Raises
    ------
    InputError
        If there is no such correction, or a marker does not exist.

    Examples
    --------
    >>> import skelgen
    >>> project = skelgen.reconstruct(skelgen.simulate("rods", n_frames=100).take)
    >>> first, second = project.trajectories.names[:2]
    >>> project = skelgen.correct(project, "apart", [first, second])
    >>> project.has("labels"), project.has("limbs")
    (True, False)
    """
    if len(frames) != 2:
        raise InputError(f"frames are {frames!r:.60}; a first and a last frame belong there")
    correction = Correction(kind, (names,) if isinstance(names, str) else tuple(names), *frames, value)
    return with_correction(project, with_places(project, correction, frames[0] or 0))


@with_checked_arguments
def fill(project: Project, monitor: Monitor | None = None) -> Filled:
    """Fill the gaps of the markers of a project by means of its skeleton, or as corrections state.

    Parameters
    ----------
    project : Project
        With a skeleton, or with corrections of the kind ``fill``.
    monitor : Monitor, optional
        Receives progress; may cancel.

    Returns
    -------
    Filled
        Complete markers with a standard deviation for each filled position; to be given to `skelgen.write`.

    Raises
    ------
    MissingResultError
        If the project has no skeleton yet.

    Examples
    --------
    >>> import skelgen
    >>> project = skelgen.reconstruct(skelgen.simulate("rods", n_frames=100, dropouts=0.1).take)
    >>> bool(project.trajectories.seen.all()), bool(skelgen.fill(project).trajectories.seen.all())
    (False, True)
    """
    from skelgen.kinematics.gap_filling.filling import fill_project  # noqa: PLC0415 - loads scipy

    return fill_project(project, monitor or SILENT)


@with_checked_arguments
def evaluate(project: Project, truth: Truth | Path | str) -> Evaluation:
    """Compare the results of a project with a known truth.

    Parameters
    ----------
    project : Project
        With the results of some stages.
    truth : Truth, Path or str
        What is true of its take: from `simulate`, or a ``.truth.npz`` file.

    Returns
    -------
    Evaluation
        Scores per stage; None for stages that have not run.

    Raises
    ------
    InputError
        If the truth is that of another take.

    Examples
    --------
    >>> import skelgen
    >>> simulated = skelgen.simulate("rods", n_frames=100)
    >>> scores = skelgen.evaluate(skelgen.reconstruct(simulated.take), simulated.truth)
    >>> scores.limbs.adjusted_rand
    1.0
    """
    from skelgen import evaluation, simulation  # noqa: PLC0415 - loads scipy

    known = simulation.read_truth(truth) if isinstance(truth, Path | str) else truth
    if not isinstance(known, simulation.Truth):
        raise InputError(f"the truth is {known!r:.60}; it must be a Truth or the path of one")
    return evaluation.evaluate(project, known)


@with_checked_arguments
def run_batch(  # noqa: PLR0913 - as above
    inputs: Iterable[Path | str] | Path | str,
    output: Path | str,
    job: Job | None = None,
    *,
    n_workers: int = 1,
    timeout: float | None = None,
    resume: bool = False,
    monitor: Monitor | None = None,
) -> BatchResult:
    """Reconstruct many takes: a folder of results for each, a manifest, and a page of all.

    Parameters
    ----------
    inputs : iterable of Path or str, or one of them
        Files, folders and patterns such as ``in/**/*.c3d``.
    output : Path or str
        Folder of the batch; each take gets a folder in it.
    job : Job, optional
        What is done with every take: parameters, options, subject, formats.
    n_workers : int
        Number of processes.
    timeout : float, s, optional
        Time after which a take is given up; as long as it takes if left out.
    resume : bool
        Whether `output` may hold a batch: takes that are finished in it are kept.
    monitor : Monitor, optional
        Receives the number of takes that are done and a notice for each that fails; may cancel.

    Returns
    -------
    BatchResult
        Records of all takes, those that failed among them.

    Raises
    ------
    InputError
        If there is no take, or there is a batch and `resume` is False.
    WriteError
        If nothing can be written any more; finished takes are kept.

    Examples
    --------
    Worker processes import the script again, so that it must begin its work below ``if __name__ == "__main__"``.

    >>> import skelgen
    >>> files = skelgen.write(skelgen.simulate("rods", n_frames=50).take, "recordings/rods.c3d")
    >>> skelgen.run_batch(["recordings"], "results").n_done
    1
    """
    from skelgen.app.batch import run, workers  # noqa: PLC0415 - loads the report

    inputs = (inputs,) if isinstance(inputs, Path | str) else inputs
    pool = partial(workers.in_processes, n_workers=n_workers, timeout=timeout)
    return run.run_batch(inputs, output, job, pool=pool, resume=resume, monitor=monitor or SILENT)
