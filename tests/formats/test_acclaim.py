"""A hand-made skeleton whose places can be told in the head; what no reader can take is refused with the line."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import read_motion

from skelgen.errors import FormatError, InputError, ParameterError
from skelgen.simulation import recorded_body, simulate

MM = 25.4 / 0.5  # of a unit: the length 0.5 stands for two units per inch

ASF = """# a leg
:version 1.10
:name leg
:units
  mass 1.0
  length 0.5
  angle deg
:documentation
  one leg
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 20 0
  orientation 0 0 0
:bonedata
  begin
    id 1
    name hip
    direction 1 0 0
    length 2
    axis 0 0 0 XYZ
  end
  begin
    id 2
    name thigh
    direction 0 -1 0
    length 8
    axis 0 0 90 XYZ
    dof rx ry
    limits (-90 90)
           (-10 10)
  end
  begin
    name shank
    direction 0 -2 0
    length 7
    axis 0 0 0 XYZ
    dof rx
  end
:hierarchy
  begin
    root hip
    hip thigh
    thigh shank
  end
"""

AMC = """#!OML:ASF leg.asf
:FULLY-SPECIFIED
:DEGREES
1
root 0 0 0 0 0 0
thigh 0 0
shank 0
2
root 1 2 3 0 90 0
thigh 0 0
shank 0
3
root 0 0 0 0 0 0
thigh 90 0
shank 0
4
root 0 0 0 0 0 0
thigh 0 90
shank 90
"""


@pytest.fixture
def written(tmp_path):
    def write(asf=ASF, amc=AMC, names=("leg.asf", "leg_01.amc")):
        for name, text in zip(names, (asf, amc), strict=True):
            (tmp_path / name).write_text(text)
        return tmp_path / names[1]

    return write


def places(motion, name) -> np.ndarray:
    return motion.world_from_bone[:, motion.names.index(name), :3, 3] / MM


def tips(motion, name) -> np.ndarray:
    bone = motion.names.index(name)
    pose = motion.world_from_bone[:, bone]
    return (pose[:, :3, :3] @ motion.tips[bone][0] + pose[:, :3, 3]) / MM


def test_bones_are_where_they_can_be_told_in_the_head(written):
    motion = read_motion(written())
    assert motion.names == ("root", "hip", "thigh", "shank")
    # Frames: at rest; the root walks and turns about y; the thigh turns about its own x, which is the world's y; then
    # about its own y, which is the world's -x.
    expected = {
        "hip": [[0, 20, 0], [1, 22, 3], [0, 20, 0], [0, 20, 0]],
        "thigh": [[2, 20, 0], [1, 22, 1], [2, 20, 0], [2, 20, 0]],
        "shank": [[2, 12, 0], [1, 14, 1], [2, 12, 0], [2, 20, 8]],
    }
    for name, where in expected.items():
        np.testing.assert_allclose(places(motion, name), where, rtol=0, atol=1e-9)
    # In the last frame the shank turns by 90 degrees about x in the thigh, which is turned by -90 about it already.
    np.testing.assert_allclose(tips(motion, "shank")[[0, 3]], [[2, 5, 0], [2, 13, 8]], rtol=0, atol=1e-9)


def test_first_freedom_is_applied_first(written):
    amc = AMC.replace("root 0 0 0 0 0 0", "root 0 0 0 90 90 0", 1)
    motion = read_motion(written(amc=amc))
    # hip along x: Rx leaves it, Ry brings it to -z; the thigh along -y: Rx brings it to -z, Ry to -x.
    np.testing.assert_allclose(tips(motion, "hip")[0], [0, 20, -2], rtol=0, atol=1e-9)
    np.testing.assert_allclose(tips(motion, "thigh")[0], [-8, 20, -2], rtol=0, atol=1e-9)


def test_radians_are_understood(written):
    half_turn = f"{np.pi / 2:.15f}"
    degrees, radians = AMC, AMC.replace(" 90", f" {half_turn}")
    asf = ASF.replace("angle deg", "angle rad").replace("axis 0 0 90 XYZ", f"axis 0 0 {half_turn} XYZ")
    expected = read_motion(written(amc=degrees)).world_from_bone
    np.testing.assert_allclose(read_motion(written(asf, radians)).world_from_bone, expected, rtol=0, atol=1e-9)


def test_rate_is_that_of_cmu_unless_stated(written):
    assert read_motion(written()).rate == 120.0
    assert "no frame rate" in read_motion(written()).notices[0]
    assert read_motion(written(), rate=60.0).rate == 60.0


def test_skeleton_is_found_beside_the_motion(written, tmp_path):
    path = written()
    (tmp_path / "other.asf").write_text("not this one")
    assert read_motion(path).n_bones == 4
    path.rename(tmp_path / "walk.amc")
    with pytest.raises(InputError, match=r"no ASF beside it belongs to it; there are leg\.asf, other\.asf"):
        read_motion(tmp_path / "walk.amc")
    assert read_motion(tmp_path / "walk.amc", skeleton=tmp_path / "leg.asf").n_bones == 4


BROKEN_ASF = [  # what is replaced, by what, the line that is named, what is said
    (":bonedata", ":bones", "root hip", "no bone 'hip'"),
    ("name shank", "name thigh", "name thigh", "a second bone"),
    ("direction 0 -2 0", "direction 0 0 0", "direction 0 0 0", "without direction"),
    ("direction 0 -2 0", "direction 0 -2", "direction 0 -2", "2 values after direction where 3"),
    ("length 7", "length nan", "length nan", "finite number"),
    ("dof rx\n", "dof spin\n", "dof spin", "is no freedom"),
    ("hip thigh", "knee thigh", "knee thigh", "no bone 'knee'"),
    ("hip thigh", "shank thigh", "shank thigh", "before any bone carries it"),
    ("thigh shank", "thigh hip", "thigh hip", "two bones carry 'hip'"),
    ("axis 0 0 90 XYZ", "axis 0 0 90", "axis 0 0 90", "ends with the order"),
    ("angle deg", "angle turn", "angle turn", "deg or rad"),
    ("length 0.5", "length 0", "length 0", "must be above 0"),
]

BROKEN_AMC = [
    ("shank 0\n2", "2", "2", "no line for 'shank'"),
    ("thigh 0 0\n", "thigh 0\n", "thigh 0", "1 values of 'thigh' where the skeleton has 2"),
    ("thigh 0 0\n", "knee 0 0\n", "knee 0 0", "no bone 'knee'"),
    ("thigh 0 0\n", "thigh 0 nan\n", "thigh 0 nan", "finite number"),
    ("shank 0\n2", "shank 0\nshank 1\n2", "shank 1", "twice in one frame"),
    ("\n2\n", "\n5\n", "5", "frame 5 follows frame 1"),
    ("thigh 0 90\nshank 90\n", "thi", "thi", "no bone 'thi'"),
    ("shank 90\n", "", "", "cut off"),
    (AMC, "nothing", "nothing", "not AMC"),
]


def line_of(text: str, content: str) -> int:
    """Number of the last line that holds just this."""
    return max(number for number, line in enumerate(text.split("\n"), start=1) if line.strip() == content)


@pytest.mark.parametrize(("old", "new", "named", "what"), BROKEN_ASF)
def test_broken_skeleton_is_refused_with_the_line(written, old, new, named, what):
    broken = ASF.replace(old, new, 1)
    with pytest.raises(FormatError, match=what) as error:
        read_motion(written(asf=broken))
    assert (error.value.path.suffix, error.value.place) == (".asf", line_of(broken, named))


@pytest.mark.parametrize(("old", "new", "named", "what"), BROKEN_AMC)
def test_broken_motion_is_refused_with_the_line(written, old, new, named, what):
    broken = AMC.replace(old, new, 1)
    with pytest.raises(FormatError, match=what) as error:
        read_motion(written(amc=broken))
    assert (error.value.path.suffix, error.value.place) == (".amc", line_of(broken, named))


def test_wrong_options_are_refused(written):
    with pytest.raises(ParameterError, match="its ASF states the unit"):
        read_motion(written(), unit="cm")
    with pytest.raises(FormatError, match="bones without motion"):
        read_motion(written().with_name("leg.asf"))


def test_recorded_motion_has_the_joints_that_its_skeleton_allows(recording):
    body = recorded_body(read_motion(recording("motion/01_01.amc")), rate=60.0)
    kinds = {limb.name: limb.kind for limb in body.structure.limbs}
    assert {kinds[name] for name in ("ltibia", "rtibia", "lradius", "rradius", "lwrist")} == {"hinge"}
    assert {kinds[name] for name in ("lfoot", "rfoot", "lhand")} == {"universal"}
    assert "lhipjoint" not in kinds  # it has no freedom: it is part of the root
    truth = simulate(body, n_frames=100).truth
    thigh = truth.joint_positions[:, [truth.joint_names.index(name) for name in ("root - lfemur", "lfemur - ltibia")]]
    lengths = np.linalg.norm(thigh[:, 1] - thigh[:, 0], axis=1)
    np.testing.assert_allclose(lengths, 7.1578 * 25.4 / 0.45, rtol=0, atol=1e-6)
