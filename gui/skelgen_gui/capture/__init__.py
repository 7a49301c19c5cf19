"""The Capture page: live pictures and numbers, recording, and the steps that calibrate cameras, targets and joints."""
