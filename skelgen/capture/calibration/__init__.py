"""Calibration of what the capture must know beforehand: cameras, rigid bodies and joints, by the rig itself."""
