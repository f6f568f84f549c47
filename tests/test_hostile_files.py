"""Files of strangers: bombs, devices, paths that lead elsewhere, absurd numbers: one line, and little memory."""

import bz2
import functools
import json
import os
import shutil
import socket
import struct
import subprocess
import sys
import textwrap
import zlib
from pathlib import Path

import cv2
import lz4.frame
import numpy as np
import pytest
import zstandard

from bag_maker import stereo, write_bag
from onnx_maker import yolov8
from pomona import FruitCloud, PomonaWarning
from pomona.detect.from_file import FileDetector
from pomona.detect.onnx import OnnxDetector
from pomona.pairs import read_pairs
from pomona.recording import Calibration, open_recording
from pomona.recording.bags.unpacked import MOST_CHUNK_BYTES, UnpackError, unpacked
from pomona.recording.calibration.rig_files import find_optics
from pomona.recording.checks.readable import checked
from pomona.recording.picture_size import encoded_size
from pomona.settings import Settings
from recording_maker import FIELDS, make_recording
from refusal import refused

LITTLE_BYTES = 1 << 30
"""A process may take so much more than it has when pomona is loaded: bombs here want three times that and more."""

CAMERA = Calibration(640, 480, 600.0, 600.0, 320.0, 240.0)


def in_little_memory(code: str, *arguments: object) -> str:
    """Run code in a process that may take `LITTLE_BYTES`; give what it prints."""
    limit = f"""
        import resource, sys, warnings
        from pathlib import Path
        import cv2, numpy
        from pomona import PomonaError, PomonaWarning, FruitCloud
        from pomona.recording import open_recording
        from pomona.recording.checks.readable import checked
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        most = pages * resource.getpagesize() + {LITTLE_BYTES}
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
        path = Path(sys.argv[1])
        try:
            with warnings.catch_warnings(record=True) as told:
                warnings.simplefilter("always")
                {textwrap.indent(textwrap.dedent(code), " " * 16).strip()}
        except PomonaError as error:
            print("refused:", error)
        for each in told:
            print("told:", each.message)
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(limit), *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


# Bombs


@functools.cache
def png_of(width: int, height: int) -> bytes:
    """A whole PNG of black of any size, some thousandths of it long."""

    def chunk(name: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))

    packer = zlib.compressobj(1)
    row = bytes(1 + 3 * width)
    packed = b"".join(packer.compress(row) for _ in range(height)) + packer.flush()
    head = struct.pack(">2I5B", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", packed) + chunk(b"IEND", b"")


@pytest.fixture
def pictures(tmp_path):
    """A folder with two left and right pictures."""
    folder = tmp_path / "row"
    for side in ("left", "right"):
        (folder / side).mkdir(parents=True)
        for number in range(2):
            cv2.imwrite(str(folder / side / f"000{number}.png"), np.full((480, 640, 3), 90 + number, np.uint8))
    (folder / "calibration.json").write_text(json.dumps({**FIELDS, "baseline_m": 0.12}))
    return folder


def test_a_picture_of_a_gigapixel_costs_its_frame_and_no_memory(pictures):
    (pictures / "left" / "0001.png").write_bytes(png_of(30_000, 30_000))
    printed = in_little_memory("print(checked(open_recording(path)).unreadable)", pictures)
    assert "found 30000x30000 pixels, expected 640x480 as in the calibration" in printed
    assert printed.startswith("{1: ")


def test_a_recording_of_gigapixels_alone_is_refused(pictures):
    for file in pictures.glob("*/*.png"):
        file.write_bytes(png_of(30_000, 30_000))
    (pictures / "calibration.json").unlink()
    (pictures / "camchain.yaml").write_text("cam0:\n  intrinsics: [1, 1, 1, 1]\n")
    assert "refused:" in in_little_memory("open_recording(path)", pictures)


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tiff", ".webp", ".bmp", ".ppm"])
@pytest.mark.parametrize("shape", [(1, 1, 3), (33, 57, 3), (240, 320, 3)])
def test_sizes_are_those_of_the_header(suffix, shape):
    pixels = np.random.default_rng(0).integers(0, 256, shape, np.uint8)
    assert encoded_size(cv2.imencode(suffix, pixels)[1].tobytes()) == (shape[1], shape[0])


def test_a_size_is_that_of_the_picture_and_not_of_a_preview_in_it():
    jpeg = cv2.imencode(".jpg", np.zeros((48, 64, 3), np.uint8))[1].tobytes()
    preview = cv2.imencode(".jpg", np.zeros((9, 16, 3), np.uint8))[1].tobytes()
    segment = b"\xff\xe1" + struct.pack(">H", 2 + len(preview)) + preview
    assert encoded_size(jpeg[:2] + segment + jpeg[2:]) == (64, 48)
    assert encoded_size(b"GIF89a" + bytes(20)) is None
    assert encoded_size(jpeg[:30]) is None


PACKERS = {"bz2": bz2.compress, "lz4": lz4.frame.compress, "zstd": zstandard.compress}


@functools.cache
def bomb(name: str) -> bytes:
    """Two GiB of nothing, in frames of 64 MiB."""
    return PACKERS[name](bytes(1 << 26)) * 32


@pytest.mark.parametrize("name", PACKERS)
def test_what_is_packed_is_unpacked_up_to_a_bound(name, monkeypatch):
    packed = PACKERS[name](b"fruit" * 1000)
    assert unpacked(name, packed) == unpacked(name, packed, 5000) == b"fruit" * 1000
    assert unpacked(name, packed + packed) == b"fruit" * 2000
    for wrong in (packed[:-3], packed + b"rest", b"no such thing"):
        with pytest.raises(UnpackError):
            unpacked(name, wrong)
    with pytest.raises(UnpackError, match="more than the 4999 bytes"):
        unpacked(name, packed, 4999)
    with pytest.raises(UnpackError, match="expected 5001"):
        unpacked(name, packed, 5001)
    with pytest.raises(UnpackError, match="declares"):
        unpacked(name, packed, MOST_CHUNK_BYTES + 1)
    monkeypatch.setattr("pomona.recording.bags.unpacked.MOST_CHUNK_BYTES", 10_000_000)
    with pytest.raises(UnpackError, match="more than the 10000000 bytes"):
        unpacked(name, PACKERS[name](bytes(10_000_001)))
    assert unpacked(name, PACKERS[name](bytes(10_000_000))) == bytes(10_000_000)


def record(operation: int, body: bytes) -> bytes:
    return struct.pack("<BQ", operation, len(body)) + body


def text(value: bytes) -> bytes:
    return struct.pack("<I", len(value)) + value


@pytest.mark.parametrize("declared", [None, 1000], ids=["declared", "hidden"])
@pytest.mark.parametrize("name", ["zstd", "lz4"])
def test_an_mcap_of_gigabytes_costs_its_chunk(tmp_path, name, declared):
    path = write_bag(tmp_path / "row", stereo(2), "mcap")
    packed, size = bomb(name), 1 << 31 if declared is None else declared
    chunk = struct.pack("<QQQI", 0, 2**62, size, 0) + text(name.encode()) + struct.pack("<Q", len(packed)) + packed
    content = path.read_bytes()
    path.write_bytes(content[:8] + record(6, chunk) + content[8:])
    printed = in_little_memory("print(len(open_recording(path)))", path)
    assert printed.startswith("2\n")
    assert "told:" in printed
    assert "the chunk at byte 17 is damaged and left out" in printed


def ros1_header(**fields: bytes) -> bytes:
    parts = (
        struct.pack("<I", len(name) + 1 + len(value)) + name.encode() + b"=" + value for name, value in fields.items()
    )
    return text(b"".join(parts))


@pytest.mark.parametrize("name", ["bz2", "lz4"])
def test_a_ros_bag_of_gigabytes_is_refused(tmp_path, name):
    """Without an index, so that our reader walks it; the bomb is its only chunk."""
    path = tmp_path / "row.bag"
    head = ros1_header(op=b"\x03", index_pos=bytes(8), conn_count=bytes(4), chunk_count=bytes(4))
    chunk = ros1_header(op=b"\x05", compression=name.encode(), size=struct.pack("<I", 1 << 31)) + text(bomb(name))
    path.write_bytes(b"#ROSBAG V2.0\n" + head + text(bytes(4096)) + chunk)
    printed = in_little_memory("open_recording(path)", path)
    assert "more than the" in printed
    assert "refused:" in printed


def test_a_ros_bag_with_an_index_is_bounded_too(tmp_path, monkeypatch):
    """Through rosbags, which unpacks by itself: the bound is ours."""
    path = write_bag(tmp_path / "row", stereo(2), "ros1 lz4")
    assert len(open_recording(path)) == 2
    monkeypatch.setattr("pomona.recording.bags.unpacked.MOST_CHUNK_BYTES", 1000)
    with pytest.warns(PomonaWarning, match="more than the 1000 bytes"):
        refused(lambda: open_recording(path), "row.bag")


def test_a_bag_whose_database_computes_its_values_is_bounded(tmp_path):
    import sqlite3

    folder = write_bag(tmp_path / "row", stereo(2), "sqlite3")
    file = next(folder.glob("*.db3"))
    with sqlite3.connect(file) as database:
        database.execute("ALTER TABLE messages RENAME TO old")
        columns = "id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER"
        database.execute(f"CREATE TABLE messages ({columns}, data BLOB AS (zeroblob(900000000)))")
        database.execute("INSERT INTO messages (id, topic_id, timestamp) SELECT id, topic_id, timestamp FROM old")
    database.close()
    assert "refused:" in in_little_memory("open_recording(path)", folder)


def test_a_raw_picture_that_declares_more_than_it_has_is_none(tmp_path):
    entries = [(topic, at, kind, {**fields, **({"width": 2**31, "height": 2**31} if "Image" in kind else {})})
               for topic, at, kind, fields in stereo(2)]  # fmt: skip
    path = write_bag(tmp_path / "row", entries, "mcap")
    assert "none that can be read" in in_little_memory("open_recording(path)", path)


def test_a_cloud_that_declares_more_than_its_file_is_refused_at_once(tmp_path):
    for count in ("100000000000000", "9" * 5000, "-1", "9223372036854775807"):
        for form in ("binary_little_endian", "ascii"):
            path = tmp_path / "cloud.ply"
            names = "".join(f"property double {name}\n" for name in "xyz")
            path.write_text(f"ply\nformat {form} 1.0\nelement vertex {count}\n{names}end_header\n")
            assert "refused:" in in_little_memory("FruitCloud.read(path)", path)


@pytest.mark.parametrize("sides", [(0, 64), (2**40, 2**40), (64, 2**31)])
def test_a_model_of_an_absurd_input_is_refused(tmp_path, sides):
    path = yolov8(tmp_path / "model.onnx", 64, 64)
    import onnx

    model = onnx.load(path)
    for dimension, side in zip(model.graph.input[0].type.tensor_type.shape.dim[2:], sides, strict=True):
        dimension.dim_value = side
    onnx.save(model, path)
    refused(lambda: OnnxDetector.open(path), "model.onnx")
    refused(lambda: OnnxDetector.open(yolov8(path, 64, 64, dynamic=True), size_px=sides), "input: found a size of")


@pytest.mark.parametrize(
    "value",
    [
        "[" * 100_000,
        '{"version": 1' + "0" * 5000 + "}",
        "\x00",
        '{"version": 1, "family": "yolov8", "preparation": [1]}',
    ],
)
def test_metadata_of_a_model_is_not_trusted(tmp_path, value):
    path = yolov8(tmp_path / "model.onnx", 64, 64, metadata={"pomona_detector": value})
    refused(lambda: OnnxDetector.open(path), "metadata pomona_detector")
    path = yolov8(tmp_path / "model.onnx", 64, 64, metadata={"names": "-" * 100_000 + "1"})
    refused(lambda: OnnxDetector.open(path), "metadata names")


# Devices, and paths that lead elsewhere


@pytest.fixture(params=["pipe", "socket", "device", "folder"])
def special(request, tmp_path, monkeypatch):
    """Something that is no plain file, behind a link."""
    place = tmp_path / "special"
    if request.param == "pipe":
        os.mkfifo(place)
    elif request.param == "socket":
        monkeypatch.chdir(tmp_path)  # the name of a socket must be short
        with socket.socket(socket.AF_UNIX) as bound:
            bound.bind("special")
    elif request.param == "folder":
        place.mkdir()
    else:
        place = Path("/dev/zero")
    return place


def test_what_is_no_file_is_no_picture(pictures, special):
    (pictures / "left" / "0001.png").unlink()
    (pictures / "left" / "0001.png").symlink_to(special)
    refused(lambda: open_recording(pictures), "0001.png: found a", "expected a file: a picture")


@pytest.mark.parametrize("name", ["calibration.json", "poses_tum.txt", "detections.csv", "recording.json"])
def test_what_is_no_file_is_no_text(pictures, special, name):
    (pictures / name).unlink(missing_ok=True)
    (pictures / name).symlink_to(special)
    if name == "detections.csv":
        refused(lambda: FileDetector.read(pictures / name, CAMERA, (0, 1)), "found a", "expected a file")
    elif name == "calibration.json":
        refused(lambda: Calibration.read(pictures / name), "found a", "expected a file")
    else:
        assert open_recording(pictures).trajectory is None  # only what is a file is looked at


def test_what_is_no_file_is_no_input(special, tmp_path):
    for suffix in (".csv", ".ply", ".toml", ".onnx", ".mp4", ".mcap", ".bag", ".svo2"):
        link = tmp_path / f"input{suffix}"
        link.symlink_to(special)
        if suffix in (".csv", ".ply"):
            refused(lambda link=link: FruitCloud.read(link), "found a")
        elif suffix == ".toml":
            refused(lambda link=link: Settings.load(link, {}), "found a")
        elif suffix == ".onnx":
            refused(lambda link=link: OnnxDetector.open(link), "found a")
        else:
            refused(lambda link=link: open_recording(link))


def test_pictures_behind_links_are_taken(pictures, tmp_path):
    """Data sets keep pictures elsewhere: who has the folder put the link there, or linked the folder itself."""
    shutil.move(pictures / "left", tmp_path / "elsewhere")
    (pictures / "left").symlink_to(tmp_path / "elsewhere")
    (tmp_path / "link").symlink_to(pictures)
    assert checked(open_recording(tmp_path / "link")).unreadable == {}


@pytest.mark.parametrize("name", ["../../etc/passwd", "/etc/passwd", "..\\..\\x.png", "C:\\x.png", "left/../../x.png"])
def test_a_list_does_not_lead_out_of_its_recording(pictures, name):
    for kind in ("rgb", "depth"):
        (pictures / f"{kind}.txt").write_text(f"0.0 left/0000.png\n0.1 {name}\n")
    refused(lambda: open_recording(pictures), "rgb.txt: line 2: found the file", "expected one inside of")
    (pictures / "mav0" / "cam0").mkdir(parents=True)
    (pictures / "mav0" / "cam0" / "data.csv").write_text(f"1,{name}\n")
    refused(lambda: open_recording(pictures), "data.csv: line 1: found the file", "expected one inside of")


def test_a_playlist_is_no_video(tmp_path):
    """FFmpeg would follow what it names, whatever its suffix: files, and addresses of the net."""
    (tmp_path / "calibration.json").write_text(json.dumps({**FIELDS, "baseline_m": 0.12}))
    lists = ("#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nother.ts\n", "ffconcat version 1.0\nfile other.mp4\n")
    for content in lists:
        (tmp_path / "row.mp4").write_text(content)
        refused(lambda: open_recording(tmp_path / "row.mp4"), "row.mp4: not a video")


# Numbers and nesting

DEEP = "[" * 100_000
HUGE = "9" * 5000


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("boxes.json", DEEP),
        ("boxes.json", f'{{"images": [{{"id": {HUGE}, "file_name": "0000.png"}}], "annotations": []}}'),
        ("boxes.json", f'{{"images": [{{"id": 1, "file_name": "{HUGE}.png"}}], "annotations": []}}'),
        ("boxes.json", f'[{{"image_id": 0, "bbox": [1, 2, 1e400, {"9" * 400}]}}]'),
        ("boxes.csv", f"frame,xmin,ymin,xmax,ymax\n{HUGE},1,2,3,4\n"),
        ("boxes.csv", "frame,xmin,ymin,xmax,ymax\n0,1,2,1e400,4\n"),
        ("boxes.csv", "frame,xmin,ymin,xmax,ymax\n0,1,2,3," + "4" * 1_000_000 + "\n"),
        ("boxes.csv", "frame,xmin\0,ymin,xmax,ymax\n"),
        ("boxes.txt", f"{HUGE},1,2,3,4,5,6\n"),
    ],
)
def test_boxes_of_absurd_numbers_are_refused(tmp_path, name, content):
    (tmp_path / name).write_text(content)
    refused(lambda: FileDetector.read(tmp_path / name, CAMERA, (0,)), name)


@pytest.mark.parametrize("width", [HUGE, "1" + "0" * 400, "1e400", "true", DEEP, "100000000", "NaN"])
def test_a_calibration_of_absurd_numbers_is_refused(tmp_path, width):
    fields = json.dumps({**FIELDS, "width": "WIDTH"}).replace('"WIDTH"', width)
    (tmp_path / "calibration.json").write_text(fields)
    refused(lambda: Calibration.read(tmp_path / "calibration.json"), "calibration.json")


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.yaml", "cam0:\n" + "".join(" " * depth + "a:\n" for depth in range(1, 3000))),
        ("a.yaml", "cam0: " + "[" * 5000 + "]" * 5000 + "\n"),
        ("a.yaml", "cam0:\n  intrinsics: [" + HUGE + ", 1, 1, 1]\n  resolution: [1, 1]\n"),
        ("a.yaml", "cam0:\n  intrinsics: [1e400, 1, 1, 1]\n"),
        ("a.yaml", "cam0:\n  intrinsics: [60, 60, 32, 24]\n  resolution: [1e18, 1e18]\n"),
        ("cameras.txt", f"1 PINHOLE {HUGE} 480 1 1 1 1\n"),
        ("cameras.txt", "1 PINHOLE nan inf 1 1 1 1\n"),
        ("SN1.conf", "[LEFT_CAM_VGA]\nfx=" + HUGE + "\n"),
        ("SN1.conf", "fx=1\n"),
    ],
)
def test_calibrations_of_other_programs_are_not_trusted(tmp_path, name, content):
    (tmp_path / name).write_text(content)
    refused(lambda: find_optics(tmp_path, (672, 376), stereo=False))


@pytest.mark.parametrize(
    "junk",
    [
        " # #" * 100_000 + '"',
        "a" + " " * 200_000 + "b",
        '"' * 100_001,
        *("- " * 100_000, "? " * 100_000, "[" * 100_000, "{a: " * 100_000, "!a" * 100_000, "&a " * 100_000),
        "\n" + "a: &a [x, x, x, x]\nb: &b [*a, *a, *a, *a]\nc: [*b, *b, *b, *b]\n",
    ],
)
def test_a_line_of_yaml_is_walked_over_once(tmp_path, junk):
    code = "from pomona.recording.calibration.rig_files import find_optics; find_optics(path, (64, 48), stereo=False)"
    (tmp_path / "a.yaml").write_text(f"cam0: {junk}\n")
    assert "refused:" in in_little_memory(code, tmp_path)


@pytest.mark.parametrize(
    "content",
    [
        DEEP,
        "x = " + DEEP,
        "[match]\nnoise_m = " + HUGE,
        "[match]\nnoise_m = inf",
        "\0",
        "[match]\nnoise_m = 1" + "0" * 400,
    ],
)
def test_settings_of_absurd_values_are_refused(tmp_path, content):
    (tmp_path / "settings.toml").write_text(content)
    refused(lambda: Settings.load(tmp_path / "settings.toml", {}), "settings.toml")


@pytest.mark.parametrize(
    "content", ['{"matches": ' + DEEP, "query,map\n" + "a" * 1_000_000 + ",a\n", "query,map\n\0,a\n"]
)
def test_pairs_are_not_trusted(tmp_path, content):
    (tmp_path / "pairs").write_text(content)
    cloud = FruitCloud(np.eye(3))
    refused(lambda: read_pairs(tmp_path / "pairs", cloud, cloud), "pairs")


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.csv", b"x,y,z\n" + b"1" * 1_000_000 + b",1\n"),
        ("a.csv", b"x,y,z,n_views\n1,2,3,1e300\n"),
        ("a.csv", b"x,y,z\n1,2,1e400\n"),
        ("a.csv", b"x,y,z" + b",a" * 1_000_000 + b"\n"),
        ("a.csv", "x,y,z\n1,2,3\n".encode("utf-16")),
        ("a.csv", b"x,y,z,id\n1,2,3,\xff\n"),
        ("a.csv", b""),
        ("a.ply", b"ply\nformat ascii 1.0\ncomment text id 0 " + b"[" * 60_000 + b"\nelement vertex 0\nend_header\n"),
        ("a.ply", b'ply\nformat ascii 1.0\ncomment text x 0 "1"\nelement vertex 1\nend_header\n1\n'),
    ],
)
def test_clouds_are_not_trusted(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    refused(lambda: FruitCloud.read(tmp_path / name), name)


def test_byte_order_marks_and_mixed_line_ends_are_read(tmp_path):
    (tmp_path / "a.csv").write_bytes(b"\xef\xbb\xbfx,y,z\r\n1,2,3\n4,5,6\r\n")
    assert len(FruitCloud.read(tmp_path / "a.csv", unit="free")) == 2
    (tmp_path / "boxes.csv").write_bytes(b"\xef\xbb\xbfframe,xmin,ymin,xmax,ymax\r0,1,2,3,4\r\n0,5,6,7,8\n")
    assert len(FileDetector.read(tmp_path / "boxes.csv", CAMERA, (0,)).by_frame[0]) == 2


@pytest.mark.parametrize(
    "line", ["0 0 0 1e300 0 0 0 1", "1e400 0 0 0 0 0 0 1", "0 0 0 0 0 0 0 inf", HUGE + " 0 0 0 0 0 0 1"]
)
def test_poses_of_absurd_numbers_are_refused(tmp_path, line):
    folder = make_recording(tmp_path / "row", (0.0, 0.1))
    (folder / "poses_tum.txt").write_text(f"{line}\n1 0 0 0 0 0 0 1\n")
    refused(lambda: open_recording(folder), "poses_tum.txt: line 1")


def test_bytes_of_a_bag_that_are_no_text_are_refused(tmp_path):
    """A name in Latin-1, where the format says UTF-8."""
    path = write_bag(tmp_path / "row", stereo(2), "mcap")
    path.write_bytes(path.read_bytes().replace(b"/stereo/left/image_rect_color", b"/ster\xe9o/left/image_rect_color"))
    refused(lambda: open_recording(path), "row.mcap: a damaged MCAP", "can't decode byte 0xe9")
    folder = write_bag(tmp_path / "bag", stereo(2), "sqlite3")
    (folder / "metadata.yaml").write_bytes(b"\xff" + (folder / "metadata.yaml").read_bytes())
    refused(lambda: open_recording(folder), "metadata.yaml: byte 0: found bytes that are not UTF-8")
