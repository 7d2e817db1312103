"""One picture through the live endpoint, as any client would take it, and what it looks like.

The camera is opened by the generated server alone, under its lock and the policy; whoever wants to see asks it.
"""

import base64
import binascii
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import octoform.endpoint
from octoform.base.files import parse
from octoform.diagnostics import Diagnostic, error
from octoform.endpoint.bounded_program import base_environment, run
from octoform.endpoint.client.sdk_client import recorded_environment
from octoform.endpoint.client.terminal import CallResult, Person, Wanted, call
from octoform.perception.image_quality import THUMB_BYTES, Picture
from octoform.state.layout import Layout

# What pictures look like, told by a program in the serving environment: nothing here can read a picture.
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
    """What each picture looks like, None for one that is broken or that no library there can read.

    PERCEPTION-NOT-DECODED when the program cannot be run or gives no answer.
    """
    environment = recorded_environment(layout)
    if environment is None:
        return _failed("the serving environment is not there", "octoform apply builds it")
    return decode_with(environment.python, pictures)


def decode_with(python: Path, pictures: Sequence[bytes]) -> list[Decoded | None] | Diagnostic:
    """The same with a given interpreter."""
    task = json.dumps({"pictures": [base64.b64encode(data).decode() for data in pictures]})
    try:
        ended = run(
            [str(python), "-I", str(SCRIPT)],
            cwd=SCRIPT.parent,
            environment=base_environment(),
            timeout=DECODE_SECONDS,
            stdin=task,
        )
    except OSError as problem:
        return _failed(f"{python} cannot be started: {problem.strerror}", "octoform plan shows what is wrong")
    if ended.timed_out:
        return _failed(f"it took more than {DECODE_SECONDS:g} s", "the machine may be busy; look again")
    try:
        return [_decoded(item) for item in parse(ended.stdout)["pictures"]]
    except (ValueError, LookupError, TypeError):
        said = ended.stderr.strip().splitlines()
        return _failed(said[-1][:300] if said else f"exit status {ended.status}", "octoform plan shows what is wrong")


def _decoded(item: dict[str, Any]) -> Decoded | None:
    if item["thumb"] is None:
        return None
    thumb = base64.b64decode(item["thumb"], validate=True)
    if len(thumb) != THUMB_BYTES:
        raise ValueError("a thumbnail of another size")
    figures = (float(item["mean"]), float(item["spread"]))
    seen = Picture(*figures, thumb, str(item["pixels"]), float(item["grain"]))
    return Decoded(int(item["width"]), int(item["height"]), seen)


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


def take(layout: Layout, view: Mapping[str, Any], person: Person | None = None) -> Taken | Diagnostic:
    """Take one picture with the tool of ``view`` (``{"tool", "arguments"}``); the endpoint is started if need be.

    The diagnostic tells why there is none: an ENDPOINT code where the call was not answered, PERCEPTION-TOOL-FAILED
    where the tool said why, PERCEPTION-NO-PICTURE and PERCEPTION-BROKEN-PICTURE for its answer,
    PERCEPTION-NOT-DECODED where nothing can look into it.
    """
    tool = str(view["tool"])
    result, found = call(layout, Wanted(tool, dict(view.get("arguments") or {}), seconds=LOOK_SECONDS), person)
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
