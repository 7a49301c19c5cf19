"""Stereo capture: two cameras' images to balls, points, rigid bodies and joint angles (Gaschler 2011).

`sources` deliver pairs of images, from files, cameras or the `simulated_rig`. `detection` finds the balls in an image,
`optics` the points in space that two balls make, `bodies` the targets among the points, `target_joints` the joints
between targets, with errors as `error_propagation` predicts them. `live` is all that, pair by pair; `markers` turns a
whole recording into unlabelled markers. `calibration` measures cameras, targets and joints beforehand. `room` is
all of it for two to sixteen cameras at once.

May change with every version; scripts import what they need from `skelgen`.
"""
