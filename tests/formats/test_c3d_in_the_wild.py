"""Every oddity of C3D files that was met, as a small file that no library writes."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import ezc3d
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from skelgen_formats.registry import read_take

BLOCK = 512
INTEL, DEC, SGI = 84, 85, 86


@dataclass
class OddC3d:
    """What a file holds, and what it states; `content` are its bytes.

    Points are positions and residual, shape (n_frames, n_points, 4); analogue values (n_frames, n per frame). Texts and
    numbers are parameters by group and name. `stated` replaces words of the header: byte -> number.
    """

    points: np.ndarray
    labels: Sequence[str]
    unit: str = "mm"
    processor: int = INTEL
    scale: float = -1.0
    analog: np.ndarray | None = None
    texts: Mapping[tuple[str, str], Sequence[str]] = field(default_factory=dict)
    numbers: Mapping[tuple[str, str], float] = field(default_factory=dict)
    stated: Mapping[int, int] = field(default_factory=dict)
    last_pointer: int = 0

    @property
    def content(self) -> bytes:
        """The file's bytes."""
        order = ">" if self.processor == SGI else "<"
        analog = np.zeros((len(self.points), 0)) if self.analog is None else self.analog
        frames = np.concatenate([self.points.reshape(len(self.points), -1), analog], axis=1)
        parameters = self._parameters(order)
        parameters += bytes(-len(parameters) % BLOCK)
        header = bytearray(BLOCK)
        header[:2] = bytes([2, 80])
        words = {
            2: self.points.shape[1],
            4: analog.shape[1],
            6: 1,
            8: len(frames),
            10: 10,
            16: 2 + len(parameters) // BLOCK,
        }
        for byte, word in {**words, 18: 1 if analog.shape[1] else 0, **self.stated}.items():
            struct.pack_into(f"{order}H", header, byte, word)
        header[12:16], header[20:24] = self._float(self.scale, order), self._float(100.0, order)
        if self.scale < 0:
            data = b"".join(self._float(x, order) for x in frames.ravel())
        else:
            data = np.round(frames / self._divisors(analog)).astype(f"{order}i2").tobytes()
        return bytes(header) + parameters + data + bytes(-len(data) % BLOCK)

    def _divisors(self, analog: np.ndarray) -> np.ndarray:
        per_point = [self.scale] * 3 + [1.0]
        return np.array(per_point * self.points.shape[1] + [1.0] * analog.shape[1])

    def _float(self, x: float, order: str) -> bytes:
        if self.processor != DEC:
            return struct.pack(f"{order}f", x)
        raw = struct.pack("<f", 4 * x)  # the exponent is biased by two more, the halves swapped
        return raw[2:] + raw[:2]

    def _parameters(self, order: str) -> bytes:
        texts = {("POINT", "LABELS"): self.labels, ("POINT", "UNITS"): [self.unit], **self.texts}
        numbers = {("POINT", "USED"): len(self.labels), ("POINT", "FRAMES"): len(self.points), **self.numbers}
        groups = list(dict.fromkeys(group for group, _ in (*texts, *numbers)))
        records = [(name, -number, b"\0") for number, name in enumerate(groups, start=1)]
        for (group, name), lines in texts.items():
            width = max((len(line) for line in lines), default=0)
            value = "".join(line.ljust(width) for line in lines).encode()
            records.append((name, groups.index(group) + 1, bytes([255, 2, width, len(lines)]) + value + b"\0"))
        for (group, name), number in numbers.items():
            is_count = isinstance(number, int)
            value = struct.pack(f"{order}h", number) if is_count else self._float(number, order)
            records.append((name, groups.index(group) + 1, bytes([2 if is_count else 4, 0]) + value + b"\0"))
        chain = bytes([1, 80, 0, self.processor])
        for place, (name, identity, rest) in enumerate(records, start=1):
            step = 2 + len(rest) if place < len(records) else self.last_pointer
            chain += struct.pack("bb", len(name), identity) + name.encode() + struct.pack(f"{order}H", step) + rest
        return chain


