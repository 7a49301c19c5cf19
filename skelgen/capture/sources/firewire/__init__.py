"""The IEEE 1394 bus: which cameras are on it, what all can do, and all started on one frame."""

import contextlib
import ctypes
import os
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from skelgen.capture.sources.firewire import library as dc
from skelgen.capture.sources.firewire.camera import FireWireCamera, Modes, Setting
from skelgen.capture.sources.options import FireWireOptions, only_two
from skelgen.capture.sources.pairs import Opener
from skelgen.errors import CaptureError, ParameterError

EXAMPLE = "firewire:00accef000001000,00accef000001001"
"""Two cameras, as a user would name them."""

_DEFAULT_RATE = 60.0  # Hz
_FAST, _SLOW = 800, 400  # Mb/s: 1394b and what every camera has
_SAME_RATE = 0.01  # part: 7.5 may be written 7.5, and 1.875 as 1.88


def opener(guids: tuple[str, ...], options: FireWireOptions) -> Opener:
    """Return what opens cameras on the bus, and starts them together.

    Parameters
    ----------
    guids : tuple of str
        Hexadecimal numbers of the cameras; empty takes the only two there are, the lower number first.
    options : FireWireOptions
        Rate, size, shutter and the like.

    Raises
    ------
    ParameterError
        If `guids` are no hexadecimal numbers, or the speed is unknown.
    """
    numbers = tuple(map(_guid_of, guids))
    if options.speed not in (0, *dc.ISO_SPEEDS):
        raise ParameterError(f"speed is {options.speed}; it must be one of {', '.join(map(str, dc.ISO_SPEEDS))} Mb/s")
    return lambda stack: _open(stack, numbers, options)


def why_no_camera(nodes: list[Path]) -> str:
    """Say why nothing was found, from the device files /dev/fw*: the computer's own node has one, too."""
    if not nodes:
        return "no IEEE 1394 bus: this computer has no FireWire card, or its driver firewire-ohci is not loaded"
    closed = [str(node) for node in nodes if not os.access(node, os.R_OK | os.W_OK)]
    if closed:
        return f"no right to open {', '.join(closed)}; the group video usually has it"
    return "no camera on the IEEE 1394 bus; check cables and power"


def common_mode(modes: Sequence[Modes], names: Sequence[str], size: str, rate: float) -> tuple[tuple[int, int], float]:
    """Choose the image size and rate that all cameras run at.

    Parameters
    ----------
    modes : sequence of Modes
        What each camera offers.
    names : sequence of str
        Of the cameras, for the sentence of an error.
    size : str
        As in ``640x480``; empty takes the largest.
    rate : float, Hz
        0 takes 60, or the highest there is.

    Raises
    ------
    CaptureError
        If they have no such mode in common; the sentence lists what each has.
    """
    shared = set(modes[0]).intersection(*modes)
    common = {key: sorted(set.intersection(*(set(one[key]) for one in modes))) for key in modes[0] if key in shared}
    if size:
        common = {key: rates for key, rates in common.items() if f"{key[0]}x{key[1]}" == size.lower()}
    chosen = {key: [each for each in rates if abs(each - rate) <= _SAME_RATE * each] for key, rates in common.items()}
    fitting = {key: rates for key, rates in (chosen if rate else common).items() if rates}
    if not fitting:
        asked = " ".join(part for part in (size, f"at {rate:g} Hz" if rate else "") if part)
        offers = "; ".join(f"{name} has {_listed(offer)}" for name, offer in zip(names, modes, strict=True))
        raise CaptureError(f"the cameras share no grey image size {asked}".rstrip() + f": {offers}")
    best = max(fitting, key=lambda key: key[0] * key[1])
    return best, _DEFAULT_RATE if not rate and _DEFAULT_RATE in fitting[best] else fitting[best][-1]


