"""One picture through the live endpoint, as any client would take it, and what it looks like.

The camera is opened by the generated server alone, under its lock and the policy; a caller that wants a picture asks
it.
"""

import base64
import binascii
import json
from collections.abc import Sequence
from itertools import compress
from operator import mul
from pathlib import Path
from typing import Any, Literal

import octoform.endpoint
from octoform.base.files import parse
from octoform.diagnostics import Diagnostic, error
from octoform.endpoint.bounded_program import ForkServer, base_environment, run
from octoform.endpoint.client.check_verdict import UNIFORM_SPREAD
from octoform.endpoint.client.jsonrpc import ToolCall
from octoform.endpoint.client.sdk_client import recorded_environment
from octoform.endpoint.client.terminal import CallResult, Person, call
from octoform.records import dataclass, replace
from octoform.state.layout import Layout

# What a picture shows of its camera: whether it shows anything, is a new one, and differs from another.
#
# Pure functions on a few figures and a small grey thumbnail. Every pixel of the thumbnail is the mean of a hundred or
# more of the picture's, so noise is small in it, and what moved is not.

Complaint = Literal["black", "uniform"]
WIDTH, HEIGHT = 64, 48
THUMB_BYTES = WIDTH * HEIGHT
BLACK_MEAN = 16.0
"""The level of black in studio video (ITU-R BT.601: 16 of 255): what is darker on average has no light."""
BLACK_SPREAD = 6.0
"""A dark room with one lit lamp has more (1 % of the picture at 100 gives 10), noise of a covered sensor less."""
CHANGED = 3.0
"""A difference from which on something changed: 1 % of the picture by 30 levels. Noise of a camera gives below 1."""
GRAIN = 0.2
"""The part of all pixels with fine structure from which on a picture carries the noise of a sensor.

Drawn patterns, screens of text and bars of colour have less; a sensor's picture has more, also after a JPEG coder.
"""
FROZEN_PICTURES = 4
FROZEN_SECONDS = 5.0
"""So many pictures without a different pixel, over so long at least, prove that the source gives an old one again."""
_FIT_PART = 0.75
_GAINS = (0.5, 2.0)


@dataclass(frozen=True, slots=True)
class Picture:
    """Brightness of a picture (mean and standard deviation, 0..255) and ``thumb``: 48 rows of 64 grey bytes.

    ``pixels`` is a digest of all pixels at full size (empty: not known), ``grain`` the part of them, 0..1, that is off
    the line between its neighbours both across and down.
    """

    mean: float
    spread: float
    thumb: bytes
    pixels: str = ""
    grain: float = 0.0


def complaint(picture: Picture) -> Complaint | None:
    """``black`` or ``uniform`` for a picture that shows nothing, None for one that shows something."""
    if picture.mean < BLACK_MEAN and picture.spread < BLACK_SPREAD:
        return "black"
    return "uniform" if picture.spread < UNIFORM_SPREAD else None


def repeated(a: Picture, b: Picture) -> bool:
    """True when no pixel differs. That alone proves nothing: a drawn pattern or a screen has no noise."""
    return a.pixels == b.pixels != ""


def noisy(picture: Picture) -> bool:
    """True when the picture carries noise as a sensor's does, so that a later one of the same source must differ."""
    return picture.grain >= GRAIN


def frozen(picture: Picture, repeats: int, seconds: float) -> bool | None:
    """Whether the source stands still, when ``repeats`` pictures before this one, over ``seconds``, had its pixels.

    False for a picture with new pixels. None where it cannot be determined: too few pictures, too close together, or a
    source without noise, whose scene may just stand still.
    """
    if not repeats:
        return False
    proven = noisy(picture) and repeats + 1 >= FROZEN_PICTURES and seconds >= FROZEN_SECONDS
    return True if proven else None


def difference(a: Picture, b: Picture) -> float:
    """How far two pictures differ, in levels of 0..255 (root mean square over the thumbnails); 0.0 for the same.

    Light that grew or fell over the whole picture (a cloud, the camera's own exposure) is taken out first.
    """
    return round((_residual(a.thumb, b.thumb) + _residual(b.thumb, a.thumb)) / 2, 2)


def _residual(a: bytes, b: bytes) -> float:
    """The difference between ``b`` and ``a`` after the best adjustment of brightness."""
    gain, offset = _fit(a, b)
    # What moved must not pull the fit: it is made once more with the pixels that fit it best.
    gaps = [abs(new - gain * old - offset) for old, new in zip(a, b, strict=True)]
    limit = sorted(gaps)[int(len(gaps) * _FIT_PART)]
    near = [gap <= limit for gap in gaps]
    gain, offset = _fit(bytes(compress(a, near)), bytes(compress(b, near)))
    expected = [min(255.0, max(0.0, gain * level + offset)) for level in range(256)]
    squares = sum((new - expected[old]) ** 2 for old, new in zip(a, b, strict=True))
    return float((squares / len(b)) ** 0.5)


def _fit(a: bytes, b: bytes) -> tuple[float, float]:
    """Gain and offset of the least squares; the gain bounded, since a picture of something else is no brighter one."""
    count, sum_a, sum_b = len(a), sum(a), sum(b)
    variance = count * sum(map(mul, a, a)) - sum_a * sum_a
    together = count * sum(map(mul, a, b)) - sum_a * sum_b
    gain = min(_GAINS[1], max(_GAINS[0], together / variance)) if variance else 1.0
    return gain, (sum_b - gain * sum_a) / count


# The looks of pictures, measured by a program in the serving environment: nothing here can read a picture.
#
# The environment of a server that takes pictures has a library that can. The program opens what came from a device,
# so it is a process of its own, with a time limit.

