"""Jobs that a window runs on threads: to capture and record, and to collect images for a calibration.

A job runs on a thread of its own. It hands pictures and numbers over in a `Feed`, and a control tells it to stop.
"""
