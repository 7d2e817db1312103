"""A tool whose device fails: it raises an error, and does not answer that there is nothing."""

import copy
from typing import Any

from cases import for_each
from failing_servers import INTERFACE, OTHERWISE, RIGHT, SERVER, UNASKED, WRONG

from octoform.contracts.rules.serve.serve_rules import serve_static
from octoform.diagnostics import Severity


def errors(server: str, interface: dict[str, Any] = INTERFACE) -> set[str]:
    found = serve_static(server, interface)
    return {f"{item.code}: {item.summary}" for item in found if item.severity is Severity.ERROR}


@for_each("case", WRONG)
def test_an_answer_of_nothing_is_refused(case: str) -> None:
    found = errors(WRONG[case])
    assert any("SERVE-DEFAULT-READING" in item and "answers with nothing" in item for item in found), found


@for_each("case", RIGHT)
def test_a_failure_that_is_raised_is_accepted(case: str) -> None:
    assert errors(RIGHT[case]) == set()


@for_each("case", UNASKED)
def test_a_device_that_is_always_there_is_refused(case: str) -> None:
    assert "SERVE-DEVICE-NOT-ASKED" in {item.partition(":")[0] for item in errors(UNASKED[case])}


def test_a_tool_of_presence_may_name_its_device() -> None:
    def named(server: str) -> str:
        fields = server.replace("    attached: bool\n", "    device: str\n    attached: bool\n")
        return fields.replace("return Presence(", 'return Presence("usb-1f00-00c1", ')

    interface = copy.deepcopy(INTERFACE)
    interface["tools"][-1]["output_schema"]["properties"]["device"] = {"type": "string"}
    assert errors(named(SERVER), interface) == set()
    for server in UNASKED.values():
        assert "SERVE-DEVICE-NOT-ASKED" in {item.partition(":")[0] for item in errors(named(server), interface)}


@for_each("case", OTHERWISE)
def test_another_attribute_than_is_named_is_refused(case: str) -> None:
    server, code = OTHERWISE[case]
    assert {item.partition(":")[0] for item in errors(server)} == {code}


def test_another_description_than_that_of_interface_is_a_warning() -> None:
    for other in ('"""Read it, and then call read_identity."""', '"""Wait for touches. You must stay."""', "pass"):
        found = serve_static(SERVER.replace('"""Wait for touches."""', other), INTERFACE)
        assert [(item.code, item.severity) for item in found] == [("SERVE-DESCRIPTION-DIFFERS", Severity.WARNING)]
    assert serve_static(SERVER.replace('"""Wait for touches."""', '"""Wait\n    for touches."""'), INTERFACE) == []
    given = SERVER.replace("@mcp.tool(annotations=READ)", '@mcp.tool(annotations=READ, description="Stay.")', 1)
    assert [item.code for item in serve_static(given, INTERFACE)] == ["SERVE-DESCRIPTION-DIFFERS"]
