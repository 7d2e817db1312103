"""The ways in which a file is damaged: cut off, other bytes, other types, nested, and something else in its place."""

import json
import os
import random
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from session_folders import session_folder

_JSON: tuple[Any, ...] = (None, True, -1, 1e308, "", "a\0b", "\ud800", [], {}, [[]], {"": {}}, "../../etc/passwd")


def truncate(path: Path, data: bytes, chance: random.Random) -> None:
    """Cut off anywhere, also to nothing."""
    path.write_bytes(data[: chance.randrange(len(data) + 1) if chance.random() < 0.8 else 0])


def flip(path: Path, data: bytes, chance: random.Random) -> None:
    """A few bytes are others."""
    spoilt = bytearray(data or b"x")
    for _ in range(chance.randint(1, 8)):
        spoilt[chance.randrange(len(spoilt))] = chance.randrange(256)
    path.write_bytes(bytes(spoilt))


def swap(path: Path, data: bytes, chance: random.Random) -> None:
    """One value of a JSON document is of another type; another file becomes such a value."""
    try:
        document = json.loads(data)
    except ValueError:
        document = None
    places = list(_places(document))
    if places:
        holder, key = chance.choice(places)
        holder[key] = chance.choice(_JSON)
    else:
        document = chance.choice(_JSON)
    path.write_text(json.dumps(document), encoding="utf-8")


def nest(path: Path, data: bytes, chance: random.Random) -> None:
    """Brackets without end, alone or in the place of a value."""
    if chance.random() < 0.5:
        path.write_bytes(b"[" * 200_000)
        return
    try:
        document = json.loads(data)
    except ValueError:
        document = {}
    places = list(_places(document))
    if places:
        holder, key = chance.choice(places)
        holder[key] = "@@"
    deep = "[" * 900 + "]" * 900
    path.write_text(json.dumps(document).replace('"@@"', deep, 1), encoding="utf-8")


def pipe(path: Path, data: bytes, chance: random.Random) -> None:
    """A pipe without a writer."""
    path.unlink()
    os.mkfifo(path)


def link(path: Path, data: bytes, chance: random.Random) -> None:
    """A link to nothing, to itself, to a device, or to the same bytes elsewhere."""
    path.unlink()
    target = chance.choice(["nothing", path.name, "/dev/zero", "same"])
    if target == "same":
        elsewhere = session_folder("elsewhere") / path.name
        elsewhere.write_bytes(data)
        target = str(elsewhere)
    path.symlink_to(target)


def folder(path: Path, data: bytes, chance: random.Random) -> None:
    """A folder, empty or not."""
    path.unlink()
    path.mkdir()
    if chance.random() < 0.5:
        (path / "file").write_bytes(data)


def nul(path: Path, data: bytes, chance: random.Random) -> None:
    """NUL bytes in the middle, or escaped in a text."""
    at = chance.randrange(len(data) + 1)
    quoted = [match.end() for match in re.finditer(rb'[:\[] *"', data)]
    if quoted and chance.random() < 0.6:
        at = chance.choice(quoted)
        path.write_bytes(data[:at] + b"\\u0000" + data[at:])
    else:
        path.write_bytes(data[:at] + b"\0" * chance.randint(1, 64) + data[at:])


MUTATIONS: tuple[Callable[[Path, bytes, random.Random], None], ...] = (
    truncate,
    flip,
    swap,
    nest,
    pipe,
    link,
    folder,
    nul,
)


def _places(document: Any) -> Iterator[tuple[Any, Any]]:
    """Every (holder, key) below a document."""
    left = [document]
    while left:
        holder = left.pop()
        if isinstance(holder, dict | list):
            for key in list(holder) if isinstance(holder, dict) else range(len(holder)):
                yield holder, key
                left.append(holder[key])
