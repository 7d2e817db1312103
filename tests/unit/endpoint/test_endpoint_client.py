"""Listing and calling for a person at a terminal."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from endpoint_servers import HEADER, VOLTAGE, processes_of, publish, tool
from endpoint_zoo import PICTURE

from octoform.endpoint.check import check
from octoform.endpoint.client import call, list_tools, save_media
from octoform.endpoint.environment import Environment
from octoform.endpoint.errand import Call, Report, recorded_environment, send
from octoform.endpoint.observing import Expected, observe
from octoform.endpoint.sighting import record_sight
from octoform.state.layout import Layout

BOUNDED = "channel: Annotated[int, Field(ge=1, le=8, description='input 1 to 8')], label: str = ''"
SOURCE = (
    HEADER.replace("import runtime", "from typing import Annotated\n\nfrom pydantic import Field\n\nimport runtime")
    + tool("return channel * 1.5", head=BOUNDED)
    + tool("raise runtime.DeviceAbsent('usb-0000-0000', 'it is not connected')", name="absent")
    + tool(PICTURE.replace("{row}", "range(16)"), name="picture", returns="Image")
)
SERVED = Expected(tools=("absent", "picture", "read_clock", "read_voltage"))


SECONDS = 20.0
WRONG = [
    ({"chanel": 2, "channel": 2}, "'chanel'", "did you mean 'channel'?"),
    ({}, "'channel'", "input 1 to 8"),
    ({"channel": 9}, "'channel'", "input 1 to 8"),
]
CALLS = [
    Call("absent", seconds=SECONDS),
    Call("picture", seconds=SECONDS),
    Call("read_voltag", seconds=SECONDS),
    *(Call("read_voltage", arguments, seconds=SECONDS) for arguments, _, _ in WRONG),
]


@pytest.fixture(scope="module")
def bench(serving: Environment, tmp_path_factory: pytest.TempPathFactory) -> Layout:
    """An applied endpoint with a tool of bounded parameters, one whose device is gone, and a camera."""
    layout = Layout(tmp_path_factory.mktemp("client"), "bench")
    check(layout, publish(layout, serving, SOURCE, VOLTAGE), smoke=False)
    assert observe(layout, SERVED).reasons == ()
    return layout


@pytest.fixture(scope="module")
def brought(bench: Layout) -> tuple[Report, str]:
    """What one real errand with all the calls brought back, and what the calls' log says of it."""
    environment = recorded_environment(bench)
    assert environment is not None
    before = bench.call_log.read_text() if bench.call_log.exists() else ""
    report = send(bench, environment, CALLS, keep_content=True)
    assert processes_of(bench) == []
    return report, bench.call_log.read_text().removeprefix(before)


@pytest.fixture
def asked(bench: Layout, brought: tuple[Report, str], monkeypatch: pytest.MonkeyPatch) -> Layout:
    """The endpoint; a call that was among those of the errand gets the answer which it got there."""

    def answer(_: Layout, __: Environment, calls: Sequence[Call], **___: object) -> Report:
        return replace(brought[0], calls=[brought[0].calls[CALLS.index(wanted)] for wanted in calls])

    monkeypatch.setattr("octoform.endpoint.client.send", answer)
    return bench


def test_the_tools_are_listed_with_their_schemas(asked: Layout) -> None:
    tools, problems = list_tools(asked)
    assert problems == ()
    assert [item["name"] for item in tools] == ["absent", "picture", "read_clock", "read_voltage"]
    assert tools[3]["input_schema"]["properties"]["channel"]["maximum"] == 8


def test_texts_of_a_command_line_become_what_the_schema_asks_for(bench: Layout) -> None:
    result, problems = call(bench, "read_voltage", {}, {"channel": "2", "label": "7"})
    assert problems == ()
    assert result is not None and not result.is_error
    assert result.structured == {"result": 3.0}
    assert result.content[0]["text"] == "3.0"
    assert '"label": "7"' in bench.call_log.read_text()
    assert processes_of(bench) == []


@pytest.mark.parametrize(("arguments", "names", "hint"), WRONG)
def test_a_wrong_argument_is_named_and_reaches_no_device(
    asked: Layout, brought: tuple[Report, str], arguments: dict[str, object], names: str, hint: str
) -> None:
    result, (problem,) = call(asked, "read_voltage", arguments, timeout=SECONDS)
    assert result is None
    assert problem.code == "ENDPOINT-BAD-ARGUMENT"
    assert names in problem.summary
    assert problem.hint == hint
    assert '"tool": "absent"' in brought[1], "what is called is in the log"
    assert "read_voltage" not in brought[1]


def test_an_unknown_tool_gets_a_suggestion(asked: Layout) -> None:
    result, (problem,) = call(asked, "read_voltag", {}, timeout=SECONDS)
    assert result is None
    assert (problem.code, problem.hint) == ("ENDPOINT-UNKNOWN-TOOL", "did you mean 'read_voltage'?")


def test_what_the_tool_says_of_itself_is_a_result(asked: Layout) -> None:
    result, problems = call(asked, "absent", {}, timeout=SECONDS)
    assert problems == ()
    assert result is not None and result.is_error
    assert "it is not connected" in result.message


def test_pictures_can_be_kept(asked: Layout, tmp_path: Path) -> None:
    result, _ = call(asked, "picture", {}, timeout=SECONDS)
    assert result is not None
    (path,), problems = save_media(result, tmp_path / "frames", "picture")
    assert problems == []
    assert path.name == "picture-1.png"
    assert path.read_bytes().startswith(b"\x89PNG")
    assert path.stat().st_mode & 0o777 == 0o600


def test_without_an_endpoint_the_person_is_told_what_to_do(layout: Layout) -> None:
    assert [item.code for item in list_tools(layout)[1]] == ["ENDPOINT-NOT-APPLIED"]
    assert [item.code for item in call(layout, "x", {})[1]] == ["ENDPOINT-NOT-APPLIED"]


def test_a_refusal_of_the_launcher_reaches_the_person_and_a_plan_knows_what_was_seen_last(bench: Layout) -> None:
    server = bench.output("serve")
    good = server.read_bytes()
    server.unlink()
    try:
        _, (problem,) = list_tools(bench)
    finally:
        server.write_bytes(good)
    assert problem.code == "ENDPOINT-DOWN"
    assert "cannot be read" in str(problem.detail)
    assert observe(bench, SERVED).reasons == ("the endpoint did not answer when it was last checked",)
    tools, problems = list_tools(bench)
    assert problems == ()
    assert tuple(item["name"] for item in tools) == SERVED.tools
    assert observe(bench, SERVED).reasons == ()


def test_what_was_seen_of_a_former_endpoint_says_nothing_of_the_present_one(
    bench: Layout, serving: Environment
) -> None:
    former = replace(serving, path=serving.path.parent / "former")
    record_sight(bench, former, Report(False, "gone", None, None, [], [], 1.0, 0, ""))
    assert observe(bench, SERVED).answered
