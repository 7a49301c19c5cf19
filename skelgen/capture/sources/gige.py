"""GigE Vision cameras, by viva-genicam."""

import contextlib
import time as clock
from collections.abc import Iterator
from contextlib import ExitStack
from types import ModuleType
from typing import Any

from skelgen.capture.images import extra_module
from skelgen.capture.sources.genicam import FrameNumber, SharedClock, first_size, grey, only_two
from skelgen.capture.sources.options import GenicamOptions, check_two_cameras
from skelgen.capture.sources.pairs import LivePairs, Shot, with_rate
from skelgen.errors import CaptureError

_EXAMPLE = "gige:10.0.0.2,10.0.0.3"
_DISCOVERY_MS = 500
_TICKS_REGISTER = 0x093C  # GigE Vision bootstrap: ticks of the time stamp a second, 64 bits
_LEAST_WAIT_MS = 0


def gige_pairs(addresses: tuple[str, ...], options: GenicamOptions) -> LivePairs:
    """Return the frame source of two cameras on the network.

    Parameters
    ----------
    addresses : tuple of str
        IP or MAC addresses of the left and the right camera; empty takes the only two there are, the lower IP left.
    options : GenicamOptions
        Rate, exposure, trigger and the like.

    Raises
    ------
    ParameterError
        If `addresses` are not none or two.
    """
    check_two_cameras("gige", addresses, _EXAMPLE)
    name = "gige:" + ",".join(addresses)
    return LivePairs(name, lambda stack: with_rate(open_gige(stack, addresses, options)), options)


class GigeCamera:
    """A camera that streams until the stack closes it.

    Parameters
    ----------
    device : viva_genicam.GigeDeviceInfo
        As discovered.
    options : GenicamOptions
        How it is to run.
    stack : ExitStack
        Closes the camera.
    """

    capacity: int | None = None  # the library keeps the newest images

    def __init__(self, device: Any, options: GenicamOptions, stack: ExitStack) -> None:
        self._viva = _viva()
        self.name = f"camera {device.ip} ({device.manufacturer} {device.model})"
        self._clock, self._number = SharedClock(), FrameNumber()
        with _errors_in_words(self.name):
            self._camera = self._viva.connect_gige(device)
            stack.callback(_quietly, self._camera.close)
            self.rate = _set_up(self._camera, options)
            self._ticks = int.from_bytes(self._camera.read_register(_TICKS_REGISTER, 8), "big")
            self._stream = self._camera.stream()
            self._stream.__enter__()
            stack.callback(_quietly, self._stream.__exit__, None, None, None)
        self.size = first_size(self, options)

    def take(self, timeout: float) -> Shot | None:
        """Return the next image, or None if none comes in time.

        Raises
        ------
        CaptureError
            If another program took the camera, or it answers no more.
        """
        try:
            frame = self._stream.next_frame(max(int(timeout * 1000), _LEAST_WAIT_MS))
        except self._viva.TransportError as error:
            if "timeout" not in str(error):
                raise CaptureError(f"{self.name}: {error}") from error
            if timeout:
                self._check_control()
            return None
        except self._viva.GenicamError as error:
            raise CaptureError(f"{self.name}: {error}") from error
        if frame is None:
            raise CaptureError(f"{self.name} has ended its stream")
        arrived = clock.time()
        taken = frame.ts_dev / self._ticks if self._ticks and frame.ts_dev else None
        image = grey(frame.to_numpy(), frame.pixel_format, self.name)
        return Shot(image, self._clock.time(taken, arrived), self._number.of(frame.block_id))

    def _check_control(self) -> None:
        if self._camera.control_state != self._viva.ControlState.HELD:
            raise CaptureError(f"{self.name} was unplugged, or another program has taken it")


def open_gige(stack: ExitStack, addresses: tuple[str, ...], options: GenicamOptions) -> list["GigeCamera"]:
    """Open cameras on the network.

    Parameters
    ----------
    stack : ExitStack
        Closes them.
    addresses : tuple of str
        IP or MAC addresses; empty takes the only two there are, the lower IP first.
    options : GenicamOptions
        How they are to run.
    """
    with _errors_in_words("the network"):
        found = _viva().discover(timeout_ms=_DISCOVERY_MS, all=True)
    found = sorted(found, key=lambda device: [int(part) for part in device.ip.split(".")])
    chosen = _named(found, addresses) if addresses else only_two(found, _listed(found), _EXAMPLE)
    return [GigeCamera(device, options, stack) for device in chosen]


def _set_up(camera: Any, options: GenicamOptions) -> float | None:
    """Set what was asked for, and return the rate [Hz] if the camera runs at one of its own."""
    viva = _viva()
    with contextlib.suppress(viva.GenApiError):  # a camera with one format has nothing to choose
        camera.set_enum("PixelFormat", "Mono8")
    if options.exposure:
        camera.set_exposure_time(options.exposure)
    if options.gain >= 0:
        camera.set_gain(options.gain)
    if options.trigger:
        camera.enable_trigger("FrameStart", options.trigger)
        return options.rate or None
    if options.rate:
        camera.set_frame_rate(options.rate)
    try:
        return float(camera.frame_rate())
    except viva.GenicamError:
        return None


def _named(found: list[Any], addresses: tuple[str, ...]) -> list[Any]:
    chosen = []
    for address in addresses:
        fitting = [device for device in found if address.lower() in (device.ip, device.mac.lower())]
        if not fitting:
            raise CaptureError(f"no GigE Vision camera answers at {address}; {_listed(found)}")
        chosen.append(fitting[0])
    return chosen


def _listed(found: list[Any]) -> str:
    if not found:
        return "no GigE Vision camera answers on the network; check cables, power and the computer's address"
    return "found " + ", ".join(f"{device.ip} ({device.manufacturer} {device.model})" for device in found)


def _quietly(act: Any, *arguments: Any) -> None:
    """Close something that may be gone already."""
    with contextlib.suppress(_viva().GenicamError):
        act(*arguments)


@contextlib.contextmanager
def _errors_in_words(who: str) -> Iterator[None]:
    try:
        yield
    except _viva().GenicamError as error:
        raise CaptureError(f"{who}: {error}") from error


def _viva() -> ModuleType:
    return extra_module("viva_genicam", "viva-genicam for GigE Vision cameras", "gige")


__all__ = ["GigeCamera", "gige_pairs", "open_gige"]
