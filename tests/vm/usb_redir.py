"""Carries a `vm.devices.model.Model` to a port of QEMU's USB controller (the usb-redir protocol, version 0.7).

QEMU connects to the socket, and the device is there as if plugged in. Nothing has to be done in the guest.
"""

import contextlib
import socket
import struct
import threading
import time
from collections.abc import Callable
from pathlib import Path

from vm.devices.model import IN, Model, Request

(_HELLO, _CONNECT, _DISCONNECT, _RESET, _INTERFACES, _ENDPOINTS, _SET_CONFIGURATION, _GET_CONFIGURATION) = range(8)
(_CONFIGURATION, _SET_SETTING, _GET_SETTING, _SETTING, _START_STREAM, _STOP_STREAM, _STREAM) = range(8, 15)
(_START_INTERRUPT, _STOP_INTERRUPT, _INTERRUPT_STATUS) = range(15, 18)
_CANCEL = 21
_CONTROL_DATA, _BULK_DATA, _STREAM_DATA, _INTERRUPT_DATA = range(100, 104)
_OK, _CANCELLED, _STALL = 0, 1, 4
_RELEASE, _PACKETS, _WIDE, _LONG = 1 << 1, 1 << 4, 1 << 5, 1 << 6
_ABLE = _RELEASE | _PACKETS | _WIDE | _LONG
_SPEED = {"low": 0, "full": 1, "high": 2}
_SLOTS = 32
_NO_ENDPOINT = 255


