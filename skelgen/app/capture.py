"""A capture, with two cameras or those of a room, from settings and a source: live, recorded, used to calibrate.

A calibration is written into a settings file beside what stands there.

What was recorded stays, whatever ends the capture: the source, an error, or the user.
"""

from collections.abc import Generator, Sequence
from contextlib import ExitStack, closing
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
from skelgen_formats.capture_settings import write_settings

from skelgen.app.recording import Recording, check_recording
from skelgen.app.room import read_capture_settings
from skelgen.capture.bodies import BodyFinder
from skelgen.capture.bodies.design import check_targets
from skelgen.capture.bodies.prediction import PredictionParameters
from skelgen.capture.calibration.body import BodyCalibration, calibrate_body
from skelgen.capture.calibration.joints import JointCalibration, calibrate_joints
from skelgen.capture.live import Captured, MotionCapture, Recogniser, search_parameters
from skelgen.capture.markers import ImageHealth
from skelgen.capture.values import FoundBody, FrameSource, JointRequest, StereoPoints
from skelgen.errors import InputError
from skelgen.model.rig import AnySettings, CameraRig, CaptureSettings, RoomSettings, StereoRig, TargetJoint
from skelgen.progress import SILENT, Monitor, with_progress


def source_of(settings: AnySettings, text: str | None = None) -> FrameSource:
    """Return the source that a text names, or else the one of the settings.

    Parameters
    ----------
    settings : CaptureSettings or RoomSettings
        What the capture knows.
    text : str, optional
        Where images come from, as docs/capture/sources.md and, for a room, docs/capture/room.md have it.

    Raises
    ------
    InputError
        If neither names a source, the text is no source, or its cameras are not as many as those of a room's settings.
    """
    named, is_from_file = text or settings.source, not text
    if not named:
        raise InputError("the settings name no source of images; add <source> to them, or give one with --source")
    if isinstance(settings, CaptureSettings):
        from skelgen.capture.sources import open_source  # noqa: PLC0415 - drivers of cameras only where there are any

        return open_source(named, from_file=is_from_file)
    from skelgen.capture.room.sources import open_room_source  # noqa: PLC0415 - loads the simulation

    source = open_room_source(named, from_file=is_from_file)
    if len(source.cameras) != len(settings.rig.cameras):
        raise InputError(
            f"{named} has {len(source.cameras)} cameras ({', '.join(source.cameras)}), the settings "
            f"have {len(settings.rig.cameras)} ({', '.join(settings.rig.names)}); give the images of all "
            "of them, in their order, or calibrate those that are there"
        )
    return source


def capture(
    settings: AnySettings,
    source: FrameSource,
    record: Sequence[Path] = (),
    prediction: PredictionParameters | None = None,
    n_frames: int | None = None,
) -> Generator[Captured]:
    """Run a capture with two cameras or with those of a room; closing the iterator ends it cleanly.

    Parameters
    ----------
    settings : CaptureSettings or RoomSettings
        Cameras, targets, joints.
    source : FrameSource
        Not yet entered.
    record : sequence of Path
        Files that are recorded while it runs, with the suffixes of `RECORDINGS`.
    prediction : PredictionParameters, optional
        Predict and smooth poses.
    n_frames : int, optional
        Pairs, or sets in a room, at most.

    Raises
    ------
    SkelgenError
        If settings or source are not what they must be, the source breaks off, or a recording cannot be written; what
        was recorded until then is kept.
    """
    for path in record:
        check_recording(path, settings)
    with ExitStack() as stack:
        live = stack.enter_context(_live(settings, prediction))
        pairs = stack.enter_context(source)
        recordings = [stack.enter_context(Recording(path, settings, source.rate)) for path in record]
        for captured in live.run(islice(pairs, n_frames)):
            for recording in recordings:
                recording.add(captured)
            yield captured


def _live(settings: AnySettings, prediction: PredictionParameters | None) -> Recogniser:
    if isinstance(settings, RoomSettings):
        from skelgen.capture.room.live import RoomCapture  # noqa: PLC0415 - loads kernels

        return RoomCapture(settings, prediction)
    return MotionCapture(settings, prediction)


