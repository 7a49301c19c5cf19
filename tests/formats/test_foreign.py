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
        (
            "walk.txt",
            b"[Header]\nNumSegments 2\n[SegmentNames&Hierarchy]\nHIP GLOBAL\n[BasePosition]\n"
            b"#Fr Tx Ty Tz Rx Ry Rz SF\n[HIP]\n1 263 816 -287 18 -8 9 1\n2 263 816 -287 18 -8 9 1\n",
            "segments of Cortex",
        ),
        ("walk.mat", b"MATLAB 7.3 MAT-file, Platform: PCWIN64", "TSV or C3D from Track Manager"),
        (
            "topic.txt",
            b"header:\n  stamp:\n    sec: 17\npose:\n  position:\n    x: 0.1\n---\n",
            "`ros2 topic echo --csv`",
        ),
        ("points.yaml", b"frames:\n- t: 0.0\n  a: [0.1, 0.2, 0.3]\n", "YAML; write the points as TRC"),
        ("ik.csv", b"Coordinates,,\nversion=1,,\nendheader,,\ntime,a_tx,a_ty,a_tz,b_tx,b_ty,b_tz\n", "of OpenSim"),
        ("imu.sto", b"DataType=Quaternion\nendheader\ntime\ta\n0\t1,0,0,0\n", "orientations of sensors, of OpenSim"),
        ("keypoints.json", b'{"people": []}', "JSON; write the points as TRC"),
        ("points.txt", b"0.0\t1.5\t-2.5e-3\n", "numbers without titles"),
        ("pose.txt", b"# ground truth\n0.0 1.5 2.5 3 0 0 1 1\n", "x, y, z, qx, qy, qz, qw"),
        ("points.tsv", b"0.0\t1.5\t2.5\n", "export TSV from Track Manager with its header"),
        ("skeleton.tsv", b"NO_OF_FRAMES\t1\nDATA_INCLUDED\tSKELETON\n", "holds SKELETON; export the 3D data"),
        ("bones.tsv", b"NO_OF_FRAMES\t1\nREFERENCE\tGLOBAL\nSOLVER\t1\n", "without the line of titles"),
        ("track.gpx", b"<?xml version='1.0'?><gpx/>", "XML of another program; export the markers"),
        ("track.xml", b"<?xml version='1.0'?><gpx/>", "of XML of another program, export the markers"),
        ("human.mjcf", b"<mujoco model='human'>", "a model of a robot"),
        ("ann.mkr", b"!MKR#2\n[Autolabel]\n", "a subject of Vicon"),
        (
            "walk.c3d",
            b"version https://git-lfs.github.com/spec/v1\n",
            "a pointer of Git LFS, not the file",
        ),
        ("walk.trc", b"\n<!DOCTYPE html><html>", "a web page, not the file"),
        ("walk.xlsx", b"PK\x03\x04", "save the sheet as CSV"),
        ("walk.calc", b"calc\n", "Perception Neuron; export BVH"),
        ("walk.b3d", b"\x0a\x10\x00", "a file of AddBiomechanics; give the .trc or .c3d"),
        ("walk.rds", b"\x1f\x8b\x08", "data of R or SPSS; write the points as CSV"),
        ("walk.o3d", b"\x02\x00\x01", "raw data of a capture program"),
        ("walk.xyzzy", b"\x02\x00\x01", "it is a binary file; export C3D, TRC or CSV"),
        ("walk.chan", b"1 0.5 1.5 2.5 10 20 30\n", "a motion of an animation program"),
        ("tf.txt", b"At time 15.3\n- Translation: [1, 2, 3]\n", "with `rostopic echo -p`"),
        ("track.txt", b"Adobe After Effects 8.0 Keyframe Data\n", "places in an image"),
        ("walk.htr", b"[Header]\nFileType htr\n", "segments of Cortex"),
        ("walk.bag", b"#ROSBAG V2.0\n", "a recording of ROS"),
        ("walk.jsonl", b'{"frame": 1, "hip": [1, 2, 3]}\n{"frame": 2, "hip": [1, 2, 3]}\n', "this is JSON"),
        ("walk.xdf", b"XDF:\x01", "a recording of Lab Streaming Layer"),
        ("S001C001.skeleton", b"103\n1\n72057 0 1 1 1 1 0 0.02 0.05 2\n", "joints of a Kinect"),
        ("arm.urdf", b"<robot name='arm'>", "a model of a robot"),
        ("led.csv", b"t,x position,y position,z position\n0,1,2,3\n", "a single point has no skeleton"),
        ("imu.csv", b"t,a_roll,a_pitch,a_yaw\n0,1,2,3\n", "the titles name rotations of a, and no positions"),
        ("angles.csv", b"time,hip,knee\n0,1,2\n", "a table needs titles: name_x, name_y, name_z"),
        ("lying.csv", b"a_x" + b",0.5" * 9 + b"\na_y" + b",1.5" * 9 + b"\n", "transpose the table"),
        ("rec.csv", b"Time" + b";0,5" * 9 + b"\nRoot" + b";(1.0, 2.0, 3.0)" * 9 + b"\n", "transpose the table"),
        ("fish.csv", b"x1,y1,x2,y2\n1,2,3,4\n", "x and y alone: points in images; triangulate"),
        ("pose.csv", b"Frame,LandmarkID,X,Y\n0,0,0.1,0.2\n", "x and y alone: points in images; triangulate"),
        ("one.csv", b"id,x,y,z,qx,qy,qz,qw\n1,1,2,3,0,0,0,1\n", "a table needs titles"),
        ("paths.txt", b"#Kinovea Trajectory data export\n#T X Y\n\n0.0 1,5 2,5\n", "paths of Kinovea in the images"),
        ("sleap.csv", b"frame,nose.x,nose.y,nose.score\n0,1,2,1\n", "x and y alone: points in images; triangulate"),
    ],
)
def test_file_that_holds_nothing_to_read_says_what_it_is(refused, put, name, content, sentence):
    assert sentence in refused(put(name, content))


@pytest.mark.parametrize(
    ("name", "content"),
    [("points.csv", b"1.5" + b"," * 5000 + b"x"), ("tracks.emt", b"BTS ASCII format\n\na" + b" " * 300_000 + b"b\n")],
)
def test_long_line_of_nothing_is_refused_at_once(refused, put, name, content):
    assert refused(put(name, content))
