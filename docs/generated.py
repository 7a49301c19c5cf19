"""Pages that are generated: ``python docs/generated.py`` writes docs/parameters.md, formats.md and licences.md."""

import tomllib
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from skelgen_formats.options import Option
from skelgen_formats.registry import COLUMNS as FORMAT_COLUMNS
from skelgen_formats.registry import formats_table, known_formats
from skelgen_formats.writing import PARTS

from skelgen.app.configuration import all_parameter_classes
from skelgen.capture.parameters import BodyParameters, DetectionParameters
from skelgen.parameters import Declaration, StageParameters

PACKAGE = "skelgen-mocap"
FOR_DEVELOPERS = {"dev", "all"}  # tools that no user installs, and a name for all other extras together
UNSTATED: dict[str, str] = {}  # packages whose metadata name no licence, and the licence file of their source
LONGEST_NAME = 60  # characters; what is longer is the text of a licence
TEXTS = {
    "Permission is hereby granted, free of charge": "MIT",
    "Redistribution and use in source and binary forms": "BSD",
    "Apache License": "Apache-2.0",
}
"""Beginnings of texts that stand where the name of a licence belongs, and the name."""

COLUMNS = ("name", "type", "default", "allowed", "in config.xml", "what it does")

PARAMETERS = """# Parameters

Generated from the declarations of the stages by `python docs/generated.py`; do not edit by hand.

Every parameter has a default that suits most takes. It can be changed in three ways, each of which checks it before
any stage starts:

- an option of the stage's own command: `skelgen joints limbs.skelgen --alpha 0.2`;
- `--set stage.name=value` of `skelgen run`, as often as needed: `skelgen run take.c3d --set joints.alpha=0.2`;
- a file: `skelgen config --write config.xml` writes all defaults with their help as comments, and
  `skelgen run take.c3d --config config.xml` reads them. Unknown names, wrong types and values out of bounds are errors
  that name the line.

From Python: `skelgen.reconstruct(take, parameters={"joints": {"alpha": 0.2}})`.

Names in `config.xml` are those of Schönauer (2007, tables 4.13-4.16) where the classic program has the parameter. A
file that holds such names alone is taken for one of that program: for the stages that it sets something of, the methods
of the thesis are used, and a note says so. `--methods default` keeps the usual ones, `--methods classic` takes those of
the thesis for all stages, with or without a file.

Some parameters have an effect only beside certain values of others, which the tables below name after "acts with";
`take` stands there for what the take holds: unlabelled points, labelled markers or bodies with orientation. A note
says where one that is set has no effect. `SPECCLUEPS`, `POLYEPS`, `SOLVEPS`, `TINYEPS` and `PI` of the classic program
are read, and a note says that they have none: eigenvectors and roots come from libraries that need no such number.
"""
CAPTURE = """They belong to a stereo capture and are set in its [settings](capture/settings.md):
`<detection><parameter name="min_area" value="25"/></detection>`."""
SEARCH = """They belong to a stereo capture and are set in its [settings](capture/settings.md):
`<search><parameter name="max_distance" value="2.5"/></search>`."""

LICENCES = """# Licences of what skelgen installs

skelgen itself is under the MIT licence. This page is generated from the metadata of the installed packages by
`python docs/generated.py`; the tests compare it with them. `skelgen-mocap[gui]` and the like are extras, installed only
when asked for.

| package | licence, as the package states it | needed by |
|---|---|---|
"""


