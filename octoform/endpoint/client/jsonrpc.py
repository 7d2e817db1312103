"""A small MCP client for octoform's own commands: the newest protocol, whose requests each say all that they need.

The SDK's client takes more than a second of a processor only to be loaded; a person who reads one sensor would wait
for that. The stateless protocol needs neither a handshake nor a session, so sockets and JSON are enough. Light.
"""

import base64
import binascii
import contextlib
import json
import socket
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import octoform
from octoform.base.files import parse, private_folder
from octoform.diagnostics import Diagnostic, error
from octoform.records import dataclass, field
from octoform.state.files import write_atomic

VERSION = "2026-07-28"
MAX_BYTES = 128_000_000
"""Of one message: a result may hold pictures, and what is longer is no result."""
_PREFIX = "io.modelcontextprotocol"
_CHUNK = 1 << 16
_FAREWELL_SECONDS = 1.0
_LEAST_SECONDS = 0.25
"""Seconds that sending may always take: a socket without any time would not wait at all."""

Progress = Callable[[float, float | None, str], None]


@dataclass(frozen=True, slots=True)
class ToolCall:
    """One call of a tool, from anyone who makes it to the endpoint's gate; at most ``seconds`` for each of its answers.

    ``texts`` are arguments as a command line has them (``channel=2``); they are converted by the tool's own input
    schema. With ``dry_run`` the endpoint shows what it would do, and does nothing. ``approved``: a person approved
    before they knew what would be asked, which the audit log must not take for an answer. ``revive``: an endpoint that
    a person stopped is started.
    """

    tool: str
    arguments: Mapping[str, Any] = field(default_factory=dict)
    texts: Mapping[str, str] = field(default_factory=dict)
    seconds: float = 60.0
    dry_run: bool = False
    approved: bool = False
    revive: bool = False

    @property
    def params(self) -> dict[str, Any]:
        """The call as MCP has it."""
        return {"name": self.tool, "arguments": dict(self.arguments)}


class WireError(Exception):
    """No result came. ``kind``: ``timeout``; ``closed``, the connection ended; ``refused``, an error was answered."""

    def __init__(self, kind: str, text: str) -> None:
        super().__init__(text)
        self.kind = kind


class Wire:
    """One connection to the endpoint, for one request after the other; closes ``connection`` with `close`."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection
        self._rest = bytearray()
        self._number = 0

    def close(self) -> None:
        """End the connection, and with it whatever still runs for it."""
        self._connection.close()

    def ask(
        self,
        method: str,
        params: Mapping[str, Any],
        seconds: float,
        *,
        progress: Progress | None = None,
        meta: Mapping[str, Any] | None = None,
    ) -> dict[str, Any]:
        """The result of a request; WireError when none comes within ``seconds``.

        A request that is given up, also by an interrupt, is cancelled: the endpoint stops the work on it.
        """
        self._number += 1
        number, end = self._number, time.monotonic() + seconds
        envelope = {**_envelope(), **(meta or {})}
        if progress is not None:
            envelope["progressToken"] = number
        self._send({"id": number, "method": method, "params": {**params, "_meta": envelope}}, end)
        try:
            for message in self._messages(end):
                if _answers(message, number):
                    return _result(message)
                if progress is not None:
                    _report(message, number, progress)
        except WireError as problem:
            if problem.kind == "timeout":
                self._cancel(number, "it took too long")
            raise
        except BaseException:
            self._cancel(number, "it was interrupted")
            raise
        raise WireError("closed", "the connection ended before the answer")

    def _send(self, message: Mapping[str, Any], end: float) -> None:
        line = json.dumps({"jsonrpc": "2.0", **message}).encode() + b"\n"
        self._connection.settimeout(max(_LEAST_SECONDS, end - time.monotonic()))
        try:
            self._connection.sendall(line)
        except TimeoutError as problem:
            raise WireError("timeout", "the endpoint does not read") from problem
        except OSError as problem:
            raise WireError("closed", problem.strerror or "the connection ended") from problem

    def _cancel(self, number: int, why: str) -> None:
        message = {"method": "notifications/cancelled", "params": {"requestId": number, "reason": why}}
        with contextlib.suppress(WireError):
            self._send(message, time.monotonic() + _FAREWELL_SECONDS)

    def _messages(self, end: float) -> Iterator[dict[str, Any]]:
        """Messages as they come, until the connection ends; WireError at the time ``end``."""
        while (line := self._line(end)) is not None:
            if not line.strip():
                continue  # a greeting that came late
            try:
                message = parse(line)
            except ValueError as problem:
                raise WireError("closed", f"the endpoint sent what is no message: {problem}") from problem
            if isinstance(message, dict):
                yield message

    def _line(self, end: float) -> bytes | None:
        searched = 0
        while (found := self._rest.find(b"\n", searched)) < 0:
            searched = len(self._rest)
            if searched > MAX_BYTES:
                raise WireError("closed", f"the endpoint sent a message of more than {MAX_BYTES} bytes")
            part = self._receive(end)
            if not part:
                return None
            self._rest += part
        line = bytes(self._rest[:found])
        del self._rest[: found + 1]
        return line

    def _receive(self, end: float) -> bytes:
        left = end - time.monotonic()
        if left <= 0:
            raise WireError("timeout", "no answer in time")
        self._connection.settimeout(left)
        try:
            return self._connection.recv(_CHUNK)
        except TimeoutError as problem:
            raise WireError("timeout", "no answer in time") from problem
        except OSError as problem:
            raise WireError("closed", problem.strerror or "the connection ended") from problem


def sender(name: str) -> dict[str, Any]:
    """The sender's name in a request, as members of its _meta."""
    return {f"{_PREFIX}/clientInfo": {"name": name, "version": octoform.__version__}}


