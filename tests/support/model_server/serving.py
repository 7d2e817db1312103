"""The HTTP side: loopback, a free port, and an end that waits for no client and no stalled reply."""

import json
import socket
import sys
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, urlsplit

from model_server import answers
from model_server.asked import KEY_HEADERS, OLLAMA, Asked, read
from model_server.turns import Script, Turn, kind

STREAMS = "text/event-stream"
MODEL = {
    "id": "scripted",
    "object": "model",
    "type": "model",
    "created": 0,
    "owned_by": "scripted",
    "name": "models/scripted",
    "display_name": "scripted",
    "created_at": "2026-01-01T00:00:00Z",
    "supportedGenerationMethods": ["generateContent"],
}


class ModelServer(ThreadingHTTPServer):
    """The running server. ``requests`` is the record, one dict for each request, in the order of their coming:

    method, path, at (seconds since the start), key (as the client sent it, None without), status; and for a request
    for a reply api, model, stream, turn (None: a side request), kind, tools, calls, usage, body.
    """

    daemon_threads = False
    block_on_close = True

    def __init__(self, script: Mapping[str, Any] | Sequence[Turn], port: int = 0) -> None:
        super().__init__(("127.0.0.1", port), _Handler)
        self.script = Script(script)
        self.requests: list[dict[str, Any]] = []
        self.url = f"http://127.0.0.1:{self.server_address[1]}"
        self.stopping = threading.Event()
        self.began = time.monotonic()
        self._lock = threading.Lock()
        self._open: set[socket.socket] = set()

    @property
    def replies(self) -> list[dict[str, Any]]:
        """The requests that asked for a reply in the conversation."""
        return [item for item in self.requests if item.get("turn") is not None]

    def note(self, **told: Any) -> None:
        """Add to the record."""
        with self._lock:
            self.requests.append({"at": round(time.monotonic() - self.began, 3), **told})

    def opened(self, connection: socket.socket) -> None:
        """A client has connected."""
        with self._lock:
            self._open.add(connection)
        if self.stopping.is_set():
            connection.shutdown(socket.SHUT_RDWR)

    def closed(self, connection: socket.socket) -> None:
        """A connection has ended."""
        with self._lock:
            self._open.discard(connection)

    def stop(self) -> None:
        """End every connection, whatever it is in the middle of, and then the server."""
        self.shutdown()
        self.stopping.set()
        with self._lock:
            waiting = list(self._open)
        for connection in waiting:
            with suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)
        self.server_close()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A client that goes away in the middle is part of the tests; anything else is reported."""
        if not isinstance(sys.exc_info()[1], OSError):
            super().handle_error(request, client_address)


@contextmanager
def serve(script: Mapping[str, Any] | Sequence[Turn], port: int = 0) -> Iterator[ModelServer]:
    """A server that follows the script until the block ends."""
    server = ModelServer(script, port)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05})
    thread.start()
    try:
        yield server
    finally:
        server.stop()
        thread.join()


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server: ModelServer

    def setup(self) -> None:
        super().setup()
        self.server.opened(self.connection)

    def finish(self) -> None:
        self.server.closed(self.connection)
        super().finish()

    def log_message(self, format: str, *arguments: Any) -> None:
        """The record is enough."""

    def do_GET(self) -> None:
        path = urlsplit(self.path).path.rstrip("/")
        if path.endswith(("/models", "/tags")):
            settings = self.server.script.settings
            status = settings.get("models_status", 200)
            if "models_key" in settings and self._key() != settings["models_key"]:
                status = 401
            listed = {"object": "list", "data": [MODEL], "models": [MODEL], "has_more": False}
            self._other(listed if status == 200 else answers.failure(None, status), status)
        elif "/models/" in path:
            self._other(MODEL, 200)
        else:
            self._other({"error": {"message": "not served"}}, 404)

    do_HEAD = do_GET

    def do_POST(self) -> None:
        raw = self._body()
        asked = read(self.path, raw)
        if asked is not None:
            self._answer(asked)
        elif "count" in self.path.lower() and "oken" in self.path:
            self._other({"input_tokens": len(raw) // 4, "totalTokens": len(raw) // 4}, 200)
        else:
            self._other({"error": {"message": "not served"}}, 404)

    def _answer(self, asked: Asked) -> None:
        number, turn = self.server.script.next(asked)
        record = {
            "api": asked.api,
            "model": asked.model,
            "stream": asked.streams,
            "turn": number,
            "kind": kind(turn),
            "tools": [tool.name for tool in asked.tools],
            "body": asked.body,
        }
        self._wait(turn.get("delay", 0))
        if turn.get("drop") == "head":
            self._note(200, **record)
            self._cut()
        elif "status" in turn:
            status = turn["status"]
            self._note(status, **record)
            self._send(answers.failure(asked.api, status), status, turn.get("headers", {}))
        else:
            reply = self.server.script.reply(asked, number, turn, f"r{len(self.server.requests)}")
            spent = reply.spent
            record["calls"] = [(call.tool, call.arguments) for call in reply.calls]
            record["usage"] = {"input": spent.input, "cached": spent.cached, "output": spent.output}
            self._note(200, **record)
            if asked.streams:
                self._stream(answers.streamed(reply, asked), asked, turn)
            else:
                self._whole(json.dumps(answers.whole(reply, asked)).encode(), turn)

    def _stream(self, pieces: list[bytes], asked: Asked, turn: Turn) -> None:
        self.send_response(200)
        self.send_header("content-type", "application/x-ndjson" if asked.api == OLLAMA else STREAMS)
        self.send_header("transfer-encoding", "chunked")
        self.end_headers()
        middle = min(1, len(pieces) - 1)
        for place, piece in enumerate(pieces):
            half = len(piece) // 2 if place == middle else 0
            if half:
                self._chunk(piece[:half])
                if not self._go_on(turn):
                    return
            self._chunk(piece[half:])
        self.wfile.write(b"0\r\n\r\n")

    def _chunk(self, data: bytes) -> None:
        self.wfile.write(b"%x\r\n%s\r\n" % (len(data), data))
        self.wfile.flush()

    def _whole(self, data: bytes, turn: Turn) -> None:
        self.send_response(200)
        self.send_header("content-type", "application/json")
        self.send_header("content-length", str(len(data)))
        self.end_headers()
        half = len(data) // 2
        self.wfile.write(data[:half])
        self.wfile.flush()
        if self._go_on(turn):
            self.wfile.write(data[half:])

    def _go_on(self, turn: Turn) -> bool:
        """In the middle of a reply: stall or close, as the turn orders; False when it ends here."""
        self._wait(turn.get("stall", 0))
        if turn.get("drop") == "mid" or self.server.stopping.is_set():
            self._cut()
            return False
        return True

    def _wait(self, seconds: float) -> None:
        if seconds:
            self.server.stopping.wait(seconds)

    def _cut(self) -> None:
        self.close_connection = True
        with suppress(OSError):
            self.connection.shutdown(socket.SHUT_RDWR)

    def _other(self, value: Mapping[str, Any], status: int) -> None:
        self._note(status)
        self._send(value, status, {})

    def _send(self, value: Mapping[str, Any], status: int, headers: Mapping[str, str]) -> None:
        data = json.dumps(value).encode()
        self.send_response(status)
        for name, text in {"content-type": "application/json", "content-length": len(data), **headers}.items():
            self.send_header(name, str(text))
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(data)

    def _note(self, status: int, **told: Any) -> None:
        path = urlsplit(self.path).path
        sent = {name.lower(): value for name, value in self.headers.items()}
        self.server.note(method=self.command, path=path, key=self._key(), headers=sent, status=status, **told)

    def _key(self) -> str | None:
        """The key as the client sent it."""
        sent = [value for name in KEY_HEADERS if (value := self.headers.get(name))]
        sent += parse_qs(urlsplit(self.path).query).get("key", [])
        return sent[0].removeprefix("Bearer ") if sent else None

    def _body(self) -> bytes:
        if "chunked" not in (self.headers.get("transfer-encoding") or "").lower():
            return self.rfile.read(int(self.headers.get("content-length") or 0))
        found = b""
        while size := int(self.rfile.readline().partition(b";")[0] or b"0", 16):
            found += self.rfile.read(size)
            self.rfile.readline()
        self.rfile.readline()
        return found
