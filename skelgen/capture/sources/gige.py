"""GigE Vision cameras, by viva-genicam."""

import contextlib
import time as clock
from contextlib import ExitStack
from types import ModuleType
from typing import Any

from skelgen.capture.images import extra_module
from skelgen.capture.sources import genicam
from skelgen.capture.sources.options import GenicamOptions, only_two
from skelgen.capture.sources.pairs import Opener, Shot, with_rate
from skelgen.errors import CaptureError

EXAMPLE = "gige:10.0.0.2,10.0.0.3"
"""Two cameras, as a user would name them."""

_DISCOVERY_MS = 500
_TICKS_REGISTER = 0x093C  # GigE Vision bootstrap: ticks of the time stamp a second, 64 bits


def opener(addresses: tuple[str, ...], options: GenicamOptions) -> Opener:
    """Return what opens cameras on the network.

    Parameters
    ----------
    addresses : tuple of str
        IP or MAC addresses; empty takes the only two there are, the lower IP first.
    options : GenicamOptions
        Rate, exposure, trigger and the like.
    """
    return lambda stack: with_rate(_open(stack, addresses, options))


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
        self._clock, self._number = genicam.SharedClock(), genicam.FrameNumber()
        with genicam.errors_in_words(self.name, self._viva.GenicamError):
            self._camera = self._viva.connect_gige(device)
            genicam.close_at_the_end(stack, self._camera.close, self._viva.GenicamError)
            self.rate = _set_up(self._camera, options)
            self._ticks = int.from_bytes(self._camera.read_register(_TICKS_REGISTER, 8), "big")
            self._stream = self._camera.stream()
            self._stream.__enter__()
            genicam.close_at_the_end(stack, lambda: self._stream.__exit__(None, None, None), self._viva.GenicamError)
        self.size = genicam.first_size(self, options)

    def take(self, timeout: float) -> Shot | None:
        """Return the next image, or None if none comes in time.

        Raises
        ------
        CaptureError
            If another program took the camera, or it answers no more.
        """
        with genicam.errors_in_words(self.name, self._viva.GenicamError):
            try:
                frame = self._stream.next_frame(int(timeout * 1000))
            except self._viva.TransportError as error:
                if "timeout" not in str(error):
                    raise
                if timeout:
                    self._check_control()
                return None
        if frame is None:
            raise CaptureError(f"{self.name} has ended its stream")
        arrived = clock.time()
        taken = frame.ts_dev / self._ticks if self._ticks and frame.ts_dev else None
        image = genicam.grey(frame.to_numpy(), frame.pixel_format, self.name)
        return Shot(image, self._clock.time(taken, arrived), self._number.of(frame.block_id))

    def _check_control(self) -> None:
        if self._camera.control_state != self._viva.ControlState.HELD:
            raise CaptureError(f"{self.name} was unplugged, or another program has taken it")


def _open(stack: ExitStack, addresses: tuple[str, ...], options: GenicamOptions) -> list[GigeCamera]:
    viva = _viva()
    with genicam.errors_in_words("the network", viva.GenicamError):
        found = viva.discover(timeout_ms=_DISCOVERY_MS, all=True)
    found = sorted(found, key=lambda device: [int(part) for part in device.ip.split(".")])
    names, listed = [(device.ip, device.mac.lower()) for device in found], _listed(found)
    lower = tuple(address.lower() for address in addresses)
    none = "no GigE Vision camera answers at"
    chosen = genicam.named(found, names, lower, none, listed) if lower else only_two(found, listed, EXAMPLE)
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


def _listed(found: list[Any]) -> str:
    if not found:
        return "no GigE Vision camera answers on the network; check cables, power and the computer's address"
    return "found " + ", ".join(f"{device.ip} ({device.manufacturer} {device.model})" for device in found)


def _viva() -> ModuleType:
    return extra_module("viva_genicam", "viva-genicam for GigE Vision cameras", "gige")
