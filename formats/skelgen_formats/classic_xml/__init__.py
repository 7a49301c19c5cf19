"""The classic output XML (Schönauer 2007, 4.13): all results of a finished project.

The thesis prints several top elements; here one root holds them, so that the file is well-formed XML. Lengths are in
mm, times in seconds. All numbers have the digits to give back the same double, or, of frames where not all is written,
nine digits. Where the file is to be compact, a vector holds its numbers as text, of ten digits, instead of an element
for each.

``MotionCapture``
    The root: ``version``, ``unit``, ``time_unit``, ``quaternion`` (order of the components), ``root_track`` (what a
    root's track refers to), ``detail`` (how much of every frame is there: ``motion``, ``joints`` or ``all``), ``rate``
    [Hz], ``take``.
``MarkerNames``
    ``MarkerName`` with ``id``, ``name`` and ``bone`` (-1 = left out).
``StatsElements``
    As in the thesis. ``FirstBone`` is the parent, ``SecondBone`` the child; distances are to the raw joint positions,
    over the frames in which marker and joint are there; a marker without such a frame is left out.
``SkeletonAndAnimation``
    ``SKELETON``: one ``BONE`` per limb, parents first. ``TRANSLATION`` and ``ROTATION`` give the bone relative to its
    parent in the reference pose: v_parent = R v_bone + t; a root's translation is zero. ``LOCALTRANSLATION`` and
    ``LOCALROTATION`` bring a vertex import re
from model space (the world, in the reference pose) to bone space:
    v_bone = R_local v_model + t_local. ``JOINT``, an addition, describes the joint to the parent;
    standard deviations and (as rows of a 3 x 3 matrix) covariances where they were estimated, see
    `skelgen.model.Joint`.
    ``NAME``, an addition, is what a bone and a joint are called.
    ``ANIMATION``: one ``TRACK`` per bone, one ``KEYFRAME`` per frame, relative to the parent; a root relative to the
    world. ``SEEN="0"`` marks a frame in which the limb's pose was interpolated.
    Quaternions are x y z w and rotate actively, v' = q v q* (not Cal3D's conjugate; `cal3d` writes that).
``RawJointPositions``, ``FinalJointPositions``
    Not with the detail ``motion``. Elements ``joint<parent>-<child>``; a vector is named by its frame; a
    frame whose joint is not determined carries no vector.
``MarkerPositions``
    ``MarkerOffsets``: markers relative to the centre of mass of their limb's markers, along the axes of the bone;
    ``CenterOfMass``, an addition, is that centre in the bone's frame and ``Sigma`` the marker's deviation;
    ``Noise`` and ``StandardDeviation`` (of the place, x y z) stand there where they were estimated.
    ``Frame``, only with the detail ``all``: an unseen marker carries no ``OrgMarkerPosition``, one that is left
    out no ``FinalMarkerPosition``.
"""

import re
from pathlib import Path

from skelgen.errors import FormatError
from skelgen.model import Project, Trajectories
from skelgen_formats.classic_xml.contents import ClassicXml, JointStats, MarkerDistance
from skelgen_formats.classic_xml.writer import ALL, JOINTS, MOTION, ROOT, TITLE, write_classic_xml
from skelgen_formats.options import AXES, RATE, Format, Option, Options, finished_project


def read_classic_xml(path: Path | str) -> ClassicXml:
    """Read everything from a classic XML file, as a stream.

    Raises
    ------
    FormatError
        If the file is no such file, is broken, or its parts contradict each other; names the line.
    """
    from skelgen_formats.classic_xml.reader import read  # noqa: PLC0415 - lxml only when a file is read

    return read(Path(path))


COMPACT = Option(
    "compact",
    False,
    "Write vectors as texts of ten digits, not as an element per number: less than half the size; read all the same.",
    reading=False,
)
"""Options of the writer."""


def _take(path: Path) -> Trajectories:
    content = read_classic_xml(path)
    if content.detail != ALL:
        raise FormatError(path, "", "the file holds no tracked markers; write it with --xml-detail all to read them")
    return content.trajectories


def _remarks(project: Project, options: Options) -> tuple[str, ...]:
    if options.xml_detail == ALL:
        return ()
    left_out = "tracked markers" if options.xml_detail == JOINTS else "tracked markers and joints before the fit"
    return (f"{TITLE} is written without {left_out}; the detail `all` has them.",)


XML_DETAIL = Option(
    "xml_detail",
    MOTION,
    "How much of every frame: poses of limbs, positions of joints as well, or markers and all digits as well.",
    (MOTION, JOINTS, ALL),
    reading=False,
)

FORMAT = Format(
    name="classic-xml",
    title=TITLE,
    suffixes=(".xml",),
    holds="skeleton",
    sniff=lambda head, path: re.search(rf"<{ROOT} [^>]*version=".encode(), head) is not None,
    read=lambda path, options: _take(path),
    write=write_classic_xml,
    check=lambda value, options: finished_project(value, TITLE),
    options=(AXES, RATE, XML_DETAIL, COMPACT),
    keeps=("markers", "names", "limbs", "joints", "kinds", "uncertainty", "motion"),
    marks_open="attributes `OPENDIRECTIONS`, `USUALDIRECTIONS` and `PLACEDBY` of `JOINT`",
    remarks=_remarks,
    note="What is found of a finished project; with the detail all, as a take it gives back the tracked markers.",
)

__all__ = ["FORMAT", "ClassicXml", "JointStats", "MarkerDistance", "read_classic_xml"]