def calibrate_body_of(
    settings: AnySettings,
    source: FrameSource,
    name: str,
    n_balls: int | None = None,
    n_frames: int | None = None,
    monitor: Monitor = SILENT,
) -> tuple[AnySettings, BodyCalibration]:
    """Calibrate a target from a source; return the settings with it, in place of one of the same name.

    Parameters
    ----------
    settings : CaptureSettings or RoomSettings
        What the capture knows.
    source : FrameSource
        Pairs of images of the target that is turned.
    name : str
        What the target is called.
    n_balls : int, optional
        Its number of balls; found if left out.
    n_frames : int, optional
        Pairs at most; all if left out.
    monitor : Monitor
        Receives progress; may cancel.
    """
    frames = _points_of(settings, source, n_frames, monitor)
    others = [body for body in settings.bodies if body.name != name]
    done = calibrate_body(frames, name, n_balls, others, search_parameters(settings), monitor)
    new = _with_body(settings, done, settings.rig.noise)
    return new, replace(done, notices=(*done.notices, *_outdated(settings, name)))


def _with_body(settings: AnySettings, done: BodyCalibration, stated: float) -> AnySettings:
    """Return settings with a target, in place of one of the same name; the noisiest target is the noise of the rig.

    Parameters
    ----------
    settings : CaptureSettings or RoomSettings
        What the capture knows.
    done : BodyCalibration
        The target.
    stated : float, px
        Noise of the rig that it was calibrated with.

    Raises
    ------
    InputError
        If it can be taken for another one of them.
    """
    target, names = replace(done.target, noise=done.image_noise(stated)), [body.name for body in settings.bodies]
    bodies = [target if body.name == target.name else body for body in settings.bodies]
    bodies = bodies if target.name in names else [*bodies, target]
    check_targets(bodies, search_parameters(settings))
    noise = max(body.noise for body in bodies) or settings.rig.noise
    return replace(settings, bodies=bodies).with_rig(replace(settings.rig, noise=noise))


def _outdated(settings: AnySettings, name: str) -> tuple[str, ...]:
    """Return a notice that names joints measured with the former calibration of a target; None if there are none."""
    joints = [joint.name for joint in settings.joints if name in (joint.parent, joint.child)]
    if not joints:
        return ()
    return (f"joints of the settings rest on the body {name!r} before: {', '.join(joints)}; calibrate them again",)


def calibrate_joints_of(
    settings: AnySettings,
    source: FrameSource,
    requests: Sequence[JointRequest] = (),
    n_frames: int | None = None,
    monitor: Monitor = SILENT,
    use_frames: int | Sequence[int] | None = None,
) -> tuple[AnySettings, JointCalibration]:
    """Calibrate joints from a source; return the settings with them, in place of those of the same names.

    Parameters
    ----------
    settings : CaptureSettings or RoomSettings
        What the capture knows.
    source : FrameSource
        Pairs of images of the joints that are moved.
    requests : sequence of JointRequest
        Joints that are stated; all are found if there are none.
    n_frames : int, optional
        Pairs at most; all if left out.
    monitor : Monitor
        Receives progress; may cancel.
    use_frames : int or sequence of int, optional
        So many of them, evenly spaced, or those of these indices.
    """
    if len(settings.bodies) < 2:
        raise InputError("joints are between two targets; calibrate them first: skelgen calibrate body")
    frames = _points_of(settings, source, n_frames, monitor)
    finder = BodyFinder(settings.bodies, search_parameters(settings))
    monitor.begin("bodies")
    found: list[list[FoundBody]] = [finder.find(points) for points in with_progress(frames, len(frames), monitor)]
    done = calibrate_joints(found, [body.name for body in settings.bodies], requests, source.rate, use_frames)
    return with_joints(settings, done), done


def with_joints(settings: AnySettings, done: JointCalibration) -> AnySettings:
    """Return settings with joints, in place of those of the same names.

    Parameters
    ----------
    settings : CaptureSettings or RoomSettings
        What the capture knows.
    done : JointCalibration
        What was calibrated.

    Raises
    ------
    InputError
        If none was found, or one names a target that is not there.
    """
    if not done.joints:
        raise InputError(f"no joint was found: {'; '.join(done.notices) or 'the targets move as one'}")
    names = {joint.name for joint in done.joints}
    joints: list[TargetJoint] = [*(joint for joint in settings.joints if joint.name not in names), *done.joints]
    return replace(settings, joints=joints)


