"""Readers for fuzz.py: each with small sound files to mutate, and what is done with what it accepts."""

from __future__ import annotations

import contextlib
import struct
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas
from scipy.io import savemat
from skelgen_formats.capture_settings import read_settings, write_settings
from skelgen_formats.identities_csv import read_identities
from skelgen_formats.lines import Sample
from skelgen_formats.registry import known_formats, read_motion, read_take, write_file

import skelgen
from skelgen.app.configuration import Settings, write_defaults
from skelgen.app.files import open_input
from skelgen.app.limb_names import read_hierarchy
from skelgen.app.outputs import write_outputs
from skelgen.app.project_file.archive import open_project, save_project
from skelgen.app.room import read_capture_settings
from skelgen.app.tables import column_rows, project_tables
from skelgen.capture.images import opencv, read_image
from skelgen.capture.simulated_rig import simulated_rig
from skelgen.capture.sources.images import listed_pairs
from skelgen.errors import MissingResultError
from skelgen.model import Poses, Project, Trajectories
from skelgen.simulation import read_truth, recorded_body, write_truth

N_FRAMES = 24
"""Of the sound files: small files are read quickly, and most damages hit something."""

SHOWN, SAMPLED, WRITTEN = 4, 3, 40
"""Of so many files one, if accepted, is shown and one is sampled, as `skelgen info` does; one project written anew."""


@dataclass(frozen=True)
class Reader:
    """What reads files of a kind.

    Attributes
    ----------
    name : str
        Its name.
    kind : str
        Which mutations: a key of `fuzz_mutations.CHANGES`.
    seeds : tuple of str
        Names of sound files.
    read : callable (path, turn)
        Reads, and does with what it read what a command would do; the turn, a large number, chooses.
    """

    name: str
    kind: str
    seeds: tuple[str, ...]
    read: Callable[[Path, int], object]


