"""Small sound texts of many systems, which fuzz.py mutates."""

from __future__ import annotations

import numpy as np

N_FRAMES = 24
"""Of the sound files: small files are read quickly, and most damages hit something."""


def swinging(frame: int) -> np.ndarray:
    """Return six points, shape (6, 3): three that swing far, and three on another body that goes."""
    angle = frame / 6
    arm = [[np.cos(angle) * r, r / 3, np.sin(angle) * r] for r in (300.0, 500.0, 640.0)]
    return np.array([*arm, *([70.0 * frame + x, 900.0 - x, 20.0 * x] for x in (0.0, 40.0, 95.0))])


TEXT_SEEDS = {
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
        " ".join(f"{x:.3f}" for x in [n / 50, *swinging(n).ravel()]) + "\n" for n in range(N_FRAMES)
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