RNG = np.random.default_rng(3)
POSITIONS = np.round(RNG.uniform(-900, 900, (5, 3, 3)), 1)
F32 = 1000 * 2.0**-23


def points(residuals: float | np.ndarray = 1.0, n_points: int = 3) -> np.ndarray:
    positions = np.resize(POSITIONS, (5, n_points, 3))
    return np.concatenate([positions, np.broadcast_to(residuals, (5, n_points))[..., None]], axis=2)


PLAIN = OddC3d(points(), ("LASI", "RASI", "SACR"))


@pytest.mark.parametrize("processor", [INTEL, DEC, SGI])
@pytest.mark.parametrize("scale", [-1.0, 0.1])
@pytest.mark.parametrize("last_pointer", [0, 0x7FF0, 0x8123, 40])
def test_byte_orders_and_junk_behind_the_last_record(put, processor, scale, last_pointer):
    odd = replace(PLAIN, processor=processor, scale=scale, last_pointer=last_pointer)
    take = read_take(put("odd.c3d", odd.content))
    assert take.names == PLAIN.labels
    np.testing.assert_allclose(take.positions, POSITIONS, rtol=0, atol=F32)


def test_broken_parameters_before_the_labels_are_refused(refused, put):
    content = bytearray(PLAIN.content)
    at = content.index(b"LABELS") + len("LABELS") + 2
    content[at] = 77  # no such type
    assert "type 77" in refused(put("broken.c3d", bytes(content)))


def test_unit_can_be_stated_where_the_file_names_none(put):
    path = put("none.c3d", replace(PLAIN, unit="").content)
    assumed, stated = read_take(path), read_take(path, recorded_unit="cm")
    np.testing.assert_allclose(stated.positions, assumed.positions * 10)
    assert any("`--recorded-unit` states another" in notice for notice in assumed.notices)
    named = read_take(put("mm.c3d", PLAIN.content), recorded_unit="cm").notices
    assert any("`--recorded-unit cm` has no effect" in notice for notice in named)


@pytest.mark.parametrize(("unit", "factor"), [("mete", 1000.0), ("mete\0\0", 1000.0), ("mill", 1.0), ("cent", 10.0)])
def test_units_that_did_not_fit_their_field(put, unit, factor):
    take = read_take(put("unit.c3d", replace(PLAIN, unit=unit).content))
    np.testing.assert_allclose(take.positions, POSITIONS * factor, rtol=1e-6)


def test_labels_that_stand_twice_get_numbers(put):
    path = put("twins.c3d", replace(PLAIN, labels=("RKNE", "RKNE", "SACR")).content)
    take = read_take(path)
    assert take.names == ("RKNE", "RKNE_2", "SACR")
    assert "labels that stand twice got numbers: RKNE_2 was RKNE" in take.notices
    theirs = ezc3d.c3d(str(path))["data"]["points"][:3].transpose(2, 1, 0)
    np.testing.assert_array_equal(take.positions, theirs)


def test_twin_that_is_never_seen_takes_no_name(put):
    unseen = points()
    unseen[:, 1] = [0, 0, 0, -1]
    take = read_take(put("twin.c3d", replace(PLAIN, points=unseen, labels=("RKNE", "RKNE", "SACR")).content))
    assert take.names == ("RKNE", "SACR")


MODELLED = OddC3d(points(n_points=6), ("S:LASI", "S:RASI", "S:SACR", "S:LHipAngles", "S:LHipMoment", "S:Speed"))
GROUPS = {("POINT", "ANGLES"): ["LHipAngles"], ("POINT", "MOMENTS"): ["S:LHipMoment"], ("POINT", "SCALARS"): ["Speed"]}