def _envelope() -> dict[str, Any]:
    """The sender's capabilities in each request: elicitation, so that the endpoint may ask for an approval."""
    return {
        f"{_PREFIX}/protocolVersion": VERSION,
        **sender("octoform"),
        f"{_PREFIX}/clientCapabilities": {"elicitation": {"form": {}}},
    }


def _answers(message: Mapping[str, Any], number: int) -> bool:
    """Whether it is the answer to this request, or an error of the connection itself, which names no request."""
    if "method" in message:
        return False
    return message.get("id") == number or ("error" in message and message.get("id") is None)


def _result(message: Mapping[str, Any]) -> dict[str, Any]:
    if "error" in message:
        fault = message["error"]
        raise WireError("refused", str(fault.get("message", fault)) if isinstance(fault, dict) else str(fault))
    result = message.get("result")
    if not isinstance(result, dict):
        raise WireError("closed", "the endpoint sent what is no result")
    return result


def _report(message: Mapping[str, Any], number: int, progress: Progress) -> None:
    """Report a progress notification of this very request; every other notification is no one's."""
    found = message.get("params")
    if message.get("method") != "notifications/progress" or not isinstance(found, dict):
        return
    done, total = found.get("progress"), found.get("total")
    if found.get("progressToken") == number and isinstance(done, int | float):
        progress(done, total if isinstance(total, int | float) else None, str(found.get("message") or ""))


# Pictures and sounds of a tool's answer as files: a terminal can show neither.

_MEDIA = ("image", "audio")
_ENDINGS = {"image/jpeg": "jpg", "image/png": "png", "audio/wav": "wav", "audio/x-wav": "wav"}


def ending_of(mime: str) -> str:
    """How the name of a file with such media ends, without the dot; ``bin`` for what is not known."""
    return _ENDINGS.get(mime, "bin")


def save_media(content: Iterable[Mapping[str, Any]], folder: Path, stem: str) -> tuple[list[Path], list[Diagnostic]]:
    """Write the pictures and sounds among the blocks as ``<stem>-<n>.<ending>`` (mode 0600); gives the files."""
    saved: list[Path] = []
    for block in content:
        if block.get("type") not in _MEDIA:
            continue
        try:
            data = base64.b64decode(block.get("data", ""), validate=True)
        except binascii.Error as fault:
            summary = "the answer holds media that are not base64"
            return saved, [error("ENDPOINT-OUTPUT-INVALID", summary, detail=str(fault))]
        path = private_folder(folder) / f"{stem}-{len(saved) + 1}.{ending_of(str(block.get('mimeType')))}"
        if problem := write_atomic(path, data, 0o600):
            return saved, [problem]
        saved.append(path)
    return saved, []
