"""Where the program of a harness is: the one that the manifest names, octoform's own pinned one, or the one on PATH.

``octoform install`` puts a tried version, with its own node where the machine's is missing or old, into a cache folder
of the user; nothing of it is written into a project. A program on PATH serves just as well where nothing was installed.
"""

import shutil
from collections.abc import Mapping
from pathlib import Path

from octoform.base.files import parse, read_plain
from octoform.records import dataclass

SETTING = "OCTOFORM_AGENTS"
RECORD = "installed.json"
RECORD_BYTES = 64 << 10


@dataclass(frozen=True, slots=True)
class Pin:
    """A program in the version that octoform was tried with.

    ``package`` is its npm package, ``binary`` the name of its command, ``node`` the oldest node it runs on (None: it
    needs none at run time). ``scripts``: its install scripts have to run, or it does not start.
    """

    package: str
    version: str
    binary: str
    node: tuple[int, int] | None
    scripts: bool = False


@dataclass(frozen=True, slots=True)
class Located:
    """How to start a program: the beginning of its argument list, folders to put before PATH, its version if known.

    ``source`` is ``manifest``, ``installed`` or ``path``.
    """

    argv: tuple[str, ...]
    source: str
    path: tuple[str, ...] = ()
    version: str | None = None


def folder(environ: Mapping[str, str]) -> Path:
    """Where programs are installed: OCTOFORM_AGENTS, else below the user's cache folder."""
    chosen = environ.get(SETTING)
    if chosen:
        return Path(chosen)
    cache = environ.get("XDG_CACHE_HOME") or str(Path(environ.get("HOME") or "~").expanduser() / ".cache")
    return Path(cache) / "octoform" / "agents"


def locate(pin: Pin, command: tuple[str, ...], environ: Mapping[str, str]) -> Located | None:
    """The program to use, or None when there is none; ``command`` is the manifest's own, already resolved."""
    if command:
        return Located(command, "manifest")
    home = folder(environ) / f"{pin.binary}-{pin.version}"
    record = _record(home)
    if record is not None:
        node = record.get("node")
        return Located(
            (str(home / "node_modules" / ".bin" / pin.binary),),
            "installed",
            (node,) if isinstance(node, str) else (),
            pin.version,
        )
    found = shutil.which(pin.binary, path=environ.get("PATH"))
    return Located((found,), "path") if found else None


def _record(home: Path) -> dict[str, object] | None:
    """``installed.json``, written last by the installation; ``node`` is the folder of the node to run it with."""
    try:
        value = parse(read_plain(home / RECORD, RECORD_BYTES) or b"")
    except ValueError:
        return None  # not installed, or not to its end
    return value if isinstance(value, dict) else None
