"""Which point is which marker by a skeleton that is posed in all frames: a calibrated one, or the take's own."""
