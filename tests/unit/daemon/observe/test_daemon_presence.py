"""Which devices are there: asked of the runtime when a name moved, and never reported as gone what was never there."""

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
from plugged import CAMERA, SENSOR, Host

from octoform import host
from octoform.daemon.model import LastSeen
from octoform.daemon.observe.presence import Presence, Seen
from octoform.endpoint.process.record import Running
from octoform.endpoint.published_files import served_nodes
from octoform.state.artifact_cache import write_instances
from octoform.state.layout import Layout

PLACE = "/sys/devices/usb1/1-5"
TOOLS = [
    {"name": "look", "effect": "read", "devices": [CAMERA]},
    {"name": "turn", "effect": "actuate", "devices": [CAMERA]},
    {"name": "read", "effect": "read", "devices": [SENSOR]},
]


@pytest.fixture
def layout(tmp_path: Path) -> Layout:
    layout = Layout(tmp_path / "project", "bench")
    layout.endpoint.mkdir(parents=True)
    (layout.endpoint / "connection.json").write_text(json.dumps({"tools": TOOLS}))
    write_instances(layout, {CAMERA: {"sysfs": PLACE, "port": "1-5", "strength": "positional"}})
    return layout


@pytest.fixture
def rig(tmp_path: Path) -> Host:
    rig = Host(tmp_path / "root")
    rig.plug(CAMERA, SENSOR)
    return rig


def environ(rig: Host) -> dict[str, str]:
    return {"PATH": os.environ["PATH"], "OCTOFORM_SYSROOT": str(rig.root)}


def test_the_devices_of_tools_and_whether_something_moves_them(layout: Layout) -> None:
    assert served_nodes(layout) == {SENSOR: False, CAMERA: True}
    (layout.endpoint / "connection.json").write_text("[]")
    assert served_nodes(layout) == {}


def look(presence: Presence, again: bool = False) -> Seen:
    seen = presence(again=again)
    assert seen is not None
    return seen


def test_a_device_that_is_there_is_gone_and_comes_back_elsewhere(layout: Layout, rig: Host) -> None:
    presence = Presence(layout, environ(rig))
    seen = look(presence).devices
    assert seen[CAMERA] == LastSeen(True, PLACE, None, PLACE)
    assert seen[SENSOR].there
    rig.unplug_camera()
    assert look(presence).devices[CAMERA] == LastSeen(False, None, None, PLACE)
    rig.plug(CAMERA)
    folder = rig.root / "sys/devices/usb1"
    (folder / "1-5").rename(folder / "1-7")
    (rig.root / "sys/bus/usb/devices/1-5").unlink()
    (rig.root / "sys/bus/usb/devices/1-7").symlink_to(folder / "1-7")
    assert look(presence).devices[CAMERA] == LastSeen(True, "/sys/devices/usb1/1-7", None, PLACE)


class Where:
    """Stands for the runtime, and counts."""

    def __init__(self) -> None:
        self.asked = 0
        self.answers: Mapping[str, Mapping[str, Any]] | None = {}

    def __call__(self, ids: Sequence[str], process: Running | None = None) -> Mapping[str, Mapping[str, Any]] | None:
        self.asked += 1
        return self.answers


def test_the_runtime_is_asked_only_when_a_name_moved(layout: Layout, rig: Host) -> None:
    where = Where()
    presence = Presence(layout, environ(rig), where)
    for _ in range(3):
        presence()
    assert where.asked == 1
    presence(again=True)
    assert where.asked == 2
    rig.unplug_camera()
    presence()
    assert where.asked == 3
    write_instances(layout, {CAMERA: {"sysfs": "/sys/devices/usb1/1-9"}})
    presence()
    assert where.asked == 4


def test_what_does_not_answer_says_nothing_and_is_asked_again(layout: Layout, rig: Host) -> None:
    where = Where()
    where.answers = None
    presence = Presence(layout, environ(rig), where)
    assert look(presence).devices[CAMERA] == LastSeen(None, None, None, PLACE)
    presence()
    assert where.asked == 2


def test_what_was_never_there_is_not_gone_and_a_doubt_is_of_what_moves(layout: Layout, rig: Host) -> None:
    where = Where()
    absent = {"attached": False, "doubt": "it is not attached"}
    doubtful = {"attached": True, "sysfs": PLACE, "doubt": "it may be another"}
    presence = Presence(layout, environ(rig), where)
    where.answers = {CAMERA: doubtful, SENSOR: absent}
    seen = look(presence, again=True).devices
    assert (seen[SENSOR].there, seen[SENSOR].doubt) == (None, None)
    assert seen[CAMERA].doubt == "it may be another"
    where.answers = {CAMERA: absent, SENSOR: doubtful}
    seen = look(presence, again=True).devices
    assert (seen[SENSOR].there, seen[SENSOR].doubt) == (True, None)
    where.answers = {CAMERA: absent, SENSOR: absent}
    seen = look(presence, again=True).devices
    assert (seen[SENSOR].there, seen[CAMERA].there) == (False, False)


def test_a_device_that_comes_back_while_the_runtime_is_asked_is_not_gone(layout: Layout, rig: Host) -> None:
    modalias = rig.root / "sys/bus/usb/devices/1-5:1.0/modalias"
    modalias.parent.mkdir()
    modalias.write_text("usb:v045Ep0772d0100\n")
    entries = host.fingerprint(rig.root).entries
    assert "usb:v045Ep0772d0100" in entries
    layout.fingerprint.write_text(json.dumps({"entries": entries}))
    modalias.unlink()

    class Slow(Where):
        def __call__(
            self, ids: Sequence[str], process: Running | None = None
        ) -> Mapping[str, Mapping[str, Any]] | None:
            modalias.write_text("usb:v045Ep0772d0100\n")
            return {CAMERA: {"attached": True, "sysfs": PLACE}}

    seen = Presence(layout, environ(rig), Slow())()
    assert seen is not None
    assert (seen.devices[CAMERA].there, seen.appeared, seen.gone) == (True, (), ())


def test_kinds_that_came_or_went_since_probe(layout: Layout, rig: Host) -> None:
    presence = Presence(layout, environ(rig), Where())
    assert look(presence).appeared == ()
    entries = host.fingerprint(rig.root).entries
    layout.fingerprint.write_text(json.dumps({"entries": [*entries, "usb:v1234"]}))
    assert look(presence).gone == ("usb:v1234",)
    silent = Where()
    silent.answers = None
    assert look(Presence(layout, environ(rig), silent)).gone == (), "it may be a device of the endpoint"
    layout.fingerprint.write_text("{")
    assert (look(presence).appeared, look(presence).gone) == ((), ())
