"""A tool of several devices is read for each of them: those readings are about the tool and that device alone."""

from octoform.contracts.model import Artifacts
from octoform.contracts.rules.report_rules import Target, sources_of

TOOL = {"name": "ask_board", "devices": ["usb-b", "usb-b-2"]}


def test_a_reading_for_one_device_is_of_the_tool_and_of_that_device() -> None:
    artifacts = Artifacts(interface={"tools": [TOOL]})
    assert {"ask_board(usb-b)", "ask_board(usb-b-2)"} <= sources_of(Target.of("tool:ask_board"), artifacts)
    one = sources_of(Target.of("device:usb-b"), artifacts)
    assert "ask_board(usb-b)" in one
    assert "ask_board(usb-b-2)" not in one
