"""Files that people try and that hold nothing to read: what each is, and what to export instead."""

import re
from pathlib import Path
from typing import NamedTuple

from skelgen_formats.lines import decoded_head
from skelgen_formats.titles import turned_without_place


class _Foreign(NamedTuple):
    """A kind of file: how it begins (any of these; none if the suffix alone tells), its suffixes, and what to do."""

    starts: tuple[bytes, ...]
    suffixes: tuple[str, ...]
    sentence: str


_NUMBER, _PARTING = re.compile(r"[-+]?[\d.]+(?:e[-+]?\d+)?", re.IGNORECASE), re.compile(r"[\s;,]+")
_CELLS, _TITLE_LINES = re.compile(r"[,;\t]"), 24
_COMMENTS = ("#", "%", "//")
_FEWEST_NUMBERS = 3  # in the first line of a table without titles
_MARKERS = "export the markers as C3D or TRC"

_OPENSIM = "coordinates, forces or results of OpenSim, no measured markers; give the .trc that they come from"
_ORIENTATIONS = (
    "orientations of sensors, of OpenSim, without positions; joints need where bodies are: give markers or poses"
)

_INSTEAD = (
    (b"version https://git-lfs", "a pointer of Git LFS, not the file; fetch it with `git lfs pull`"),
    (b"<!doctype html", "a web page, not the file; download the file itself"),
    (b"<html", "a web page, not the file; download the file itself"),
)
_UNTITLED = (
    "numbers without titles; write over the columns which point's they are: name_x, name_y, name_z, or of a single body"
    " x, y, z, qx, qy, qz, qw"
)

_FOREIGN = (
    _Foreign(
        (b"Kaydara FBX Binary", b"; FBX"),
        (".fbx",),
        f"an FBX scene; {_MARKERS} from the program that recorded them, or bones as BVH",
    ),
    _Foreign(
        (), (".vsk", ".vst", ".vss", ".mp", ".mkr"), f"a subject of Vicon, without a recording; {_MARKERS} from Nexus"
    ),
    _Foreign((), (".x1d", ".x2d", ".xcp", ".trial", ".system"), f"raw data of Vicon; {_MARKERS} from Nexus"),
    _Foreign((), (".tak", ".ttp"), f"a take of OptiTrack Motive; {_MARKERS}, or CSV, from Motive"),
    _Foreign((), (".qtm", ".qca"), f"a measurement of Qualisys; {_MARKERS}, or TSV, from Track Manager"),
    _Foreign((), (".mvn",), "a session of Xsens; export MVNX or C3D from MVN"),
    _Foreign((), (".calc",), "sensors and bones of Perception Neuron; export BVH, for `skelgen simulate --motion`"),
    _Foreign((), (".cap", ".vc", ".trb", ".prj"), f"binary data of Cortex or EVaRT; {_MARKERS} from Cortex"),
    _Foreign((), (".htr", ".htr2", ".gtr"), f"segments of Cortex, which it computed; {_MARKERS} from Cortex"),
    _Foreign((), (".anc", ".anb", ".forces"), f"analogue data of Cortex, no markers; {_MARKERS}"),
    _Foreign((b"<OpenSimDocument",), (".osim",), "a model of OpenSim, without a recording; give its .trc"),
    _Foreign((), (".mot", ".sto"), _OPENSIM),
    _Foreign(
        (b"<robot", b"<sdf", b"<mujoco"),
        (".urdf", ".sdf", ".mjcf"),
        "a model of a robot, without a recording; give its markers",
    ),
    _Foreign(
        (b"#ROSBAG", b"\x89MCAP", b"SQLite format 3"),
        (".bag", ".mcap", ".db3"),
        "a recording of ROS; write the topic with the markers or poses as CSV, e.g. with `rostopic echo -p`",
    ),
    _Foreign(
        (b"XDF:",), (".xdf",), "a recording of Lab Streaming Layer; write its stream of markers as CSV, e.g. with pyxdf"
    ),
    _Foreign(
        (),
        (".skeleton",),
        "a file of joints of a Kinect, as of NTU RGB+D; write CSV with a row per joint: frame, joint, x, y, z",
    ),
    _Foreign((), (".cmz", ".cmo", ".p3d"), f"a workspace of Visual3D; {_MARKERS}, or targets as ASCII, from Visual3D"),
    _Foreign((b"glTF",), (".glb", ".gltf"), f"a 3D scene; {_MARKERS}, or bones as BVH for `skelgen simulate --motion`"),
    _Foreign((b"PXR-USDC", b"#usda"), (".usd", ".usda", ".usdc"), f"a USD scene; {_MARKERS}"),
    _Foreign((), (".blend", ".ma", ".mb", ".max"), f"a scene of an animation program; {_MARKERS}, or bones as BVH"),
    _Foreign(
        (b"\x89HDF\r\n\x1a\n",),
        (".h5", ".hdf5", ".nwb", ".slp"),
        "an HDF5 file; export a wide CSV (name_x, name_y, name_z) from DeepLabCut, SLEAP or anipose",
    ),
    _Foreign(
        (b"{", b"[{", b"[[", b"[\n", b"[\r", b"[ "),
        (".json",),
        "JSON; write the points as TRC or wide CSV, those of images triangulated first",
    ),
    _Foreign(
        (b"header:", b"---\n", b"%YAML"),
        (".yaml", ".yml"),
        "YAML; write the points as TRC or wide CSV, a topic of ROS with `rostopic echo -p` or `ros2 topic echo --csv`",
    ),
    _Foreign((), (".pkl", ".pickle", ".p"), "a pickle, which may run anything; save the positions with numpy.save"),
    _Foreign((b"PK\x03\x04", b"\xd0\xcf\x11\xe0"), (".xlsx", ".xls", ".ods"), "a spreadsheet; save the sheet as CSV"),
    _Foreign((b"PK\x03\x04", b"\x1f\x8b", b"7z\xbc\xaf"), (".zip", ".gz", ".7z"), "an archive; unpack it first"),
    _Foreign(
        (b"RIFF",),
        (".mp4", ".avi", ".mov", ".mkv"),
        "a video; markers in it become points with `skelgen motion-capture`, of two calibrated cameras",
    ),
)


