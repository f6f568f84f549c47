"""ZED recordings, written as the published description of the format says: by a real encoder into a real MCAP."""

import json
import struct
import sys
from fractions import Fraction

import av
import numpy as np
import pytest
from mcap.writer import Writer

from pomona import PomonaError, PomonaWarning
from pomona.recording import open_recording, selected
from pomona.recording.checks.readable import checked

SIZE = (672, 376)
SERIAL = 38486288
START_NS = 1_723_190_400 * 10**9
STEP_NS = 66_666_667
CONF = """[LEFT_CAM_VGA]
fx=350
fy=350
cx=335.5
cy=187.5
k1=0
k2=0
p1=0
p2=0
k3=0

[RIGHT_CAM_VGA]
fx=350
fy=350
cx=335.5
cy=187.5
k1=0
k2=0

[STEREO]
Baseline=119.9
CV_VGA=0
RX_VGA=0
RZ_VGA=0
TY=0
TZ=0
"""


def access_units(codec: str, n_frames: int) -> list[tuple[bytes, bool]]:
    """Encode frames whose left half is brightness 10 n and whose right half is 10 n + 5; a key picture every tenth."""
    encoder = av.CodecContext.create({"h264": "libx264", "hevc": "libx265"}[codec], "w")
    encoder.width, encoder.height, encoder.pix_fmt = 2 * SIZE[0], SIZE[1], "yuv420p"
    encoder.time_base, encoder.framerate = Fraction(1, 15), Fraction(15)
    parameters = "log-level=none:keyint=10:min-keyint=10:scenecut=0:bframes=0:repeat-headers=1"
    encoder.options = (
        {"g": "10", "keyint_min": "10", "sc_threshold": "0", "bf": "0", "x264-params": "repeat-headers=1"}
        if codec == "h264"
        else {"x265-params": parameters}
    )
    units = []
    for row in [*range(n_frames), None]:
        frame = None
        if row is not None:
            picture = np.full((SIZE[1], 2 * SIZE[0], 3), 10 * (row % 24), np.uint8)
            picture[:, SIZE[0] :] += 5
            frame = av.VideoFrame.from_ndarray(picture, format="bgr24").reformat(format="yuv420p")
            frame.pts = row
        units += [(bytes(packet), packet.is_keyframe) for packet in encoder.encode(frame)]
    return units


def write_svo2(path, codec="h264", n_frames=30, *, stamp_of=lambda row: START_NS + row * STEP_NS, change=None):
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=8192)
        writer.start("", "libmcap stereolabs")
        schemas = [writer.register_schema(name, "jsonschema", b"{}") for name in ("sl_type", "sensors")]
        head = writer.register_channel("svo_header", "json", schemas[0])
        topic = f"Camera_SN{SERIAL}/side_by_side"
        pictures = writer.register_channel(topic, "zed_sdk_encoded", writer.register_schema(topic, "", b""))
        writer.add_message(head, START_NS, json.dumps({"ZED_SDK_version": "4.2.0"}).encode(), START_NS)
        for row, (unit, is_key) in enumerate(access_units(codec, n_frames)):
            key_kind = 3 if is_key else 0
            shape, unknown, about = (2 * SIZE[0], SIZE[1]), (0x002C005C, 1, 2, -1), (key_kind, 0, row, 7)
            footer = struct.pack("<2I4iQIiq2i", *shape, *unknown, stamp_of(row), len(unit), *about)
            assert len(footer) == 56
            body = struct.pack("<2I", 4 + len(unit) + 56, len(unit)) + unit + footer
            body = body if change is None else change(row, body)
            logged_ns = START_NS + row * STEP_NS + 1_000_000
            writer.add_message(pictures, logged_ns, body, logged_ns)
        writer.finish()
    return path


@pytest.fixture
def row(tmp_path):
    (tmp_path / f"SN{SERIAL}.conf").write_text(CONF)
    return tmp_path


def brightness(recording):
    return [(frame.read_left().mean(), frame.read_right().mean()) for frame in recording.frames()]


@pytest.mark.parametrize("codec", ["h264", "hevc"])
def test_left_and_right_come_out(pomona, row, codec):
    recording = open_recording(write_svo2(row / "row.svo2", codec))
    assert len(recording) == 30
    assert recording.date == "2024-08-09T08:00:00"
    assert recording.calibration.baseline_m == pytest.approx(0.1199)
    for number, (left, right) in enumerate(brightness(recording)):
        assert left == pytest.approx(10 * (number % 24), abs=4)
        assert right == pytest.approx(10 * (number % 24) + 5, abs=4)
    assert [frame.time_s for frame in recording.frames()] == pytest.approx(
        [(START_NS + number * STEP_NS) / 1e9 for number in range(30)], abs=1e-6
    )
    code, printed, errors = pomona("info", row / "row.svo2", "--check")
    assert code == 0, errors
    for line in (
        "kind           ZED .svo2",
        "frames         30",
        "rate_hz        15",
        "fx             350",
        "unreadable     0",
    ):
        assert line in printed


