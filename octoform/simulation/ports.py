"""A tty for a simulated device: a pseudo terminal whose far end feeds it, in a thread of its own.

What a real adapter does is done here: it tells the device that a host has opened or closed the port, hands nothing on
at a wrong speed, and forgets what no one read when the port is closed.
"""

import os
import pty
import re
import select
import termios
import threading
import tty
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

_SPEEDS = {getattr(termios, name): int(name[1:]) for name in dir(termios) if re.fullmatch(r"B\d+", name)}
_GLANCE, _SOON, _NEVER = 10, 5, 50
"""Milliseconds between two looks: at a closed port, when the device has something to say later, and else."""


class Device(Protocol):
    """What is at the far end: bytes in, bytes out."""

    @property
    def baud(self) -> int | None:
        """The only speed that it understands; None for any."""

    @property
    def due(self) -> float | None:
        """When ``feed(b"")`` has something to say; None when it has not."""

    def feed(self, data: bytes) -> bytes:
        """What it answers to these bytes and to those before; OSError when it goes away."""

    def garbled(self, data: bytes) -> None:
        """Bytes at a speed that it does not understand."""

    def opened(self) -> None:
        """A host has opened the port."""

    def closed(self) -> None:
        """No host has it open any more."""


class Port:
    """``node`` becomes a link to the terminal; ``gone`` is called when the device unplugged itself."""

    def __init__(self, device: Device, node: Path, gone: Callable[[], None] = lambda: None) -> None:
        self._device, self._node, self._gone = device, node, gone
        self._over, self._open = threading.Event(), False
        self._thread = threading.Thread(target=self._run, name=node.name, daemon=True)
        self._master, slave = pty.openpty()
        tty.setraw(slave)
        self.terminal = os.ttyname(slave)
        os.close(slave)
        os.set_blocking(self._master, False)

    def start(self) -> None:
        """Make the node; from now on it answers."""
        self._node.parent.mkdir(parents=True, exist_ok=True)
        self._node.unlink(missing_ok=True)
        self._node.symlink_to(self.terminal)
        self._thread.start()

    def stop(self) -> None:
        """Take node and terminal away: anyone who has it open sees the line go dead."""
        self._over.set()
        if self._thread is not threading.current_thread():
            self._thread.join()

    def say(self, data: bytes) -> None:
        """Send what no one asked for; what a host does not read is lost when its buffer is full."""
        while data:
            try:
                data = data[os.write(self._master, data) :]
            except BlockingIOError:
                return

    @property
    def speed(self) -> int | None:
        """The line's speed as the host has set it; None for one without a name."""
        return _SPEEDS.get(termios.tcgetattr(self._master)[5])

    def _run(self) -> None:
        poller = select.poll()
        poller.register(self._master, select.POLLIN)
        try:
            while not self._over.is_set():
                found = poller.poll(_NEVER if self._device.due is None else _SOON)
                self._look(found[0][1] if found else 0)
        except OSError:
            self._node.unlink(missing_ok=True)
            self._gone()
        finally:
            if self._open:
                self._device.closed()
            self._node.unlink(missing_ok=True)
            os.close(self._master)

    def _look(self, flags: int) -> None:
        data = b""
        if flags & select.POLLIN:
            data = os.read(self._master, 4096)
        elif flags & select.POLLHUP:
            self._closed()
            self._over.wait(_GLANCE / 1000)
            return
        if not self._open:
            self._open = True
            self._device.opened()
        if self._device.baud not in (None, self.speed):
            self._device.garbled(data)
            return
        answer = self._device.feed(data)
        if answer:
            self.say(answer)

    def _closed(self) -> None:
        if not self._open:
            return
        self._open = False
        self._device.closed()
        slave = os.open(self.terminal, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        termios.tcflush(slave, termios.TCIFLUSH)
        os.close(slave)
