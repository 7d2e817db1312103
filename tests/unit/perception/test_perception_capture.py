"""A picture is taken through a live endpoint and looked into; each way to have none is reported apart."""

import base64
import struct
import sys
import zlib
from pathlib import Path

import pytest

from octoform.diagnostics import Diagnostic
from octoform.endpoint.bounded_program import ForkServer
from octoform.endpoint.client.jsonrpc import ToolCall
from octoform.endpoint.client.terminal import CallResult
from octoform.perception.capture import Decoded, Taken, decode, decode_with, judged, picture_of, take
from octoform.state.layout import Layout

PYTHON = Path(sys.executable)


def png(width: int, height: int, rows: list[bytes], colour: int = 0, filters: bytes = b"") -> bytes:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    kinds = filters or bytes(height)
    lines = b"".join(kinds[y : y + 1] + rows[y] for y in range(height))
    head = struct.pack(">IIBBBBB", width, height, 8, colour, 0, 0, 0)
    body = chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(lines)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body


LEFT_DARK = png(128, 96, [bytes([20] * 64 + [220] * 64)] * 96)


def answer(*content: dict[str, str], message: str = "") -> CallResult:
    return CallResult(tuple(content), None, bool(message), message, 1.0)


def image(data: str, mime: str = "image/png") -> dict[str, str]:
    return {"type": "image", "data": data, "mimeType": mime}


def test_size_brightness_and_thumbnail_of_pictures_in_one_run() -> None:
    red = png(2, 1, [bytes([255, 0, 0, 255, 0, 0])], colour=2)
    raised = png(3, 2, [bytes([10, 10, 10]), bytes([30, 30, 30])], filters=b"\1\2")  # left, up
    seen = decode_with(PYTHON, [LEFT_DARK, red, raised, b"no picture", b"", LEFT_DARK[:-40]])
    assert isinstance(seen, list)
    first, second, third, *rest = seen
    assert first is not None and (first.width, first.height) == (128, 96)
    assert (first.picture.mean, first.picture.spread) == (120.0, 100.0)
    assert first.picture.thumb == bytes([20] * 32 + [220] * 32) * 48
    assert second is not None and second.picture.mean == 76.0
    assert third is not None and third.picture.thumb[:64:31] == bytes([10, 20, 30])
    assert third.picture.thumb[-64::31] == bytes([40, 50, 60])
    assert rest == [None, None, None]


def test_a_fork_of_what_has_loaded_the_library_sees_the_same() -> None:
    server = ForkServer.at(PYTHON, "pictures")
    assert server.loaded(60)
    pictures = [LEFT_DARK, b"no picture", LEFT_DARK[:-40]]
    assert decode_with(PYTHON, pictures, server) == decode_with(PYTHON, pictures)


def test_a_jpeg_without_its_end_is_no_picture() -> None:
    assert decode_with(PYTHON, [b"\xff\xd8\xff\xe0 the rest was lost"]) == [None]


@pytest.mark.parametrize("python", [Path("/nowhere/python"), Path("/bin/false"), Path("/bin/cat")])
def test_a_program_that_cannot_look_is_told(python: Path) -> None:
    found = decode_with(python, [LEFT_DARK])
    assert isinstance(found, Diagnostic) and found.code == "PERCEPTION-NOT-DECODED" and found.detail


def test_a_host_without_an_endpoint_gives_its_reason(tmp_path: Path) -> None:
    layout = Layout(tmp_path, "bench")
    found = take(layout, ToolCall("capture_image", {}))
    assert isinstance(found, Diagnostic) and found.code == "ENDPOINT-NOT-APPLIED"
    lost = decode(layout, [LEFT_DARK])
    assert isinstance(lost, Diagnostic) and lost.code == "PERCEPTION-NOT-DECODED"


@pytest.mark.parametrize(
    ("result", "code", "told"),
    [
        (answer({"type": "text", "text": "x"}, message="it is unplugged"), "PERCEPTION-TOOL-FAILED", "unplugged"),
        (answer({"type": "text", "text": "/tmp/a.jpg"}), "PERCEPTION-NO-PICTURE", "text"),
        (answer(), "PERCEPTION-NO-PICTURE", "nothing"),
        (answer(image("@@@")), "PERCEPTION-BROKEN-PICTURE", "base64"),
    ],
)
def test_each_way_to_have_no_picture_is_told_apart(result: CallResult, code: str, told: str) -> None:
    found = picture_of("capture_image", result)
    assert isinstance(found, Diagnostic) and found.code == code
    assert found.detail is not None and told in found.detail


def test_the_first_picture_of_an_answer_is_taken() -> None:
    given = base64.b64encode(LEFT_DARK).decode()
    text = {"type": "text", "text": "a picture"}
    media = picture_of("capture_image", answer(text, image(given), image("bm8=")))
    assert media == (LEFT_DARK, "image/png")
    (seen,) = decode_with(PYTHON, [LEFT_DARK])  # type: ignore[misc]
    taken = judged("capture_image", LEFT_DARK, "image/png", seen)
    assert isinstance(seen, Decoded) and taken == Taken(LEFT_DARK, "image/png", seen.picture, 128, 96)
    broken = judged("capture_image", b"\xff\xd8", "image/jpeg", None)
    assert isinstance(broken, Diagnostic) and broken.code == "PERCEPTION-BROKEN-PICTURE"