def test_outputs_that_groups_name_are_left_out(put):
    path = put("model.c3d", replace(MODELLED, texts=GROUPS).content)
    take = read_take(path)
    assert take.names == ("LASI", "RASI", "SACR")
    assert any("3 markers left out because a model computed them" in notice for notice in take.notices)
    every = read_take(path, points="all")
    assert every.n_markers == 6
    np.testing.assert_array_equal(every.positions[:, :3], take.positions)


@pytest.mark.parametrize(
    "groups",
    [
        {("POINT", "USERMOS"): ["USERMO0"], ("POINT", "MODELED_MARKERS"): ["RHJC"]},
        {("POINT", "TYPE_GROUPS"): ["MINE", "OTHERS"], ("POINT", "MINE"): ["USERMO0"], ("POINT", "OTHERS"): ["RHJC"]},
    ],
)
def test_values_of_vicons_own_groups_are_no_coordinates(put, groups):
    """Nexus writes muscle signals of ProCalc as points: three volts would be three coordinates."""
    odd = OddC3d(points(0.0, 5), ("LASI", "RASI", "SACR", "USERMO0", "RHJC"), texts=groups)
    assert read_take(put("procalc.c3d", odd.content)).names == ("LASI", "RASI", "SACR")


@pytest.mark.parametrize("name", ["LHipAngles", "RKneeForce", "CentreOfMass", "LGroundReactionForce", "RAnklePower"])
def test_outputs_without_residuals_are_known_by_their_names(put, name):
    residuals = np.array([0.0, 0.0, 0.0])  # of all points, as some programs write them
    take = read_take(put("named.c3d", replace(PLAIN, points=points(residuals), labels=("LASI", "RASI", name)).content))
    assert take.names == ("LASI", "RASI")


def test_origin_and_axes_of_a_segment_are_known_together(put):
    labels = ("LASI", "RASI", "RFOO", "LFEO", "LFEA", "LFEL", "LFEP")  # RFOO alone is a marker
    take = read_take(put("bones.c3d", OddC3d(points(0.0, 7), labels).content))
    assert take.names == ("LASI", "RASI", "RFOO")


def test_points_with_residual_0_throughout_are_computed_where_others_are_measured(put):
    take = read_take(put("virtual.c3d", replace(PLAIN, points=points(np.array([1.5, 1.2, 0.0]))).content))
    assert take.names == ("LASI", "RASI")
    assert read_take(put("no.c3d", replace(PLAIN, points=points(np.array([1.5, 0.0, 0.0]))).content)).n_markers == 3


def test_infinite_positions_are_unseen_with_a_notice(put):
    odd = points(1.0)
    odd[2, 1, 0] = np.inf
    take = read_take(put("infinite.c3d", replace(PLAIN, points=odd).content))
    assert np.argwhere(~take.seen).tolist() == [[2, 1]]
    assert "1 position is infinite, and taken as unseen" in take.notices


def test_file_of_outputs_alone_says_how_to_read_it(refused, put):
    odd = OddC3d(points(0.0), ("LHipAngles", "LKneeAngles", "LAnkleAngles"))
    assert "`--points all`" in refused(put("angles.c3d", odd.content))
    assert read_take(put("angles.c3d", odd.content), points="all").n_markers == 3


ANALOG = RNG.uniform(-128_000, 128_000, (5, 112))


@pytest.mark.parametrize(
    "odd",
    [
        replace(PLAIN, analog=ANALOG, stated={4: 16, 18: 7}),
        replace(PLAIN, analog=ANALOG, stated={4: 16}, numbers={("ANALOG", "RATE"): 700.0, ("ANALOG", "USED"): 16}),
        replace(PLAIN, analog=ANALOG, stated={4: 16}),
        replace(PLAIN, analog=ANALOG, stated={4: 0}, numbers={("ANALOG", "RATE"): 700.0, ("ANALOG", "USED"): 16}),
    ],
)
def test_analogue_values_that_the_header_counts_wrong_are_no_coordinates(put, odd):
    odd = replace(odd, points=np.tile(odd.points, (4, 1, 1)), analog=np.tile(ANALOG, (4, 1)))
    take = read_take(put("motion_monitor.c3d", odd.content))
    np.testing.assert_allclose(take.positions, np.tile(POSITIONS, (4, 1, 1)), rtol=0, atol=F32)
    assert any("analogue values per frame where 112 are" in notice for notice in take.notices)


