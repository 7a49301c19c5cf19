"""Settings of the stereo capture in one XML file: cameras, noise, bodies, joints, source and detection.

The calibrations write it and ``skelgen motion-capture`` reads it. Lengths are in mm, pixels count from the centre of
the first one, matrices are written row by row; ``a_from_b`` turns coordinates of b into those of a. The left camera's
frame is the world unless its ``camera_from_world`` says otherwise::

    <capture version="1" unit="mm">
      <source>recording/</source>
      <rig noise="0.1">
        <left name="left" width="640" height="480">
          <matrix>...9 numbers...</matrix>
          <distortion>k1 k2 p1 p2 k3</distortion>
          <camera_from_world>...16 numbers...</camera_from_world>
        </left>
        <right ...>...</right>
      </rig>
      <detection><parameter name="..." value="..."/></detection>
      <body name="upper"><point std="0.1 0.1 0.1">0 0 0</point>...</body>
      <joint name="elbow" kind="hinge" parent="upper" child="lower">
        <parent_from_joint>...16 numbers...</parent_from_joint>
        <child_from_joint>...16 numbers...</child_from_joint>
      </joint>
    </capture>

Every name is checked: what is unknown, missing or twice there is refused with file, line and what is allowed.
"""

from skelgen_formats.capture_settings.reader import read_settings
from skelgen_formats.capture_settings.writer import write_settings

__all__ = ["read_settings", "write_settings"]
