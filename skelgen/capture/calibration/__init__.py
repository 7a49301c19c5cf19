"""Calibration of what the capture must know beforehand: cameras, rigid bodies and joints, measured by the rig itself."""
