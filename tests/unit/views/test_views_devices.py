"""The devices of a host as a person and as a program see them."""

import io
import json
from typing import Any

from octoform.engine.inspect.devices import Attached, LeftOut, Listing, Row
from octoform.views import devices
from octoform.views.format.console import Console

STRONG = Attached(True, "1-7", "strong", ("/dev/video5",), "")
DOUBTED = Attached(True, "1-4", "weak", (), "usb-1f00-00b1 may be any of 2 equal devices (1-4, 1-5)")
ABSENT = Attached(False, "", "", (), "usb-1f00-00a1 is not attached, or its driver does not see it")


def row(name: str, now: Attached | None, *tools: str, **more: Any) -> Row:
    given: dict[str, Any] = {"serial": "", "pseudonym": "", "evidence": ("product: Cam",), "missing": "", **more}
    return Row(name, "Bench \x1b[31mCam", "sensor", tools, now, **given)


FOUND = Listing(
    "bench",
    (
        row("usb-1f00-00c1", STRONG, "capture_image", serial="CAM-0007", pseudonym="redacted-0123456789"),
        row("usb-1f00-00b1", DOUBTED, "ask", "move"),
        row("usb-1f00-00a1", ABSENT, missing="Say what it measures."),
        row("usb-1f00-00d1", None, needs_profile=True),
    ),
    (LeftOut("pci-1f00-0001", "bus_infrastructure", "carries other devices"),),
    True,
)


def shown(found: Listing = FOUND, *, as_json: bool = False, verbose: bool = False) -> str:
    out = io.StringIO()
    console = Console(out, io.StringIO(), colour=False, colour_err=False, interactive=False)
    assert devices.show(console, found, as_json=as_json, verbose=verbose) == 0
    return out.getvalue()


def test_one_line_a_device_without_its_serial_number() -> None:
    assert shown().splitlines() == [
        "usb-1f00-00c1  Bench \\x1b[31mCam (sensor, 1 tool)  at 1-7 as /dev/video5 [by serial]",
        "usb-1f00-00b1  Bench \\x1b[31mCam (sensor, 2 tools)  at 1-4 [ambiguous, in doubt]",
        "usb-1f00-00a1  Bench \\x1b[31mCam (sensor, no tool)  absent",
        "usb-1f00-00d1  Bench \\x1b[31mCam (sensor, no tool, needs a profile)  not known whether attached",
        "4 devices, 2 attached now, 1 skipped; -v shows reasons, evidence and serial numbers",
    ]


def test_all_that_lies_behind_it_with_v() -> None:
    text = shown(verbose=True)
    for line in (
        "serial number: CAM-0007, committed as redacted-0123456789",
        "evidence: product: Cam",
        "missing: Say what it measures.",
        "ambiguous: only its device model identifies it; with two of them attached, nothing is moved",
        "needs a profile: octoform profile new usb-1f00-00d1 drafts one",
        "note: usb-1f00-00b1 may be any of 2 equal devices (1-4, 1-5)",
        "skipped: pci-1f00-0001: bus infrastructure (carries other devices)",
    ):
        assert line in text


def test_the_document_has_serial_numbers_only_with_v() -> None:
    plain, whole = (json.loads(shown(as_json=True, verbose=verbose)) for verbose in (False, True))
    assert "CAM-0007" not in json.dumps(plain)
    assert whole["devices"][0]["serial"] == "CAM-0007"
    assert plain["devices"][0]["now"] == {
        "attached": True,
        "port": "1-7",
        "strength": "strong",
        "nodes": ["/dev/video5"],
        "doubt": "",
        "refused": [],
    }
    assert plain["left_out"] == [
        {"id": "pci-1f00-0001", "reason": "bus_infrastructure", "detail": "carries other devices"}
    ]


def test_a_machine_without_a_ledger_is_told_what_helps() -> None:
    assert "`octoform apply` lets PROBE look again" in shown(Listing("bench", (), (), False))


def test_a_node_that_is_closed_to_this_user_is_shown_with_its_remedy() -> None:
    closed = {"node": "/dev/ttyUSB0", "mode": "0660", "group": "dialout", "lacks": "write to", "remedy": "join dialout"}
    now = Attached(True, "1-2", "strong", ("/dev/ttyUSB0",), "", (closed,))
    found = Listing("bench", (row("usb-1f00-00e1", now, "ask"),), (), True)
    assert "[by serial, no rights]" in shown(found)
    assert "no rights: /dev/ttyUSB0: join dialout" in shown(found, verbose=True)
