"""Asks the package tool (uv) for versions that agree, for this interpreter, in bounded time.

The package cache is asked first and the index second: a host without a network still gets an answer, and one with
both gets the versions that the environment is then built from. The agent's own home folder is a fresh one, so the
tool is pointed at the cache and the configuration of the user that it really runs as.
"""

import contextlib
import errno
import os
import pwd
import re
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from uv import find_uv_bin

from octoform.base import shortage

TOTAL_SECONDS = 90.0
_PINNED = re.compile(r"^([A-Za-z0-9][A-Za-z0-9._-]*)==([^\s;]+)", re.MULTILINE)
_CREDENTIALS = re.compile(r"(://)[^/@\s]+@")
_REASON_CHARS = 400


@dataclass(frozen=True, slots=True)
class Resolution:
    """Normalised name to exact version of the whole closure, or why there is none."""

    versions: Mapping[str, str]
    reason: str | None


class Resolver:
    """Resolves several sets of requirements within one bound of time."""

    def __init__(self, seconds: float = TOTAL_SECONDS) -> None:
        """``seconds`` bounds all calls together."""
        self._end = time.monotonic() + seconds

    def resolve(self, requirements: Sequence[str]) -> Resolution:
        """Versions for these requirements; BlockingIOError where the package tool gets no thread."""
        text = "\n".join(sorted(requirements)) + "\n"
        reason = ""
        for extra in (["--offline"], []):
            try:
                done = subprocess.run(
                    [find_uv_bin(), *_ARGUMENTS, "--python", sys.executable, *extra, "-"],
                    input=text,
                    capture_output=True,
                    text=True,
                    errors="replace",
                    timeout=max(self._end - time.monotonic(), 0.1),
                    env=_environment(),
                    check=False,
                )
            except FileNotFoundError:
                return Resolution({}, "the package tool uv is not installed beside this agent")
            except subprocess.TimeoutExpired:
                return Resolution({}, f"no set of versions was found in time; {reason}".rstrip("; "))
            if done.returncode == 0:
                return Resolution({name.lower(): version for name, version in _PINNED.findall(done.stdout)}, None)
            if shortage.printed(done.stderr):
                raise BlockingIOError(errno.EAGAIN, shortage.TEXT)
            reason = _reason(done.stderr)
        return Resolution({}, reason)


_ARGUMENTS = ("pip", "compile", "--quiet", "--no-header", "--no-annotate", "--no-emit-index-url", "--color", "never")


def _environment() -> dict[str, str]:
    """This process's variables with the home folder of the account, where cache and configuration are."""
    found = dict(os.environ)
    # A user id without an account, as containers have them, keeps the home that this process was given.
    with contextlib.suppress(KeyError):
        home = Path(pwd.getpwuid(os.getuid()).pw_dir)
        if home.is_dir():
            found["HOME"] = str(home)
    # The certificates of the system, which a host behind an inspecting proxy has been given.
    for name in ("UV_SYSTEM_CERTS", "UV_NATIVE_TLS"):  # its name today, and before
        found.setdefault(name, "true")
    return found


def _reason(stderr: str) -> str:
    """The tool's own words on one line, bounded and without credentials."""
    text = " ".join(_CREDENTIALS.sub(r"\1***@", stderr).split())
    return text[:_REASON_CHARS] or "the package tool gave no reason"
