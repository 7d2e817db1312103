"""Authentication over HTTP: the token of each request, and an end to everything of a token that counts no more.

A request is checked when it comes, but a stream may stay open for days and a session is only a number. So whatever is
open is kept by the token that opened it, and ends soon after that token was revoked, given a new value, or ran out.
One token cannot take the room of the others: it may have as many requests open as are left for them, and a few in any
case.
"""

import contextlib
import hashlib
import logging
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import anyio
from fastmcp.server.auth import AccessToken, TokenVerifier
from mcp.server.auth.middleware.bearer_auth import AuthenticatedUser
from starlette.datastructures import Headers
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from octoform.base.tokens import Token, read
from octoform.server.internals import end_session, owners, transports
from octoform.server.process.stderr_log import Throttle, write_line

# Who may come in over the network: the tokens of this host, by the digest of their values. Standard library only.
#
# octoform writes the file, this process only reads it: whenever it moved, before a request is answered. A file that
# cannot be understood admits no one, because the last good reading may hold a token that was revoked since.


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

        The value is looked up by its digest, so the time that it takes shows nothing about a value that is nearly
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
            write_line("there are no tokens, so no one gets in over the network; octoform token create makes one")
            return {}
        except (OSError, ValueError) as problem:
            write_line(f"the tokens cannot be read ({problem!r}), so no one gets in over the network: {self._path}")
            return {}
        return {token.sha256: token for token in tokens}


LOOK_SECONDS = 0.25
"""How often open streams and sessions are held against the tokens."""
MAX_OPEN = 448
"""Requests that may be open at a time, of all tokens: fewer than connections, so that the rest can be reported."""
LEAST_OPEN = 4
"""The open requests that a token may always have."""
LOGGER = logging.getLogger("octoform.admission")
LOGGER.addFilter(Throttle())
_TOO_MANY = JSONResponse(
    {"error": "too_many_requests", "error_description": "this token has too many requests open"},
    429,
    {"Retry-After": "1"},
)
_UNAUTHORIZED = JSONResponse({"error": "invalid_token"}, 401, {"WWW-Authenticate": 'Bearer error="invalid_token"'})


class Verifier(TokenVerifier):
    """FastMCP's question for a bearer token, answered from the tokens of this host.

    A principal is the token's name and the digest of its value: a session that was opened with a value can be used
    with no other, not even with the same token's next one. The value itself is not handed on.
    """

    def __init__(self, tokens: Tokens) -> None:
        super().__init__()
        self._tokens = tokens

    async def verify_token(self, token: str) -> AccessToken | None:
        """The rights of the token; None when it is not, or no more, one of this host."""
        found = self._tokens.find(token)
        if found is None:
            return None
        return AccessToken(
            token=found.sha256, client_id=found.name, subject=found.sha256, scopes=sorted(found.effects), claims={}
        )


class Open:
    """The open work of each token: requests under way (streams are requests that last) and sessions."""

    def __init__(self, app: ASGIApp, tokens: Tokens) -> None:
        self.app = app
        self._tokens = tokens
        self._requests: dict[str, set[anyio.CancelScope]] = {}
        self._busy: Counter[str | None] = Counter()
        self.sessions: Any = None
        """The SDK's session manager, once it runs."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request, until its token ends."""
        user = scope.get("user")
        if not isinstance(user, AuthenticatedUser):
            await self.app(scope, receive, send)
            return
        digest = str(user.access_token.subject)
        if not self._has_room(digest):
            await _TOO_MANY(scope, receive, send)
            return
        begun = finished = False

        async def noted(message: Message) -> None:
            nonlocal begun, finished
            begun, finished = True, message["type"] == "http.response.body" and not message.get("more_body", False)
            await send(message)

        headers = Headers(scope=scope)
        session = headers.get("mcp-session-id")
        if session is None and "mcp-protocol-version" not in headers:
            # Only such a request can open one: the era without sessions names its version in each.
            await self._make_room()
        with self._kept(digest, session) as under_way:
            await self.app(scope, receive, noted)
        if not under_way.cancelled_caught or finished:
            return
        if begun:
            await send({"type": "http.response.body", "body": b""})
        else:
            await _UNAUTHORIZED(scope, receive, send)

    def _has_room(self, digest: str) -> bool:
        """Whether a token may have one request more: not more than are still free for others, alone half of all."""
        free = MAX_OPEN - sum(map(len, self._requests.values()))
        return len(self._requests.get(digest, ())) < max(free, LEAST_OPEN)

    @contextlib.contextmanager
    def _kept(self, digest: str, session: str | None) -> Iterator[anyio.CancelScope]:
        with anyio.CancelScope() as under_way:
            mine = self._requests.setdefault(digest, set())
            mine.add(under_way)
            self._busy[session] += 1
            try:
                yield under_way
            finally:
                mine.discard(under_way)
                if not mine:
                    self._requests.pop(digest, None)
                self._busy[session] -= 1
                if not self._busy[session]:
                    del self._busy[session]

    async def _make_room(self) -> None:
        """When no more session may open, end the oldest one of the token that has the most, unless it is in use.

        A client that opens one after the other and ends none then costs only its own token's idle ones.
        """
        sessions = self.sessions
        if sessions is None or len(transports(sessions)) < sessions.max_sessions:
            return
        subjects = {identity: owner["subject"] for identity, owner in owners(sessions).items()}
        most = Counter(subjects.values()).most_common(1)[0][0]
        for identity, transport in tuple(transports(sessions).items()):
            if subjects.get(identity) == most and identity not in self._busy:
                await end_session(sessions, identity, transport)
                return

    def end_all(self) -> None:
        """End every request: the door closes."""
        for mine in tuple(self._requests.values()):
            for under_way in tuple(mine):
                under_way.cancel()

    async def watch(self) -> None:
        """End what is open of tokens that ended, permanently."""
        while True:
            await anyio.sleep(LOOK_SECONDS)
            opened = {} if self.sessions is None else owners(self.sessions)
            if self._requests or opened:
                await self._end(self._tokens.valid(), opened)

    async def _end(self, valid: frozenset[str], opened: dict[str, Any]) -> None:
        for digest in [digest for digest in self._requests if digest not in valid]:
            LOGGER.warning("a token ended: %d of its requests were ended", len(self._requests[digest]))
            for under_way in tuple(self._requests[digest]):
                under_way.cancel()
        for identity, owner in opened.items():
            transport = transports(self.sessions).get(identity)
            if owner["subject"] not in valid and transport is not None:
                LOGGER.warning("a token ended: its session was ended")
                await end_session(self.sessions, identity, transport)
