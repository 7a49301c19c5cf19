"""Bright balls in an image: adaptive thresholds, spots by union-find, brightness-weighted centres, touching balls."""

from skelgen.capture.detection.detect import check_image, detect_balls
from skelgen.capture.detection.outline import centred
from skelgen.capture.parameters import DetectionParameters

__all__ = ["DetectionParameters", "centred", "check_image", "detect_balls"]
