"""What a calibration is worth, in plain words: good, usable or to be repeated, and what would make it better."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from skelgen.capture.calibration.bundle_adjustment import Adjusted, BoardBundle
from skelgen.capture.calibration.chessboard import BoardView, uncovered
from skelgen.model.rig import N_CAMERA_STD, StereoRig
from skelgen.progress import counted

GOOD, USABLE, REPEAT = "good", "usable", "repeat"
"""Grades, best first."""


@dataclass(frozen=True)
class Verdict:
    """A judgement in words.

    Attributes
    ----------
    grade : str
        ``good``, ``usable`` or ``repeat``.
    sentences : tuple of str
        The judgement, and then what would make it better, the most important first.
    """

    grade: str
    sentences: tuple[str, ...]

    def __str__(self) -> str:
        return " ".join(self.sentences)


def as_sentence(words: str) -> str:
    """Return a notice as a sentence: with a capital, and a full stop."""
    return f"{words[:1].upper()}{words[1:]}{'' if words.endswith('.') else '.'}"


Row = Mapping[str, str | int | float]
"""Texts and numbers by the titles of columns."""


def hundredths(value: float, std: float) -> str:
    """Return a value in hundredths, with its standard deviation if it was estimated.

    Parameters
    ----------
    value, std : float
        Both in one unit; a deviation of 0 was not estimated.
    """
    return f"{value:.2f} ± {std:.2f}" if std > 0 else f"{value:.2f}"


GOOD_RMS, USABLE_RMS = 0.3, 1.0
"""Root mean square distances [px]: sharp images of a flat board reach 0.1 to 0.3; a whole pixel is a mistake."""

GOOD_SCALE, USABLE_SCALE = 0.003, 0.01
"""Relative standard deviations of focal lengths and of the baseline: 3 mm at 1 m are what targets of 100 mm bear."""

ENOUGH_PAIRS = 10
"""Pairs from which on Bouguet and Gaschler (2011) call a calibration complete."""

LEAST_LEAN = 15.0
"""Largest angle [degrees] between two poses of the board below which focal length and distance hardly
differ in effect."""

BLUR_RATIO, SHARP_EDGE = 1.5, 4.0
"""An image is blurred if its edges are so many times as wide as in the median image, and wider than so many pixels."""


@dataclass(frozen=True, eq=False)
class PairSeen:
    """One pair of images of the board.

    Attributes
    ----------
    name : str
        What the user knows it by.
    left, right : BoardView or None
        What was found; None if no whole board is seen.
    left_rms, right_rms : float, px
        Root mean square distance of the corners from where they are expected; NaN where no pair was found.
    is_used : bool
        Whether the calibration rests on it.
    """

    name: str
    left: BoardView | None
    right: BoardView | None
    left_rms: float
    right_rms: float
    is_used: bool


def judge(rig: StereoRig, adjusted: Adjusted[BoardBundle], baseline_std: float, pairs: Sequence[PairSeen]) -> Verdict:
    """Return the verdict of a calibration.

    Parameters
    ----------
    rig : StereoRig
        The result.
    adjusted : Adjusted
        Its adjustment.
    baseline_std : float, mm
        Standard deviation of the distance between the cameras.
    pairs : sequence of PairSeen
        All pairs of images.
    """
    std = np.sqrt(np.diag(adjusted.covariance)).reshape(-1, N_CAMERA_STD)[:, :2]
    focal = [np.diag(camera.matrix)[:2] for camera in adjusted.bundle.cameras]
    scale = max(float((std / focal).max()), baseline_std / rig.baseline)
    swapped = _swapped(rig)
    used = [pair for pair in pairs if pair.is_used]
    is_good = adjusted.rms <= GOOD_RMS and scale <= GOOD_SCALE and len(used) >= ENOUGH_PAIRS
    is_usable = adjusted.rms <= USABLE_RMS and scale <= USABLE_SCALE
    grade = REPEAT if swapped else GOOD if is_good else USABLE if is_usable else REPEAT
    first = (
        f"{grade.capitalize()}: corners lie {adjusted.rms:.2f} px from where they are expected, in {len(used)} of "
        f"{len(pairs)} pairs; lengths are known to {100 * scale:.2g} %."
    )
    advice = swapped
    if adjusted.rms > USABLE_RMS:
        advice.append("Errors of more than a pixel are no noise: see that the board is flat, still, and counted right.")
    advice += _left_out(pairs)
    if len(used) < ENOUGH_PAIRS:
        advice.append(f"{counted(len(used), 'pair is', 'pairs are')} few: take {ENOUGH_PAIRS} to 20.")
    normals = adjusted.bundle.poses[:, :3, 2]
    lean = np.degrees(np.arccos(np.clip((normals @ normals.T).min(), -1.0, 1.0)))
    if lean < LEAST_LEAN:
        advice.append(f"The board leans by {lean:.0f} degrees at most: turn it about different axes by 20 to 45.")
    return Verdict(grade, (first, *advice, *_gaps(rig, used)))


def _swapped(rig: StereoRig) -> list[str]:
    """Whether the left camera stands on the right."""
    place = -rig.right_from_left[:3, :3].T @ rig.right_from_left[:3, 3]
    if place[0] >= 0 or abs(place[0]) < np.abs(place[1:]).max():
        return []
    return [
        "The right images were taken to the left of the left ones: exchange the cameras, unless they hang upside down."
    ]


def _left_out(pairs: Sequence[PairSeen]) -> list[str]:
    """Pairs that do not show the whole board, are blurred, or are not used for another reason."""
    missing = [pair for pair in pairs if pair.left is None or pair.right is None]
    blurred = [pair for pair, is_blurred in zip(pairs, _are_blurred(pairs), strict=True) if is_blurred]
    others = [pair for pair in pairs if not (pair.is_used or pair in missing or pair in blurred)]
    whole, one = "show the whole board in both images.", "one board at one moment."
    return [
        *_about(missing, f"does not {whole}", f"do not {whole}"),
        *_about(blurred, "is blurred: hold the board still.", "are blurred: hold the board still."),
        *_about(others, f"is left out: its images do not show {one}", f"are left out: none shows {one}"),
    ]


def _are_blurred(pairs: Sequence[PairSeen]) -> list[bool]:
    sides = [[pair.left for pair in pairs], [pair.right for pair in pairs]]
    edges = [[view.edge for view in views if view is not None] for views in sides]
    limits = [max(SHARP_EDGE, BLUR_RATIO * float(np.median(one))) if one else np.inf for one in edges]
    return [
        any(view is not None and view.edge > limit for view, limit in zip(views, limits, strict=True))
        for views in zip(*sides, strict=True)
    ]


def _gaps(rig: StereoRig, used: Sequence[PairSeen]) -> list[str]:
    advice = []
    for side, size in (("left", rig.left.size), ("right", rig.right.size)):
        views = [view.corners for pair in used if (view := pair.left if side == "left" else pair.right) is not None]
        gaps = uncovered(views, size)
        if gaps:
            advice.append(f"No view covers the {_list_of(gaps)} of the {side} image.")
    return advice


def _about(pairs: Sequence[PairSeen], of_one: str, of_more: str) -> list[str]:
    if not pairs:
        return []
    names = [pair.name for pair in pairs]
    return [f"Pair {names[0]} {of_one}" if len(names) == 1 else f"Pairs {_list_of(names)} {of_more}"]


def _list_of(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
