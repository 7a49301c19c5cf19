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
from fuzz_texts import N_FRAMES, TEXT_SEEDS
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
    for name, text in TEXT_SEEDS.items():
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
