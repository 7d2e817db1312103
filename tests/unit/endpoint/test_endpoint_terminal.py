"""Listing and calling for a person at a terminal, against a running endpoint with its gate."""

import json
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from launched import Launched, launched
from launched import tool as told
from unit.endpoint.endpoint_servers import HEADER, tool
from unit.endpoint.endpoint_zoo import PICTURE

from octoform.endpoint.client.jsonrpc import ToolCall
from octoform.endpoint.client.terminal import (
    EndpointState,
    Person,
    call,
    list_tools,
    published,
    record_state,
    save_media,
)
from octoform.endpoint.published_files import CHECK
from octoform.state.layout import Layout

pytestmark = pytest.mark.usefixtures("forks")

BOUNDED = "channel: Annotated[int, Field(ge=1, le=8, description='input 1 to 8')], label: str = ''"
SLOW = '''

@mcp.tool(annotations=READ)
async def sweep(steps: int, mark: str, ctx: Context) -> int:
    """Goes from step to step, and leaves word when it is stopped."""
    try:
        for step in range(steps):
            await ctx.report_progress(step + 1, steps, f"step {step + 1}")
            await anyio.sleep(0.02)
    except BaseException:
        Path(mark).write_text("stopped")
        raise
    return steps


@mcp.tool(annotations=READ, output_schema={"type": "object", "properties": {"volts": {"type": "number"}}})
def lie() -> ToolResult:
    """Promises a number."""
    return ToolResult(content="x", structured_content={"volts": "many"})
'''
IMPORTS = """from pathlib import Path
from typing import Annotated

import anyio
from fastmcp import Context
from pydantic import Field

import runtime"""
SOURCE = (
    HEADER.replace("import runtime", IMPORTS)
    + tool("return channel * 1.5", head=BOUNDED)
    + tool("raise runtime.DeviceAbsent('usb-0000-0000', 'it is not connected')", name="absent")
    + tool(PICTURE.replace("{row}", "range(16)"), name="picture", returns="Image")
    + tool("return float(steps)", name="move", head="steps: int")
    + tool("import time\ntime.sleep(30)\nreturn 1.0", name="hang")
    + SLOW
)
NAMES = ["absent", "hang", "lie", "move", "picture", "read_clock", "read_voltage", "sweep"]
WRONG: list[tuple[dict[str, Any], str, str]] = [
    ({"chanel": 2, "channel": 2}, "'chanel'", "did you mean 'channel'?"),
    ({}, "'channel'", "input 1 to 8"),
    ({"channel": 9}, "'channel'", "input 1 to 8"),
]


class Somebody(Person):
    """A person whose answer is known; keeps questions and messages."""

    def __init__(self, answer: bool | None) -> None:
        self.answer = answer
        self.asked: list[tuple[str, Mapping[str, Any], str]] = []
        self.seen: list[tuple[float, float | None, str]] = []
        self.waited = False

    def waiting(self) -> None:
        self.waited = True

    def progress(self, done: float, total: float | None, message: str) -> None:
        self.seen.append((done, total, message))

    def approves(self, tool: str, arguments: Mapping[str, Any], message: str) -> bool | None:
        self.asked.append((tool, arguments, message))
        return self.answer


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launched]:
    """A running endpoint: bounded parameters, a device that is gone, a camera, an actuator that wants an approval."""
    readers = [told(name, "read", f"usb-{name}") for name in NAMES if name != "move"]
    policy = {"tools": {"move": {"decision": "confirm"}}}
    folder = tmp_path_factory.mktemp("client")
    with launched(folder, SOURCE, [*readers, told("move", "irreversible", "usb-move")], policy=policy) as endpoint:
        yield endpoint


def logged(endpoint: Launched) -> str:
    log = endpoint.layout.call_log
    return log.read_text() if log.exists() else ""


def until(holds: Callable[[], object], seconds: float = 10.0) -> None:
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_the_tools_are_listed_with_their_schemas(bench: Launched) -> None:
    tools, problems = list_tools(bench.layout)
    assert problems == ()
    assert [item["name"] for item in tools] == NAMES
    assert tools[6]["input_schema"]["properties"]["channel"]["maximum"] == 8
    assert tools[6]["annotations"]["readOnlyHint"] is True


def test_texts_of_a_command_line_become_what_the_schema_asks_for(bench: Launched) -> None:
    result, problems = call(bench.layout, ToolCall("read_voltage", {}, {"channel": "2", "label": "7"}))
    assert problems == ()
    assert result is not None and not result.is_error
    assert result.structured == {"result": 3.0}
    assert result.content[0]["text"] == "3.0"
    assert '"label": "7"' in logged(bench)