class Carrier:
    """A device on a socket, until ``close``."""

    def __init__(self, model: Model, path: Path) -> None:
        """Listens at once; ``plugged`` is set when QEMU has taken the device."""
        self._model, self._peer = model, socket.socket(socket.AF_UNIX)
        self.plugged = threading.Event()
        self._closed = False
        self._writing = threading.Lock()
        self._wanted: dict[int, list[tuple[int, int]]] = {}
        self._interrupts: set[int] = set()
        self._streams: dict[int, threading.Event] = {}
        self._door = socket.socket(socket.AF_UNIX)
        self._door.bind(str(path))
        self._door.listen(1)
        threading.Thread(target=self._serve, name="usb-redir", daemon=True).start()

    def close(self) -> None:
        """Unplug for good."""
        self._closed = True
        self._hush()
        for end in (self._peer, self._door):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()

    # -- the connection

    def _serve(self) -> None:
        with contextlib.suppress(OSError):
            self._peer, _ = self._door.accept()
            self._greet()
            while not self._closed:
                kind, size, number = struct.unpack("<IIQ", self._read(16)) if self._wide else self._narrow()
                payload = self._read(size)
                with self._model.lock:
                    self._handle(kind, number, payload)

    def _narrow(self) -> tuple[int, int, int]:
        kind, size, number = struct.unpack("<III", self._read(12))
        return kind, size, number

    def _read(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            piece = self._peer.recv(count - len(data))
            if not piece:
                raise ConnectionError("QEMU closed the device's socket")
            data += piece
        return data

    def _write(self, kind: int, number: int, payload: bytes) -> None:
        form = "<IIQ" if self._wide else "<III"
        with self._writing, contextlib.suppress(OSError):  # after an unplug no one reads
            self._peer.sendall(struct.pack(form, kind, len(payload), number) + payload)

    def _greet(self) -> None:
        self._wide = False
        self._write(_HELLO, 0, b"a device of octoform's tests".ljust(64, b"\0") + struct.pack("<I", _ABLE))
        _, size, _ = self._narrow()
        greeting = self._read(size)
        self._shared = struct.unpack_from("<I", greeting, 64)[0] & _ABLE if size >= 68 else 0
        self._wide = bool(self._shared & _WIDE)
        model = self._model
        model.ready = self._ready
        with model.lock:
            model.reset()
            self._describe()
            named = struct.pack("<HH", model.identity.vendor, model.identity.product)
            release = struct.pack("<H", model.identity.release) if self._shared & _RELEASE else b""
            self._write(_CONNECT, 0, bytes([_SPEED[model.speed], *model.kind]) + named + release)
        self.plugged.set()

    def _describe(self) -> None:
        """Interfaces and endpoints of the settings in force."""
        interfaces, endpoints = self._model.interfaces()
        columns = [bytes(item[place] for item in interfaces).ljust(_SLOTS, b"\0") for place in range(4)]
        self._write(_INTERFACES, 0, struct.pack("<I", len(interfaces)) + b"".join(columns))
        kinds, intervals, owners, packets = [_NO_ENDPOINT] * _SLOTS, [0] * _SLOTS, [0] * _SLOTS, [0] * _SLOTS
        kinds[0] = kinds[16] = 0
        packets[0] = packets[16] = 64
        for item in endpoints:
            slot = item.address & 15 | (item.address & IN) >> 3
            kinds[slot], intervals[slot] = item.kind, item.interval
            owners[slot], packets[slot] = item.interface, item.packet
        sizes = struct.pack("<32H", *packets) if self._shared & _PACKETS else b""
        self._write(_ENDPOINTS, 0, bytes(kinds) + bytes(intervals) + bytes(owners) + sizes)

    # -- what QEMU asks

    def _handle(self, kind: int, number: int, payload: bytes) -> None:
        acts: dict[int, Callable[[int, bytes], None]] = {
            _RESET: self._reset,
            _SET_CONFIGURATION: self._configure,
            _GET_CONFIGURATION: self._configured,
            _SET_SETTING: self._set,
            _GET_SETTING: self._setting,
            _START_INTERRUPT: self._start_interrupt,
            _STOP_INTERRUPT: self._stop_interrupt,
            _START_STREAM: self._start_stream,
            _STOP_STREAM: self._stop_stream,
            _CANCEL: self._cancel,
            _CONTROL_DATA: self._control,
            _BULK_DATA: self._bulk,
            _STREAM_DATA: self._stream,
            _INTERRUPT_DATA: self._interrupt,
        }
        if kind in acts:
            acts[kind](number, payload)

    def _reset(self, number: int, payload: bytes) -> None:
        self._hush()
        self._wanted, self._interrupts = {}, set()
        self._model.reset()

    def _configure(self, number: int, payload: bytes) -> None:
        self._model.configure(payload[0])
        self._describe()
        self._configured(number, payload)

    def _configured(self, number: int, payload: bytes) -> None:
        self._write(_CONFIGURATION, number, bytes([_OK, self._model.configuration]))

    def _set(self, number: int, payload: bytes) -> None:
        self._model.settings[payload[0]] = payload[1]
        self._describe()
        self._setting(number, payload)

    def _setting(self, number: int, payload: bytes) -> None:
        self._write(_SETTING, number, bytes([_OK, payload[0], self._model.settings.get(payload[0], 0)]))

    def _start_interrupt(self, number: int, payload: bytes) -> None:
        self._interrupts.add(payload[0])
        self._write(_INTERRUPT_STATUS, number, bytes([_OK, payload[0]]))
        self._ready(payload[0])

    def _stop_interrupt(self, number: int, payload: bytes) -> None:
        self._interrupts.discard(payload[0])
        self._write(_INTERRUPT_STATUS, number, bytes([_OK, payload[0]]))

    def _start_stream(self, number: int, payload: bytes) -> None:
        address = payload[0]
        self._write(_STREAM, number, bytes([_OK, address]))
        if address & IN and address not in self._streams:
            stop = self._streams[address] = threading.Event()
            threading.Thread(target=self._run, args=(address, stop), name="usb-stream", daemon=True).start()

    def _stop_stream(self, number: int, payload: bytes) -> None:
        if payload[0] in self._streams:
            self._streams.pop(payload[0]).set()
        self._write(_STREAM, number, bytes([_OK, payload[0]]))

    def _cancel(self, number: int, payload: bytes) -> None:
        for address, queue in self._wanted.items():
            for entry in [entry for entry in queue if entry[0] == number]:
                queue.remove(entry)
                self._transferred(number, address, _CANCELLED, 0, b"")

    def _control(self, number: int, payload: bytes) -> None:
        end, code, kind, _, value, index, length = struct.unpack_from("<BBBBHHH", payload)
        answer = self._model.control(Request(kind, code, value, index, length, payload[10:]))
        status = _STALL if answer is None else _OK
        data = answer or b"" if kind & IN else b""
        moved = len(data) if kind & IN else 0 if status else length
        self._write(_CONTROL_DATA, number, struct.pack("<BBBBHHH", end, code, kind, status, value, index, moved) + data)

    def _bulk(self, number: int, payload: bytes) -> None:
        address, _, length, _ = struct.unpack_from("<BBHI", payload)
        start = 8
        if self._shared & _LONG:
            length |= struct.unpack_from("<H", payload, 8)[0] << 16
            start = 10
        if address & IN:
            self._wanted.setdefault(address, []).append((number, length))
            self._ready(address)
        else:
            self._model.receive(address, payload[start:])
            self._transferred(number, address, _OK, length, b"")

    def _stream(self, number: int, payload: bytes) -> None:
        self._model.receive(payload[0], payload[4:])

    def _interrupt(self, number: int, payload: bytes) -> None:
        address, _, length = struct.unpack_from("<BBH", payload)
        self._model.receive(address, payload[4:])
        self._write(_INTERRUPT_DATA, number, struct.pack("<BBH", address, _OK, length))

    # -- what the device sends

    def _transferred(self, number: int, address: int, status: int, length: int, data: bytes) -> None:
        head = struct.pack("<BBHI", address, status, length & 0xFFFF, 0)
        if self._shared & _LONG:
            head += struct.pack("<H", length >> 16)
        self._write(_BULK_DATA, number, head + data)

    def _ready(self, address: int) -> None:
        """Hand over what the device has for an endpoint that the host reads."""
        model = self._model
        with model.lock:
            while address in self._interrupts and (data := model.take(address, 64)) is not None:
                self._write(_INTERRUPT_DATA, 0, struct.pack("<BBH", address, _OK, len(data)) + data)
            queue = self._wanted.get(address)
            while queue and (data := model.take(address, queue[0][1])) is not None:
                number, _ = queue.pop(0)
                self._transferred(number, address, _OK, len(data), data)

    def _run(self, address: int, stop: threading.Event) -> None:
        """A packet for each millisecond, made up for when this thread came late."""
        due = time.monotonic()
        while not stop.is_set() and not self._closed:
            with self._model.lock:
                data = self._model.packet(address)
            self._write(_STREAM_DATA, 0, struct.pack("<BBH", address, _OK, len(data)) + data)
            due += 0.001
            stop.wait(max(0.0, due - time.monotonic() - 0.001))

    def _hush(self) -> None:
        while self._streams:
            self._streams.popitem()[1].set()