def test_decoding_is_that_of_the_stream_alone(row):
    """Against PyAV on the bare stream: no picture is lost, moved or filled in."""
    units = access_units("hevc", 30)
    decoder = av.CodecContext.create("hevc", "r")
    frames = [frame for unit, _ in units for frame in decoder.decode(av.Packet(unit))] + decoder.decode(None)
    recording = open_recording(write_svo2(row / "row.svo2", "hevc"))
    for frame, expected in zip(recording.frames(), frames, strict=True):
        picture = expected.to_ndarray(format="bgr24")
        assert np.array_equal(frame.read_left(), picture[:, : SIZE[0]])
        assert np.array_equal(frame.read_right(), picture[:, SIZE[0] :])


@pytest.mark.parametrize("codec", ["h264", "hevc"])
def test_a_part_is_equal_to_the_bit(row, codec):
    recording = open_recording(write_svo2(row / "row.svo2", codec, 130))
    expected = {frame.number: frame.read_left() for frame in recording.frames()}
    for numbers in ([0, 127], [64], [9, 10, 11], range(3, 130, 40)):
        frames = list(recording.frames(numbers))
        assert [frame.number for frame in frames] == list(numbers)
        assert all(np.array_equal(frame.read_left(), expected[frame.number]) for frame in frames)
    assert len(list(selected(recording, first=100).frames())) == 30


def test_footers_in_other_units_fall_back_on_the_log(row):
    recording = open_recording(write_svo2(row / "row.svo2", stamp_of=lambda number: 1_738_434_526_000 + 66 * number))
    assert next(recording.frames()).time_s == pytest.approx((START_NS + 1_000_000) / 1e9, abs=1e-6)
    assert recording.description()["rate_hz"] == pytest.approx(15, abs=0.01)


def test_times_that_go_back_are_refused(row):
    svo2 = write_svo2(row / "row.svo2", stamp_of=lambda number: START_NS + (number - 10 * (number > 20)) * STEP_NS)
    with pytest.raises(PomonaError, match=r"row\.svo2: frame 21: time goes back from 1723190401\.333 s"):
        open_recording(svo2)


def test_a_picture_that_is_cut_off_costs_what_is_built_on_it(row):
    svo2 = write_svo2(row / "row.svo2", change=lambda number, body: body[:30] if number == 15 else body)
    recording = open_recording(svo2)
    bad = checked(recording).unreadable
    assert 15 in bad
    assert set(bad) <= set(range(15, 20))
    assert "row.svo2: frame 15 at" in bad[15]
    assert len(list(recording.frames())) == 30


def test_an_svo2_that_was_cut_off_is_used_as_far_as_it_goes(row):
    svo2 = write_svo2(row / "row.svo2", n_frames=60)
    svo2.write_bytes(svo2.read_bytes()[: svo2.stat().st_size // 2])
    with pytest.warns(PomonaWarning, match=r"row\.svo2: cut off"):
        recording = open_recording(svo2)
    assert 10 < len(recording) < 50
    assert checked(recording).unreadable == {}


def test_the_calibration_is_that_of_the_serial_number(row):
    svo2 = write_svo2(row / "row.svo2", n_frames=2)
    (row / "SN1.conf").write_text(CONF.replace("119.9", "63"))
    assert open_recording(svo2).calibration.baseline_m == pytest.approx(0.1199)
    assert open_recording(svo2, calibration=row / "SN1.conf").calibration.baseline_m == pytest.approx(0.063)
    for file in row.glob("*.conf"):
        file.unlink()
    with pytest.raises(PomonaError, match=f"calibration: found none.*SN{SERIAL}.conf, from its maker"):
        open_recording(svo2)


def test_what_is_no_svo2_is_refused(row, monkeypatch):
    (row / "row.svo2").write_bytes(b"SVO of old" * 50)
    with pytest.raises(PomonaError, match="not an MCAP file"):
        open_recording(row / "row.svo2")
    write_svo2(row / "row.svo2", n_frames=2, change=lambda _, body: body[:8] + b"JPEG" + body[12:])
    with pytest.raises(PomonaError, match=r"begin with 4a504547, expected H\.264 or H\.265"):
        open_recording(row / "row.svo2")
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(PomonaError, match="pip install av"):
        open_recording(row / "row.svo2")


def test_an_svo_of_before_is_refused(row):
    (row / "row.svo").write_bytes(b"SVO")
    with pytest.raises(PomonaError, match=r"row\.svo: only its maker can read an \.svo: convert it to \.svo2"):
        open_recording(row / "row.svo")
