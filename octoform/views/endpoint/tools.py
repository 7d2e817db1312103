"""The live endpoint for a person and for a program: its tools, an answer."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from shutil import get_terminal_size
from typing import TYPE_CHECKING, Any

from octoform.base.escaping import escaped_json
from octoform.diagnostics import Diagnostic, to_json
from octoform.engine.tools import SavedAnswer
from octoform.views.format import problems
from octoform.views.format.console import Console
from octoform.views.format.values import escape, one_line

if TYPE_CHECKING:
    from octoform.engine.look import Look

_MAX_LENGTH = 20_000
"""Characters of a foreign text: enough for every description, and no flood."""


def tools(console: Console, listed: list[dict[str, Any]], *, as_json: bool) -> int:
    """Name, effect, description and parameters of each tool; wrapped on a terminal, whole in a pipe."""
    if as_json:
        _json(console, {"format": 1, "tools": listed})
        return 0
    if not listed:
        console.line("The endpoint has no tools: nothing here can be controlled or read through a standard interface.")
    for tool in listed:
        effect = tool.get("effect") or "?"
        colour = "green" if effect == "read" else "yellow"
        asks = ", a person approves each call" if tool.get("decision") == "confirm" else ""
        console.line(f"{console.paint(tool['name'], 'bold')}  {console.paint(f'{effect}{asks}', colour)}")
        console.wrapped("    ", one_line(tool.get("description") or "", _MAX_LENGTH), indent=4)
        for line in _parameters(tool["input_schema"]):
            console.wrapped("      ", line, indent=8)
    return 0


def _parameters(schema: dict[str, Any]) -> list[str]:
    required = set(schema.get("required", []))
    lines = []
    for name, given in schema.get("properties", {}).items():
        kind = " | ".join(str(value) for value in given["enum"]) if "enum" in given else _kind(given)
        low, high = given.get("minimum"), given.get("maximum")
        span = f" {'' if low is None else low}..{'' if high is None else high}" if (low, high) != (None, None) else ""
        default = "" if "default" not in given else f", default {json.dumps(given['default'])}"
        need = "required, " if name in required else ""
        lines.append(one_line(f"{name}: {need}{kind}{span}{default}", _MAX_LENGTH))
    return lines


def _kind(given: dict[str, Any]) -> str:
    if "anyOf" in given:
        return " or ".join(_kind(item) for item in given["anyOf"])
    return str(given.get("const", given.get("type", "any")))


def answer(console: Console, tool: str, found: SavedAnswer, *, as_json: bool) -> int:
    """The tool's result; exit code 1 when it is an error."""
    result = found.result
    failed = 1 if result.is_error else 0
    if as_json:
        content = [block for block in result.content if block.get("type") == "text"]
        document = {
            "format": 1,
            "tool": tool,
            "is_error": result.is_error,
            "structured": result.structured,
            "content": content,
            "files": [str(path) for path in found.files],
            "ms": result.ms,
        }
        _json(console, document)
        return failed
    if result.is_error:
        console.problem(f"{tool}: {escape(result.message)}")
        return failed
    if result.structured is not None:
        console.raw(escape(json.dumps(result.structured, ensure_ascii=False, indent=2)))
    else:
        for block in result.content:
            if block.get("type") == "text":
                console.raw(escape(block.get("text", "")))
    for path in found.files:
        console.line(f"saved {path}")
    return failed


def _json(console: Console, value: dict[str, Any]) -> None:
    console.raw(escaped_json(json.dumps(value, ensure_ascii=False, indent=2)))


# What a person sees and is asked while a call runs: on standard error, because standard output is the answer's.

PATIENCE_SECONDS = 1.0
"""A call that is done sooner needs no sign of life."""


