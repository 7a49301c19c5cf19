"""Small takes with known content, and one valid file of every format that can be read."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from skelgen_formats.registry import find_format, read_take, write_file

from skelgen.geometry.rotations import matrix_from_vector, transform_from
from skelgen.model import (
    Joint,
    Limbs,
    Motion,
    PointCloud,
    Poses,
    Project,
    Skeleton,
    StageReport,
    Topology,
    Trajectories,
)
from skelgen.model.topology import outward_order

RECORDINGS = Path(__file__).parents[3] / "shared" / "data"


@pytest.fixture
def recording() -> Callable[[str], Path]:
    """The path of a real recording, or a skip where the recordings are absent."""

    def path_of(name: str) -> Path:
        if not (RECORDINGS / name).exists():
            pytest.skip(f"the recording {name} is not on this machine")
        return RECORDINGS / name

    return path_of


@pytest.fixture
def walk() -> Trajectories:
    """Six markers in twelve frames at 120 Hz within a metre; LFHD is unseen in frames 3 to 5, T10 in the last."""
    positions = np.random.default_rng(1).uniform(-1000, 1000, (12, 6, 3))
    positions[3:6, 0] = np.nan
    positions[11, 4] = np.nan
    return Trajectories(positions, ("LFHD", "RFHD", "C7", "CLAV", "T10", "STRN"), 120.0, "walk")


@pytest.fixture
def cloud() -> PointCloud:
    """Twenty frames at 100 Hz with 2, 3, 4, 2, 3, 4 ... points, all attributes, ids from a billion up."""
    generator = np.random.default_rng(2)
    counts = 2 + np.arange(20) % 3
    n_points = int(counts.sum())
    attributes = {
        "reprojection_error": generator.uniform(0, 1, n_points).astype(np.float32),
        "n_blobs": generator.integers(2, 9, n_points),
        "id": 10**9 + np.arange(n_points),
    }
    points = generator.uniform(-1000, 1000, (n_points, 3)).astype(np.float32)
    return PointCloud(points, np.concatenate(([0], np.cumsum(counts))), np.arange(20) / 100.0, attributes, "cloud")


@pytest.fixture
def sensors() -> Poses:
    """Two sensors in eight frames at 60 Hz with random orientations; the second is unseen in frame 4."""
    generator = np.random.default_rng(3)
    rotations, _ = np.linalg.qr(generator.normal(size=(8, 2, 3, 3)))
    rotations *= np.linalg.det(rotations)[..., np.newaxis, np.newaxis]
    transforms = np.tile(np.eye(4), (8, 2, 1, 1))
    transforms[:, :, :3, :3] = rotations
    transforms[:, :, :3, 3] = generator.uniform(-500, 500, (8, 2, 3))
    transforms[4, 1] = np.nan
    return Poses(transforms, ("pelvis", "left thigh"), 60.0, "sensors")


@pytest.fixture
def put(tmp_path: Path) -> Callable[[str, bytes | str], Path]:
    """Write content to a file of this name and return its path."""

    def write(name: str, content: bytes | str) -> Path:
        path = tmp_path / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return write


@pytest.fixture
def edited(put: Callable[[str, bytes | str], Path]) -> Callable[[str, str, str, str], Path]:
    """Write text in which one part, which must occur, is replaced."""

    def write(name: str, text: str, old: str, new: str) -> Path:
        assert old in text
        return put(name, text.replace(old, new, 1))

    return write


@pytest.fixture
def refused() -> Callable[..., str]:
    """Read a file that must be refused and return the sentence."""
    from skelgen.errors import FormatError

    def message(path: Path, format_name: str | None = None) -> str:
        with pytest.raises(FormatError) as caught:
            read_take(path, format_name)
        assert str(path) in str(caught.value)
        return str(caught.value).removeprefix(str(path))

    return message


@pytest.fixture
def qualisys_text() -> str:
    """Two markers in three frames at 100 Hz, in mm; the second marker is unseen in the last frame."""
    return (
        "NO_OF_FRAMES\t3\r\nNO_OF_CAMERAS\t7\r\nNO_OF_MARKERS\t2\r\nFREQUENCY\t100\r\nDATA_INCLUDED\t3D\r\n"
        "MARKER_NAMES\thip\tknee\r\nFrame\tTime\thip X\thip Y\thip Z\tknee X\tknee Y\tknee Z\r\n"
        "1\t0.00\t1.5\t2.5\t3.5\t4.5\t5.5\t6.5\r\n2\t0.01\t1.6\t2.6\t3.6\t4.6\t5.6\t6.6\r\n"
        "3\t0.02\t1.7\t2.7\t3.7\t0.000\t0.000\t0.000\r\n"
    )


@pytest.fixture
def motive_text() -> str:
    """Two markers and a rigid body in three frames at 120 Hz, in metres; the second marker is unseen in frame 1."""
    return (
        "Format Version,1.23,Take Name,walk,Capture Frame Rate,240.000000,Export Frame Rate,120.000000,"
        "Total Exported Frames,3,Rotation Type,Quaternion,Length Units,Meters,Coordinate Space,Global\r\n\r\n"
        ",,Rigid Body,Rigid Body,Marker,Marker,Marker,Marker,Marker,Marker\r\n"
        ",Name,Foot,Foot,Bob:LKNE,Bob:LKNE,Bob:LKNE,Bob:RKNE,Bob:RKNE,Bob:RKNE\r\n"
        ",ID,F1,F1,A0,A0,A0,A1,A1,A1\r\n"
        ",,Rotation,Position,Position,Position,Position,Position,Position,Position\r\n"
        "Frame,Time (Seconds),X,X,X,Y,Z,X,Y,Z\r\n"
        "0,0.0000,0.1,0.2,0.5,0.6,0.7,-0.5,-0.6,-0.7\r\n1,0.0083,0.1,0.2,0.51,0.61,0.71,,,\r\n"
        "2,0.0167,0.1,0.2,0.52,0.62,0.72,-0.52,-0.62,-0.72\r\n"
    )


@pytest.fixture
def valid_file(
    tmp_path: Path, walk: Trajectories, cloud: PointCloud, sensors: Poses, qualisys_text: str, motive_text: str
) -> Callable[[str], Path]:
    """A small valid file of the named format."""

    def make(name: str) -> Path:
        path = tmp_path / f"valid{find_format(name).suffixes[0]}"
        texts = {"qualisys": qualisys_text, "motive": motive_text}
        values: dict[str, Trajectories | PointCloud | Poses] = {"mfml": cloud, "poses-csv": sensors}
        if name in texts:
            path.write_bytes(texts[name].encode())
        else:
            write_file(values.get(name, walk), path, name)
        return path

    return make


SMALL_ASF = """:units
  length 0.45
  angle deg
