"""Articulated structures, motion, markers and occlusion with ground truth."""