@pytest.mark.parametrize(
    ("stated", "what"),
    [({8: 999}, "999 frames where 60 are"), ({2: 4}, "4 points where 3 are"), ({8: 30}, "30 frames")],
)
def test_size_of_the_file_decides(put, stated, what):
    odd = replace(PLAIN, points=np.tile(PLAIN.points, (12, 1, 1)), stated=stated)
    take = read_take(put("stated.c3d", odd.content))
    np.testing.assert_allclose(take.positions, np.tile(POSITIONS, (12, 1, 1)), rtol=0, atol=F32)
    assert any(what in notice for notice in take.notices)


LONG = replace(PLAIN, points=np.tile(PLAIN.points, (12, 1, 1)))
LONG_POSITIONS = np.tile(POSITIONS, (12, 1, 1))


@pytest.mark.parametrize(
    ("odd", "notice"),
    [
        (replace(LONG, numbers={("POINT", "USED"): 5}), "POINT:USED says 5 points; the 3 of the header"),
        (replace(LONG, numbers={("POINT", "USED"): 0}, labels=()), "POINT:USED says 0 points"),
        (replace(LONG, stated={16: 0}, numbers={("POINT", "DATA_START"): 3}), "POINT:DATA_START is taken"),
        (replace(LONG, stated={6: 65535, 8: 5}), "the header contradicts the size of the file"),
        (replace(LONG, stated={8: 0}), "it states 0 frames where 60 are"),
        (replace(LONG, numbers={("POINT", "RATE"): 0.0}), ""),
        (replace(LONG, numbers={("POINT", "FRAMES"): 60.0}), ""),
        (replace(LONG, numbers={("POINT", "DATA_START"): 9}), ""),
        (replace(LONG, stated={6: 60000, 8: 60059}), ""),
    ],
)
def test_what_the_header_and_the_parameters_say_apart(put, odd, notice):
    take = read_take(put("apart.c3d", odd.content))
    np.testing.assert_allclose(take.positions, LONG_POSITIONS, rtol=0, atol=F32)
    assert take.rate == 100.0
    assert any(notice in told for told in take.notices) if notice else take.notices == ()


@pytest.mark.parametrize("n_bytes", [512, 1024, 4096, 3 * 4096])
def test_zeros_behind_the_data_are_no_analogue_values(put, n_bytes):
    odd = replace(LONG, analog=RNG.uniform(-1, 1, (60, 4)))
    take = read_take(put("padded.c3d", odd.content + bytes(n_bytes)))
    np.testing.assert_allclose(take.positions, LONG_POSITIONS, rtol=0, atol=F32)
    assert take.notices == ()


def test_bytes_behind_the_data_are_no_analogue_values(put):
    """What follows is somebody's own, where header and parameters agree on one analogue value per frame."""
    numbers = {("ANALOG", "RATE"): 100.0, ("ANALOG", "USED"): 1}
    odd = replace(PLAIN, analog=RNG.uniform(-1, 1, (5, 1)), numbers=numbers)
    take = read_take(put("more.c3d", odd.content + bytes(range(1, 101)) * 10))
    np.testing.assert_allclose(take.positions, POSITIONS, rtol=0, atol=F32)
    assert any("bytes behind the frames, of which nothing says" in notice for notice in take.notices)


def test_reserved_bytes_before_the_parameters_say_nothing(put):
    content = bytearray(PLAIN.content)
    content[BLOCK : BLOCK + 2] = b"\0\0"
    np.testing.assert_allclose(read_take(put("zero.c3d", bytes(content))).positions, POSITIONS, rtol=0, atol=F32)