def _take(name: str) -> Callable[[Path, int], object]:
    def read(path: Path, turn: int) -> None:
        sample = Sample(N_FRAMES // 2, above=0) if turn % SAMPLED == 0 else None
        take = read_take(path, None if turn % 2 else name, sample=sample)
        if turn % SHOWN == 0:
            _show(Project(take))

    return read


def _show(project: Project) -> None:
    project_tables(project)
    column_rows(project.take)


def _project(path: Path, turn: int) -> None:
    project = open_project(path)
    if turn % SHOWN == 0:
        _show(project)
    if turn % WRITTEN == 0:
        with tempfile.TemporaryDirectory() as folder, contextlib.suppress(MissingResultError):
            write_outputs(project, folder, "again")


def _motion(path: Path, turn: int) -> None:
    motion = read_motion(path.with_suffix(".amc") if path.suffix == ".asf" else path)
    if turn % SHOWN == 0:
        recorded_body(motion)


def _settings(path: Path, turn: int) -> None:
    read_settings(path) if turn % 2 else read_capture_settings(path)


_TEXTS = (
    "trc",
    "csm",
    "qualisys",
    "motive",
    "nexus",
    "mvnx",
    "wide-csv",
    "vector-csv",
    "poses-csv",
    "classic-xml",
    "tidy-csv",
    "emt",
    "dtrack",
    "tracking-tools",
    "untitled-poses",
    "named-rows",
    "untitled-points",
    "xml",
    "json",
    "bids-motion",
)
_IMAGES = ("png", "jpg", "bmp", "pgm", "tiff")


def _swinging(frame: int) -> np.ndarray:
    """Return six points, shape (6, 3): three that swing far, and three on another body that goes."""
    angle = frame / 6
    arm = [[np.cos(angle) * r, r / 3, np.sin(angle) * r] for r in (300.0, 500.0, 640.0)]
    return np.array([*arm, *([70.0 * frame + x, 900.0 - x, 20.0 * x] for x in (0.0, 40.0, 95.0))])


MORE_SEEDS = {
    "json": ("records.json", "parts.json"),
    "c3d": ("c3d-integers.c3d", "c3d-dec.c3d"),
    "nexus": ("tracker.csv",),
    "numpy": ("numpy.npz", "turned.npz", "poses.npz"),
    "qualisys": ("skeleton.tsv",),
    "qualisys-mat": ("packed.mat", "struct.mat", "cells.mat", "skeleton.mat"),
    "tidy-csv": ("blanks.txt", "long.csv", "melted.csv", "tf.csv", "segments.csv", "ids.csv", "trials.csv"),
    "wide-csv": (
        "sure.csv",
        "aria.csv",
        "angles.csv",
        "flags.csv",
        "stamps.csv",
        "euroc.csv",
        "face.csv",
        "kinect.csv",
        "bones.csv",
        "coda.csv",
        "threes.csv",
    ),
    "wide-parquet": ("tidy.parquet",),
    "untitled-poses": ("kitti.txt", "hand.traj"),
    "xml": ("attributes.xml",),
    "named-rows": ("pairs.log", "names.csv", "blocks.csv"),
    "vector-csv": ("vectors.sto", "turns.csv", "lists.csv", "unreal.csv"),
}
"""Further sound files of a format."""

READERS = (
    *(
        Reader(name, "text" if name in _TEXTS else "bytes", (f"{name}{suffix}", *more), _take(name))
        for name, suffix, *more in (
            (entry.name, entry.suffixes[0], *(MORE_SEEDS.get(entry.name, ())))
            for entry in known_formats()
            if entry.read is not None
        )
    ),
    *(Reader(name, "text", (f"motion.{name}",), _motion) for name in ("bvh", "amc", "asf")),
    Reader("project", "archive", ("finished.skelgen", "labels.skelgen", "sensors.skelgen"), _project),
    Reader("truth", "archive", ("rods.truth.npz",), lambda path, turn: read_truth(path)),
    Reader("identities", "text", ("points.csv", "places.csv"), lambda path, turn: read_identities(path)),
    Reader("hierarchy", "text", ("tree.txt",), lambda path, turn: read_hierarchy(path)),
    Reader("config", "text", ("config.xml",), lambda path, turn: Settings(path)),
    Reader("settings", "text", ("settings.xml",), _settings),
    Reader("list", "text", ("pairs.txt",), lambda path, turn: listed_pairs(path)),
    Reader("image", "bytes", tuple(f"image.{suffix}" for suffix in _IMAGES), lambda path, turn: read_image(path)),
    Reader(
        "any",
        "bytes",
        ("trc.trc", "c3d.c3d", "mfml.mfml", "csm.csm", "finished.skelgen", "classic-xml.xml"),
        lambda path, turn: open_input(path),
    ),
)
"""Every reader."""


def make_seeds(folder: Path) -> None:
    """Write the sound files of all readers; the same bytes every time."""
    simulated = skelgen.simulate("rods", seed=1, n_frames=N_FRAMES)
    take, rng = simulated.take, np.random.default_rng(0)
    assert isinstance(take, Trajectories)
    odd = replace(take, positions=np.where(rng.random((N_FRAMES, take.n_markers, 1)) < 0.1, np.nan, take.positions))
    finished = _still(skelgen.reconstruct(odd, n_limbs=3))
    cloud = skelgen.simulate("rods", seed=1, n_frames=60, labelled=False).take
    sensors = _sensors(rng)
    values = {"mfml": cloud, "poses-csv": sensors, "classic-xml": finished}
    for entry in known_formats():
        if entry.read is not None and entry.write is not None:
            write_file(values.get(entry.name, odd), folder / f"{entry.name}{entry.suffixes[0]}", entry.name)
    _other_c3d(folder)
    _tables(folder, odd)
    save_project(finished, folder / "finished.skelgen")
    save_project(_still(skelgen.reconstruct(cloud, until="labels")), folder / "labels.skelgen")
    save_project(Project(sensors), folder / "sensors.skelgen")
    write_file(finished, folder / "motion.bvh")
    write_truth(simulated.truth, folder / "rods.truth.npz")
    write_defaults(folder / "config.xml")
    rig = simulated_rig("arm", n_frames=1)
    write_settings(rig.settings, folder / "settings.xml")
    left = rig.render(0)[0].left[200:280, 280:380]
    for suffix in _IMAGES:
        opencv().imwrite(str(folder / f"image.{suffix}"), left)
    for name, text in _TEXT_SEEDS.items():
        (folder / name).write_text(text)


def _tables(folder: Path, take: Trajectories) -> None:
    """An array of points, and a wide Parquet file."""
    np.save(folder / "numpy.npy", take.positions)
    np.savez_compressed(folder / "numpy.npz", positions=take.positions, names=take.names, rate=take.rate)
    table = pandas.DataFrame({"time": take.times})
    for column, title in enumerate(f"{name}_{axis}" for name in take.names for axis in "xyz"):
        table[title] = take.positions.reshape(take.n_frames, -1)[:, column]
    table.to_parquet(folder / "wide-parquet.parquet")
    data = np.concatenate([take.positions, np.ones((take.n_frames, take.n_markers, 1))], axis=2).transpose(1, 2, 0)
    labeled = {"Labels": np.array(take.names, dtype=object), "Data": data}
    held = {"Frames": take.n_frames, "FrameRate": take.rate, "Trajectories": {"Labeled": labeled}}
    savemat(folder / "qualisys-mat.mat", {"walk": held})
    savemat(folder / "packed.mat", {"walk": held}, do_compression=True)
    points = dict(zip(take.names, take.positions.swapaxes(0, 1), strict=True))
    savemat(
        folder / "struct.mat", {"markers": points, "info": {"freq": 100.0, "who": np.array(["a", "b"], dtype=object)}}
    )
    places, turns = np.zeros((3, 2, N_FRAMES)), np.ones((4, 2, N_FRAMES)) / 2
    skeleton = {"SegmentLabels": np.array(["a", "b"], dtype=object), "PositionData": places, "RotationData": turns}
    savemat(folder / "skeleton.mat", {"walk": {"FrameRate": take.rate, "Skeletons": skeleton}})
    elements = np.array([*points.items()], dtype=[("name", object), ("xyz", object)])
    savemat(folder / "cells.mat", {"markers": elements, "FRAME_RATE": np.array([[100.0]], dtype=object)})
    np.savez(folder / "turned.npz", points=take.positions.transpose(2, 1, 0), labels=take.names, rate=take.rate)
    np.savez(folder / "poses.npz", poses=np.tile(np.eye(4), (N_FRAMES, 3, 1, 1)))
    for name in (
        "qualisys-mat.mat",
        "packed.mat",
        "struct.mat",
        "cells.mat",
        "skeleton.mat",
    ):  # the header holds the time
        content = (folder / name).read_bytes()
        (folder / name).write_bytes(b"MATLAB 5.0 MAT-file".ljust(116) + content[116:])
    rows = [(f, name, *take.positions[f, m]) for f in range(20) for m, name in enumerate(take.names)]
    tidy = pandas.DataFrame(rows, columns=["frame", "keypoint", "x", "y", "z"])
    tidy.to_csv(folder / "tidy-csv.csv", index=False)
    tidy.to_parquet(folder / "tidy.parquet")
    _tdf(folder / "tdf.tdf", take)


def _tdf(path: Path, take: Trajectories) -> None:
    """Tracks of BTS, each in one segment."""
    block = struct.pack("<iifI", take.n_frames, int(take.rate), 0.0, take.n_markers) + bytes(64)
    for name, track in zip(take.names, take.positions.swapaxes(0, 1), strict=True):
        block += name.encode().ljust(256, b"\0") + struct.pack("<iiii", 1, 0, 0, take.n_frames)
        block += np.nan_to_num(track / 1000.0).astype("<f4").tobytes()
    header = bytes.fromhex("824b6041d31184ca6000b6ac16680c08") + struct.pack("<Ii", 1, 1) + bytes(40)
    path.write_bytes(header + struct.pack("<IIii", 5, 2, 64 + 288, len(block)) + bytes(272) + block)


def _still(project: Project) -> Project:
    """The project without the times that its stages took, which are others every time."""
    reports = {name: replace(report, seconds=0.0) for name, report in project.reports.items()}
    return replace(project, reports=reports)


def _sensors(rng: np.random.Generator) -> Poses:
    rotations, _ = np.linalg.qr(rng.normal(size=(N_FRAMES, 2, 3, 3)))
    poses = np.tile(np.eye(4), (N_FRAMES, 2, 1, 1))
    poses[..., :3, :3] = rotations * np.linalg.det(rotations)[..., np.newaxis, np.newaxis]
    poses[..., :3, 3] = rng.uniform(-500, 500, (N_FRAMES, 2, 3))
    poses[4, 1] = np.nan
    return Poses(poses, ("pelvis", "left thigh"), 60.0, "sensors")


def _other_c3d(folder: Path) -> None:
    """C3D files with whole numbers, and with a DEC's numbers."""
    content = bytearray((folder / "c3d.c3d").read_bytes())
    data, n_points = 512 * (int.from_bytes(content[16:18], "little") - 1), int.from_bytes(content[2:4], "little")
    floats = np.frombuffer(bytes(content[data : data + 16 * n_points * N_FRAMES]), "<f4")
    whole = bytearray(content[:data])
    whole[12:16] = np.float32(0.1).tobytes()
    (folder / "c3d-integers.c3d").write_bytes(bytes(whole) + (floats * 10).astype("<i2").tobytes())
    dec = bytearray(content[:data])
    dec[512 + 3] = 85
    for at in (12, 20):
        dec[at : at + 4] = _as_dec(np.frombuffer(bytes(content[at : at + 4]), "<f4"))
    rate = content.index(b"RATE") + len("RATE") + 4
    dec[rate : rate + 4] = _as_dec(np.frombuffer(bytes(content[rate : rate + 4]), "<f4"))
    (folder / "c3d-dec.c3d").write_bytes(bytes(dec) + _as_dec(floats))


def _as_dec(values: np.ndarray) -> bytes:
    return (values * 4).astype("<f4").view("<u2").reshape(-1, 2)[:, ::-1].tobytes()


_TEXT_SEEDS = {
    "emt.emt": "BTS ASCII format\n\nType:         \t3D point tracks\nMeasure unit: \tm\n\nTracks:       \t2\n"
    "Frequency:    \t100 Hz\nFrames:       \t2\nStart time:   \t0.000\n\n"
    " Frame\t  Time\tc7.X\tc7.Y\tc7.Z\tknee.X\tknee.Y\tknee.Z\t\n"
    "     0\t   0.000\t 0.1\t 0.2\t 0.3\t 0.4\t 0.5\t 0.6\t\n     1\t   0.010\t 0.1\t 0.2\t 0.3\t   \t   \t   \t\n",
    "dtrack.dtrack.txt": "fr 7\nts 39596.02\n6d 1 [0 1.000][10 20 30 0 0 90][0 1 0 -1 0 0 0 0 1]\n"
    "3d 1 [79 1.000][1 2 3]\nfr 8\nts 39596.04\n6di 1 [2 2 0.1][11 20 30][0 1 0 -1 0 0 0 0 1]\n"
    "3d 2 [79 1.000][1 2 4] [83 1.000][5 6 7]\n",
    "melted.csv": "time,variable,value\n0,a_x,1\n0,a_y,2\n0,a_z,3\n0,b_x,4\n0,b_y,5\n0,b_z,6\n0.1,a_x,1\n0.1,a_y,7\n",
    "bones.csv": "frame,hand,bone_name,start_x,start_y,start_z,end_x,end_y,end_z\n# recorded\n"
    "7,left,Proximal,1,2,3,4,5,6\n7,left,Distal,4,5,6,7,8,9\n9,left,Proximal,1,2,3,4,5,7\n9,left,Distal,4,5,7,7,8,9\n",
    "tracking-tools.csv": 'comment,NaturalPoint\nlefthanded\ninfo,version,1.1\nrigidbody,"Wand",1,3\n'
    "frame,0,0.0,1,1,0.1,0.2,0.3,0,0,0,1,0,0,0,2,0.1,0.2,0.3,1,M1,0.4,0.5,0.6,2,\n"
    "frame,1,0.01,0,1,0.1,0.2,0.3,1,M1\nframe,2,0.02,1,1,0.1,0.2,0.4,0,0,0.6,0.8,0,0,0,0\n",
    "qualisys.tsv": "NO_OF_FRAMES\t3\nNO_OF_MARKERS\t2\nFREQUENCY\t100\nDATA_INCLUDED\t3D\nMARKER_NAMES\thip\tknee\n"
    "Frame\tTime\thip X\thip Y\thip Z\tknee X\tknee Y\tknee Z\n1\t0.00\t1.5\t2.5\t3.5\t4.5\t5.5\t6.5\n"
    "2\t0.01\t1.6\t2.6\t3.6\t4.6\t5.6\t6.6\n3\t0.02\t1.7\t2.7\t3.7\t0.000\t0.000\t0.000\n",
    "skeleton.tsv": "NO_OF_FRAMES\t2\nFREQUENCY\t85\nREFERENCE\tGLOBAL\nSCALE\t1.00000\nSOLVER\tAnimation\n"
    "Frame\tTime\tHips\tX\tY\tZ\tQX\tQY\tQZ\tQW\tSpine\tX\tY\tZ\tQX\tQY\tQZ\tQW\n"
    "1\t0.0\t\t10\t20\t900\t0\t0\t0\t1\t\t11\t20\t1000\t0\t0\t0.6\t0.8\n"
    "2\t0.01\t\t10\t20\t900\t0\t0\t0\t1\t\t\t\t\t\t\t\t\n",
    "motive.csv": "Format Version,1.23,Take Name,walk,Export Frame Rate,120.0,Total Exported Frames,2,"
    "Rotation Type,Quaternion,Length Units,Meters,Coordinate Space,Global\n\n"
    ",,Rigid Body,Marker,Marker,Marker,Marker,Marker,Marker\n"
    ",Name,Foot,Bob:LKNE,Bob:LKNE,Bob:LKNE,Bob:RKNE,Bob:RKNE,Bob:RKNE\n,ID,F1,A0,A0,A0,A1,A1,A1\n"
    ",,Rotation,Position,Position,Position,Position,Position,Position\nFrame,Time (Seconds),X,X,Y,Z,X,Y,Z\n"
    "0,0.0000,0.1,0.5,0.6,0.7,-0.5,-0.6,-0.7\n1,0.0083,0.1,0.51,0.61,0.71,,,\n",
    "nexus.csv": "Model Outputs\n100\n,,A:LHipAngles,,\nFrame,Sub Frame,X,Y,Z\n,,deg,deg,deg\n1,0,10,20,30\n\n"
    "Trajectories\n100\n,,A:LASI,,,A:RASI,,\nFrame,Sub Frame,X,Y,Z,X,Y,Z\n,,mm,mm,mm,mm,mm,mm\n"
    "1,0,1.5,2.5,3.5,4.5,5.5,6.5\n2,0,1.6,2.6,3.6,,,\n3,0,1.7,2.7,3.7,4.7,5.7,6.7\n",
    "mvnx.mvnx": '<?xml version="1.0" encoding="UTF-8"?>\n<mvnx xmlns="http://www.xsens.com/mvn/mvnx" version="4">\n'
    '<subject frameRate="60">\n<segments><segment label="Pelvis" id="1"/><segment label="L5" id="2"/></segments>'
    '\n<frames><frame type="identity"><orientation>1 0 0 0 1 0 0 0</orientation></frame>\n<frame type="normal">'
    "<orientation>1 0 0 0 0.6 0.8 0 0</orientation>\n<position>0 0 0.9 0.1 0.2 1.0</position></frame></frames>\n"
    "</subject></mvnx>\n",
    "tracker.csv": "Objects\n100\n,,Wand:Wand,,,,,\nFrame,Sub Frame,RX,RY,RZ,TX,TY,TZ\n,,deg,deg,deg,mm,mm,mm\n"
    "1,0,10,20,30,1.5,2.5,3.5\n2,0,11,21,31,1.6,2.6,3.6\n3,0,,,,,,\n",
    "angles.csv": "t,a_x,a_y,a_z,a_roll,a_pitch,a_yaw,b_x,b_y,b_z,b_roll,b_pitch,b_yaw\n"
    "0.0,1.5,2.5,3.5,10,20,30,4.5,5.5,6.5,0,0,0\n0.02,1.6,2.6,3.6,11,21,31,,,,,,\n",
    "flags.csv": "time,id,a_x,a_y,a_z,a_valid,r11,r12,r13,r21,r22,r23,r31,r32,r33,b_tx,b_ty,b_tz\n"
    "12:00:00.00,1,1.5,2.5,3.5,1,1,0,0,0,1,0,0,0,1,4,5,6\n12:00:00.02,1,1.6,2.6,3.6,0,1,0,0,0,1,0,0,0,1,4,5,6\n",
    "stamps.csv": "sec,nanosec,a.name,a.pose.position.x,a.pose.position.y,a.pose.position.z,"
    + ",".join(f"a.pose.rot_{k}" for k in range(9))
    + "\n7,990000000,hip,1,2,3,1,0,0,0,1,0,0,0,1\n8,0,hip,1.5,2,3,0,-1,0,1,0,0,0,0,1\n8,10000000,hip,,,,,,,,,,,,\n",
    "euroc.csv": "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m],"
    " q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []\n"
    "1403636580838555648,4.6,-1.7,0.7,0.6,0.8,0,0\n1403636580843555328,4.7,-1.7,0.7,0,0,0,0\n",
    "long.csv": "time,bodypart,axis,value_mm\n"
    + "".join(f"{frame / 50},{name},{axis},{frame}.5\n" for frame in range(2) for name in "ab" for axis in "xyz"),
    "tf.csv": "sec,nanosec,frame_id,tx,ty,tz,qx,qy,qz,qw\n7,990000000,hip,1,2,3,0,0,0,1\n"
    "7,990000000,toe,1,2,3,0,0,0.6,0.8\n8,10000000,hip,1,2,3,0,0,0,1\n8,10000000,toe,1,2,3,0,0,0,1\n",
    "blanks.txt": "# frame time marker x y z valid\n"
    "0 0.00 7 1.5 2.5 3.5 1\n0 0.00 8 4.5 5.5 6.5 0\n1 0.02 7 1.6 2.6 3.6 1\n",
    "vector-csv.csv": 't,"nose","tail","hand"\n0.0,"(1.5, 2.5, 3.5)","(4.5, 5.5, 6.5)",None\n'
    '0.02,"(1.6, 2.6, 3.6)","(4.6, 5.6, 6.6)","(7.5, 8.5, 9.5)"\n',
    "turns.csv": "t;a.position;a.rotation;b.position;b.rotation\n"
    "0;(1, 2, 3);(0, 0, 0, 1);(4, 5, 6);(0, 0, 0.6, 0.8)\n0.02;(1, 2, 3);(0, 0, 0, 1);(4, 5, 6);None\n",
    "lists.csv": 'stamp,pose\n638000000000000000,[]\n638000000000333333,"[[1.5, 2.5, 3.5], [4.5, 5.5, 6.5]]"\n',
    "ids.csv": "id,x,y,z,rx,ry,rz\n"
    + "".join(f"{name},{frame}.5,2,3,0.1,0.2,0.3\n" for frame in "123" for name in "78"),
    "hand.traj": "0 0 1\n1 0 0 5\n0 1 0 6\n0 0 1 7\n0 0 0 1\n\n1 1 2\n1 0 0 5\n0 1 0 6\n0 0 1 8\n0 0 0 1\n",
    "aria.csv": "delta_time_ms,left_frame_id,tx_a_hand,ty_a_hand,tz_a_hand,qx_a_hand,qy_a_hand,qz_a_hand,qw_a_hand\n"
    "0,hts,1,2,3,0,0,0.6,0.8\n10,hts,1,2,4,0,0,0.6,0.8\n20,hts,1,2,5,0,0,0.6,0.8\n",
    "sure.csv": "a_x,a_y,a_z,a_conf,b_x,b_y,b_z,b_conf\n1,2,3,0.9,7,7,7,0\n1,2,3,0.8,4,5,6,0.7\n",
    "vectors.sto": "DataRate=50\nDataType=Vec3\nUnits=m\nendheader\ntime\t/a|location\t/b|location\n"
    "0.0\t1.5,2.5,3.5\t4.5,5.5,6.5\n0.02\t1.6,2.6,3.6\tnan,nan,nan\n",
    "wide-csv.csv": "t,nose_x,nose_y,nose_z,tail_x,tail_y,tail_z\n0.0,1.5,2.5,3.5,4.5,5.5,6.5\n0.02,1.6,2.6,3.6,,,\n",
    "untitled-poses.tum": "# ground truth\n1305031098.66 1.5 2.5 3.5 0 0 0 1\n1305031098.68 1.6 2.6 3.6 0 0 0.6 0.8\n",
    "named-rows.xyz": "".join(f"2\nframe {frame} t={frame / 50}\na 1.5 2 {frame}.5\nb 4 5 6\n" for frame in range(4)),
    "xml.mmm.xml": "<M rate='50'><S type='a'><D t='0'>1</D></S><S type='b'>"
    + "".join(f"<D t='{n / 50}'><P name='a'>1 2 {n}</P><P name='b'>4 5 6</P></D>" for n in range(4))
    + "</S></M>",
    "attributes.xml": "<?xml version='1.0'?><m fps='50'>"
    + "".join(f"<f n='{n}'><a x='1' y='2' z='{n}'/><b x='4' y='5' z='6'/></f>" for n in range(4))
    + "</m>",
    "untitled-points.points.txt": "".join(
        " ".join(f"{x:.3f}" for x in [n / 50, *_swinging(n).ravel()]) + "\n" for n in range(N_FRAMES)
    ),
    "pairs.log": "".join(f"t={frame / 50} a_x=1 a_y=2 a_z={frame} b_x=3 b_y=4 b_z=5\n" for frame in range(4)),
    "blocks.csv": "".join(f"{name}\nframe,x,y,z\n0,1,2,3\n1,1.5,2,3\n\n" for name in "ab"),
    "names.csv": "".join(f"{frame / 50},a,1,2,{frame},b,4,5,6\n" for frame in range(4)),
    "kitti.txt": "1 0 0 0 0 1 0 0 0 0 1 0\n0.6 0 0.8 0.1 0 1 0 0 -0.8 0 0.6 0.2\n",
    "segments.csv": "FrameNumber,SubjectName,SegmentName,TX,TY,TZ,Occluded\n"
    + "".join(f"{frame},Ann,{name},{frame}.5,2,3,False\n" for frame in range(3) for name in "ab"),
    "face.csv": "frame,timestamp,gaze_0_x,gaze_0_y,gaze_0_z,x_0,x_1,y_0,y_1,X_0,X_1,Y_0,Y_1,Z_0,Z_1,a_unc[0],a_quat_1\n"
    + "".join(f"{frame},{1e9 + frame / 50},0,0,1,9,9,9,9,1,2,3,4,5,6,7,8\n" for frame in range(3)),
    "kinect.csv": "Frame,Time,Joint,PositionX,PositionY,PositionZ,RotationW,RotationX,RotationY,RotationZ,"
    "Joint,PositionX,PositionY,PositionZ,RotationW,RotationX,RotationY,RotationZ\n"
    + "".join(f"{frame},{frame / 50},Hip,1,2,3,1,0,0,0,Knee,{frame}.5,5,6,0.8,0,0,0.6\n" for frame in range(3)),
    "motion.asf": ":units\n  length 0.45\n  angle deg\n:root\n  order TX TY TZ RX RY RZ\n  position 0 20 0\n"
    "  orientation 0 0 10\n:bonedata\n  begin\n    name thigh\n    direction 0 -1 0\n    length 8\n"
    "    axis 0 0 90 XYZ\n    dof rx ry tz\n  end\n  begin\n    name shank\n    direction 0 -1 0\n    length 7\n"
    "    axis 0 20 0 XYZ\n    dof rx\n  end\n:hierarchy\n  begin\n    root thigh\n    thigh shank\n  end\n",
    "motion.amc": ":DEGREES\n"
    + "".join(
        f"{frame}\nroot {frame} 2 3 1 2 3\nthigh {10 * frame} 5 0\nshank {-15 * frame}\n" for frame in range(1, 6)
    ),
    "points.csv": "# by hand\nname,frame,point,last_frame\nA,0,1,5\nnobody,3,2,\nB,4,0,4\n",
    "places.csv": "label,first_frame,x,y,z\nA,0,1.5,2,3\n\nB,3,-4,5e2,0\nnobody,7,0,0,0\n",
    "json.json": '{"fps": 50, "joints": ["a", "b"], "frames": [{"points": [[1, 2, 3], [4, 5, 6]]},'
    ' {"points": [[1, 2, 3.5], [4, null, 6]]}]}',
    "records.json": '[{"t": 0, "markers": [{"name": "a", "x": 1, "y": 2, "z": 3}, {"name": "b", "x": 4, "y": 5,'
    ' "z": 6}]}, {"t": 0.1, "markers": [{"name": "b", "x": 4, "y": 5, "z": 6}]}]',
    "parts.json": '{"Timebase": {"Frequency": 9}, "Markers": [{"Name": "a", "Parts": [{"Range": {"Start": 1, "End": 2},'
    ' "Values": [[1, 2, 3, 0.1], [1, 2, 4, 0.1]]}]}, {"Name": "b", "Parts": [{"Range": {"Start": 2, "End": 2},'
    ' "Values": [[4, 5, 6, 0.2]]}]}]}',
    "bids-motion_motion.tsv": "1\t2\t3\t4\t5\t6\n1\t2\t3.5\t4\tn/a\t6\n",
    "bids-motion_channels.tsv": "name\tcomponent\ttype\ttracked_point\tunits\n"
    + "".join(f"{name}{axis}\t{axis}\tPOS\t{name}\tmm\n" for name in "ab" for axis in "xyz"),
    "coda.csv": "CODAmotion Analysis Text\nTime,a.X,a.Y,a.Z,a.V,b.X,b.Y,b.Z\n(s),(mm),(mm),(mm),(),(mm),(mm),(mm)\n"
    "0,1,2,3,1,4,5,6\n0.01,1,2,3,0,4,5,6\n",
    "threes.csv": "Frequency,50,Unit,mm\na,b\n1,2,3,4,5,6\n1,2,3.5,4,5,6\n",
    "trials.csv": '"trial" "frame" "marker" "x" "y" "z"\n'
    + "".join(f'"{n + 1}" {n // 4} {n // 2 % 2} "{"ab"[n % 2]}" {n}.5 2 3\n' for n in range(8)),
    "unreal.csv": 'Time,Bone,Place\n0,a,"X=1.5 Y=2 Z=3"\n0,b,"X=4.5 Y=5 Z=6"\n0.1,a,"X=1.6 Y=2 Z=3"\n0.1,b,\n',
    "tree.txt": "# child,parent\nlimb0,\nlimb1,limb0\nlimb2,limb1\n",
    "pairs.txt": "# left right time\na0.png\tb0.png\t0.0\na1.png\tb1.png\t0.02\na2.png\tb2.png\t0.04\n",
}
