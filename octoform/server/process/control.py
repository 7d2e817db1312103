"""The process's own door for octoform: one question and one answer as lines of JSON.

It has a thread of its own, so an emergency stop and a question for the state are answered at once, whatever the event
loop and the generated code are doing. A shortage of descriptors or memory closes it only for as long as it lasts,
without threads it answers one question after the other, and connections that ask nothing make room for those that do.
Standard library only.
"""

import json
import logging
import socket
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from octoform.base.files import parse

from .local_socket import PASSING, PAUSE, listen, peer
from .stderr_log import Throttle, write_line

Handler = Callable[[Mapping[str, Any]], Mapping[str, Any]]
NAME = "control.sock"
MAX_BYTES = 65536
SECONDS = 5.0
MAX_CLIENTS = 32
"""Connections that have not asked yet, of which the oldest has to go for a new one; also answers under way, which an
emergency stop alone may exceed, by as many again."""
LOGGER = logging.getLogger("octoform.control")
LOGGER.addFilter(Throttle())


class Control:
    """Answers at ``run/control.sock`` from `start` to `stop`; handlers run in a thread for each question."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / NAME
        self._handlers: dict[str, Handler] = {}
        self._socket: socket.socket | None = None
        self._stopped = threading.Event()
        self._lock = threading.Lock()
        self._silent: dict[socket.socket, None] = {}
        self._answering = 0
        self._short = False

    def on(self, op: str, handler: Handler) -> None:
        """Let ``handler`` answer the questions ``{"op": op, ...}``; it returns a JSON object."""
        self._handlers[op] = handler

    def start(self, ended: Callable[[], None] | None = None) -> None:
        """Listen; OSError when the socket cannot be made.

        ``ended`` is called from the thread of the door should it end before `stop`: no one could stop anything then.
        """
        self._socket = listen(self._path)
        threading.Thread(target=self._serve, args=(self._socket, ended), name="control", daemon=True).start()

    def stop(self) -> None:
        """Listen no more."""
        self._stopped.set()
        if self._socket is not None:
            self._socket.close()
            self._path.unlink(missing_ok=True)

    def _serve(self, server: socket.socket, ended: Callable[[], None] | None) -> None:
        try:
            while not self._stopped.is_set():
                self._next(server)
        except OSError as problem:
            if not self._stopped.is_set():
                LOGGER.error("the control door failed: %r", problem)
        finally:
            if ended is not None and not self._stopped.is_set():
                ended()

    def _next(self, server: socket.socket) -> None:
        """Take one connection; in a shortage wait a little instead."""
        try:
            connection, _ = server.accept()
        except OSError as problem:
            if self._stopped.is_set() or problem.errno not in PASSING:
                raise
            self._wait(problem)
            return
        self._admit(connection)
        try:
            threading.Thread(target=self._answer, args=(connection,), name="control-answer", daemon=True).start()
        except RuntimeError as problem:  # no thread to be had: one after the other is still better than none
            self._complain(problem)
            self._answer(connection)
            return
        self._short = False

    def _wait(self, problem: Exception) -> None:
        self._complain(problem)
        self._stopped.wait(PAUSE)

    def _complain(self, problem: Exception) -> None:
        if not self._short:
            self._short = True
            LOGGER.error("no connection can be taken at the control door now: %s", problem)

    def _admit(self, connection: socket.socket) -> None:
        with self._lock:
            if len(self._silent) >= MAX_CLIENTS:
                oldest = next(iter(self._silent))
                del self._silent[oldest]
                _shut(oldest)
            self._silent[connection] = None

    def _heard(self, connection: socket.socket) -> None:
        """The connection has asked, or is over: from here on it is not the one that makes room."""
        with self._lock:
            self._silent.pop(connection, None)

    def _answer(self, connection: socket.socket) -> None:
        with connection:
            try:
                try:
                    if not peer(connection).mine:
                        return
                    connection.settimeout(SECONDS)
                    question = parse(_line(connection))
                finally:
                    self._heard(connection)  # before it is closed, and its number another connection's
                answer = self._handle(question)
                connection.settimeout(SECONDS)
                connection.sendall(json.dumps(answer).encode() + b"\n")
            except (OSError, ValueError) as problem:
                LOGGER.error("a question was not answered: %s", problem)

    def _handle(self, question: Any) -> Mapping[str, Any]:
        if not isinstance(question, dict):
            return {"error": "a question is an object"}
        op = str(question.get("op"))
        handler = self._handlers.get(op)
        if handler is None:
            return {"error": f"this endpoint does not know {question.get('op')!r}"}
        with self._lock:
            if self._answering >= (2 * MAX_CLIENTS if op == "estop" else MAX_CLIENTS):
                return {"error": "too many questions are being answered; ask again"}
            self._answering += 1
        try:
            return handler(question)
        except Exception as problem:  # noqa: BLE001 - the client gets the error, and the socket stays open
            write_line(f"{op} failed: {problem!r}")
            return {"error": f"{type(problem).__name__}: {problem}"}
        finally:
            with self._lock:
                self._answering -= 1


def _shut(connection: socket.socket) -> None:
    """Let its waiting client see its end; its thread closes it."""
    try:
        connection.shutdown(socket.SHUT_RDWR)
    except OSError:  # the other side was quicker
        return


def _line(connection: socket.socket) -> bytes:
    data = b""
    while not data.endswith(b"\n"):
        part = connection.recv(4096)
        if not part or len(data) > MAX_BYTES:
            raise ValueError("no whole question came")
        data += part
    return data