class Attended:
    """The person at the terminal, if there is one; ``approved`` when they approved beforehand."""

    def __init__(self, console: Console, *, approved: bool, clock: Callable[[], float] = time.monotonic) -> None:
        self._console = console
        self._approved = approved
        self._clock = clock
        self._began = clock()
        self._width = 0

    def waiting(self) -> None:
        """Report a start that takes its time."""
        starting(self._console)

    def progress(self, done: float, total: float | None, message: str) -> None:
        """One moving line on a terminal, once the call has taken more than a second."""
        if not self._console.err.isatty() or self._clock() - self._began < PATIENCE_SECONDS:
            return
        text = f"{done:.12g}" if total is None else f"{done:.12g} of {total:.12g}"
        width = get_terminal_size((80, 24)).columns - 1
        self._draw(one_line(f"  {text}  {message}".rstrip(), width))

    def approves(self, tool: str, arguments: Mapping[str, Any], message: str) -> bool | None:
        """Show the call and ask; None where there is no terminal to ask at."""
        if self._approved:
            return True
        if sys.stdin is None or not sys.stdin.isatty() or not self._console.err.isatty():
            return None
        self.clear()
        lines = [f"{tool} wants an approval:"]
        lines += [f"  {name} = {json.dumps(value, ensure_ascii=False)}" for name, value in arguments.items()]
        lines += [f"  {line}" for line in message.splitlines()]
        self._console.problem("\n".join(escape(line).replace("\n", "\\n") for line in lines))
        self._console.err.write("Approve this one call? [y/N] ")
        self._console.err.flush()
        try:
            answer = sys.stdin.readline()
        except UnicodeDecodeError:
            answer = ""
        if not answer.endswith("\n"):
            self._console.problem("")
        self._began = self._clock()
        return answer.strip().lower() in ("y", "yes")

    def clear(self) -> None:
        """Take the moving line away."""
        if self._width:
            self._draw("")
            self._console.err.write("\r")
            self._console.err.flush()

    def _draw(self, text: str) -> None:
        # Overwritten with blanks, which every terminal understands.
        self._console.err.write("\r" + text.ljust(self._width))
        self._console.err.flush()
        self._width = len(text)


@contextmanager
def attended(console: Console, *, approved: bool) -> Iterator[Attended]:
    """The person for the time of one call; nothing is left on their terminal behind it."""
    person = Attended(console, approved=approved)
    try:
        yield person
    finally:
        person.clear()


def starting(console: Console) -> None:
    """The endpoint is being started, and that takes more than a second."""
    console.problem("octoform: the endpoint is not running; starting it ...")


# What a look through a camera showed, for a person and for a program: one line each.


def one(console: Console, look: Look, saved: Path | None, *, as_json: bool) -> int:
    """One look; exit code 0 for a picture that shows something, 1 for none, 2 for one that shows nothing."""
    if as_json:
        console.raw(escaped_json(json.dumps(_document(look, saved), ensure_ascii=False)))
    elif isinstance(look.outcome, Diagnostic):
        problems.show(console, [look.outcome, *look.found])
        console.line(f"{look.at}  {console.paint('no picture', 'red')}{_since(look)}")
    else:
        problems.show(console, look.found)
        console.line(_line(console, look))
        if saved is not None:
            console.line(f"saved {saved}")
    if isinstance(look.outcome, Diagnostic):
        return 1
    return 2 if look.problem else 0


def _line(console: Console, look: Look) -> str:
    taken = look.outcome
    frame = look.record.current if look.record else None
    if isinstance(taken, Diagnostic) or look.camera is None:
        raise ValueError("a look without a picture has no such line")
    parts = [
        look.at,
        one_line(look.camera.device, 60),
        f"{taken.width}x{taken.height}",
        f"mean {taken.picture.mean:.1f}",
        f"spread {taken.picture.spread:.1f}",
    ]
    if frame is not None and frame.difference is not None:
        parts.append(f"difference {frame.difference:.1f}")
    if look.problem:
        parts.append(console.paint(f"shows nothing: {look.problem}", "yellow"))
    return "  ".join(parts)


def _since(look: Look) -> str:
    """Since when there is none, where it is not the first time."""
    absent = look.record.absent if look.record else None
    return f" since {absent.since}" if absent and absent.since != look.at else ""


def _document(look: Look, saved: Path | None) -> dict[str, Any]:
    from octoform.perception.frames import words  # heavy, and only a look pays for it

    frame = look.record.current if look.record else None
    taken = look.outcome
    picture = None
    if not isinstance(taken, Diagnostic):
        picture = {
            "mime": taken.mime,
            "bytes": len(taken.data),
            "width": taken.width,
            "height": taken.height,
            "mean": taken.picture.mean,
            "spread": taken.picture.spread,
            "complaint": look.problem,
            "difference": frame.difference if frame else None,
        }
    return {
        "format": 1,
        "at": look.at,
        "camera": look.camera.model_dump() if look.camera else None,
        "picture": picture,
        "problem": to_json(taken) if isinstance(taken, Diagnostic) else None,
        "file": str(saved) if saved else None,
        "summary": words(look.record).splitlines() if look.record else None,
        "diagnostics": [to_json(problems.near(item)) for item in look.found],
    }