def test_names_of_groups_in_lower_case_are_the_same(put):
    content = PLAIN.content.replace(b"POINT", b"Point").replace(b"LABELS", b"labels")
    assert read_take(put("lower.c3d", content)).names == PLAIN.labels


def test_frames_that_overflow_their_word_are_all_read(put):
    n_frames = 65536 + 400
    odd = replace(PLAIN, stated={8: 400}, numbers={("POINT", "FRAMES"): 400})
    head = odd.content[: 3 * BLOCK]
    frames = np.resize(PLAIN.points, (n_frames, 3, 4)).astype("<f4")
    take = read_take(put("long.c3d", head[: 2 * BLOCK] + frames.tobytes()))
    assert take.n_frames == n_frames
    np.testing.assert_array_equal(take.positions[-1], frames[-1, :, :3])


ROTATED = {("ROTATION", "LABELS"): ["worldbody_4X4", "pelvis_4X4", "l_thigh_4X4"]}


def with_rotations(odd: OddC3d) -> tuple[OddC3d, bytes, np.ndarray]:
    """The file with three segments, one unseen in the third frame; what stands behind its points; their poses."""
    poses = np.tile(np.eye(4), (5, 3, 1, 1))
    poses[:, 1:, :3, :3] = Rotation.random(10, random_state=2).as_matrix().reshape(5, 2, 3, 3)
    poses[:, 1:, :3, 3] = np.round(RNG.uniform(-900, 900, (5, 2, 3)), 1)
    words = np.ones((5, 3, 17), dtype="<f4")
    words[..., :16] = poses.swapaxes(2, 3).reshape(5, 3, 16)
    words[2, 2, 16] = -1.0
    numbers = {("ROTATION", key): number for key, number in (("USED", 3), ("RATIO", 1), ("DATA_START", 99))}
    blocks = len(replace(odd, texts=ROTATED, numbers=numbers).content) // BLOCK
    numbers["ROTATION", "DATA_START"] = blocks + 1
    return replace(odd, texts=ROTATED, numbers=numbers), words.tobytes() + bytes(-words.nbytes % BLOCK), poses


def test_segments_of_theia_are_bodies(put):
    odd, behind, poses = with_rotations(replace(PLAIN, points=np.zeros((5, 0, 4)), labels=()))
    take = read_take(put("theia.c3d", odd.content + behind))
    assert (take.names, take.rate) == (("pelvis", "l_thigh"), 100.0)
    assert "worldbody is the world, and left out" in take.notices
    assert np.isnan(take.world_from_body[2, 1]).all()
    np.testing.assert_allclose(take.world_from_body[:, 0], poses[:, 1], rtol=0, atol=F32)


def test_segments_beside_points_are_no_points(put):
    odd, behind, poses = with_rotations(PLAIN)
    path = put("both.c3d", odd.content + behind)
    take = read_take(path)
    np.testing.assert_allclose(take.positions, POSITIONS, rtol=0, atol=F32)
    assert any("`--bodies` reads them" in notice for notice in take.notices)
    theirs = ezc3d.c3d(str(path))["data"]["rotations"].transpose(3, 2, 0, 1)[:, 1:]
    ours = read_take(path, bodies=True).world_from_body
    np.testing.assert_allclose(ours[:, 0], theirs[:, 0], rtol=0, atol=F32)
    np.testing.assert_allclose(ours[:, 0], poses[:, 1], rtol=0, atol=F32)


def test_frame_rates_that_differ_are_told(put):
    take = read_take(put("rates.c3d", replace(PLAIN, numbers={("POINT", "RATE"): 60.0}).content))
    assert take.rate == 60.0
    assert "the header says 100 Hz and POINT:RATE 60 Hz, which is taken" in take.notices


def test_points_that_mokka_numbers_have_no_label(put):
    take = read_take(put("uname.c3d", replace(PLAIN, labels=("LASI", "RASI", "uname*3")).content))
    assert take.names == ("LASI", "RASI")
    assert "1 marker left out because unlabelled: uname*3" in take.notices
