"""The part of a client's session that a new endpoint needs. Light.

A pipe that outlives the process behind it must know three things: what the client still waits for, how it introduced
itself, and what it was asked and has not answered. No call that may have reached a device is ever sent twice: such a
request is answered with an error that states that. Messages are kept as bytes and looked into only now and then, so
that a proxy that just passes them on parses nothing.
"""

import os
from collections import deque

HEAD = 512
"""Bytes of a message of the endpoint that are kept: its id and its kind come first in what it writes."""
_MAX_KEPT, _LARGE = 512, 1 << 14
_LOST = "the endpoint ended during this call; its outcome is unknown, so it is not sent again"
_REPEATED = frozenset(("initialize", "ping", "server/discover", "tools/list", "subscriptions/listen"))
"""Requests that change nothing wherever they get to, and may therefore be sent twice."""
_GREETING_ID = "octoform/again"
_LISTEN = "subscriptions/listen"
_SUBSCRIPTION = "io.modelcontextprotocol/subscriptionId"
CODE = -32000

Message = dict[str, object]


class Conversation:
    """One client's conversation over as many connections as it takes."""

    def __init__(self) -> None:
        self._kept: deque[tuple[bool, bytes]] = deque()
        self._waiting: dict[str, tuple[Message, bytes]] = {}
        """The client's requests without an answer by id, each as it was sent where it may be sent again."""
        self._asked: dict[str, Message] = {}
        """The endpoint's unanswered requests to the client, by id."""
        self._stale: set[str] = set()
        """Ids of questions of an endpoint that is gone, which the client may still answer."""
        self._initialize: Message | None = None
        self._version: object = None
        self.shaking = False
        """An endpoint has got the client's initialize request, and has not answered: nothing else may be sent to it."""

    @property
    def careful(self) -> bool:
        """Whether each message of the endpoint has to be looked at before it is passed on."""
        return self.shaking or bool(self._stale)

    def sent(self, line: bytes) -> None:
        """The client's message has wholly gone to the endpoint."""
        self._keep(True, line)

    def heard(self, head: bytes) -> None:
        """The client has wholly got a message of the endpoint that begins so."""
        self._keep(False, head)

    def lost(self) -> list[bytes]:
        """The connection ended: the errors for what was under way and must not be sent again."""
        self._settle()
        self.shaking = False
        lines = []
        for key, (message, _) in list(self._waiting.items()):
            if message.get("method") not in _REPEATED:
                del self._waiting[key]
                lines.append(failed(message["id"], _LOST))
        for message in self._asked.values():
            self._stale.add(_key(message["id"]))
            lines.append(_line({"method": "notifications/cancelled", "params": {"requestId": message["id"]}}))
        self._asked.clear()
        return lines

    def found(self) -> list[bytes]:
        """There is a connection to another endpoint: what it has to be sent first."""
        first = []
        if self._initialize is not None and _key(self._initialize["id"]) not in self._waiting:
            self.shaking = True
            first.append(_line({**self._initialize, "id": _GREETING_ID}))
        return first + ([] if self.shaking else self._again())

    def refused(self, line: bytes, why: str) -> bytes | None:
        """The error for a message of the client for which there is no endpoint; None for what is no request."""
        message = _object(line)
        if message is None or "method" not in message or "id" not in message:
            return None
        return failed(message["id"] if _is_id(message["id"]) else None, why)

    def from_client(self, line: bytes) -> bytes:
        """The part of a client's message that goes to the endpoint."""
        message = _object(line) if self._stale else None
        if message is None or "method" in message or "id" not in message or _key(message["id"]) not in self._stale:
            return line
        self._stale.discard(_key(message["id"]))  # it answers a question that is no longer asked
        return b""

    def from_endpoint(self, line: bytes) -> tuple[bytes, list[bytes]]:
        """While one has to be careful: what of a message of the endpoint goes to the client, and what goes back.

        ValueError when it turns out that the client cannot go on with this endpoint.
        """
        message = _object(line)
        if message is None:
            return line, []
        if self.shaking and message.get("id") == _GREETING_ID:
            return self._shaken(message)
        if "method" in message and "id" in message and _key(message["id"]) in self._stale:
            # The client's answer to the former question could be taken for the one to this.
            return b"", [failed(message["id"], "the client has not answered a former question with this number")]
        self.heard(line[:HEAD])
        return line, []

    def _shaken(self, message: Message) -> tuple[bytes, list[bytes]]:
        """The endpoint has accepted the client's initialize request; the client does not get that answer again."""
        result = message.get("result")
        version = result.get("protocolVersion") if isinstance(result, dict) else None
        if version is None or (self._version is not None and version != self._version):
            raise ValueError("the endpoint speaks another protocol than before")
        self.shaking = False
        changed = _line({"method": "notifications/tools/list_changed"})
        return changed, [_line({"method": "notifications/initialized"}), *self._again()]

    def _again(self) -> list[bytes]:
        return [line for _, line in self._waiting.values()]

    def renewed(self) -> list[bytes]:
        """The notification for clients that listen by the stateless protocol: the tools may be others now."""
        return [
            _line({"method": "notifications/tools/list_changed", "params": {"_meta": {_SUBSCRIPTION: message["id"]}}})
            for message, _ in self._waiting.values()
            if message.get("method") == _LISTEN
        ]

    def _keep(self, client: bool, data: bytes) -> None:
        self._kept.append((client, data))
        if len(self._kept) > _MAX_KEPT or len(data) > _LARGE:
            self._settle()

    def _settle(self) -> None:
        """Look into what was kept, in its order."""
        while self._kept:
            client, data = self._kept.popleft()
            if client:
                self._from_client(data)
            else:
                self._from_endpoint(data)

    def _from_client(self, line: bytes) -> None:
        message = _object(line)
        if message is None:
            return
        key = _key(message.get("id"))
        if "method" not in message:
            self._asked.pop(key, None)
        elif _waits(message):
            repeated = message["method"] in _REPEATED
            kept = message if repeated else {"id": message["id"], "method": message["method"]}
            self._waiting[key] = (kept, line if repeated else b"")
            if message["method"] == "initialize":
                self._initialize, self._version = message, None

    def _from_endpoint(self, head: bytes) -> None:
        found = _headed(head)
        if found is None:
            return
        identity, kind = found
        key = _key(identity)
        if kind == "method":
            self._asked[key] = {"id": identity}
            return
        message, _ = self._waiting.pop(key, ({}, b""))
        if message.get("method") == "initialize":
            self._version = _version(head)


