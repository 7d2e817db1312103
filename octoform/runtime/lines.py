"""One exchange on a line protocol: a command goes out, a line comes back, and no other is taken for its answer.

The server opens the port itself, under the lock of its device, because pyserial is not of the standard library:

    talk = runtime.lines.Exchange(device, wire, command, reply)
    with talk, runtime.device(device).bus() as unit, serial.Serial(unit.node(wire.kind), ...) as port:
        found = talk.over(port)
"""

import re
import termios
import time
from types import TracebackType
from typing import NamedTuple, Protocol

from .counting import NONE, Counted, Step, refuse
from .faults import DeviceFault, sentence

LONGEST = 200
_late: dict[str, float] = {}
"""Device to until when the answer to a command that got none in time may still come."""


class Port(Protocol):
    """An open serial line whose ``read`` gives up after a moment, as pyserial's does with a timeout."""

    @property
    def fd(self) -> int:
        """The number of its file."""
        ...

    def read(self, size: int) -> bytes:
        """At most so many bytes."""
        ...

    def write(self, data: bytes) -> object:
        """All of these bytes."""
        ...

    def reset_input_buffer(self) -> None:
        """Throw away what came and was not read."""
        ...


class Wire(NamedTuple):
    """How a product talks: one command a line, one line in answer."""

    kind: str
    baud: int
    ending: str
    error: str  # pattern of the answer to a command that was refused; "" where there is none
    timeout: float
    settle: float


class Exchange:
    """A command and its answer. Around the port, it turns what breaks the line into a DeviceFault in one sentence."""

    def __init__(self, device: str, wire: Wire, command: str, reply: str, step: Step = NONE) -> None:
        """``command`` is the line to send, without its ending; ``reply`` the pattern of its answer.

        ``step`` says what the command means for the position of the device, and whether it ends a stop.
        """
        self._device, self._wire, self._command, self._reply = device, wire, command, reply
        self._step = step
        self._unsure = ""

    def __enter__(self) -> "Exchange":
        """Watch for what breaks the line; DeviceFault while the device is stopped."""
        refuse(self._device, self._step)
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, problem: BaseException | None, _trace: TracebackType | None
    ) -> None:
        """Say what broke it, and whether the command went out before."""
        if isinstance(problem, OSError | termios.error):
            if self._unsure:
                _late.pop(self._device, None)  # whatever it still has to say is lost with the line
            text = sentence(problem) if isinstance(problem, OSError) else "the device went away"
            raise DeviceFault(self._device, f"{self._device}: {text}{self._unsure}") from problem

    def over(self, port: Port) -> re.Match[str]:
        """Send the command; the answer, which fits the pattern. DeviceFault for none, a refusal, or any other line."""
        with Counted(self._device, self._step, port.fd):
            return self._sent(port)

    def _sent(self, port: Port) -> re.Match[str]:
        device, command, wire = self._device, self._command, self._wire
        self._quiet(port)
        self._unsure = f"; whether it did {command!r} is not known"
        _late[device] = time.monotonic() + 2 * wire.timeout
        port.write(f"{command}{wire.ending}".encode("ascii"))
        said = _next_line(port, time.monotonic() + wire.timeout)
        if not said:
            raise DeviceFault(
                device, f"{device} did not answer {command!r} within {wire.timeout:g} s; it may still do it"
            )
        refused, found = wire.error and re.fullmatch(wire.error, said), re.fullmatch(self._reply, said)
        if refused or found:
            del _late[device]  # behind any other line, such as an echo, the answer may still come
        if refused:
            raise DeviceFault(device, f"{device} refused {command!r}: {refused.groupdict().get('message', said)!a}")
        if found:
            return found
        raise DeviceFault(device, f"{device} answered {command!r} with {said!a}, which its grammar does not know")

    def _quiet(self, port: Port) -> None:
        """No reset when the line is closed, and no late answer that could be taken for the next one."""
        settings = termios.tcgetattr(port.fd)
        settings[2] &= ~termios.HUPCL
        termios.tcsetattr(port.fd, termios.TCSANOW, settings)
        time.sleep(self._wire.settle)
        if _late.get(self._device, 0.0) > time.monotonic():
            _next_line(port, _late[self._device])
        _late.pop(self._device, None)
        port.reset_input_buffer()


def _next_line(port: Port, end: float) -> str:
    """The next line that is not blank, bounded and without its end; "" when none is complete at that moment."""
    line = b""
    while time.monotonic() < end:
        byte = port.read(1)
        line += byte
        if byte in (b"\r", b"\n") or len(line) == LONGEST:
            if text := line.decode("latin-1").strip():
                return text
            line = b""
    return ""
