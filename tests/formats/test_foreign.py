from __future__ import annotations

import pytest


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("walk.fbx", b"Kaydara FBX Binary  \x00", "an FBX scene; export the markers as C3D or TRC"),
        ("walk", b"Kaydara FBX Binary  \x00", "an FBX scene"),
        ("ann.vsk", b"<?xml version='1.0'?><KinematicModel/>", "a subject of Vicon"),
        ("walk.tak", b"\x01\x02", "a take of OptiTrack Motive"),
        ("walk.h5", b"\x89HDF\r\n\x1a\n", "export a wide CSV"),
        ("walk.bvh", b"HIERARCHY\nROOT Hips\n", "simulate --motion walk.bvh"),
        ("walk.txt", b"HIERARCHY\nROOT Hips\n", "simulate --motion walk.txt"),
        ("walk.mot", b"Coordinates\nversion=1\n", "give the .trc"),
        ("walk.mat", b"MATLAB 7.3 MAT-file, Platform: PCWIN64", "TSV or C3D from Track Manager"),
        ("walk.xlsx", b"PK\x03\x04", "save the sheet as CSV"),
    ],
)
def test_file_that_holds_nothing_to_read_says_what_it_is(refused, put, name, content, sentence):
    assert sentence in refused(put(name, content))
