"""A frame source of image files, which belong together by their names in a folder or by a list."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from skelgen.capture.images import IMAGE_SUFFIXES, read_image
from skelgen.capture.sources.options import FileOptions
from skelgen.capture.sources.pairs import check_same_size, lost_between
from skelgen.capture.values import SIDES, FrameSet, Image, NothingToOpen
from skelgen.errors import CaptureError, FormatError, InputError
from skelgen.files import read_content
from skelgen.progress import counted

_SIDES = (("left", "right"), ("_l", "_r"), ("-l", "-r"), ("cam0", "cam1"), ("cam1", "cam2"))


@dataclass(frozen=True)
class ImagePair:
    """The files of one pair.

    Attributes
    ----------
    left, right : Path
        The images.
    time : float or None, s
        Where the list says it.
    lost : int
        Pairs between the one before and this of which one side is missing.
    """

    left: Path
    right: Path
    time: float | None = None
    lost: int = 0


def folder_pairs(folder: Path, options: FileOptions) -> list[ImagePair]:
    """Find the pairs of a folder: ``left01.png`` and ``right01.png``, or ``left/01.png`` and ``right/01.png``.

    Parameters
    ----------
    folder : Path
        Where the images are.
    options : FileOptions
        `left` and `right` say how the names look; without them the usual ways are tried.

    Returns
    -------
    list of ImagePair
        In the order of their numbers. An image without a partner is a lost pair.

    Raises
    ------
    CaptureError
        If there is no such folder, or no pair in it.
    """
    if not folder.is_dir():
        raise CaptureError(f"{folder}: no such folder")
    patterns = [options.left, options.right]
    named = [_matching(folder, pattern) for pattern in patterns] if any(patterns) else _by_usual_names(folder)
    left, right = named
    if not set(left) & set(right):
        raise CaptureError(_why_no_pairs(folder, left, right))
    return _ordered(left, right)


def listed_pairs(path: Path) -> list[ImagePair]:
    """Read a list: in each line a left and a right image and perhaps the time [s], between tabs, commas or blanks.

    Empty lines and those that begin with # are passed over; names count from the list's folder.

    Raises
    ------
    FormatError
        If a line is not like that, or times do not grow; with the line's number.
    """
    try:
        lines = read_content(path).decode().splitlines()
    except UnicodeDecodeError as error:
        raise FormatError(path, "", f"cannot be read as a list of images: {error}") from error
    pairs: list[ImagePair] = []
    for number, line in enumerate(lines, 1):
        if line.strip() and not line.lstrip().startswith("#"):
            pairs.append(_listed(path, number, line, pairs[-1].time if pairs else None))
    if not pairs:
        raise FormatError(path, "", "lists no images; each line needs a left and a right one")
    return pairs


def _listed(path: Path, number: int, line: str, before: float | None) -> ImagePair:
    separator = next((mark for mark in "\t," if mark in line), None)
    fields = [field.strip() for field in line.split(separator)]
    if len(fields) not in (2, 3):
        wrong = f"{len(fields)} entries where a left and a right image and perhaps a time belong"
        raise FormatError(path, number, wrong)
    time = None
    if len(fields) == 3:
        try:
            time = float(fields[2])
        except ValueError as error:
            raise FormatError(path, number, f"{fields[2]!r} is no time in seconds") from error
        if not time > (-np.inf if before is None else before):
            raise FormatError(path, number, f"the time {time:g} s is not later than the one before")
    return ImagePair(path.parent / fields[0], path.parent / fields[1], time)


def _by_usual_names(folder: Path) -> list[dict[str, Path]]:
    """Return the images of both sides by their names without the side; the way that pairs most wins."""
    inside = [path for path in folder.iterdir() if path.suffix.lower() in IMAGE_SUFFIXES]
    below = [
        [path for path in (folder / side).glob("*") if path.suffix.lower() in IMAGE_SUFFIXES] for side in _SIDES[0]
    ]
    ways = [[{path.stem: path for path in side} for side in below]]
    ways += [[_without(inside, word) for word in words] for words in _SIDES]
    return max(ways, key=lambda sides: (len(set(sides[0]) & set(sides[1])), len(sides[0]) + len(sides[1])))


def _without(paths: list[Path], word: str) -> dict[str, Path]:
    found = {}
    for path in paths:
        stem = path.stem.lower()
        before, there, after = stem.rpartition(word)
        if there and not after[:1].isalpha():
            found[f"{before}|{after}"] = path
    return found


def _matching(folder: Path, pattern: str) -> dict[str, Path]:
    """Return files by the texts that the stars of a pattern match."""
    if "**" in pattern:
        raise InputError(f"{pattern!r}: a pattern names images of one folder; two stars together are not understood")
    first, *others = (re.escape(part) for part in pattern.split("*"))
    lazily = "".join(f"(?>(.*?){part})" for part in others[:-1])  # what has matched is not tried anew
    as_regex = re.compile(first + lazily + "".join(f"(.*){part}" for part in others[-1:]))
    try:
        there = list(folder.glob(pattern or "*"))
    except (ValueError, NotImplementedError) as error:
        raise InputError(f"{pattern!r} is no pattern of names in {folder}: {error}") from error
    named = {path: as_regex.fullmatch(path.relative_to(folder).as_posix()) for path in there}
    return {"|".join(match.groups()): path for path, match in named.items() if match}


def _ordered(left: dict[str, Path], right: dict[str, Path]) -> list[ImagePair]:
    pairs: list[ImagePair] = []
    lost = 0
    for key in sorted(set(left) | set(right), key=natural_order):
        if key in left and key in right:
            pairs.append(ImagePair(left[key], right[key], lost=lost if pairs else 0))
            lost = 0
        else:
            lost += 1
    return pairs


def natural_order(key: str) -> list[tuple[int, int, str]]:
    """Return what sorts names with numbers by value: frame 10 comes after frame 9."""
    return [(0, int(part), "") if part.isdigit() else (1, 0, part) for part in re.split(r"(\d+)", key) if part]


def _why_no_pairs(folder: Path, left: dict[str, Path], right: dict[str, Path]) -> str:
    how = "name them left01.png and right01.png, or give ?left=...&right=..."
    if left and right:
        one, other = min(left.values()).name, min(right.values()).name
        return f"{folder}: {one} and {other} do not belong together, nor do any others; {how}"
    if left or right:
        side, there = ("right", left) if left else ("left", right)
        return f"{folder}: {counted(len(there), 'image')} of one camera, but none of the {side} one; {how}"
    return f"{folder}: no pairs of images; {how}"


class ImagePairs(NothingToOpen):
    """A frame source of image files.

    Parameters
    ----------
    name : str
        For messages.
    pairs : list of ImagePair
        At least one, in the order of their times.
    options : FileOptions
        Rate and number of pairs.

    Raises
    ------
    CaptureError, FormatError
        If the first pair cannot be read or its sizes differ.
    """

    def __init__(self, name: str, pairs: list[ImagePair], options: FileOptions) -> None:
        self.name, self.cameras, self.n_dropped = name, SIDES, 0
        self._pairs = pairs[: options.frames or None]
        times = [pair.time for pair in self._pairs if pair.time is not None]
        follows = float(1 / np.median(np.diff(times))) if len(times) == len(self._pairs) > 1 else None
        self.rate = options.rate or follows  # at which most pairs of a list follow each other
        self.n_frames = len(self._pairs)
        first = self._pairs[0]
        sizes = [_size(read_image(path)) for path in (first.left, first.right)]
        self.size = check_same_size(sizes[0], sizes[1], (str(first.left), str(first.right)))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the left images, in the order of the pairs."""
        return tuple(pair.left.name for pair in self._pairs)

    def __iter__(self) -> Iterator[FrameSet]:
        """Read one pair after the other."""
        index = -1
        before: float | None = None
        for pair in self._pairs:
            lost = max(pair.lost, lost_between(before, pair.time, self.rate))
            index += 1 + lost
            self.n_dropped += lost
            before = pair.time
            yield FrameSet((self._read(pair.left), self._read(pair.right)), self._time(pair, index), index, lost)

    def _time(self, pair: ImagePair, index: int) -> float:
        first = self._pairs[0].time
        if pair.time is not None and first is not None:
            return pair.time - first
        return index / self.rate if self.rate else float(index)  # a second each, so that times at least grow

    def _read(self, path: Path) -> Image:
        image = read_image(path)
        if _size(image) != self.size:
            raise FormatError(path, "", f"is {_by(_size(image))} pixels where the images before are {_by(self.size)}")
        return image


def _size(image: Image) -> tuple[int, int]:
    return image.shape[1], image.shape[0]


def _by(size: tuple[int, int]) -> str:
    return f"{size[0]} x {size[1]}"
