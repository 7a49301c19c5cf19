"""Balls in rendered images against their truth, beside OpenCV: ``python tests/benchmarks/capture_centroids.py``.

The cameras of the reference rig (Gaschler 2011, Table 4.1) look at balls of 14 mm: blur 0.7 px, noise of 1.5 grey
levels in the dark and 2.5 at edges, saturated in the middle, darker towards the border and far away, three pieces of
dull metal. Errors are those of x and y together, rms, of balls that stand alone; centres are those of the balls, not
of their outlines.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from functools import partial

import cv2
import numpy as np
from shown import show, show_machine, verdict

from skelgen.capture.detection import correct_eccentricity, detect_balls
from skelgen.capture.parameters import DetectionParameters
from skelgen.capture.reference_rig import reference_rig
from skelgen.capture.simulated_rig import render_pair, render_view, simulated_rig
from skelgen.capture.simulated_rig.view import RenderParameters, ViewTruth
from skelgen.capture.values import Image
from skelgen.model.arrays import Floats
from skelgen.model.rig import Camera

WANTED = 0.02  # px
DISTANCES = (500.0, 750.0, 1000.0, 1500.0, 2000.0, 2500.0)  # mm
REFERENCE_DISTANCES = (750.0, 1500.0)  # mm: about the 1 m at which Gaschler (2011) gives his figures
N_IMAGES, N_BALLS = 40, 15
RANGE = 0.05  # of a distance, to both sides
APART = 6.0  # radii of balls that stand alone
RADIUS = 7.0  # mm
MILLISECONDS, RENDERED = 1.5, 20.0  # an image, a pair
N_USUAL = 20  # balls in an image, more than three targets have
REPEATS = 200
Find = Callable[[Image], Floats]


def places(rng: np.random.Generator, distance: float, n_balls: int) -> Floats:
    """Balls all over the left image."""
    depth = distance * rng.uniform(1 - RANGE, 1 + RANGE, n_balls)
    slopes = rng.uniform([-0.36, -0.27], [0.36, 0.27], size=(n_balls, 2))
    return np.column_stack([slopes, np.ones(n_balls)]) * depth[:, np.newaxis]


def images(camera: Camera, distance: float) -> Iterator[tuple[Image, ViewTruth]]:
    """Rendered images with their truth."""
    rng = np.random.default_rng(int(distance))
    for index in range(N_IMAGES):
        yield render_view(camera, places(rng, distance, N_BALLS), RenderParameters(), index)


def ours(parameters: DetectionParameters, camera: Camera, image: Image) -> Floats:
    """Centres by this package."""
    return correct_eccentricity(camera, detect_balls(image, parameters)).centres


def blob_detector(image: Image) -> Floats:
    """Centres by OpenCV's blob detector, told to take bright blobs of all sizes."""
    parameters = cv2.SimpleBlobDetector_Params()
    parameters.filterByColor, parameters.blobColor = True, 255
    parameters.minArea, parameters.maxArea = 10, 4000
    parameters.filterByConvexity = parameters.filterByInertia = parameters.filterByCircularity = False
    parameters.minThreshold, parameters.maxThreshold, parameters.thresholdStep = 30, 220, 10
    parameters.minDistBetweenBlobs = 3
    found = cv2.SimpleBlobDetector_create(parameters).detect(image)
    return np.array([point.pt for point in found]).reshape(-1, 2)


