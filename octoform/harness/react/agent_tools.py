"""The agent's tools as the model sees them, and the way from a call that it wrote to what really happens.

A call can be wrong in every way: no such tool, arguments that are no JSON, missing or of another type. All of that is
an answer to the model, which then does better or ends by the bound on such calls.
"""

import json
import os
import selectors
import shutil
import signal
import stat
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache, partial
from pathlib import Path, PurePosixPath
from typing import Any

from octoform.base.escaping import escaped
from octoform.base.files import parse, replace_in
from octoform.base.processes import signal_group
from octoform.harness.llm.client import Call
from octoform.harness.react.chat_history import ARGUMENT_BYTES, KEPT, HeadAndTail, parsed
from octoform.records import dataclass
from octoform.redaction import redacted

# The tool ``shell``: one command in a process group of its own, bounded in time and output.
#
# What it leaves in the background may go on, a server under test for example; the end of the run ends it.

OUTPUT_BYTES = 24 << 10
PIECE_BYTES = 64 << 10
STEP_SECONDS = 0.02
GRACE_SECONDS = 1.0


@dataclass(frozen=True, slots=True)
class ToolResult:
    """The result of a tool for the model; ``failed`` when it did not do what was asked."""

    text: str
    failed: bool = False


@dataclass(frozen=True, slots=True)
class Shell:
    """Runs commands in ``workdir`` with that environment; seconds when nothing is stated, and at most."""

    workdir: Path
    environment: Mapping[str, str]
    seconds: int
    most_seconds: int

    def run(self, command: str, timeout_seconds: int | None = None) -> ToolResult:
        """Run it; a command that takes longer is ended with its whole group."""
        limit = min(self.most_seconds, max(1, timeout_seconds or self.seconds))
        program = shutil.which("bash", path=self.environment.get("PATH")) or "/bin/sh"
        try:
            process = subprocess.Popen(
                [program, "-c", command],
                cwd=self.workdir,
                env=dict(self.environment),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        except (OSError, ValueError) as problem:
            return ToolResult(f"the command could not be started: {problem}", failed=True)
        kept = HeadAndTail(OUTPUT_BYTES)
        with process:
            ended = _follow(process, kept, limit)
            # The pipe may stay open in what runs on in the background; no one reads it any more.
        return _shell_result(kept.text(), process.returncode, None if ended else limit)


def _follow(process: subprocess.Popen[bytes], kept: HeadAndTail, seconds: float) -> bool:
    """Read until the command has ended; False when it had to be ended."""
    assert process.stdout is not None
    descriptor = process.stdout.fileno()
    os.set_blocking(descriptor, False)
    deadline = time.monotonic() + seconds
    with selectors.DefaultSelector() as selector:
        selector.register(descriptor, selectors.EVENT_READ)
        while process.poll() is None and time.monotonic() < deadline:
            if selector.get_map() and selector.select(STEP_SECONDS):
                if not _read(descriptor, kept):
                    selector.unregister(descriptor)
            elif not selector.get_map():
                with suppress(subprocess.TimeoutExpired):
                    process.wait(deadline - time.monotonic())
    ended = process.poll() is not None
    if not ended:
        _end(process)
    rounds = 64
    while rounds and _read(descriptor, kept):
        rounds -= 1
    return ended


def _read(descriptor: int, kept: HeadAndTail) -> bool:
    """Take one piece; False when there is none now, or never again."""
    try:
        data = os.read(descriptor, PIECE_BYTES)
    except BlockingIOError:
        return False
    kept.feed(data)
    return bool(data)


def _end(process: subprocess.Popen[bytes]) -> None:
    """Ask the command's group to end, and kill it when it does not."""
    for number, patience in ((signal.SIGTERM, GRACE_SECONDS), (signal.SIGKILL, None)):
        signal_group(process, number)
        with suppress(subprocess.TimeoutExpired):
            process.wait(patience)
            return


def _shell_result(output: str, status: int, limit: float | None) -> ToolResult:
    output = output.rstrip("\n")
    if limit is not None:
        return ToolResult(f"{output}\n[ended after {limit:g} seconds, its limit]".lstrip("\n"), failed=True)
    if status:
        how = f"exit status {status}" if status > 0 else f"ended by signal {-status}"
        return ToolResult(f"{output}\n[{how}]".lstrip("\n"), failed=True)
    return ToolResult(output or "[no output, exit status 0]")


# The file tools: bounded reading of plain files, and writing that cannot leave the attempt's folder.
#
# Reading may go anywhere, as the shell can, but opens no device: opening alone already acts on some of them. Writing
# walks down from the folder without following a link, and puts a whole file in place or none.

READ_BYTES = 24 << 10
SEARCHED_BYTES = 32 << 20
PATCHED_BYTES = 4 << 20
FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC
PLAIN = os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC


class FileToolRefused(ValueError):
    """A file tool refuses a call; the text is for the model."""


def read_file(workdir: Path, path: str, offset: int = 1, limit: int | None = None) -> ToolResult:
    """Lines of a plain file from line ``offset`` on, at most `READ_BYTES` of them."""
    target = workdir / path
    try:
        if not stat.S_ISREG(target.stat().st_mode):
            return ToolResult(f"{path} is no plain file", failed=True)
        with os.fdopen(os.open(target, PLAIN), "rb") as stream:
            if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
                return ToolResult(f"{path} is no plain file", failed=True)
            lines = _lines(stream.read(SEARCHED_BYTES) or b"")
    except (OSError, ValueError) as problem:
        return ToolResult(f"{path} cannot be read: {_why(problem)}", failed=True)
    first = max(1, offset)
    wanted = lines[first - 1 :] if limit is None else lines[first - 1 : first - 1 + max(0, limit)]
    return ToolResult(_part(wanted, first, len(lines)))


def _lines(data: bytes) -> list[bytes]:
    return data.splitlines(keepends=True)


def _part(wanted: Sequence[bytes], first: int, count: int) -> str:
    shown: list[bytes] = []
    room, taken = READ_BYTES, 0
    for line in wanted:
        if len(line) > room and shown:
            break
        shown.append(line[:room])
        room -= len(shown[-1])
        taken += 1
        if len(shown[-1]) < len(line):
            break
    text = escaped(b"".join(shown).decode("utf-8", "replace"), KEPT)
    last = first + taken - 1
    if not count:
        return "[the file is empty]"
    if not taken:
        return f"[nothing there: the file has {count} lines]"
    cut = len(shown[-1]) < len(wanted[taken - 1])
    if first == 1 and last == count and not cut:
        return text
    return f"{text.rstrip()}\n[lines {first} to {last} of {count}{', the last one cut' if cut else ''}]"


def write_file(workdir: Path, path: str, content: str) -> ToolResult:
    """Put a text file below the folder in place."""
    data = content.encode("utf-8", "replace")
    try:
        with _parent(workdir, path, make=True) as (folder, name):
            replace_in(folder, name, data, _mode(folder, name))
    except FileToolRefused as problem:
        return ToolResult(str(problem), failed=True)
    except (OSError, ValueError) as problem:
        return ToolResult(f"{path} cannot be written: {_why(problem)}", failed=True)
    return ToolResult(f"{len(data)} bytes written to {path}")


def patch(workdir: Path, path: str, edits: Sequence[Mapping[str, str]]) -> ToolResult:
    """Replace each ``old``, which must be there exactly once, by its ``new``; all or none."""
    if not edits:
        return ToolResult("edits is empty: nothing was changed", failed=True)
    try:
        with _parent(workdir, path, make=False) as (folder, name):
            text = _text(folder, name, path)
            for number, edit in enumerate(edits, 1):
                text = _edited(text, edit["old"], edit["new"], f"edit {number} of {len(edits)}")
            replace_in(folder, name, text.encode("utf-8"), _mode(folder, name))
    except FileToolRefused as problem:
        return ToolResult(f"{problem}; nothing was changed", failed=True)
    except (OSError, ValueError) as problem:
        return ToolResult(f"{path} cannot be changed: {_why(problem)}", failed=True)
    return ToolResult(f"{len(edits)} replacement(s) made in {path}")


def _edited(text: str, old: str, new: str, which: str) -> str:
    if not old:
        raise FileToolRefused(f"{which}: old is empty")
    found = text.count(old)
    if found != 1:
        what = "is not in the file" if not found else f"is in the file {found} times"
        more = "read the file and copy the text exactly" if not found else "add the lines around the one you mean"
        raise FileToolRefused(f"{which}: old {what}; {more}")
    return text.replace(old, new)


def _text(folder: int, name: str, path: str) -> str:
    descriptor = os.open(name, PLAIN | os.O_NOFOLLOW, dir_fd=folder)
    with os.fdopen(descriptor, "rb") as stream:
        if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
            raise FileToolRefused(f"{path} is no plain file")
        data = stream.read(PATCHED_BYTES + 1)
    if len(data) > PATCHED_BYTES:
        raise FileToolRefused(f"{path} has more than {PATCHED_BYTES} bytes")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as problem:
        raise FileToolRefused(f"{path} is not UTF-8 text") from problem


def _mode(folder: int, name: str) -> int:
    """The permissions that the file has or gets; FileToolRefused when no plain file is in its place."""
    try:
        facts = os.stat(name, dir_fd=folder, follow_symlinks=False)
    except FileNotFoundError:
        return 0o644
    if not stat.S_ISREG(facts.st_mode):
        raise FileToolRefused(f"{name} is there and is no plain file")
    return stat.S_IMODE(facts.st_mode)


@contextmanager
def _parent(workdir: Path, path: str, *, make: bool) -> Iterator[tuple[int, str]]:
    """The open folder of a file below ``workdir`` and the file's name; no link on the way is followed."""
    *above, name = _steps(workdir, path)
    opened = [os.open(workdir, FOLDER)]
    try:
        for step in above:
            if make:
                # The open below fails if what is already there is no folder.
                with suppress(FileExistsError):
                    os.mkdir(step, 0o755, dir_fd=opened[-1])
            opened.append(os.open(step, FOLDER, dir_fd=opened[-1]))
        yield opened[-1], name
    finally:
        for descriptor in opened:
            os.close(descriptor)


def _steps(workdir: Path, path: str) -> list[str]:
    """The names from ``workdir`` down to the file; FileToolRefused for what lies elsewhere."""
    pure = PurePosixPath(os.path.normpath(workdir / path))
    try:
        steps = list(pure.relative_to(os.path.normpath(workdir)).parts)
    except ValueError:
        steps = []
    if not steps:
        raise FileToolRefused(f"{path} is not below your folder {workdir}")
    return steps


def _why(problem: Exception) -> str:
    return problem.strerror or str(problem) if isinstance(problem, OSError) else str(problem)


DECLARED = Path(__file__).with_name("tools.json")
TYPES: Mapping[str, type] = {"string": str, "integer": int, "array": list, "object": dict}
QUOTED = 200


@cache
def declared() -> tuple[dict[str, Any], ...]:
    """The tools in the form in which a model is notified of them."""
    return tuple(parse(DECLARED.read_text(encoding="utf-8")))


@dataclass(frozen=True, slots=True)
class Ready:
    """A call that can be made; ``text`` states for what, in one argument of it."""

    tool: str
    arguments: Mapping[str, Any]

    @property
    def text(self) -> str:
        """The subject of the call."""
        return str(self.arguments.get("command") or self.arguments.get("path") or "")


def checked(call: Call) -> Ready | str:
    """The call, or what is wrong with it, for the model."""
    schema = {item["function"]["name"]: item["function"]["parameters"] for item in declared()}.get(call.name)
    if schema is None:
        names = ", ".join(item["function"]["name"] for item in declared())
        return f"there is no tool {call.name[:QUOTED]!r}; the tools are {names}"
    if len(call.arguments.encode("utf-8", "replace")) > ARGUMENT_BYTES:
        return f"the arguments have more than {ARGUMENT_BYTES} bytes; do it in smaller parts"
    arguments = parsed(call.arguments)
    if arguments is None:
        return f"the arguments are no JSON object: {call.arguments[:QUOTED]!r}"
    problem = _mismatch(schema, arguments, "")
    return (
        f"{problem}; {call.name} takes {json.dumps(schema['properties'])}" if problem else Ready(call.name, arguments)
    )


def _mismatch(schema: Mapping[str, Any], value: Any, at: str) -> str | None:
    """The mismatch with the schema (of the few forms that are in tools.json), or None."""
    if not isinstance(value, TYPES[schema["type"]]) or isinstance(value, bool):
        return f"{at or 'the value'} is no {schema['type']}"
    if isinstance(value, list):
        found = (_mismatch(schema["items"], item, f"{at}[{place}]") for place, item in enumerate(value))
        return next((item for item in found if item), None)
    if not isinstance(value, dict):
        return None
    for name in schema["required"]:
        if value.get(name) is None:
            return f"{at + '.' if at else ''}{name} is missing"
    known = ((name, value[name]) for name in schema["properties"] if value.get(name) is not None)
    found = (_mismatch(schema["properties"][name], item, f"{at + '.' if at else ''}{name}") for name, item in known)
    return next((item for item in found if item), None)


@dataclass(frozen=True, slots=True)
class Toolbox:
    """The tools at work in one attempt's folder; ``secrets`` are values, by name, that reach no model."""

    workdir: Path
    shell: Shell
    secrets: Mapping[str, str]

    def use(self, ready: Ready) -> ToolResult:
        """Make a call that was checked."""
        known = next(item for item in declared() if item["function"]["name"] == ready.tool)["function"]["parameters"]
        arguments = {
            name: value for name, value in ready.arguments.items() if name in known["properties"] and value is not None
        }
        runs: Mapping[str, Callable[..., ToolResult]] = {
            "shell": self.shell.run,
            "read_file": partial(read_file, self.workdir),
            "write_file": partial(write_file, self.workdir),
            "patch": partial(patch, self.workdir),
        }
        found = runs[ready.tool](**arguments)
        return ToolResult(redacted(found.text, self.secrets), found.failed)