def _open(stack: ExitStack, guids: tuple[int, ...], options: FireWireOptions) -> tuple[list[FireWireCamera], float]:
    context = _context(stack)
    cameras = []
    for guid in guids or _only_two(_guids_of(context)):
        cameras.append(FireWireCamera(context, guid))
        stack.callback(cameras[-1].close)
    names = [camera.name for camera in cameras]
    size, rate = common_mode([camera.modes() for camera in cameras], names, options.size, options.rate)
    speed = options.speed or (_FAST if all(camera.knows_1394b for camera in cameras) else _SLOW)
    _check_speed(cameras, speed)
    setting = Setting(size, rate, speed, options.shutter, options.gain, options.buffers)
    _set_up(cameras, setting)
    _start(cameras)
    return cameras, rate


def _context(stack: ExitStack) -> int:
    library = dc.dc1394()
    context = library.other("dc1394_new")
    if not context:
        raise CaptureError("libdc1394 cannot start: it is out of memory")
    stack.callback(library.other, "dc1394_free", context)
    return int(context)


def _guids_of(context: int) -> list[int]:
    library = dc.dc1394()
    found = ctypes.POINTER(dc.CameraList)()
    library.call("dc1394_camera_enumerate", context, ctypes.byref(found))
    try:
        return sorted(found.contents.ids[at].guid for at in range(found.contents.num))
    finally:
        library.other("dc1394_camera_free_list", found)


def _only_two(guids: list[int]) -> list[int]:
    if not guids:
        raise CaptureError(why_no_camera(sorted(Path("/dev").glob("fw[0-9]*"))))
    called = ", ".join(f"{guid:016x}" for guid in guids)
    several = f"{len(guids)} cameras are on the IEEE 1394 bus: {called}"
    return only_two(guids, several if len(guids) > 1 else f"only {called} is on the IEEE 1394 bus", EXAMPLE)


def _check_speed(cameras: list[FireWireCamera], speed: int) -> None:
    for camera in cameras:
        if speed >= _FAST and not camera.knows_1394b:
            raise CaptureError(f"{camera.name} does not know 1394b, which {speed} Mb/s needs; take ?speed={_SLOW}")


def _set_up(cameras: list[FireWireCamera], setting: Setting) -> None:
    for camera in cameras:
        try:
            camera.set_up(setting)
        except dc.FireWireError as error:
            if error.code not in dc.NO_RESOURCES:
                raise
            raise dc.FireWireError(error.code, _why_no_bandwidth(len(cameras), camera.bandwidth(), setting)) from error


def _why_no_bandwidth(n_cameras: int, units: int, setting: Setting) -> str:
    advice = "take a lower rate or a smaller size"
    if setting.speed < _FAST:
        advice += f", or {_FAST} Mb/s if the cameras know 1394b"
    return (
        f"bandwidth exhausted: {n_cameras} x {units} of {dc.BUS_UNITS} units at {setting.rate:g} fps "
        f"and {setting.speed} Mb/s, or other devices hold the rest; {advice}"
    )


def _start(cameras: list[FireWireCamera]) -> None:
    """Start all on one frame by a broadcast; a camera that it did not reach is started on its own.

    That happens with old kernels, on two buses, and if the cameras' registers lie at different addresses. Whether the
    images are synchronous after all, the times of the images tell.
    """
    with contextlib.suppress(dc.FireWireError):
        cameras[0].transmit(True, broadcast=True)
    for camera in cameras:
        if not camera.transmits():
            camera.transmit(True)


def _guid_of(text: str) -> int:
    try:
        return int(text, 16)
    except ValueError as error:
        raise ParameterError(f"{text!r} is no camera's number; it looks like {EXAMPLE}") from error


def _listed(offer: Modes) -> str:
    if not offer:
        return "none"
    return ", ".join(
        f"{size[0]}x{size[1]} at {' '.join(f'{rate:g}' for rate in rates)} Hz" for size, rates in sorted(offer.items())
    )
