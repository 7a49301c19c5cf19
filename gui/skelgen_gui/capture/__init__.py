"""Capturing in the window: live pictures, points and angles, recording, and the assistant that calibrates cameras."""
