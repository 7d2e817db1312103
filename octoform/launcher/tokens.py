"""Who may come in over the network: the tokens of this host, by the digest of their values. Standard library only.

octoform writes the file, this process only reads it: whenever it moved, before a request is answered. A file that
cannot be understood lets nobody in, because the last good reading may hold a token that was revoked since.
"""

import hashlib
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from octoform.base.tokens import Token, read

from .saying import say


class Tokens:
    """The tokens in the file ``path``; may be asked from any thread."""

    def __init__(self, path: Path, now: Callable[[], float] = time.time) -> None:
        self._path = path
        self._now = now
        self._lock = threading.Lock()
        self._seen: tuple[int, ...] | None = None
        self._by_digest: Mapping[str, Token] = {}
        self._read = False

    def find(self, value: str) -> Token | None:
        """The token with this value, unless it ended.

        The value is looked up by its digest, so the time that it takes tells nothing about a value that is nearly
        right.
        """
        token = self._current().get(hashlib.sha256(value.encode("utf-8", "surrogateescape")).hexdigest())
        return None if token is None or token.ended_at(self._now()) else token

    def valid(self) -> frozenset[str]:
        """The digests of all tokens that count now."""
        now = self._now()
        return frozenset(digest for digest, token in self._current().items() if not token.ended_at(now))

    def _current(self) -> Mapping[str, Token]:
        try:
            status = self._path.stat()
            seen = (status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns)
        except OSError:
            seen = None
        if self._read and seen == self._seen:
            return self._by_digest
        with self._lock:
            self._by_digest = self._load()
            self._seen, self._read = seen, True
            return self._by_digest

    def _load(self) -> Mapping[str, Token]:
        try:
            tokens = read(self._path)
        except FileNotFoundError:
            say("there are no tokens, so no one gets in over the network; octoform token create makes one")
            return {}
        except (OSError, ValueError) as problem:
            say(f"the tokens cannot be read ({problem!r}), so no one gets in over the network: {self._path}")
            return {}
        return {token.sha256: token for token in tokens}