FORMATS = """# File formats

Generated from the formats' declarations by `python docs/generated.py`; do not edit by hand.

A file is recognised by its content first and by its suffix second; `--format NAME` skips that. Inside skelgen
everything is in mm, s and rad; a reader converts from the unit that the file names. Unseen markers are NaN inside.
Beside these formats `skelgen` reads its own [project file](project-file.md), and settings of a stereo capture, whose
images become points ([from images to a skeleton](capture/pipeline.md)).
What is read "as motion" holds bones without markers: `skelgen simulate --motion` [puts markers on
them](how-to/motions.md).
"""
TRIED = """## Large files

`skelgen info` reads files above 16 MB by a sample: 2000 frames, evenly spread, first and last among them. Exact are
format, names, number of frames (lines, or frames of a binary file, are all counted), rate and duration; the extent,
what is up, missing and seen, and the notes are those of the sample, and it says so. Gaps are not counted, and what
stands between the sampled frames is not checked; every other command reads, and refuses, the whole file, and so does
`skelgen info --full`. Where the sample cannot tell (frames that an export leaves out, a line that cannot be read),
the whole file is read at once. Files of 96 to 114 MB with 100,000 frames of 40 markers take 0.6 s of processor time
as C3D (64 MB), mfml, npy or npz and 0.8 to 0.9 s as TRC, Qualisys, Nexus or wide CSV (4.1, 1.6 and 1.8 s for TRC, C3D
and mfml if all is read); MVNX, MAT, TDF, tidy CSV and tables whose rows take
turns are always read whole.

## What was tried

"Recorded" are files of people; "layout" are small files after the layout that the maker documents, or that files in
public repositories have, made by the tests. What is not named was not tried.

| tool | versions | tried with |
| --- | --- | --- |
| C3D, among them of EVa and OptiTrack | Intel words | recorded, against ezc3d |
| C3D | DEC and SGI words, and the oddities of the changelog | layout |
| C3D of Nexus 2 with ProCalc | muscle signals and angles as points | recorded, against the CSV of the same take |
| Cortex, OpenSim, Pyomeca TRC | tabs, commas, blanks, doubled tabs, indented; virtual markers | recorded; layout |
| OpenCap, Pose2Sim, Sports2D TRC | keypoints | layout |
| Vicon Nexus CSV | 2.x: with and without blank lines and other blocks | two recorded; layout |
| Vicon Workstation, Nexus 1 CSV | TRAJECTORIES, Field # | layout of public readers |
| OptiTrack Motive CSV | format versions 1.2, 1.22 to 1.25: markers, rigid bodies, bones, also with angles | layout |
| OptiTrack CSV 1.1 | Tracking Tools, Arena, first Motive | layout of public readers |
| Qualisys TSV | 3D | recorded; layout |
| Qualisys TSV | 6D, with and without FILE_VERSION | layout of a public recording |
| Qualisys TSV | skeletons in global coordinates | layout of public scripts |
| Qualisys MAT | level 5, packed or not; labelled and unidentified | layout that MATLAB scripts in public use |
| Xsens MVNX | 4 | layout of a public recording |
| BTS TDF | version 1, tracks with and without links | written by basictdf 0.1 |
| ART DTrack text | 6d, 6di, 3d of DTrack's output | layout of its documentation |
| BTS EMT | 3D tracks | layout of public readers |
| Vicon Tracker CSV | Objects with quaternions, helical or Euler angles | layout of public readers |
| Mokka (BTK) ASCII export | points with or without events and analogue data | layout of its writer |
| Visual3D ASCII export | targets and landmarks of one trial | layout |
| C3D of Theia | segments with rotations, beside points or alone | layout of C-Motion's extension, against ezc3d |
| anipose, DeepLabCut in 3D; CSV and Parquet | titles only | layout |
| NDI First Principles, Simi Motion as text | rate and unit before the titles, or neither | layout |
| NDI Aurora, Polaris; ROS (`rostopic echo -p`) | tables of bodies with quaternions | layout of public recorders |
| pandas' melt, R's pivot_longer | a row per coordinate: frame, variable, value | layout |
| pandas, R, MATLAB, NumPy | tables of points as they write them: index, NA, name_1, # before titles | layout |
| Kinetics Toolkit, Venus3D, recorders of NatNet | vectors `[0]` to `[3]`, titles twice, rows that end early | layout |
| OpenSim .sto, Unity, pandas | a vector in each cell | layout of their writers |
| tables of bodies with angles | roll, pitch, yaw; Rx, Ry, Rz; rotation vectors | layout; a simulated person |
| tables of bodies with matrices | r11 to r33, R[0][0] to R[2][2], Rot[0] to Rot[8] | layout; skelgen's own |
| CODA text, loggers of Kinect, NatNet, ArUco | flags of visibility, times of a clock, people by number | layout |
| Leap Motion, Blender scripts, SLEAP | a row for each bone or animal of a frame | layout |
| EuRoC, TUM, ROS 2, D-Flow, JARVIS | seconds and nanoseconds, names in cells, force plates, blanks | layout |
| TUM, KITTI, Redwood | numbers without titles, also 4 x 4 matrices on one line or four | layout of recordings |
| Aria, PhaseSpace, Quest | axes before names, people by id, times since the first row | layout of recordings |
| OpenFace, Unreal, The Captury, scripts of Vicon's DataStream | X_0 to X_67, Loc and Rot, units of places | layout |
| FreeMoCap CSV | 1.8: by model, by trajectory, by frame | layout of its writer |
| Codamotion, LabVIEW, NatNet, AnyBody, NDI Wave as text | lines around titles, units in brackets, paths | layout |
| R, xarray, Unreal | numbered rows, columns of axes, `X=1.0 Y=2.0 Z=3.0` | layout |
| BIDS motion | points and bodies, with channels.tsv and motion.json | layout of its specification |
| JSON of Track Manager, Azure Kinect, pandas, scripts | a list per frame or marker, names once or in all | layout |
| JSON of AlphaPose, COCO, MediaPipe | a record per person and image; landmarks in images and in the world | layout |
| JSON of MMPose, ZED, VIBE | people of each frame with scores; people with frames of their own | layout |
| DLTdv | CSV, and sparse tables of version 8 | layout of its writer |
| Quest, visionOS, Unity recorders | heads, hands and joints with quaternions or angles | layout of public recorders |
| PeTrack, Axis Studio, PlotJuggler | rate in comments; sensors beside joints; topics at other times | layout |
| NumPy .npy, .npz | format 1.0, axes in any order, an array per point, rows of ezc3d, poses, robots | by NumPy |
| MATLAB .mat | level 5: structs, MoCap Toolbox, Visual3D, Theia, biomechZoo, arrays | written by scipy |

Not read: Cortex .trb (its layout is not published), bodies beside trajectories in Qualisys .mat, MATLAB 7.3, TDF frame
by frame, MVNX of sensors alone, Motive and skeletons of Qualisys with local coordinates, orientations alone. The error
says what to export instead.

What is written was opened with these, in every case by the tests:

| program | version | opened | found |
| --- | --- | --- | --- |
| Blender (bpy) | 5.0.1 | glTF, USD, BVH | 20 frames within 0.05 mm; bones along limbs; speed; USD's range |
| OpenSim | 4.6 | model, motion, setup, TRC | poses, inverse kinematics, masses, ranges, upright at zero |
| MuJoCo | 4.0.0 | MJCF, URDF | poses, masses and inertias, ranges, gravity |
| PyBullet | 3.2.7 | URDF | poses, masses |
| yourdfpy | 0.0.60 | URDF | poses, zero, axes, inertias |
| Khronos' glTF validator | 2.0.0-dev.3.10 | glTF | no error, no warning |
| usd-core | 26.11 | USD | poses, its own validators |
| bvhio | 1.5.4 | BVH | poses |
| Cal3D | 0.11 of Debian | XSF, XAF | poses |
| ezc3d, c3d | 1.7.2, 0.6 | C3D | markers and joints |

Unity, Unreal and Maya were not tried.
"""
OPEN = """## Joints that the motion does not determine

Where such a joint lies is a choice, or the marker set that is worn or what is usual of bodies places it (see
[skeleton](stages/skeleton.md#how-sure-it-is)), and files that hold joints say so: in a sentence with the names of these
joints, or in a mark of each joint; which of these it is, where there are words. BVH has no comments: the export says
so, and a summary-json beside the file tells which joints these are (`place`: `motion`, `marker_set`, `usual`,
`in_part`, `choice`; of hinges that the motion determines but along their axes `usual_along_axis`, `choice_along_axis`).
In `.raw-joints.c3d` of a run the points have the same descriptions as in c3d-joints. Marks beside angles are about the
places of joints, not about the angles.
"""
KEPT = """## What a written file keeps

All else that a project holds is lost; the project file `.skelgen` keeps everything.
"""