@pytest.mark.parametrize(("arguments", "names", "hint"), WRONG)
def test_a_wrong_argument_is_named_and_reaches_no_device(
    bench: Launched, arguments: dict[str, object], names: str, hint: str
) -> None:
    before = logged(bench)
    result, (problem,) = call(bench.layout, ToolCall("read_voltage", arguments))
    assert result is None
    assert problem.code == "ENDPOINT-BAD-ARGUMENT"
    assert names in problem.summary
    assert problem.hint == hint
    assert logged(bench) == before


def test_an_unknown_tool_gets_a_suggestion(bench: Launched) -> None:
    result, (problem,) = call(bench.layout, ToolCall("read_voltag"))
    assert result is None
    assert (problem.code, problem.hint) == ("ENDPOINT-UNKNOWN-TOOL", "did you mean 'read_voltage'?")


def test_what_the_tool_says_of_itself_is_a_result(bench: Launched) -> None:
    result, problems = call(bench.layout, ToolCall("absent"))
    assert problems == ()
    assert result is not None and result.is_error
    assert "it is not connected" in result.message


def test_a_result_that_breaks_its_own_schema_is_an_error(bench: Launched) -> None:
    result, problems = call(bench.layout, ToolCall("lie"))
    assert problems == ()
    assert result is not None and result.is_error
    assert "does not fit its output schema" in result.message


def test_pictures_can_be_kept(bench: Launched, tmp_path: Path) -> None:
    result, _ = call(bench.layout, ToolCall("picture"))
    assert result is not None
    (path,), problems = save_media(result.content, tmp_path / "frames", "picture")
    assert problems == []
    assert path.name == "picture-1.png"
    assert path.read_bytes().startswith(b"\x89PNG")
    assert path.stat().st_mode & 0o777 == 0o600


def test_a_call_is_made_when_the_person_approves_it(bench: Launched) -> None:
    person = Somebody(True)
    result, problems = call(bench.layout, ToolCall("move", {}, {"steps": "7"}), person)
    assert problems == ()
    assert result is not None and result.structured == {"result": 7.0}
    ((name, arguments, message),) = person.asked
    assert (name, arguments) == ("move", {"steps": 7})
    assert "move" in message


@pytest.mark.parametrize(("answer", "words"), [(False, "move was not approved"), (None, "move wants an approval")])
def test_a_call_that_nobody_approves_is_not_made(bench: Launched, answer: bool | None, words: str) -> None:
    before = logged(bench)
    result, (problem,) = call(bench.layout, ToolCall("move", {"steps": 7}), Somebody(answer))
    assert result is None
    assert (problem.code, problem.summary) == ("ENDPOINT-CALL-NOT-APPROVED", words)
    records = [json.loads(line) for line in (bench.layout.logs / "audit.jsonl").read_text().splitlines()]
    last = [each for each in records if each["event"] == "decision"][-1]
    if answer is None:
        assert problem.detail == "no one could be asked: there is no terminal; -auto-approve approves"
        assert last["decision"] == "ask", "no word of a person is on the log that no one gave"
    else:
        assert str(problem.detail).startswith("the person declined this call")
        assert last["code"] == "declined"
    assert "move" not in logged(bench).removeprefix(before)


def test_a_dry_run_asks_nobody_and_calls_nothing(bench: Launched) -> None:
    person, before = Somebody(True), logged(bench)
    result, problems = call(bench.layout, ToolCall("move", {"steps": 7}, dry_run=True), person)
    assert problems == ()
    assert result is not None and not result.is_error
    assert "dry run" in result.message.lower()
    assert person.asked == []
    assert logged(bench) == before


def test_progress_is_told_while_the_tool_works(bench: Launched, tmp_path: Path) -> None:
    person = Somebody(None)
    result, problems = call(bench.layout, ToolCall("sweep", {"steps": 3, "mark": str(tmp_path / "m")}), person)
    assert problems == ()
    assert result is not None and result.structured == {"result": 3}
    assert person.seen == [(1, 3, "step 1"), (2, 3, "step 2"), (3, 3, "step 3")]


def test_an_interrupted_call_is_stopped_where_it_works(bench: Launched, tmp_path: Path) -> None:
    mark = tmp_path / "mark"

    class Impatient(Somebody):
        def progress(self, done: float, total: float | None, message: str) -> None:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        call(bench.layout, ToolCall("sweep", {"steps": 100_000, "mark": str(mark)}), Impatient(None))
    until(mark.exists)


def test_a_call_that_takes_too_long_is_given_up_and_the_endpoint_lives_on(bench: Launched) -> None:
    result, (problem,) = call(bench.layout, ToolCall("hang", seconds=0.3))
    assert result is None
    assert (problem.code, problem.summary) == ("ENDPOINT-CALL-TIMEOUT", "hang gave no answer within 0.3 s")
    result, problems = call(bench.layout, ToolCall("read_clock"))
    assert problems == () and result is not None


