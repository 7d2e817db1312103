"""QEMU's control socket: a command and its answer at a time; the events in between are not needed."""

import json
import socket
import time
from pathlib import Path
from typing import Any


class ControlError(Exception):
    """QEMU refused a command, or is gone."""


class Control:
    """Commands to a running QEMU."""

    def __init__(self, path: Path, seconds: float) -> None:
        """Connect as soon as the socket is there."""
        self._socket = socket.socket(socket.AF_UNIX)
        self._connect(path, time.monotonic() + seconds)
        self._lines = self._socket.makefile("rw", encoding="utf-8", newline="\n")
        self._next()
        self.ask("qmp_capabilities")

    def _connect(self, path: Path, end: float) -> None:
        while True:
            try:
                self._socket.connect(str(path))
                return
            except OSError as problem:
                if time.monotonic() > end:
                    raise ControlError("QEMU opened no control socket") from problem
                time.sleep(0.02)

    def close(self) -> None:
        """Leave QEMU as it is."""
        self._lines.close()
        self._socket.close()

    def ask(self, command: str, **arguments: Any) -> Any:
        """The answer to a command."""
        self._lines.write(json.dumps({"execute": command, "arguments": arguments}) + "\n")
        self._lines.flush()
        while True:
            message = self._next()
            if "error" in message:
                raise ControlError(f"{command}: {message['error']['desc']}")
            if "return" in message:
                return message["return"]

    def until_gone(self, device: str, seconds: float = 60.0) -> None:
        """Wait until the machine has a device no longer.

        Its event may come late: it waits for the last transfer that was under way.
        """
        end = time.monotonic() + seconds
        while any(part["name"] == device for part in self.ask("qom-list", path="/machine/peripheral")):
            if time.monotonic() > end:
                raise ControlError(f"{device} was not let go within {seconds:.0f} s")
            time.sleep(0.05)

    def _next(self) -> dict[str, Any]:
        line = self._lines.readline()
        if not line:
            raise ControlError("QEMU closed its control socket")
        message: dict[str, Any] = json.loads(line)
        return message
