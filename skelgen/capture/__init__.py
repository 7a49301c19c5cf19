"""Stereo capture: two cameras' images to balls, points, rigid bodies and joint angles (Gaschler 2011)."""
