"""A GPIO chip as the kernel's character device shows it, after include/uapi/linux/gpio.h (version 2 of the interface).

The structures are written with ctypes from that header, so that the offsets which a server packs by hand are held
against a compiler's layout of the same declarations.
"""

import ctypes
import errno
import os
from dataclasses import dataclass, field
from typing import Any

U8, U32, U64, S32 = ctypes.c_uint8, ctypes.c_uint32, ctypes.c_uint64, ctypes.c_int32
NAME = 32
USED, ACTIVE_LOW, INPUT, OUTPUT = 1, 2, 4, 8
OUTPUT_VALUES = 2


class ChipInfo(ctypes.Structure):
    """struct gpiochip_info."""

    _fields_ = [("name", ctypes.c_char * NAME), ("label", ctypes.c_char * NAME), ("lines", U32)]


class Attribute(ctypes.Structure):
    """struct gpio_v2_line_attribute and its mask (struct gpio_v2_line_config_attribute)."""

    _fields_ = [("id", U32), ("padding", U32), ("values", U64), ("mask", U64)]


class Config(ctypes.Structure):
    """struct gpio_v2_line_config."""

    _fields_ = [("flags", U64), ("num_attrs", U32), ("padding", U32 * 5), ("attrs", Attribute * 10)]


class Request(ctypes.Structure):
    """struct gpio_v2_line_request."""

    _fields_ = [
        *(("offsets", U32 * 64), ("consumer", ctypes.c_char * NAME), ("config", Config), ("num_lines", U32)),
        *(("event_buffer_size", U32), ("padding", U32 * 5), ("fd", S32)),
    ]


class LineAttribute(ctypes.Structure):
    """struct gpio_v2_line_attribute."""

    _fields_ = [("id", U32), ("padding", U32), ("values", U64)]


class LineInfo(ctypes.Structure):
    """struct gpio_v2_line_info."""

    _fields_ = [
        *(("name", ctypes.c_char * NAME), ("consumer", ctypes.c_char * NAME), ("offset", U32), ("num_attrs", U32)),
        *(("flags", U64), ("attrs", LineAttribute * 10), ("padding", U32 * 4)),
    ]


class Values(ctypes.Structure):
    """struct gpio_v2_line_values."""

    _fields_ = [("bits", U64), ("mask", U64)]


def number(way: int, shape: type[ctypes.Structure], index: int) -> int:
    """The kernel's _IOC (asm-generic/ioctl.h); way 2 is _IOR, 3 is _IOWR."""
    return way << 30 | ctypes.sizeof(shape) << 16 | 0xB4 << 8 | index


GET_CHIPINFO, GET_LINEINFO, GET_LINE = number(2, ChipInfo, 1), number(3, LineInfo, 5), number(3, Request, 7)
SET_CONFIG, GET_VALUES = number(3, Config, 0x0D), number(3, Values, 0x0E)


@dataclass
class Line:
    """One line: what is wired to it gives ``pull`` while it is not driven."""

    name: str = ""
    consumer: str = ""
    flags: int = INPUT
    driven: int = 0
    pull: int = 0

    @property
    def level(self) -> int:
        return self.driven if self.flags & OUTPUT else self.pull


@dataclass
class Chip:
    """Stands in for ``fcntl.ioctl`` of a process that has one GPIO chip; ``held`` is file to offset."""

    lines: list[Line]
    held: dict[int, int] = field(default_factory=dict)
    requests: int = 0
    unplugged: bool = False

    def ioctl(self, file: Any, request: int, argument: bytes) -> bytes:
        handler = {
            **{GET_CHIPINFO: self._info, GET_LINEINFO: self._line, GET_LINE: self._request},
            **{SET_CONFIG: self._configure, GET_VALUES: self._values},
        }.get(request)
        if handler is None:
            raise OSError(errno.ENOTTY, "no such request")
        return handler(file if isinstance(file, int) else file.fileno(), argument)

    def replug(self) -> None:
        """Take the chip away and give it back: the files that held a line are dead, the lines are free."""
        for line in self.lines:
            line.flags, line.consumer = INPUT, ""
        self.held = dict.fromkeys(self.held, -1)

    def sweep(self) -> None:
        """What the kernel does at once: a line whose file was closed is free and falls back."""
        for file, offset in list(self.held.items()):
            try:
                os.fstat(file)
            except OSError:
                del self.held[file]
                if offset >= 0:
                    self.lines[offset].flags &= ~USED & ~OUTPUT
                    self.lines[offset].consumer = ""

    def _info(self, _: int, argument: bytes) -> bytes:
        assert len(argument) == ctypes.sizeof(ChipInfo)
        return bytes(ChipInfo(b"gpiochip0", b"demo", len(self.lines)))

    def _line(self, _: int, argument: bytes) -> bytes:
        self.sweep()
        asked = LineInfo.from_buffer_copy(argument)
        line = self.lines[asked.offset]
        asked.name, asked.consumer, asked.flags = line.name.encode(), line.consumer.encode(), line.flags
        return bytes(asked)

    def _request(self, _: int, argument: bytes) -> bytes:
        self.sweep()
        asked = Request.from_buffer_copy(argument)
        assert asked.num_lines == 1 and not any(asked.padding)
        line = self.lines[asked.offsets[0]]
        if line.flags & USED:
            raise OSError(errno.EBUSY, os.strerror(errno.EBUSY))
        line.consumer, line.flags = asked.consumer.decode(), line.flags | USED
        self._apply(line, asked.config)
        asked.fd = os.open(os.devnull, os.O_RDONLY)
        self.held[asked.fd] = asked.offsets[0]
        self.requests += 1
        return bytes(asked)

    def _configure(self, file: int, argument: bytes) -> bytes:
        self._apply(self._of(file), Config.from_buffer_copy(argument))
        return argument

    def _values(self, file: int, argument: bytes) -> bytes:
        asked = Values.from_buffer_copy(argument)
        return bytes(Values(self._of(file).level & asked.mask, asked.mask))

    def _of(self, file: int) -> Line:
        if self.held[file] < 0:
            raise OSError(errno.ENODEV, os.strerror(errno.ENODEV))
        return self.lines[self.held[file]]

    @staticmethod
    def _apply(line: Line, config: Config) -> None:
        assert not any(config.padding) and config.num_attrs <= 1
        if config.flags & (INPUT | OUTPUT):
            line.flags = line.flags & ~(INPUT | OUTPUT) | config.flags
        if config.flags & OUTPUT and config.num_attrs:
            assert config.attrs[0].id == OUTPUT_VALUES and config.attrs[0].mask == 1
            line.driven = config.attrs[0].values & 1
