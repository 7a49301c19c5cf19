from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.registry import read_take, recognise

from skelgen.model import Poses

QUARTER = np.sqrt(0.5)
MVNX = f"""<?xml version="1.0" encoding="UTF-8"?>
<!-- exported -->
<mvnx xmlns="http://www.xsens.com/mvn/mvnx" version="4"><mvn version="2019.0.0"/>
<subject label="Ann" frameRate="60" segmentCount="2"><segments>
<segment label="Pelvis" id="1"><points><point label="p"><pos_b>0 0 0</pos_b></point></points></segment>
<segment label="L5" id="2"/></segments>
<frames segmentCount="2"><frame time="0" type="identity"><orientation>1 0 0 0 1 0 0 0</orientation>
<position>0 0 0.8 0 0 0.9</position></frame>
<frame time="0" index="0" type="normal"><orientation>1 0 0 0 {QUARTER:.6f} 0 0 {QUARTER:.6f}</orientation>
<position>0 0 0.9 0.1 0.2 1.0</position><velocity>0 0 0 0 0 0</velocity></frame>
<frame time="17" index="1" type="normal"><orientation>1 0 0 0 1 0 0 0</orientation>
<position>0 0 0.9 0.1 0.2 1.1</position></frame></frames></subject></mvnx>
"""


@pytest.mark.parametrize("text", [MVNX, MVNX.replace(' xmlns="http://www.xsens.com/mvn/mvnx"', "")])
def test_segments_are_bodies_in_millimetres(put, text):
    path = put("walk.dat", text)
    take = read_take(path)
    assert recognise(path).name == "mvnx"
    assert isinstance(take, Poses)
    assert (take.names, take.rate, take.n_frames) == (("Pelvis", "L5"), 60.0, 2)
    turned = [[0, -1, 0, 100], [1, 0, 0, 200], [0, 0, 1, 1000], [0, 0, 0, 1]]  # by 90 degrees about z
    np.testing.assert_allclose(take.world_from_body[0, 1], turned, atol=2e-6)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        (' frameRate="60"', "", "frameRate"),
        ("0.1 0.2 1.0", "0.1 0.2", "<position> has 5 numbers where 3 belong to each of 2 segments"),
        ("<position>0 0 0.9 0.1 0.2 1.0</position>", "", "export MVNX with segment position"),
        ("0.1 0.2 1.1", "0.1 0.2 x", "no number"),
        ("<subject ", "<subject <", "broken XML"),
        ("</frames>", '</frames><segments><segment label="L4"/></segments>', "segment is named behind the first frame"),
        ("<mvnx ", "<!DOCTYPE mvnx []><mvnx ", "document type"),
    ],
)
def test_broken_file_is_told(refused, edited, old, new, sentence):
    assert sentence in refused(edited("odd.mvnx", MVNX, old, new))


def test_frames_before_the_end_of_a_cut_file_are_taken(put):
    take = read_take(put("cut.mvnx", MVNX[: MVNX.index("0.1 0.2 1.1")]))
    assert take.n_frames == 1
    assert any("the XML breaks off in line" in notice for notice in take.notices)
