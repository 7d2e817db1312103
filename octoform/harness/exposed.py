"""What of the hidden places a program needs to run: itself, its interpreter, their libraries, what it is told to read.

Programs are installed below homes all the time: in octoform's own cache, by version managers, in virtual environments.
A folder of programs is shown with the libraries beside it and nothing else of the home that it lies in.
"""

import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import octoform
from octoform.base.files import head

BESIDE = ("lib", "lib64", "libexec")
MODULES = "node_modules"
ENVIRONMENT = "pyvenv.cfg"
SHIMS = "shims"
FIRST_LINE = 4096


def belongings(argv: Sequence[str], variables: Mapping[str, str]) -> Iterator[Path]:
    """The paths that a command and its variables speak of, and what belongs to the programs among them."""
    yield from (Path(sys.prefix), Path(sys.base_prefix), Path(octoform.__file__).parent)
    yield from _program(Path(argv[0]))
    for item in argv[1:]:
        path = Path(item)
        if path.is_absolute() and path.exists():
            # A script brings its neighbours along.
            yield from (path, path if path.is_dir() else path.parent)
    for folder in variables.get("PATH", "").split(os.pathsep):
        if Path(folder).is_absolute():
            yield from _folder(Path(folder))
    for name, value in variables.items():
        if name not in ("PATH", "HOME", "TMPDIR") and value.startswith("/") and "\0" not in value:
            yield Path(value)


def _program(path: Path) -> Iterator[Path]:
    """A program, what its links lead to, and the interpreter in its first line."""
    for place in dict.fromkeys((path, path.resolve())):
        yield place
        yield from _folder(place.parent)
        if MODULES in place.parts:
            yield Path(*place.parts[: place.parts.index(MODULES) + 1])
    interpreter = _interpreter(path)
    if interpreter is not None:
        for place in dict.fromkeys((interpreter, interpreter.resolve())):
            yield from _folder(place.parent)


def _folder(folder: Path) -> Iterator[Path]:
    """A folder of programs with the libraries beside it; the whole of a virtual environment."""
    yield folder
    above = folder.parent
    if folder.name == SHIMS or (above / ENVIRONMENT).is_file():
        yield above
        python = (folder / "python").resolve()
        yield from (python.parent, *(python.parent.parent / name for name in BESIDE))
    elif folder.name in ("bin", "sbin"):
        yield from (above / name for name in BESIDE)


def _interpreter(path: Path) -> Path | None:
    try:
        line = head(path, FIRST_LINE, follow=True).partition(b"\n")[0]
    except OSError:
        return None
    words = line[2:].split() if line.startswith(b"#!") else []
    found = Path(os.fsdecode(words[0])) if words else None
    return found if found is not None and found.is_absolute() else None