def contours(image: Image) -> Floats:
    """Centres of OpenCV's contours at the middle between dark and bright, which Gaschler (2011) tried first."""
    dark, bright = np.quantile(image[::4], [0.98, 0.9999])
    _, binary = cv2.threshold(image, (dark + bright) / 2, 255, cv2.THRESH_BINARY)
    outlines, _ = cv2.findContours(binary, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    moments = [cv2.moments(outline) for outline in outlines]
    return np.array([(m["m10"] / m["m00"], m["m01"] / m["m00"]) for m in moments if m["m00"] > 0]).reshape(-1, 2)


def alone(truth: ViewTruth) -> Floats:
    """Centres of balls that are wholly seen and stand apart from all others."""
    gaps = np.linalg.norm(truth.centres[:, np.newaxis] - truth.centres, axis=2)
    np.fill_diagonal(gaps, np.inf)
    return truth.centres[(gaps.min(axis=1) > APART * truth.radii) & (truth.visible > 0.999)]


def errors(find: Find, camera: Camera, distance: float) -> tuple[float, float, int, int]:
    """Rms and 99th percentile [px] of coordinates, balls lost, spots too many."""
    off, lost, more = [], 0, 0
    for image, truth in images(camera, distance):
        found, wanted = find(image), alone(truth)
        found = found if len(found) else np.full((1, 2), np.inf)
        gaps = np.linalg.norm(found[np.newaxis] - wanted[:, np.newaxis], axis=2)
        near = gaps.min(axis=1) < 1.0
        lost += int((~near).sum())
        more += max(len(found) - int((truth.visible > 0).sum()), 0)
        off.append(found[gaps.argmin(axis=1)][near] - wanted[near])
    all_off = np.concatenate(off)
    return float(np.sqrt((all_off**2).mean())), float(np.quantile(np.abs(all_off), 0.99)), lost, more


def show_errors(camera: Camera) -> None:
    """Print errors of all ways by distance."""
    ways: dict[str, Find] = {
        "whole edge": partial(ours, DetectionParameters(), camera),
        "brightness between thresholds": partial(ours, DetectionParameters(centre="brightness"), camera),
        "OpenCV, blob detector": blob_detector,
        "OpenCV, contours": contours,
    }
    rows = []
    for distance in DISTANCES:
        for name, find in ways.items():
            rms, worst, lost, more = errors(find, camera, distance)
            is_asked = name == "whole edge" and REFERENCE_DISTANCES[0] <= distance <= REFERENCE_DISTANCES[1]
            told = (f"<= {WANTED}", verdict(rms <= WANTED)) if is_asked else ("", "")
            figures = (f"{rms:.4f}", f"{worst:.3f}", str(lost), str(more))
            rows.append((f"{distance / 1000:g}", name, *figures, *told))
    columns = ("distance [m]", "centre by", "rms [px]", "99 % below", "lost", "too many", "wanted", "")
    show(f"Centres of balls, {N_IMAGES} images of {N_BALLS} balls each", columns, rows)


def show_deviations(camera: Camera) -> None:
    """Print how predicted deviations agree with errors."""
    rows = []
    for noise in (1.0, 2.0, 4.0):
        ratios = []
        for seed in range(N_IMAGES):
            rng = np.random.default_rng(seed)
            points = places(rng, rng.uniform(800.0, 2000.0), N_BALLS)
            image, truth = render_view(camera, points, RenderParameters(noise=noise, reflections=0), seed)
            balls, wanted = correct_eccentricity(camera, detect_balls(image)), alone(truth)
            gaps = np.linalg.norm(balls.centres[np.newaxis] - wanted[:, np.newaxis], axis=2)
            nearest = gaps.argmin(axis=1)
            near = gaps.min(axis=1) < 1.0
            ratios.append(((balls.centres[nearest] - wanted) / balls.std[nearest, np.newaxis])[near])
        rows.append((f"{noise:g}", f"{np.sqrt((np.concatenate(ratios) ** 2).mean()):.2f}"))
    show("Errors over predicted deviations, 0.8 to 2 m", ("noise [grey levels]", "rms (1 is right)"), rows)


def show_touching(camera: Camera) -> None:
    """Print how balls that touch are separated."""
    rows = []
    for distance in (750.0, 1000.0, 1500.0, 2000.0):
        for apart in (0.5, 0.75, 1.0, 1.5, 2.0):
            rng, off, n_right = np.random.default_rng(1), [], 0
            for seed in range(60):
                turn, aside = rng.uniform(0, 2 * np.pi), rng.uniform(-0.2, 0.2, 2) * distance
                near = np.array([*aside, distance])
                behind = near + apart * RADIUS * np.array([np.cos(turn), np.sin(turn), 0.0])
                points = np.stack([near, behind * (1 + rng.uniform(10.0, 100.0) / distance)])
                image, truth = render_view(camera, points, RenderParameters(reflections=0), seed)
                found = correct_eccentricity(camera, detect_balls(image)).centres
                if len(found) == 2:
                    gaps = np.linalg.norm(found[np.newaxis] - truth.centres[:, np.newaxis], axis=2)
                    off.append(found[gaps.argmin(axis=1)] - truth.centres)
                    n_right += 1
            rms = np.sqrt((np.array(off) ** 2).mean(axis=(0, 2))) if off else (np.nan, np.nan)
            rows.append((f"{distance / 1000:g}", f"{apart:g}", f"{n_right} of 60", f"{rms[0]:.3f}", f"{rms[1]:.3f}"))
    columns = ("distance [m]", "apart [radii]", "separated", "near ball, rms [px]", "far ball, rms [px]")
    show("Two balls that touch or hide each other, one behind the other", columns, rows)


def milliseconds(work: Callable[[], object]) -> tuple[float, float]:
    """Median and 99th percentile of processor time [ms]."""
    work()
    spent = []
    for _ in range(REPEATS):
        begin = time.process_time_ns()
        work()
        spent.append((time.process_time_ns() - begin) / 1e6)
    return float(np.median(spent)), float(np.quantile(spent, 0.99))


def show_speed(camera: Camera) -> None:
    """Print times of detection and rendering."""
    cv2.setNumThreads(1)
    rows = []
    for n_balls in (5, 20, 40):
        image, _ = render_view(camera, places(np.random.default_rng(3), 1200.0, n_balls), RenderParameters(), 1)
        median, worst = milliseconds(partial(detect_balls, image))
        told = (f"<= {MILLISECONDS}", verdict(median <= MILLISECONDS)) if n_balls == N_USUAL else ("", "")
        rows.append((f"{n_balls} balls", "detection", f"{median:.2f}", f"{worst:.2f}", *told))
        median, worst = milliseconds(partial(blob_detector, image))
        rows.append((f"{n_balls} balls", "OpenCV, blob detector", f"{median:.2f}", f"{worst:.2f}", "", ""))
    source = simulated_rig("arm", n_frames=REPEATS + 1)
    pairs = iter([source.render(index)[0].left for index in range(REPEATS + 1)])
    median, worst = milliseconds(lambda: detect_balls(next(pairs)))
    told = (f"<= {MILLISECONDS}", verdict(median <= MILLISECONDS))
    rows.append(("arm, targets before each other", "detection", f"{median:.2f}", f"{worst:.2f}", *told))
    points = places(np.random.default_rng(3), 1200.0, 20)
    median, worst = milliseconds(lambda: render_pair(reference_rig(), points))
    told = (f"<= {RENDERED:g}", verdict(median <= RENDERED))
    rows.append(("20 balls", "rendering a pair", f"{median:.2f}", f"{worst:.2f}", *told))
    columns = ("image of 640 x 480", "what", "median [ms]", "99 % below", "wanted", "")
    show("Processor time on one core", columns, rows)


if __name__ == "__main__":
    show_machine()
    left = reference_rig().left
    show_errors(left)
    show_deviations(left)
    show_touching(left)
    show_speed(left)
