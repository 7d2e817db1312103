"""What pictures look like, told by a program in the serving environment: nothing here can read a picture.

The environment of a server that takes pictures has a library that can. The program opens what came from a device,
so it is a process of its own, with a time limit.
"""

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import octoform.endpoint
from octoform.base.files import parse
from octoform.diagnostics import Diagnostic, error
from octoform.endpoint.bounded_program import base_environment, run
from octoform.endpoint.client.sdk_client import recorded_environment
from octoform.perception.image_quality import THUMB_BYTES, Picture
from octoform.state.layout import Layout

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
        return _failed(f"{python} cannot be started: {problem.strerror}", "octoform plan tells what is amiss")
    if ended.timed_out:
        return _failed(f"it took more than {DECODE_SECONDS:g} s", "the machine may be busy; look again")
    try:
        return [_decoded(item) for item in parse(ended.stdout)["pictures"]]
    except (ValueError, LookupError, TypeError):
        said = ended.stderr.strip().splitlines()
        return _failed(said[-1][:300] if said else f"exit status {ended.status}", "octoform plan tells what is amiss")


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