def test_an_endpoint_that_dies_under_a_call_is_told_and_started_by_the_next(bench: Launched, tmp_path: Path) -> None:
    pid = bench.process.pid

    class Killer(Somebody):
        def progress(self, done: float, total: float | None, message: str) -> None:
            os.kill(pid, signal.SIGKILL)

    _, (problem,) = call(bench.layout, ToolCall("sweep", {"steps": 100_000, "mark": str(tmp_path / "m")}), Killer(None))
    assert (problem.code, problem.summary) == ("ENDPOINT-DOWN", "the endpoint broke off during sweep")
    result, problems = call(bench.layout, ToolCall("read_clock"))
    assert problems == () and result is not None
    assert bench.process.pid != pid


def test_whoever_waits_for_a_start_is_told_after_a_second(bench: Launched, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.stop()
    monkeypatch.setattr("octoform.endpoint.dial.PATIENCE_SECONDS", 0.001)
    found = threading.Event()
    tools, problems = list_tools(bench.layout, found.set)
    assert problems == () and len(tools) == len(NAMES)
    assert found.is_set()


def test_a_list_without_a_start_starts_nothing(bench: Launched) -> None:
    bench.stop()
    tools, (problem,) = list_tools(bench.layout, start=False)
    assert (tools, problem.code) == ((), "ENDPOINT-DOWN")
    assert not bench.layout.socket.exists()
    bench.start()


def test_without_an_endpoint_the_person_is_told_what_to_do(layout: Layout) -> None:
    assert [item.code for item in list_tools(layout)[1]] == ["ENDPOINT-NOT-APPLIED"]
    assert [item.code for item in call(layout, ToolCall("x"))[1]] == ["ENDPOINT-NOT-APPLIED"]


def test_a_refusal_of_the_launcher_reaches_the_person_and_a_plan_knows_what_was_seen_last(bench: Launched) -> None:
    layout, server = bench.layout, bench.layout.output("serve")
    record = layout.endpoint / CHECK
    record.write_text(json.dumps({"format": 1, "answered": True, "error": None, "tools": NAMES, "calls": [1]}))
    bench.stop()
    good = server.read_bytes()
    server.unlink()
    try:
        _, (problem,) = list_tools(layout)
    finally:
        server.write_bytes(good)
    assert problem.code == "ENDPOINT-START-FAILED"
    assert "cannot be read" in str(problem.detail)
    seen = json.loads(record.read_text())
    assert (seen["answered"], seen["tools"], seen["calls"]) == (False, [], [1])
    assert "cannot be read" in seen["error"]
    assert list_tools(layout)[1] == ()
    seen = json.loads(record.read_text())
    assert (seen["answered"], seen["tools"]) == (True, NAMES)


def test_what_was_seen_of_a_former_endpoint_says_nothing_of_the_present_one(bench: Launched) -> None:
    record = bench.layout.endpoint / CHECK
    record.write_text(json.dumps({"answered": True, "tools": NAMES}))
    record_state(bench.layout, f"{published(bench.layout)}-former", EndpointState(False, "gone"))
    assert json.loads(record.read_text())["answered"] is True


WORDS = "from typing import Annotated, Literal\n\nfrom pydantic import Field\n\nimport runtime"
DEVICE = "device: Annotated[Literal['usb-1', 'usb-2'], Field(description='device id')]"
CHOSEN = (
    HEADER.replace("import runtime", WORDS)
    + tool("return 20.5", name="read_temperature", head=DEVICE)
    + tool("return 1.0", name="read_lines")
)


def test_a_denied_tool_is_refused_in_the_words_of_the_policy_and_an_argument_tells_what_it_may_be(
    tmp_path: Path,
) -> None:
    policy = {"tools": {"read_lines": {"decision": "deny", "source": "policy.rules[0]"}}}
    with launched(tmp_path, CHOSEN, [told("read_temperature"), told("read_lines")], policy=policy) as endpoint:
        assert [item["name"] for item in list_tools(endpoint.layout)[0]] == ["read_temperature"]
        result, problems = call(endpoint.layout, ToolCall("read_lines"))
        assert problems == () and result is not None and result.is_error
        assert result.message == "read_lines is denied by policy.rules[0]"
        assert '"code":"denied"' in (endpoint.layout.logs / "audit.jsonl").read_text()
        result, (problem,) = call(endpoint.layout, ToolCall("read_temperature"))
        assert result is None and problem.hint == "device id; device is one of usb-1, usb-2"
        result, (problem,) = call(endpoint.layout, ToolCall("read_line"))
        assert problem.code == "ENDPOINT-UNKNOWN-TOOL"
