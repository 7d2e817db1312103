"""The command that starts octoform again, for files that outlive this run.

A program that was fetched for one run (`uvx`, `pipx run`) lives in a cache, which is cleaned: a client's file with that
path works today and not next week. Light.
"""

import os
import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

NAME = "octoform"
_UV_FOLDER = re.compile(r"(archive|environments|builds)-v\d+")
_PIPX_CACHES = (".cache/pipx", ".local/pipx/.cache", ".local/share/pipx/.cache", "Library/Caches/pipx")


def lasting_command(words: Sequence[str], environ: Mapping[str, str]) -> list[str] | None:
    """The command line that runs octoform with ``words`` later as well.

    This interpreter where it stays; else an octoform of the PATH that does; None where there is none.
    """
    if stays(environ):
        return [sys.executable, "-I", "-m", "octoform.cli", *words]
    for folder in map(Path, environ.get("PATH", "").split(os.pathsep)):
        program = folder / NAME
        if folder.is_absolute() and os.access(program, os.X_OK) and not _of_a_cache(program, environ):
            return [str(program), *words]
    return None


def stays(environ: Mapping[str, str]) -> bool:
    """Whether this octoform is there for later runs too, and does not lie in a cache for one run."""
    return not _of_a_cache(Path(sys.prefix), environ)


def _of_a_cache(path: Path, environ: Mapping[str, str]) -> bool:
    """Whether the path, or what it leads to, lies where uv or pipx keeps what is needed for one run."""
    home = Path(environ.get("HOME") or Path.home())
    caches = [home / name for name in _PIPX_CACHES]
    caches += [Path(environ[name]) for name in ("UV_CACHE_DIR",) if environ.get(name)]
    caches += [Path(environ["PIPX_HOME"]) / ".cache"] if environ.get("PIPX_HOME") else []
    seen = (path.absolute(), path.resolve())
    return any(
        any(_UV_FOLDER.fullmatch(part) for part in each.parts) or any(each.is_relative_to(cache) for cache in caches)
        for each in seen
    )