def no_file(head: bytes) -> str:
    """Return what came instead of a file, whatever it is called, or an empty text.

    Parameters
    ----------
    head : bytes
        Its beginning.
    """
    begin = head.lstrip().lower()
    return next((sentence for start, sentence in _INSTEAD if begin.startswith(start)), "")


def table_hint(head: bytes) -> str:
    """Return what the titles of a table lack, or an empty text if the file is no table.

    Parameters
    ----------
    head : bytes
        Its beginning.
    """
    lines = [line for line in decoded_head(head).splitlines()[:_TITLE_LINES] if line.strip()]
    rows = [[cell.strip(' "') for cell in _CELLS.split(line)] for line in lines]
    if not any(len(row) > 1 for row in rows):
        return ""
    for row in rows:
        along = [{title[:-1] for title in row if title.lower().endswith(axis)} for axis in "xyz"]
        if turned := turned_without_place(row):
            names = ", ".join(turned[:8])
            return f"the titles name rotations of {names}, and no positions: name_x, name_y, name_z; export both"
        if along[0] & along[1] - along[2] - {""}:
            return "the titles name x and y alone: points in images; triangulate them first, e.g. with anipose"
    return "a table needs titles: name_x, name_y, name_z of each point, or frame, name, x, y, z with a row per point"


def is_foreign(head: bytes, path: Path) -> str:
    """Return what a file is and what to do instead, or an empty text if it is none of these.

    Parameters
    ----------
    head : bytes
        Its beginning.
    path : Path
        The file; its suffix tells where the content does not.
    """
    name, text = path.name.lower(), decoded_head(head)
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    by_text = ""
    if text.lstrip().startswith("HIERARCHY"):
        by_text = f"BVH: bones, not markers; `skelgen simulate --motion {path.name}` puts markers on them"
    elif any(line.startswith("ITEM\t") for line in lines[:6]):
        by_text = (
            f"an ASCII export of Visual3D without targets; export those of the folder ORIGINAL with it, or {_MARKERS}"
        )
    elif any(line.strip(",; ") == "endheader" for line in lines):
        by_text = _ORIENTATIONS if any("quaternion" in line.lower() for line in lines[:_TITLE_LINES]) else _OPENSIM
    by_name = [kind.sentence for kind in _FOREIGN if name.endswith(kind.suffixes)]
    by_content = [kind.sentence for kind in _FOREIGN if head.startswith(kind.starts)]
    plain = [line for line in lines if not line.startswith(_COMMENTS)]
    words = [word for word in _PARTING.split(plain[0]) if word] if plain else []
    is_untitled = len(words) >= _FEWEST_NUMBERS and all(map(_NUMBER.fullmatch, words))
    return next(filter(None, (by_text, *by_name, *by_content, _UNTITLED if is_untitled else "")), "")