SCRIPT = Path(octoform.endpoint.__file__).parent / "scripts" / "picture.py"
DECODE_SECONDS = 30.0


@dataclass(frozen=True, slots=True)
class Decoded:
    """A picture's size in pixels and what it looks like."""

    width: int
    height: int
    picture: Picture


def decode(layout: Layout, pictures: Sequence[bytes]) -> list[Decoded | None] | Diagnostic:
    """The measures of each picture, None for one that is broken or that no library there can read.

    PERCEPTION-NOT-DECODED when the program cannot be run or gives no answer. Its libraries are loaded once for all
    pictures of this process: a hardware test or a view of a camera looks into a dozen of them.
    """
    environment = recorded_environment(layout)
    if environment is None:
        return _failed("the serving environment is not there", "octoform apply builds it")
    try:
        return decode_with(environment.python, pictures, ForkServer.at(environment.python, "pictures"))
    except OSError as problem:
        return _not_started(environment.python, problem)


def decode_with(
    python: Path, pictures: Sequence[bytes], fork_server: ForkServer | None = None
) -> list[Decoded | None] | Diagnostic:
    """The same with a given interpreter."""
    task = json.dumps({"pictures": [base64.b64encode(data).decode() for data in pictures]})
    try:
        ended = run(
            [str(python), "-I", str(SCRIPT)],
            cwd=SCRIPT.parent,
            environment=base_environment(),
            timeout=DECODE_SECONDS,
            stdin=task,
            fork_server=fork_server,
        )
    except OSError as problem:
        return _not_started(python, problem)
    if ended.timed_out:
        return _failed(f"it took more than {DECODE_SECONDS:g} s", "the machine may be busy; look again")
    try:
        return [_decoded(item) for item in parse(ended.stdout)["pictures"]]
    except (ValueError, LookupError, TypeError):
        lines = ended.stderr.strip().splitlines()
        return _failed(lines[-1][:300] if lines else f"exit status {ended.status}", "octoform plan shows what is wrong")


def _decoded(item: dict[str, Any]) -> Decoded | None:
    if item["thumb"] is None:
        return None
    thumb = base64.b64decode(item["thumb"], validate=True)
    if len(thumb) != THUMB_BYTES:
        raise ValueError("a thumbnail of another size")
    figures = (float(item["mean"]), float(item["spread"]))
    seen = Picture(*figures, thumb, str(item["pixels"]), float(item["grain"]))
    return Decoded(int(item["width"]), int(item["height"]), seen)


def _not_started(python: Path, problem: OSError) -> Diagnostic:
    return _failed(f"{python} cannot be started: {problem.strerror}", "octoform plan shows what is wrong")


def _failed(reason: str, hint: str) -> Diagnostic:
    return error("PERCEPTION-NOT-DECODED", "the picture could not be looked into", detail=reason, hint=hint)


LOOK_SECONDS = 60.0
"""For one picture; the endpoint's policy mostly ends the call before."""


@dataclass(frozen=True, slots=True)
class Taken:
    """One picture: its bytes as the tool gave them, their media type, what they show, width and height in pixels."""

    data: bytes
    mime: str
    picture: Picture
    width: int
    height: int


def take(layout: Layout, view: ToolCall, person: Person | None = None) -> Taken | Diagnostic:
    """Take one picture with a call of a camera's tool; the endpoint is started if need be.

    The diagnostic shows why there is none: an ENDPOINT code where the call was not answered, PERCEPTION-TOOL-FAILED
    where the tool gave the reason, PERCEPTION-NO-PICTURE and PERCEPTION-BROKEN-PICTURE for its answer,
    PERCEPTION-NOT-DECODED where nothing can look into it.
    """
    tool = view.tool
    result, found = call(layout, replace(view, seconds=LOOK_SECONDS), person)
    if result is None:
        return found[0]
    media = picture_of(tool, result)
    if isinstance(media, Diagnostic):
        return media
    data, mime = media
    seen = decode(layout, [data])
    return seen if isinstance(seen, Diagnostic) else judged(tool, data, mime, seen[0])


def picture_of(tool: str, result: CallResult) -> tuple[bytes, str] | Diagnostic:
    """The first picture of a tool's answer and its media type."""
    if result.is_error:
        hint = "check that the camera is connected, free and permitted; octoform logs has the call"
        return error("PERCEPTION-TOOL-FAILED", f"{tool} took no picture", detail=result.message or None, hint=hint)
    block = next((item for item in result.content if item.get("type") == "image"), None)
    if block is None:
        kinds = ", ".join(sorted({str(item.get("type")) for item in result.content})) or "nothing"
        hint = "a camera's tool gives its picture as image content; octoform apply -replace serve writes it again"
        summary = f"the answer of {tool} holds no picture"
        return error("PERCEPTION-NO-PICTURE", summary, detail=f"it holds: {kinds}", hint=hint)
    try:
        data = base64.b64decode(str(block.get("data", "")), validate=True)
    except binascii.Error as fault:
        return _broken(tool, f"not base64: {fault}")
    return data, str(block.get("mimeType") or "application/octet-stream")


def judged(tool: str, data: bytes, mime: str, seen: Decoded | None) -> Taken | Diagnostic:
    """The picture with what it looks like, or that it can't be read."""
    if seen is None:
        return _broken(tool, f"{len(data)} bytes of {mime} that cannot be read as a picture")
    return Taken(data, mime, seen.picture, seen.width, seen.height)


def _broken(tool: str, reason: str) -> Diagnostic:
    hint = "take another one; if it stays so, octoform apply -replace serve writes the tool again"
    return error("PERCEPTION-BROKEN-PICTURE", f"the picture of {tool} is broken", detail=reason, hint=hint)