def _points_of(
    settings: AnySettings, source: FrameSource, n_frames: int | None, monitor: Monitor
) -> list[StereoPoints]:
    """Points of every moment of a source; an error if hardly any ball is in both images of a pair, as if exchanged."""
    monitor.begin("images")
    health = None if isinstance(settings, RoomSettings) else ImageHealth(settings.rig)
    found, notices = [], list[str]()
    total = min(count for count in (n_frames, source.n_frames, 10**9) if count is not None)
    with closing(capture(replace(settings, bodies=(), joints=()), source, n_frames=n_frames)) as stream:
        for captured in with_progress(stream, total, monitor):
            found.append(captured.points)
            if health is None:
                notices += captured.notices
            else:
                left, right = captured.views
                health.look(captured.pair, left, right, captured.points)
    if health is not None:
        health.check(source.name)
    for sentence in dict.fromkeys(notices):
        monitor.notice(sentence)
    return found


_CAMERAS = ("firewire:", "gige:", "gentl:")
"""Sources that are cameras: the next capture comes from them too."""


def save_cameras(rig: StereoRig | CameraRig, path: Path, before: Path | None, source: str = "") -> int:
    """Write calibrated cameras into a settings file; return how many bodies and joints were kept.

    Parameters
    ----------
    rig : StereoRig or CameraRig
        The calibrated cameras.
    path : Path
        The file.
    before : Path or None
        A settings file whose bodies, joints and other settings are kept, if it is there, and of a pair or a room, too.
    source : str
        Source of the images; it is written into the settings of a pair if it is cameras.
    """
    settings: AnySettings = RoomSettings(rig) if isinstance(rig, CameraRig) else CaptureSettings(rig)
    known = read_capture_settings(before) if before is not None and before.exists() else None
    if isinstance(known, type(settings)):
        settings = known.with_rig(rig)
    elif source.startswith(_CAMERAS):
        settings = replace(settings, source=source)
    write_settings(settings, path)
    return len(settings.bodies) + len(settings.joints)


def add_body(path: Path, used: AnySettings, done: BodyCalibration) -> tuple[str, ...]:
    """Add a target to a settings file, in place of one of the same name; return what the user should know.

    The noise of the rig becomes that of the noisiest target.

    Parameters
    ----------
    path : Path
        The file; if it is not there, it is written with the settings that were used.
    used : CaptureSettings or RoomSettings
        The settings that were used for the calibration.
    done : BodyCalibration
        What was calibrated.

    Raises
    ------
    SkelgenError
        If the file cannot be read or written, its cameras are others than those that were used, or the target can be
        taken for another one.
    """
    settings = _stored(path, used)
    write_settings(_with_body(settings, done, used.rig.noise), path)
    return _outdated(settings, done.target.name)


def add_joints(path: Path, used: AnySettings, calibration: JointCalibration) -> None:
    """Add joints to a settings file, in place of those of the same names.

    Parameters
    ----------
    path, used
        As of `add_body`.
    calibration : JointCalibration
        What was calibrated.

    Raises
    ------
    SkelgenError
        If the file cannot be read or written, its cameras are others than those that were used, or no joint was found.
    """
    write_settings(with_joints(_stored(path, used), calibration), path)


def _stored(path: Path, used: AnySettings) -> AnySettings:
    """Settings as they are in a file by now; those that were used if there is none."""
    stored = read_capture_settings(path) if path.exists() else used
    if not _is_same(stored.rig, used.rig):
        raise InputError(
            f"the cameras of {path} are others than those that this was measured with; choose these settings above, "
            "and take it again"
        )
    return stored


def _is_same(one: StereoRig | CameraRig, two: StereoRig | CameraRig) -> bool:
    return len(one.cameras) == len(two.cameras) and all(
        np.array_equal(getattr(a, name), getattr(b, name))
        for a, b in zip(one.cameras, two.cameras, strict=True)
        for name in ("size", "matrix", "distortion", "camera_from_world")
    )
