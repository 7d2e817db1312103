"""One exchange on a line protocol: a command goes out, its answer comes back, and no other is taken for it.

The server opens the port itself, under the lock of its device, because pyserial is not of the standard library:

    talk = runtime.lines.Exchange(device, wire, command, replies)
    with talk, runtime.device(device).bus() as unit, serial.Serial(unit.node(wire.kind), ...) as port:
        found = talk.over(port)
"""

import re
import termios
import time
from collections.abc import Sequence
from types import TracebackType
from typing import NamedTuple, Protocol

from .counting import NONE, Counted, Step, refuse
from .faults import DeviceFault, sentence

MAX_LENGTH = 200
UNANSWERED = 0.5
"""How many seconds a product that acknowledges nothing has to refuse a command."""
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
    """How a product talks: one command a line."""

    kind: str
    baud: int
    ending: str
    error: str  # pattern of the answer to a command that was refused; "" where there is none
    timeout: float
    settle: float


class Answer(NamedTuple):
    """The answer: the lines as they came, and the values in them by their names."""

    lines: tuple[str, ...]
    values: dict[str, str]


class Exchange:
    """A command and its answer. Around the port, it turns what breaks the line into a DeviceFault in one sentence."""

    def __init__(self, device: str, wire: Wire, command: str, replies: Sequence[str], step: Step = NONE) -> None:
        """``command`` is the line to send, without its ending; ``replies`` has the pattern of each line of its answer.

        Without a command the product speaks by itself. Without a pattern it acknowledges nothing, and may refuse.
        ``step`` states what the command means for the position of the device, and whether it ends a stop.
        """
        self._device, self._wire, self._command, self._replies = device, wire, command, replies
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

    def over(self, port: Port) -> Answer:
        """Send the command; the answer, which fits the patterns. DeviceFault for none, a refusal, or any other line."""
        with Counted(self._device, self._step, port.fd):
            self._quiet(port)
            if not self._command:
                return self._heard(port)
            self._unsure = f"; whether it did {self._command!r} is not known"
            if self._replies:
                _late[self._device] = time.monotonic() + 2 * self._wire.timeout
            port.write(f"{self._command}{self._wire.ending}".encode("ascii"))
            return self._answered(port) if self._replies else self._unanswered(port)

    def _answered(self, port: Port) -> Answer:
        device, command, wire = self._device, self._command, self._wire
        lines: list[str] = []
        values: dict[str, str] = {}
        end = time.monotonic() + wire.timeout
        for at, reply in enumerate(self._replies):
            result = _next_line(port, end)
            if not result:
                text = f"ended its answer to {command!r} after {at} of {len(self._replies)} lines"
                text = text if at else f"did not answer {command!r} within {wire.timeout:g} s; it may still do it"
                raise DeviceFault(device, f"{device} {text}")
            if refused := self._refused(result):
                del _late[device]
                raise DeviceFault(device, refused)
            found = re.fullmatch(reply, result)
            if not found:  # behind any other line, such as an echo, the answer may still come
                unknown = f"{device} answered {command!r} with {result!a}, which its protocol definition does not know"
                raise DeviceFault(device, unknown)
            lines.append(result)
            values |= found.groupdict()
        del _late[device]
        return Answer(tuple(lines), values)

    def _unanswered(self, port: Port) -> Answer:
        """Check a line without acknowledgements for a refusal, where the protocol definition has its form."""
        end = time.monotonic() + UNANSWERED
        while self._wire.error and (found := _next_line(port, end)):
            if refused := self._refused(found):
                raise DeviceFault(self._device, refused)
        return Answer((), {})

    def _heard(self, port: Port) -> Answer:
        """The next whole lines that fit the patterns, one behind the other, of those that come without a question."""
        device, wire = self._device, self._wire
        lines: list[str] = []
        values: dict[str, str] = {}
        end = time.monotonic() + wire.timeout
        result = _line(port, end)  # the rest of one that was under way
        while result is not None:
            result = _line(port, end)
            found = result and re.fullmatch(self._replies[len(lines)], result)
            if result and not found:
                lines, values = [], {}
                found = re.fullmatch(self._replies[0], result)
            if result and found:
                lines, values = [*lines, result], {**values, **found.groupdict()}
                if len(lines) == len(self._replies):
                    return Answer(tuple(lines), values)
        raise DeviceFault(
            device, f"{device} answered nothing within {wire.timeout:g} s that its protocol definition knows"
        )

    def _refused(self, answer: str) -> str:
        """The sentence for a line that refuses the command; "" for any other."""
        found = self._wire.error and re.fullmatch(self._wire.error, answer)
        return (
            f"{self._device} refused {self._command!r}: {found.groupdict().get('message', answer)!a}" if found else ""
        )

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
    text: str | None = ""
    while text == "":
        text = _line(port, end)
    return text or ""


def _line(port: Port, end: float) -> str | None:
    """The received text up to the end of a line, "" for a blank one; None when it is not complete at that moment."""
    line = b""
    while time.monotonic() < end:
        byte = port.read(1)
        line += byte
        if byte in (b"\r", b"\n") or len(line) == MAX_LENGTH:
            return line.decode("latin-1").strip()
    return None
