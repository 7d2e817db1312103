"""Which devices are there: what counts as absent, what triggers a look, and that nothing is claimed that is unknown."""

import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from offered import runtime_beside, until
from plugged import CAMERA, SENSOR, Host

from octoform.server.process import device_presence as presence
from octoform.server.process.device_presence import Presence

DEVICES = [{"id": CAMERA, "name": "C270 HD Webcam"}, {"id": SENSOR, "name": ""}]
TOOLS = [{"name": "capture_image", "devices": [CAMERA]}, {"name": "read_both", "devices": [SENSOR, CAMERA]}]


@pytest.fixture
def host(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Host]:
    monkeypatch.setenv("OCTOFORM_SYSROOT", str(tmp_path / "root"))
    monkeypatch.setenv("OCTOFORM_INSTANCES", str(tmp_path / "none.json"))
    monkeypatch.setattr(presence, "ON_DISK", 0.05)
    with runtime_beside(tmp_path / "server", monkeypatch):
        yield Host(tmp_path / "root")


class Watched:
    """A presence that is watching, and the changes that it reported."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch | None = None, events: socket.socket | None = None) -> None:
        self.told: list[set[str]] = []
        self.presence = Presence(
            DEVICES, TOOLS, lambda changed: self.told.append(set(changed)), (lambda: events) if events else None
        )

    def __enter__(self) -> "Watched":
        self.presence.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.presence.stop()
        thread = self.presence._thread
        if thread is not None:
            thread.join(10)
            assert not thread.is_alive()


@pytest.mark.usefixtures("thousand_descriptors")
def test_a_server_with_a_thousand_files_open_watches_too(host: Host) -> None:
    host.plug(CAMERA, SENSOR)
    with Watched() as watched:
        until(lambda: watched.presence.present(CAMERA) is True)
        host.unplug_camera()
        until(lambda: watched.presence.absent("read_both") == ["C270 HD Webcam"])


def test_a_device_that_goes_and_comes_is_absent_in_between(host: Host) -> None:
    host.plug(CAMERA, SENSOR)
    with Watched() as watched:
        until(lambda: watched.presence.present(CAMERA) is True)
        assert watched.presence.absent("read_both") == []

        host.unplug_camera()
        until(lambda: watched.presence.absent("read_both") == ["C270 HD Webcam"])
        assert watched.presence.present(SENSOR) is True
        until(lambda: watched.told == [{CAMERA}])

        host.plug(CAMERA)
        until(lambda: watched.told == [{CAMERA}, {CAMERA}])
        assert watched.presence.absent("capture_image") == []


def test_a_call_is_for_the_device_that_it_names_and_hears_of_one_that_has_just_come_back(host: Host) -> None:
    host.plug(CAMERA, SENSOR)
    watched = Watched()
    presence = watched.presence
    presence._there.update({CAMERA: False, SENSOR: True})
    assert presence.missing("read_both", SENSOR) == []
    assert presence.missing("read_both", CAMERA) == []  # not looked at since, and it is there
    host.unplug_camera()
    assert presence.missing("read_both", CAMERA) == presence.missing("read_both", None) == ["C270 HD Webcam"]
    assert presence.missing("read_both", SENSOR) == []
    presence.stop()


def test_what_was_never_seen_and_has_no_place_is_unknown(host: Host, monkeypatch: pytest.MonkeyPatch) -> None:
    host.plug(SENSOR)
    monkeypatch.setenv("OCTOFORM_INSTANCES", str(host.record(None)))
    with Watched() as watched:
        until(lambda: watched.presence.present(SENSOR) is True)
        assert watched.presence.present(CAMERA) is None
        assert watched.presence.absent("capture_image") == []

        host.plug(CAMERA)
        until(lambda: watched.told == [{CAMERA}])
    assert watched.presence.present(CAMERA) is True


def test_what_has_a_recorded_place_is_absent_from_the_start(host: Host, monkeypatch: pytest.MonkeyPatch) -> None:
    host.plug(SENSOR)
    monkeypatch.setenv("OCTOFORM_INSTANCES", str(host.record("/sys/devices/usb1/1-5")))
    with Watched() as watched:
        until(lambda: watched.told == [{CAMERA}])
        assert watched.presence.absent("capture_image") == ["C270 HD Webcam"]


def test_a_server_without_a_runtime_has_devices_of_unknown_presence() -> None:
    with Watched() as watched:
        assert watched.presence._thread is None
        assert watched.presence.absent("capture_image") == []


def test_an_event_of_the_kernel_makes_it_look_and_a_change_event_does_not(
    host: Host, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Events reach a host whose tree is at /; here only the runtime gets the tree.
    monkeypatch.setattr(presence, "QUIET", 0.01)
    kernel, events = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    host.plug(CAMERA, SENSOR)
    root = os.environ.pop("OCTOFORM_SYSROOT")
    import runtime.sysfs  # type: ignore[import-not-found]

    monkeypatch.setattr(runtime.sysfs.os, "environ", {"OCTOFORM_SYSROOT": root})
    with kernel, Watched(events=events) as watched:
        until(lambda: watched.presence.present(CAMERA) is True)
        host.unplug_camera()
        kernel.send(b"change@/devices/usb1/1-5\0ACTION=change\0")
        kernel.send(b"libudev\0\0\0")
        kernel.send(b"remove@/devices/usb1/1-5\0ACTION=remove\0")
        until(lambda: watched.told == [{CAMERA}])


@pytest.mark.parametrize(
    ("event", "counts"),
    [
        (b"add@/devices/usb1/1-5\0ACTION=add\0", True),
        (b"unbind@/devices/usb1/1-5\0", True),
        (b"change@/devices/power_supply/BAT0\0ACTION=change\0", False),
        (b"libudev\0\xfe\xed\xca\xfe", False),
        (b"", False),
    ],
)
def test_what_neither_comes_nor_goes_is_no_reason_to_look(event: bytes, counts: bool) -> None:
    kernel, events = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    with kernel, events:
        kernel.send(event)
        assert presence._is_plugging(events) is counts


def test_only_the_kernel_is_believed() -> None:
    events = presence.kernel_events()
    if events is None:
        pytest.skip("this process may not listen to the kernel's events")
    with events, socket.socket(socket.AF_NETLINK, socket.SOCK_DGRAM, presence.KOBJECT_UEVENT) as other:
        events.settimeout(5)
        try:
            other.sendto(b"add@/devices/x\0ACTION=add\0", (events.getsockname()[0], 0))
        except PermissionError:
            pytest.skip("this process may not send to another's socket")
        assert presence._is_plugging(events) is False


def test_a_real_event_of_the_kernel_is_heard() -> None:
    events, trigger = presence.kernel_events(), Path("/sys/class/net/lo/uevent")
    if events is None or not os.access(trigger, os.W_OK):
        pytest.skip("this process may not make the kernel announce a device")
    with events:
        events.settimeout(5)
        trigger.write_text("add")
        until(lambda: presence._is_plugging(events), 10)
