"""The process's own door for octoform: one question and one answer as lines of JSON.

It has a thread of its own, so an emergency stop and a question for the state are answered at once, whatever the event
loop and the generated code are doing. Standard library only.
"""

import json
import socket
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from .saying import say
from .socketfile import is_mine, listen

Handler = Callable[[Mapping[str, Any]], Mapping[str, Any]]
NAME = "control.sock"
MOST_BYTES = 65536
SECONDS = 5.0


class Control:
    """Answers at ``run/control.sock`` from `start` to `stop`; handlers run in a thread for each question."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / NAME
        self._handlers: dict[str, Handler] = {}
        self._socket: socket.socket | None = None

    def on(self, op: str, handler: Handler) -> None:
        """Let ``handler`` answer the questions ``{"op": op, ...}``; it returns a JSON object."""
        self._handlers[op] = handler

    def start(self) -> None:
        """Listen; OSError when the socket cannot be made."""
        self._socket = listen(self._path)
        threading.Thread(target=self._serve, args=(self._socket,), name="control", daemon=True).start()

    def stop(self) -> None:
        """Listen no more."""
        if self._socket is not None:
            self._socket.close()
            self._path.unlink(missing_ok=True)

    def _serve(self, server: socket.socket) -> None:
        while True:
            try:
                connection, _ = server.accept()
            except OSError:  # closed: the process ends
                return
            threading.Thread(target=self._answer, args=(connection,), name="control-answer", daemon=True).start()

    def _answer(self, connection: socket.socket) -> None:
        with connection:
            try:
                if not is_mine(connection):
                    return
                connection.settimeout(SECONDS)
                question = json.loads(_line(connection))
                answer = self._handle(question)
                connection.settimeout(SECONDS)
                connection.sendall(json.dumps(answer).encode() + b"\n")
            except (OSError, ValueError) as problem:
                say(f"a question was not answered: {problem}")

    def _handle(self, question: Mapping[str, Any]) -> Mapping[str, Any]:
        handler = self._handlers.get(str(question.get("op")))
        if handler is None:
            return {"error": f"this endpoint does not know {question.get('op')!r}"}
        try:
            return handler(question)
        except Exception as problem:  # noqa: BLE001 - whoever asks is told, and the door stays open
            say(f"{question.get('op')} failed: {problem!r}")
            return {"error": f"{type(problem).__name__}: {problem}"}


def _line(connection: socket.socket) -> bytes:
    data = b""
    while not data.endswith(b"\n"):
        part = connection.recv(4096)
        if not part or len(data) > MOST_BYTES:
            raise ValueError("no whole question came")
        data += part
    return data