def failed(identity: object, why: str) -> bytes:
    """The JSON-RPC error that answers a request, as a line."""
    return _line({"id": identity, "error": {"code": CODE, "message": why}})


def _line(message: Message) -> bytes:
    import json  # here, since a pipe to an endpoint that goes on needs it seldom

    return json.dumps({"jsonrpc": "2.0", **message}).encode() + b"\n"


def _object(line: bytes) -> Message | None:
    from octoform.base.files import parse

    try:
        value = parse(line)
    except ValueError:
        return None
    return value if isinstance(value, dict) else None


def _waits(message: Message) -> bool:
    """Whether this is a request that an endpoint takes; it answers every other one at once."""
    return isinstance(message.get("method"), str) and "id" in message and _is_id(message["id"])


def _is_id(value: object) -> bool:
    return isinstance(value, str | int) and not isinstance(value, bool)


def _key(identity: object) -> str:
    """An id as a key: 1 and "1" are two."""
    return f"{type(identity).__name__}:{identity}"


def _headed(head: bytes) -> tuple[object, str] | None:
    """(id, ``result``, ``error`` or ``method``) of a message by its beginning; None for a notification.

    The endpoint writes the id before anything that could be long; a test holds it to that.
    """
    import re

    from octoform.base.files import parse

    match = re.match(rb'\{"jsonrpc":"2\.0","id":(-?\d+|"(?:[^"\\]|\\.)*"),"(result|error|method)"', head)
    if match is None:
        whole = _object(head)
        if whole is None or "id" not in whole:
            return None
        return whole["id"], next((kind for kind in ("method", "error") if kind in whole), "result")
    return parse(match[1]), match[2].decode()


def _version(head: bytes) -> str | None:
    import re

    match = re.search(rb'"protocolVersion":"([^"]+)"', head)
    return match[1].decode() if match else None


# The two directions of a pipe: what waits on its way, and where one message ends and the next begins. Light.
#
# Upwards only whole messages go, so that none is cut in two between an endpoint and the next. Downwards bytes go as
# they come, since pictures are large; only the beginning of each message is looked at.

CHUNK = 1 << 16
MAX_WAITING = 1 << 20
"""Bytes that may wait for a slow reader before its writer is made to wait too."""
MAX_LINE = 9 << 20
"""Bytes of a client's message that are waited for; no endpoint takes one that is longer."""


def read(source: int) -> bytes | None:
    """The available bytes; empty at the end, None when there is nothing yet."""
    try:
        return os.read(source, CHUNK)
    except BlockingIOError:
        return None
    except OSError:
        return b""