:root
  order TX TY TZ RX RY RZ
  position 0 20 0
  orientation 0 0 10
:bonedata
  begin
    name thigh
    direction 0 -1 0
    length 8
    axis 0 0 90 XYZ
    dof rx ry tz
  end
  begin
    name shank
    direction 0 -1 0
    length 7
    axis 0 20 0 XYZ
    dof rx
  end
:hierarchy
  begin
    root thigh
    thigh shank
  end
"""
SMALL_AMC = ":DEGREES\n" + "".join(
    f"{frame}\nroot {frame} 2 3 1 2 3\nthigh {10 * frame} 5 0\nshank {-15 * frame}\n" for frame in range(1, 6)
)


@pytest.fixture
def valid_motion(tmp_path: Path, small_project: Project) -> Callable[[str], Path]:
    """A small valid file of bones in motion, by suffix."""

    def make(suffix: str) -> Path:
        path = tmp_path / f"motion.{suffix}"
        if suffix == "bvh":
            write_file(small_project, path)
            return path
        for ending, text in (("asf", SMALL_ASF), ("amc", SMALL_AMC)):
            (tmp_path / f"motion.{ending}").write_text(text)
        return path

    return make


JOINTED_PARENTS = np.array([1, -1, 1, 2, 2, -1, 5, 5, 3])
JOINTED_KINDS = {0: "hinge", 2: "ball", 3: "universal", 4: "rigid", 6: "undetermined", 7: "hinge", 8: "ball"}


@pytest.fixture(scope="session")
def jointed_project() -> Project:
    """Two trees of nine limbs with every type of joint, which the motion keeps to exactly; 40 frames at 50 Hz.

    Four markers per limb without noise, the first unseen every seventh frame; the last is on no limb and unseen in the
    last frame. Names hold blanks and slashes.
    """
    rng = np.random.default_rng(0)
    n_limbs, n_frames, rate = len(JOINTED_PARENTS), 40, 50.0
    offsets = rng.normal(size=(n_limbs, 3)) * 200
    time = np.linspace(0, 2 * np.pi, n_frames)[:, np.newaxis]

    def waves(size: float, n: int) -> np.ndarray:
        parts = (np.sin(k * time + rng.uniform(0, 6, n)) * rng.uniform(-1, 1, n) for k in (1, 2))
        return sum(parts) * size / 2

    poses, reference = np.tile(np.eye(4), (n_frames, n_limbs, 1, 1)), np.tile(np.eye(4), (n_limbs, 1, 1))
    joints = []
    for limb in outward_order(JOINTED_PARENTS).tolist():
        parent = int(JOINTED_PARENTS[limb])
        if parent < 0:
            reference[limb, :3, 3] = offsets[limb] + [0, 0, 900]
            place = reference[limb, :3, 3] + waves(300, 3)
            poses[:, limb] = transform_from(matrix_from_vector(waves(0.8, 3)), place)
            continue
        first, second = (axis / np.linalg.norm(axis) for axis in rng.normal(size=(2, 3)))
        kind = JOINTED_KINDS[limb]
        axes = {"rigid": [], "hinge": [first], "universal": [first, second]}.get(kind)
        turn = matrix_from_vector(waves(0.8, 3)) if axes is None else np.tile(np.eye(3), (n_frames, 1, 1))
        for axis in axes or []:
            turn = turn @ matrix_from_vector(waves(0.8, 1) * axis)
        poses[:, limb] = poses[:, parent] @ transform_from(turn, np.tile(offsets[limb], (n_frames, 1)))
        reference[limb, :3, 3] = reference[parent, :3, 3] + offsets[limb]
        axis, other = (first if axes else None), (second if kind == "universal" else None)
        joints.append(Joint(parent, limb, offsets[limb], np.zeros(3), kind, axis, np.full(3, 0.1), other))
    limb_of_marker = np.append(np.repeat(np.arange(n_limbs), 4), -1)
    places = rng.normal(size=(len(limb_of_marker), 3)) * 90
    places[-1] = np.nan
    on = poses[:, limb_of_marker]
    markers = (on[..., :3, :3] @ places[:, :, np.newaxis])[..., 0] + on[..., :3, 3]
    measured = markers.copy()
    measured[:, -1] = rng.normal(size=(n_frames, 3)) * 1000
    measured[::7, 0] = measured[-1, -1] = np.nan
    names = tuple(f"M {index}/a" if index % 5 == 0 else f"M{index}" for index in range(len(limb_of_marker)))
    take, report = Trajectories(measured, names, rate, "jointed"), StageReport({}, 0.0, ())
    spread = np.full(len(limb_of_marker), 0.1)
    skeleton = Skeleton(JOINTED_PARENTS, tuple(joints), limb_of_marker, places, spread, reference)
    seen = np.ones((n_frames, n_limbs), dtype=bool)
    at = poses[:, [joint.child for joint in joints]][..., :3, 3]
    motion = Motion(poses, at, markers, np.linalg.norm(measured - markers, axis=2), seen, rate)
    topology = Topology(
        JOINTED_PARENTS, np.zeros((n_limbs, n_limbs)), at, np.arange(len(joints)), np.zeros(len(joints)), 0.01
    )
    project = Project(take).with_trajectories(take, report)
    project = project.with_limbs(Limbs(limb_of_marker, np.zeros((len(names), len(names)))), report)
    return project.with_topology(topology, report).with_skeleton(skeleton, motion, report)


@pytest.fixture(scope="session")
def standing_project(jointed_project: Project) -> Project:
    """The jointed project with a marker of no limb on the floor, a metre below all others, so that z is surely up."""
    take = jointed_project.trajectories
    positions = take.positions.copy()
    positions[:, -1] = [0.0, 0.0, np.nanmin(positions[:, :, 2]) - 1000.0]
    take = replace(take, positions=positions)
    return replace(jointed_project, take=take, _trajectories=take)


@pytest.fixture(scope="session")
def judged_apart(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., dict[str, Any]]:
    """What a script beside says that a judge makes of files: of one that wants other packages than ours, or crashes."""

    def judge(module: str, script: str, *arguments: object) -> dict[str, Any]:
        own = Path(__file__).parents[2] / ".blender" / "bin" / "python"
        python = str(own) if own.exists() else sys.executable
        if subprocess.run([python, "-c", f"import {module}"], capture_output=True, check=False).returncode:
            pytest.skip(f"no {module}: `bash .ci/blender` installs it into an environment of its own")
        result = tmp_path_factory.mktemp("judged") / "found.json"
        command = [python, Path(__file__).with_name(script), *arguments, result]
        run = subprocess.run(command, capture_output=True, text=True, check=False, env={"PATH": os.environ["PATH"]})
        assert run.returncode == 0, run.stderr
        return json.loads(result.read_text())

    return judge
