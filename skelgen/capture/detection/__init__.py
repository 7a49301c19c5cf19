"""Bright balls in an image (Gaschler 2011, 3.1): thresholds, bright spots, centres from edges, balls that touch."""

from skelgen.capture.detection.balls import check_image, detect_balls
from skelgen.capture.detection.eccentricity import correct_eccentricity
from skelgen.capture.parameters import DetectionParameters

__all__ = ["DetectionParameters", "check_image", "correct_eccentricity", "detect_balls"]