class Up:
    """From the client to whichever endpoint there is."""

    def __init__(self, source: int, conversation: Conversation) -> None:
        self.source = source
        self.ended = False
        self._conversation = conversation
        self._parts: list[bytes] = []
        self._part_bytes = 0
        self._ahead: deque[bytes] = deque()
        """The messages to this endpoint in the client's name, before the client's own."""
        self._lines: deque[bytes] = deque()
        self._bytes = 0
        self._current, self._own, self._gone = b"", False, 0
        """The message that is being sent, whether it is the client's own, and how much of it this endpoint has."""

    @property
    def waits(self) -> bool:
        """Whether a message of the client's waits for an endpoint."""
        return bool(self._lines) or (bool(self._current) and self._own)

    @property
    def ready(self) -> bool:
        """Whether something can be sent now: while an endpoint has not answered the introduction, only that."""
        return bool(self._current or self._ahead or (self._lines and not self._conversation.shaking))

    @property
    def full(self) -> bool:
        """Whether so much waits that the client has to wait too."""
        return self._bytes >= MAX_WAITING

    def fill(self) -> None:
        """Take what the client reports now."""
        part = read(self.source)
        if part is None:
            return
        self.ended = not part
        *whole, rest = part.split(b"\n")
        for piece in whole:
            self._put(b"".join((*self._parts, piece, b"\n")))
            self._parts, self._part_bytes = [], 0
        self._parts.append(rest)
        self._part_bytes += len(rest)
        if self.ended or self._part_bytes > MAX_LINE:
            self._put(b"".join(self._parts))
            self._parts, self._part_bytes = [], 0

    def ahead(self, lines: list[bytes]) -> None:
        """Send this endpoint a message in the client's name."""
        self._ahead.extend(lines)

    def drain(self, target: int) -> bool:
        """Send what the endpoint takes now; False when it is gone."""
        try:
            while self._current or self._next():
                self._gone += os.write(target, self._current[self._gone :] if self._gone else self._current)
                if self._gone == len(self._current):
                    if self._own:
                        self._conversation.sent(self._current)
                    self._current, self._gone = b"", 0
        except BlockingIOError:
            return True
        except OSError:
            return False
        return True

    def reset(self) -> None:
        """The endpoint is gone: a message of which it got only a part was never received by it."""
        if self._current and self._own:
            self._lines.appendleft(self._current)
            self._bytes += len(self._current)
        self._current, self._gone = b"", 0
        self._ahead.clear()

    def taken(self) -> list[bytes]:
        """All that waits, which waits no longer."""
        lines = list(self._lines)
        self._lines.clear()
        self._bytes = 0
        return lines

    def _next(self) -> bool:
        """Take the next message up; False when there is none that may be sent now."""
        if self._ahead:
            self._current, self._own = self._ahead.popleft(), False
            return True
        while self._lines and not self._conversation.shaking:
            line = self._lines.popleft()
            self._bytes -= len(line)
            self._current, self._own = self._conversation.from_client(line), True
            if self._current:
                return True
        return False

    def _put(self, line: bytes) -> None:
        if line:
            self._lines.append(line)
            self._bytes += len(line)


class Down:
    """From whichever endpoint there is to the client."""

    def __init__(self, target: int, conversation: Conversation) -> None:
        self.target = target
        self.waiting = b""
        self._conversation = conversation
        self._head = b""
        self._open = False
        """Whether a message has begun and not ended."""
        self._held = b""

    @property
    def full(self) -> bool:
        """Whether so much waits that the endpoint has to wait too."""
        return len(self.waiting) >= MAX_WAITING

    def put(self, part: bytes) -> list[bytes]:
        """Take a message of the endpoint; returns the answer that it needs in the client's place.

        ValueError when the client cannot go on with it.
        """
        back: list[bytes] = []
        if self._held or self._conversation.careful:
            part = self._judged(self._held + part, back)
        if part:
            self._scan(part)
            self.waiting += part
        return back

    def send(self, lines: list[bytes]) -> None:
        """Send the client a message in the endpoint's place; only between two messages."""
        self.waiting += b"".join(lines)

    def reset(self) -> None:
        """The endpoint is gone: what it had begun is ended, so that the next message can be read."""
        if self._open:
            self.waiting += b"\n"
        self._open, self._head, self._held = False, b"", b""

    def drain(self) -> bool:
        """Give the client what it takes now; False when it is gone."""
        try:
            self.waiting = self.waiting[os.write(self.target, self.waiting) :]
        except BlockingIOError:
            return True
        except OSError:  # what it did not take is lost
            self.waiting = b""
            return False
        return True

    def _judged(self, data: bytes, back: list[bytes]) -> bytes:
        """Look at each whole message as long as one has to be careful; the bytes that need not be looked at."""
        while self._conversation.careful:
            line, end, rest = data.partition(b"\n")
            if not end:
                self._held = data
                return b""
            if line.strip():
                found, answers = self._conversation.from_endpoint(line + end)
                self.waiting += found
                back += answers
            data = rest
        self._held = b""
        return data

    def _scan(self, part: bytes) -> None:
        """Note the beginning of each message that ends here."""
        start = 0
        while (end := part.find(b"\n", start)) >= 0:
            if self._open or end > start:
                self._conversation.heard(self._head + part[start : min(end, start + HEAD - len(self._head))])
            self._head, self._open, start = b"", False, end + 1
        if start < len(part):
            self._head += part[start : start + HEAD - len(self._head)]
            self._open = True
