"""What formats declare: themselves, options of readers and writers, and which parts of a project a file keeps."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from skelgen.errors import WriteError
from skelgen.geometry.frame_rate import AS_RECORDED_RATE
from skelgen.geometry.up_axis import AS_RECORDED, TURNS
from skelgen.model import Project, Take
from skelgen.model.filled import Filled
from skelgen.model.takes import BoneMotion
from skelgen.parameters import Declaration
from skelgen.progress import Monitor
from skelgen_formats.lines import Sample

_UNITS = {
    1.0: ("mm", "millimeter", "millimeters", "millimetre", "millimetres"),
    10.0: ("cm", "centimeter", "centimeters", "centimetre", "centimetres"),
    100.0: ("dm",),
    1000.0: ("m", "meter", "meters", "metre", "metres"),
    25.4: ("in", "inch", "inches"),
    304.8: ("ft", "feet"),
}
MM_PER_UNIT = {name: mm for mm, names in _UNITS.items() for name in names}
"""Length units that files name, in mm."""

AUTO = "auto"
"""Find the unit from the size of the body."""

OptionValue = str | float | bool

Writable = Project | Take | Filled
"""What writers are given; each says which of these it can hold."""

MARKERS, KEYPOINTS, ALL_POINTS = "markers", "keypoints", "all"
"""Choices of `POINTS`, beside `AUTO`."""

REFERENCE, T_POSE, A_POSE, FIRST_FRAME = "reference", "t-pose", "a-pose", "first-frame"
"""Choices of `REST`."""

AS_MOVED, AS_FOUND = "as-moved", "as-found"
"""Choices of `JOINTS`."""

ROTATION_VECTOR = "vector"
"""Choice of `ANGLE_ORDER`: axis times angle, which Vicon calls helical."""


@dataclass(frozen=True)
class Options:
    """What the user chose about a file; each format offers some of these, declared as an `Option` of the same name.

    Attributes
    ----------
    axes : str
        Axes of the world, one of `TURNS`.
    rate : float, Hz
        Frame rate of the file; 0 as recorded.
    unit : str
        Unit of the lengths in the file.
    filled : bool
        Whether gaps are filled, and the filled positions written.
    joints : str
        Whether joints keep the types found (`AS_FOUND`) or move freely where the motion does (`AS_MOVED`).
    dropout : str
        How CSM writes an unseen marker: ``word`` or ``zero``.
    id_width : str
        Bytes of a unique id in mfml, or `AUTO`.
    timestamp_unit : str
        Unit of the time stamps in mfml.
    points : str
        What points are: `MARKERS`, on limbs; `KEYPOINTS`, on joints; `AUTO` finds out. `ALL_POINTS` reads those that a
        model computed, too, as markers.
    bodies : bool
        Whether bodies are read where a file has markers, too.
    recorded_rate : float, Hz
        Rate of the recording where the file states none; 0: as it says.
    recorded_unit : str
        Unit of its lengths where the file states none, or `AUTO`.
    angle_order : str
        How three angles make the rotation of a body: the leftmost factor's axis first, or `ROTATION_VECTOR`, or `AUTO`.
    fixed_distance : float, mm
        Distance of two sensors that are fixed to one limb, which tells the unit; 0: as the file says.
    time_codes : float
        Time codes per second in USD; 0 for one in each frame.
    density : float, kg/m^3
        Of the limbs, for their masses.
    compact : bool
        Whether the vectors of classic XML are texts of ten digits.
    xml_detail : str
        How much the classic XML holds of every frame: ``motion``, ``joints`` or ``all``.
    bone_names : str
        What bones are called, a choice of `BONE_NAMES`.
    rest : str
        How bones rest, a choice of `REST`.
    sample : Sample, optional
        Some frames of a large file instead of all, where the reader can do that.
    """

    axes: str = AS_RECORDED
    rate: float = AS_RECORDED_RATE
    unit: str = "mm"
    filled: bool = False
    joints: str = AS_MOVED
    dropout: str = "word"
    id_width: str = AUTO
    timestamp_unit: str = "us"
    points: str = AUTO
    bodies: bool = False
    recorded_rate: float = AS_RECORDED_RATE
    recorded_unit: str = AUTO
    angle_order: str = AUTO
    fixed_distance: float = 0.0
    time_codes: float = 24.0
    density: float = 1000.0
    compact: bool = False
    xml_detail: str = "motion"
    bone_names: str = "own"
    rest: str = REFERENCE
    sample: Sample | None = None


@dataclass(frozen=True)
class Option:
    """One choice that a reader or writer offers; given by name to `read_take` and `write_file`.

    Attributes
    ----------
    name : str
        Field of `Options`, e.g. ``timestamp_unit``.
    default : str, float or bool
        Value when nobody says otherwise.
    help : str
        One sentence for the user.
    choices : tuple of str
        Allowed values, empty for any.
    reading : bool
        Whether the reader takes it.
    writing : bool
        Whether the writer takes it.
    unit : str
        Unit of a number.
    low, high : float or None
        Bounds of a number.
    """

    name: str
    default: OptionValue
    help: str
    choices: tuple[str, ...] = ()
    reading: bool = True
    writing: bool = True
    unit: str = ""
    low: float | None = None
    high: float | None = None

    @property
    def declaration(self) -> Declaration:
        """The option as parameters are declared: for forms, and to check values."""
        bounds = (self.low, self.high, self.choices)
        return Declaration(self.name, type(self.default), self.default, self.help, self.unit, *bounds)


AXES = Option(
    "axes",
    AS_RECORDED,
    "Which axis is up: as recorded; z-to-y turns a recording with z up so that y is up, y-to-z the other way.",
    tuple(TURNS),
    reading=False,
)
"""The registry turns the value before it is written, for every format that offers this."""

OWN_NAMES = "own"
BONE_NAMES = Option(
    "bone_names",
    OWN_NAMES,
    "What bones of a person are called: as the limbs are, or as others call them; limbs that these lack are left out.",
    (OWN_NAMES, "mixamo", "unreal", "unity", "cmu", "opensim", "smpl"),
    reading=False,
)
"""The registry renames the limbs before they are written, for every format that offers this."""

REST = Option(
    "rest",
    REFERENCE,
    "Bones at rest: as the skeleton's reference, as the first frame, or a person's T or A with trunk and legs upright.",
    (REFERENCE, T_POSE, A_POSE, FIRST_FRAME),
    reading=False,
)
"""The registry turns the reference pose before it is written, for every format that offers this."""

UNIT = Option("unit", "mm", "Unit of the lengths in the file.", ("mm", "cm", "m"), reading=False)
METRES = replace(UNIT, default="m")
"""Each writer scales by itself."""

RATE = Option(
    "rate",
    AS_RECORDED_RATE,
    "Frame rate of the file, 0 as recorded; between frames positions go straight, rotations turn evenly, gaps stay.",
    reading=False,
    unit="Hz",
    low=0.0,
    high=1e5,
)
"""The registry resamples the value before it is written, for every format that offers this."""

POINTS = Option(
    "points",
    AUTO,
    "What points are: markers on limbs, or keypoints on joints; auto finds out. All: computed ones are markers, too.",
    (AUTO, MARKERS, KEYPOINTS, ALL_POINTS),
    writing=False,
)
"""The registry tells markers from keypoints in what any reader that offers this has read."""

BODIES = Option("bodies", False, "Read bodies with orientation where the file has markers, too.", writing=False)
"""The option of readers of files that may hold both."""

RECORDED_RATE = Option(
    "recorded_rate",
    AS_RECORDED_RATE,
    "Frame rate of the recording, where the file states none; 0 as it says, or 100 Hz.",
    writing=False,
    unit="Hz",
    low=0.0,
    high=1e6,
)
FIXED_DISTANCE = Option(
    "fixed_distance",
    0.0,
    "Distance of two sensors that are fixed to one limb, from which the unit is found; 0 as the file says.",
    writing=False,
    unit="mm",
    low=0.0,
    high=1e5,
)
"""Which two, is found: those that move least against each other."""

RECORDED_UNIT = Option(
    "recorded_unit",
    AUTO,
    "Unit of the lengths, where the file states none; auto: m if all lie within 50, else mm.",
    (AUTO, "mm", "cm", "m", "in"),
    writing=False,
)
"""Options of readers of tables and arrays, which state neither."""

ANGLE_ORDER = Option(
    "angle_order",
    AUTO,
    "How three angles turn a body: about its axes in this order, or as a vector; auto: as the file says, or as usual.",
    (AUTO, "xyz", "xzy", "yxz", "yzx", "zxy", "zyx", ROTATION_VECTOR),
    writing=False,
)
"""The option of readers of bodies whose files give angles, and do not say how these make a rotation."""

FILLED = Option(
    "filled",
    False,
    "Fill the gaps of a fitted project and write the filled positions as well, listed in <stem>.filled.csv.",
    reading=False,
)
"""The option of every writer of markers."""


JOINTS = Option(
    "joints",
    AS_MOVED,
    "Joints that the motion does not hold to their types: free as they moved, or of the types found, poses changed.",
    (AS_MOVED, AS_FOUND),
    reading=False,
)
"""The option of every writer that poses a skeleton by angles."""


def files_beside(path: Path, *endings: str) -> tuple[Path, ...]:
    """Return the files of a format that writes several: one name, with each ending.

    Parameters
    ----------
    path : Path
        The file that was asked for, with the first ending or another suffix.
    endings : str
        Of the files, e.g. ``.urdf``.

    Examples
    --------
    >>> [file.name for file in files_beside(Path("walk.urdf"), ".urdf", ".csv")]
    ['walk.urdf', 'walk.csv']
    """
    stem = path.name.removesuffix(endings[0]) if path.name.endswith(endings[0]) else path.stem
    return tuple(path.with_name(stem + ending) for ending in endings)


def per_mm(unit: str) -> float:
    """Return how many of the unit a millimetre has, for one of `UNIT.choices`."""
    return 1.0 / MM_PER_UNIT[unit]


def finished_project(value: Writable, title: str) -> Project:
    """Return a project that has its skeleton and its motion.

    Parameters
    ----------
    value : Project, PointCloud, Trajectories, Poses or Filled
        What is to be written.
    title : str
        Of the format, for errors.

    Raises
    ------
    WriteError
        If it is no project.
    MissingResultError
        If a stage has not run.
    """
    if not isinstance(value, Project):
        raise WriteError(
            f"{title} holds what is found of a skeleton, not a take; run the four stages first, or choose a format for"
            " takes"
        )
    _ = value.motion  # says which stage is missing
    return value


def moving_project(value: Writable, title: str) -> Project:
    """Return a finished project with at least one limb and one frame; parameters and errors as `finished_project`.

    Parameters
    ----------
    value : Project, PointCloud, Trajectories, Poses or Filled
        What is to be written.
    title : str
        Of the format, for errors.
    """
    project = finished_project(value, title)
    if project.skeleton.n_limbs == 0 or project.motion.n_frames == 0:
        raise WriteError(f"{title} needs at least one limb and one frame")
    return project


@dataclass(frozen=True)
class Format:
    """One file format.

    Attributes
    ----------
    name : str
        Short name for the command line, e.g. ``c3d``.
    title : str
        Name for people.
    suffixes : tuple of str
        File endings, lower case with the dot, the usual one first.
    sniff : callable (head, path) -> bool
        Whether the first `registry.SNIFF_BYTES` bytes look like this format; must not read the file.
    read : callable (path, options) -> Take, or None
        Reader.
    write : callable (value, path, options, monitor), or None
        Writer of all `files`, which appear whole or not at all.
    check : callable (value, options)
        Raises `WriteError` or `MissingResultError` if the writer cannot take the value. Quick.
    files : callable (path, options) -> tuple of Path
        The files that the writer will make of a path.
    keeps : tuple of str
        Names of the `PARTS` that a written file holds; all else is lost.
    remarks : callable (project, options) -> tuple of str
        Sentences on what becomes of this project beyond the parts that are lost.
    holds : str
        What it holds, for the table: ``points``, ``markers``, ``poses``, ``skeleton``, ``joints``, ``summary``.
    options : tuple of Option
        What the user can choose of reader and writer.
    note : str
        One sentence for the docs table.
    read_motion : callable (path, skeleton, unit) -> BoneMotion, or None
        Reader of bones in motion, which are no take; see `registry.read_motion`.
    up : str
        The axis that is up in such files, ``y`` or ``z``; empty where they do not say.
    filled_mark : str
        How filled positions differ from measured ones in the file; empty where the format cannot mark them.
    marks_open : str
        Where the file says which joints the motion does not determine; empty where it cannot.
    """

    name: str
    title: str
    suffixes: tuple[str, ...]
    holds: str
    sniff: Callable[[bytes, Path], bool] = lambda head, path: False
    read: Callable[[Path, Options], Take] | None = None
    write: Callable[[Writable, Path, Options, Monitor], None] | None = None
    options: tuple[Option, ...] = ()
    note: str = ""
    check: Callable[[Writable, Options], object] = lambda value, options: None
    files: Callable[[Path, Options], tuple[Path, ...]] = lambda path, options: (path,)
    keeps: tuple[str, ...] = ()
    remarks: Callable[[Project, Options], tuple[str, ...]] = lambda project, options: ()
    read_motion: Callable[[Path, Path | None, str], BoneMotion] | None = None
    up: str = ""
    filled_mark: str = ""
    marks_open: str = ""