def parameters_markdown() -> str:
    """Return the text of docs/parameters.md."""
    sections = [_section(declared) for declared in all_parameter_classes()]
    capture = [_section(DetectionParameters, CAPTURE), _section(BodyParameters, SEARCH)]
    return "\n".join([PARAMETERS, *sections, *capture])


def formats_markdown() -> str:
    """Return the text of docs/formats.md."""
    rows = [FORMAT_COLUMNS, ("---",) * len(FORMAT_COLUMNS), *formats_table()]
    options = "\n".join(
        f"- **{entry.name}** {_option(option)}" for entry in known_formats() for option in entry.options
    )
    written = [entry for entry in known_formats() if entry.write is not None]
    kept = [("", *(entry.name for entry in written)), ("---",) * (len(written) + 1)]
    kept += [(part.title, *("yes" if part.name in entry.keeps else "" for entry in written)) for part in PARTS]
    marks = [("name", "where the file says so"), ("---",) * 2]
    marks += [
        (entry.name, entry.marks_open or "nowhere")
        for entry in written
        if entry.marks_open or {"joints", "angles"} & {*entry.keeps}
    ]
    tables = f"{TRIED}\n{KEPT}\n{_table(kept)}\n\n{OPEN}\n{_table(marks)}\n"
    return f"{FORMATS}\n{_table(rows)}\n\n## Options\n\n{options}\n\n{tables}"


