"""What the capture must know beforehand: cameras, rigid bodies and joints, each measured by the rig itself."""
