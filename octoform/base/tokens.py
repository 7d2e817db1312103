"""The tokens of an endpoint as a file: one format, written by the core and read by the process at the door.

Both must agree on what counts: a token that one of them takes and the other refuses would be a way in that no one
sees, or a lock-out that no one understands. Standard library only.
"""

import json
import re
import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from octoform.base import files
from octoform.base.clock import epoch, parse_stamp

FORMAT = 1
MAX_BYTES = 1 << 20
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")


@dataclass(frozen=True, slots=True)
class Token:
    """A token without its value; ``sha256`` is of the value (hexadecimal), the times are RFC 3339 with a zone."""

    name: str
    sha256: str
    effects: tuple[str, ...]
    created: str
    expires: str | None

    @property
    def end(self) -> float | None:
        """When it ends, in seconds since 1970; None: never."""
        return None if self.expires is None else _moment(self.expires)

    @property
    def ended(self) -> bool:
        """True when it counts no more."""
        return self.ended_at(time.time())

    def ended_at(self, now: float) -> bool:
        """True when it counts no more at ``now``, in seconds since 1970."""
        return self.end is not None and now >= self.end


def read(path: Path) -> tuple[Token, ...]:
    """The tokens in a file; OSError when it cannot be read, ValueError when any of it cannot be understood."""
    document = files.record(files.read_json(path, MAX_BYTES, follow=False), FORMAT)
    items = document.get("tokens")
    if not isinstance(items, list):
        raise ValueError("`tokens` must be a list")
    tokens = tuple(_token(item, f"tokens[{index}]") for index, item in enumerate(items))
    if len({token.name for token in tokens}) != len(tokens):
        raise ValueError("two tokens have one name")
    return tokens


def encoded(tokens: Iterable[Token]) -> bytes:
    """The file's bytes."""
    items = [asdict(token) for token in sorted(tokens, key=lambda token: token.name)]
    return (json.dumps({"format": FORMAT, "tokens": items}, indent=1) + "\n").encode()


def _token(item: Any, place: str) -> Token:
    if not isinstance(item, dict):
        raise ValueError(f"{place} must be an object")
    name, digest, effects = item.get("name"), item.get("sha256"), item.get("effects")
    if not isinstance(name, str) or not NAME.fullmatch(name):
        raise ValueError(f"{place}.name is no name of a token")
    if not isinstance(digest, str) or not re.fullmatch(r"[0-9a-fA-F]{64}", digest):
        raise ValueError(f"{place}.sha256 must be a SHA-256")
    if not isinstance(effects, list) or not all(isinstance(effect, str) for effect in effects):
        raise ValueError(f"{place}.effects must be a list of words")
    created, expires = item.get("created"), item.get("expires")
    if not isinstance(created, str) or "expires" not in item:
        raise ValueError(f"{place} must hold when it was made and when it ends")
    if expires is not None:
        _moment(expires, f"{place}.expires")
    return Token(name, digest.lower(), tuple(effects), created, expires)


def _moment(text: Any, place: str = "an end") -> float:
    moment = parse_stamp(text, zone=None)
    seconds = epoch(text, zone=None)
    if moment is None or seconds is None:
        raise ValueError(f"{place} must be a time")
    if moment.tzinfo is None:
        raise ValueError(f"{place} must have a time zone")
    return seconds