def licences_markdown() -> str:
    """Return the text of docs/licences.md."""
    rows = []
    for name, wanted_by in sorted(needed_packages().items()):
        about = metadata.metadata(name)
        title = f"[{about['Name']}]({_page(about)})" if _page(about) else about["Name"]
        rows.append(f"| {title} | {licence_of(name)} | {', '.join(sorted(wanted_by))} |")
    return LICENCES + "\n".join(rows) + "\n"


def needed_packages() -> dict[str, set[str]]:
    """Return every installed package that skelgen or one of its extras needs, and what needs it.

    Packages that only other systems need, and those of extras that are not installed, are not known here.
    """
    project = tomllib.loads((Path(__file__).parent.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    waiting = [(PACKAGE, text) for text in project["dependencies"]]
    for extra, texts in project["optional-dependencies"].items():
        if extra not in FOR_DEVELOPERS:
            waiting += [(f"{PACKAGE}[{extra}]", text) for text in texts]
    found: dict[str, set[str]] = {}
    while waiting:
        wanted_by, text = waiting.pop()
        requirement = Requirement(text)
        name = canonicalize_name(requirement.name)
        try:
            distribution = metadata.distribution(name)
        except metadata.PackageNotFoundError:
            continue
        if name not in found:
            further = [each for each in distribution.requires or () if _applies(Requirement(each), requirement.extras)]
            waiting += [(distribution.metadata["Name"], each) for each in further]
        found.setdefault(name, set()).add(wanted_by)
    found.pop(PACKAGE, None)
    return found


def licence_of(name: str) -> str:
    """Return the licence that an installed package states: its expression, its field, or its classifiers.

    Parameters
    ----------
    name : str
        Of the package.
    """
    about = metadata.metadata(name)
    stated = " ".join((about.get("License-Expression") or about.get("License") or "").split())
    if stated and stated != "UNKNOWN" and len(stated) <= LONGEST_NAME:
        return stated
    prefix = "License :: OSI Approved :: "
    every = about.get_all("Classifier") or ()
    classifiers = [entry.removeprefix(prefix) for entry in every if entry.startswith(prefix)]
    texts = [licence for beginning, licence in TEXTS.items() if beginning in stated]
    return ", ".join(classifiers) or next(iter(texts), UNSTATED.get(name, "not stated"))


def _applies(requirement: Requirement, extras: set[str]) -> bool:
    marker = requirement.marker
    return marker is None or any(marker.evaluate({"extra": extra}) for extra in ("", *extras))


def _page(about: metadata.PackageMetadata) -> str:
    """The home page, or the first address that looks like one."""
    pages = dict(entry.split(", ", 1) for entry in about.get_all("Project-URL") or () if ", " in entry)
    by_name = {name.lower(): page for name, page in pages.items()}
    known = [by_name.get(name, "") for name in ("homepage", "home", "source", "source code", "repository")]
    return next((page for page in (about.get("Home-page") or "", *known, *pages.values()) if page), "")


def _section(declared: type[StageParameters], set_by: str = "") -> str:
    """One table; parameters that are set elsewhere than in config.xml have no place there."""
    summary = (declared.__doc__ or "").partition("\n")[0]
    rows = [COLUMNS, tuple("---" for _ in COLUMNS), *(_row(entry, declared) for entry in declared.declarations())]
    if set_by:
        summary, place = f"{summary}\n{set_by}", COLUMNS.index("in config.xml")
        rows = [row[:place] + row[place + 1 :] for row in rows]
    return f"## {declared.stage}\n\n{summary}\n\n{_table(rows)}\n"


def _table(rows: Sequence[Sequence[str]]) -> str:
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows)


def _option(option: Option) -> str:
    choices = f" ({' | '.join(option.choices)})" if option.choices else ""
    return f"`{option.name}`, default `{option.default}`{choices}: {option.help}"


def _row(entry: Declaration, declared: type[StageParameters]) -> tuple[str, ...]:
    place = "/".join((entry.config_section or declared.config_section, entry.config_name or entry.name.upper()))
    allowed = entry.bounds.replace(" .. inf", " or more")
    default = f"{_text(entry.default)} {entry.unit}".strip()
    help_ = entry.help.rstrip(".") + (f"; acts with {entry.acts_with}" if entry.acts_with else "")
    return (f"`{entry.name}`", entry.kind.__name__, default, allowed, f"`{place}`", help_)


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:g}" if isinstance(value, float) else str(value)


if __name__ == "__main__":
    folder = Path(__file__).parent
    (folder / "parameters.md").write_text(parameters_markdown(), encoding="utf-8")
    (folder / "formats.md").write_text(formats_markdown(), encoding="utf-8")
    (folder / "licences.md").write_text(licences_markdown(), encoding="utf-8")
