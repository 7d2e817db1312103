"""Asks a tool that the system already has, with fixed arguments and within bounds, where no file has the same facts.

Nothing is installed and no shell is involved. A tool gets an environment of two variables, no input and a process
group of its own, which is killed when its time or its space is over: a tool that hangs costs seconds.

On a recorded host nothing is started, since a tool would report the wrong machine. Its output is read from
``recorded/commands/<record>`` below the root instead: what the tool wrote to standard output, byte for byte; no such
file means that the host has no such tool.
"""

import errno
import os
import selectors
import shutil
import subprocess
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from octoform.base.processes import signal_group
from octoform.builtin.probe.reader import Reader
from octoform.records import dataclass

RECORDED = "/recorded/commands"
MAX_BYTES = 8 << 20
MARGIN = 0.8
"""The part of a scan's time that its tool gets: the rest is for ending it, so that the scan itself ends in time."""
MAX_SECONDS = 10.0
_SYSTEM_FOLDERS = ("/usr/bin", "/bin", "/usr/sbin", "/sbin")
_CHUNK = 1 << 16


@dataclass(frozen=True, slots=True)
class Command:
    """A program with fixed arguments; ``record`` names the file of its recorded output, ``folders`` more places."""

    record: str
    words: tuple[str, ...]
    folders: tuple[str, ...] = ()


def output(command: Command, reader: Reader, most: int = MAX_BYTES) -> str:
    """The tool's output as text; OSError, worded as a scan's status, when it fails.

    FileNotFoundError: the host has no such tool. TimeoutError: it did not end in time. Another OSError: it failed,
    or it printed more than ``most`` bytes.
    """
    data = _recorded(command, reader, most) if reader.root else _run(command, _time_left(reader), most)
    reader.still_wanted()
    return data.decode("utf-8", "replace").removeprefix("\ufeff")


def _recorded(command: Command, reader: Reader, most: int) -> bytes:
    if command.record not in reader.names_or_none(RECORDED):
        raise FileNotFoundError(errno.ENOENT, "no such tool")
    data = reader.data(f"{RECORDED}/{command.record}", most + 1)
    if data is None:
        raise OSError(errno.EIO, "the recorded output cannot be read")
    return _bounded(data, most)


def _run(command: Command, seconds: float, most: int) -> bytes:
    program = _found(command)
    process = subprocess.Popen(
        [program, *command.words[1:]],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={"PATH": os.pathsep.join(_folders(command)), "LC_ALL": "C", **_bridge()},
        cwd="/",
        process_group=0,
    )
    ends = time.monotonic() + seconds
    try:
        data = _bounded(_read(process, ends, most), most)
        status = process.wait(max(0.0, ends - time.monotonic()))
    except subprocess.TimeoutExpired as problem:
        raise TimeoutError(errno.ETIMEDOUT, "no answer in time") from problem
    finally:
        _end(process)
    if status:
        raise OSError(errno.EIO, f"ended with status {status}")
    return data


def _read(process: subprocess.Popen[bytes], ends: float, most: int) -> bytes:
    """Up to ``most + 1`` bytes of what it prints; TimeoutExpired when it goes on for longer."""
    assert process.stdout is not None
    parts: list[bytes] = []
    size = 0
    with selectors.DefaultSelector() as selector:
        selector.register(process.stdout, selectors.EVENT_READ)
        while size <= most:
            left = ends - time.monotonic()
            if left <= 0 or not selector.select(left):
                raise subprocess.TimeoutExpired(process.args, left)
            part = os.read(process.stdout.fileno(), _CHUNK)
            if not part:
                break
            parts.append(part)
            size += len(part)
    return b"".join(parts)


def _end(process: subprocess.Popen[bytes]) -> None:
    """Kill what is left of the tool's process group, and close the pipe."""
    if process.returncode is None:
        signal_group(process)
        process.wait()
    if process.stdout is not None:
        process.stdout.close()


def _bounded(data: bytes, most: int) -> bytes:
    if len(data) > most:
        raise OSError(errno.EFBIG, f"printed more than {most} bytes")
    return data


def _found(command: Command) -> str:
    program = shutil.which(command.words[0], path=os.pathsep.join(_folders(command)))
    if program is None:
        raise FileNotFoundError(errno.ENOENT, "no such tool")
    return program


def _folders(command: Command) -> Sequence[str]:
    """Where programs are looked for: absolute folders only, for the current one may hold anything."""
    named = os.environ.get("PATH", os.defpath).split(os.pathsep)
    places = dict.fromkeys((*named, *_SYSTEM_FOLDERS, *command.folders))
    return [place for place in places if Path(place).is_absolute()]


def _bridge() -> dict[str, str]:
    """The environment for a program of the Windows side, started from a WSL2 kernel."""
    return {name: os.environ[name] for name in ("WSL_INTEROP",) if name in os.environ}


def _time_left(reader: Reader) -> float:
    return min(MAX_SECONDS, MARGIN * max(0.0, reader.ends - time.monotonic()))


# Reads what tools report as objects whose members may be missing, empty or of another type than expected.

Entry = dict[str, Any]
_NOTHING = frozenset(("", "not provided", "unknown", "n/a", "none"))


def number(entry: Entry, *keys: str) -> int | None:
    """The first integer under one of the keys."""
    for key in keys:
        value = entry.get(key)
        if isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 1 << 64:
            return value
    return None


def first_text(entry: Entry, *keys: str) -> str:
    """The first text (or number, as text) under one of the keys; empty where the system has nothing to say."""
    for key in keys:
        value = entry.get(key)
        if isinstance(value, str) and value.strip().lower() not in _NOTHING:
            return value.strip()
        if isinstance(value, int | float) and not isinstance(value, bool):
            return str(value)
    return ""


def dicts(value: Any) -> Iterator[Entry]:
    """The objects in a list; none where there is no list."""
    yield from (item for item in value if isinstance(item, dict)) if isinstance(value, list) else ()
