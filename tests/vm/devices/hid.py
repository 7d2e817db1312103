"""What devices of the HID class share: a description of their reports and an endpoint in each direction."""

from dataclasses import dataclass

from vm.devices.model import INTERRUPT, Model, Request, endpoint, interface

SPEAKS, _LISTENS = 0x83, 0x03
_HID, _REPORT = 0x21, 0x22
_GET_REPORT = 0x01


@dataclass
class HidDevice(Model):
    """A device whose reports have the form of ``description``."""

    speed: str = "full"
    description: bytes = b""

    def _hid(self) -> bytes:
        return bytes([9, _HID, 0x11, 0x01, 0, 1, _REPORT, len(self.description), 0])

    def body(self) -> bytes:
        """One interface."""
        ends = endpoint(SPEAKS, INTERRUPT, 64, 1) + endpoint(_LISTENS, INTERRUPT, 64, 1)
        return interface(0, 0, 2, (3, 0, 0)) + self._hid() + ends

    def descriptor(self, kind: int, request: Request) -> bytes | None:
        """What its reports are like."""
        return {_HID: self._hid(), _REPORT: self.description}.get(kind)

    def request(self, request: Request) -> bytes | None:
        """Reports that are asked for; what is set, idle rates and the like, is accepted."""
        if request.code == _GET_REPORT:
            return self.report(request.value >> 8, request.value & 255)
        return None if request.reads else b""

    def report(self, kind: int, number: int) -> bytes | None:
        """A report that the host asks for: of ``kind`` 1 for input and 3 for a feature."""
        return None
