"""What a client and the endpoint have said to each other, as far as a new endpoint has to be told of it. Light.

A pipe that outlives the process behind it must know three things: what the client still waits for, how it introduced
itself, and what it was asked and has not answered. Nothing that a device may have been told is ever said twice: such a
request is answered with an error that says so. Messages are kept as bytes and looked into only now and then, so that
whoever just passes them on loads and does nothing.
"""

from collections import deque

HEAD = 512
"""Bytes of a message of the endpoint that are kept: its id and its kind come first in what it writes."""
_MOST_KEPT, _LARGE = 512, 1 << 14
_LOST = (
    "the endpoint ended while this was under way; whether it was carried out is not known, so it is not sent to the "
    "next one"
)
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
        """What the endpoint asked the client, and has no answer to, by id."""
        self._stale: set[str] = set()
        """Ids of questions of an endpoint that is gone, which the client may still answer."""
        self._initialize: Message | None = None
        self._version: object = None
        self.shaking = False
        """An endpoint was told who the client is, and has not answered: nothing else may be sent to it."""

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
        told = []
        for key, (message, _) in list(self._waiting.items()):
            if message.get("method") not in _REPEATED:
                del self._waiting[key]
                told.append(failed(message["id"], _LOST))
        for message in self._asked.values():
            self._stale.add(_key(message["id"]))
            told.append(_line({"method": "notifications/cancelled", "params": {"requestId": message["id"]}}))
        self._asked.clear()
        return told

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
        return failed(message["id"], why)

    def from_client(self, line: bytes) -> bytes:
        """What of a message of the client goes to the endpoint."""
        message = _object(line) if self._stale else None
        if message is None or "method" in message or "id" not in message or _key(message["id"]) not in self._stale:
            return line
        self._stale.discard(_key(message["id"]))  # it answers a question that nobody asks any more
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
        """The endpoint has taken the client's introduction, of which the client is not told again."""
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
        """What clients are told that listen in the way of the stateless protocol: the tools may be others now."""
        return [
            _line({"method": "notifications/tools/list_changed", "params": {"_meta": {_SUBSCRIPTION: message["id"]}}})
            for message, _ in self._waiting.values()
            if message.get("method") == _LISTEN
        ]

    def _keep(self, client: bool, data: bytes) -> None:
        self._kept.append((client, data))
        if len(self._kept) > _MOST_KEPT or len(data) > _LARGE:
            self._settle()

    def _settle(self) -> None:
        """Look into what was kept, in its order."""
        while self._kept:
            client, data = self._kept.popleft()
            if client:
                self._client_said(data)
            else:
                self._endpoint_said(data)

    def _client_said(self, line: bytes) -> None:
        message = _object(line)
        if message is None:
            return
        key = _key(message.get("id"))
        if "method" not in message:
            self._asked.pop(key, None)
        elif "id" in message:
            repeated = message["method"] in _REPEATED
            kept = message if repeated else {"id": message["id"], "method": message["method"]}
            self._waiting[key] = (kept, line if repeated else b"")
            if message["method"] == "initialize":
                self._initialize, self._version = message, None

    def _endpoint_said(self, head: bytes) -> None:
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
