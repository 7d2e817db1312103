"""A profile's text is enough for products that acknowledge nothing, answer in several lines, or speak by themselves.

One live endpoint for the file: the real command line onboards a planted board whose far end is a pseudo terminal. What
counts is which bytes reached that end, and the answer to the client.
"""

import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hosts.plant import plant
from projects import Project
from rig.rail import DEVICE, HOST

from octoform.endpoint.client.jsonrpc import ToolCall
from octoform.endpoint.client.terminal import call
from octoform.simulation.rig import Port
from octoform.state.layout import Layout

pytestmark = pytest.mark.dear

PROFILE = """---
name: heater
about: a heater that reports by itself
product: Bench Heater
evidence: {all: [{vid_pid: "2341:804f"}, {text: [bench heater]}]}
grammar:
  line: {class: tty, baud: 9600, error: "NO {message}", timeout: 2s}
  commands:
    - tool: heater_switch
      send: "HEAT {on}"
      about: switch the heater
      effect: actuate
      parameters: {on: {type: boolean, words: ["OFF", "ON"]}}
    - tool: heater_state
      send: "STATE?"
      about: state of the heater
      effect: read
      reply: ["T {celsius}", "HEAT {on}", "END"]
      fields: {celsius: {type: number, unit: Cel}, on: {type: boolean, words: ["OFF", "ON"]}}
    - tool: heater_report
      about: what the heater says every moment
      effect: read
      reply: ["t={celsius}", "h={percent}"]
      fields: {celsius: {type: number, unit: Cel}, percent: {type: integer, unit: "%"}}
---
It gets warm.
"""


class Heater:
    """The far end: ``lines`` are all that arrived; ``speaks`` has it report without a question."""

    baud = None
    STREAM = b"3\nh=9\nhum\nt=21.5\nnoise\nt=22.5\nh=41\n"

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.heats = self.speaks = self.refuses = self.breaks_off = False
        self._text = b""

    @property
    def due(self) -> float | None:
        return time.monotonic() if self.speaks else None

    def feed(self, data: bytes) -> bytes:
        *lines, self._text = (self._text + data).split(b"\n")
        return b"".join(self._answer(line.decode()) for line in lines) + (self.STREAM if self.speaks else b"")

    def _answer(self, line: str) -> bytes:
        self.lines.append(line)
        if line == "STATE?":
            text = f"T 19.5\nHEAT {'ON' if self.heats else 'OFF'}\nEND\n"
            return (text[:7] if self.breaks_off else text).encode()
        if self.refuses:
            return b"NO too hot\n"
        self.heats = line == "HEAT ON"
        return b""

    def garbled(self, data: bytes) -> None: ...

    def opened(self) -> None: ...

    def closed(self) -> None: ...


class Bench:
    def __init__(self, project: Project) -> None:
        self.project, self.heater = project, Heater()

    def ask(self, tool: str, **arguments: object) -> tuple[bool, object]:
        """Whether a call goes well, and the answer to the client."""
        result, found = call(Layout(self.project.folder, self.project.host), ToolCall(tool, arguments))
        assert result is not None, found
        return not result.is_error, result.message if result.is_error else result.structured


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory, packaged: Callable[..., Path]) -> Iterator[Bench]:
    folder = tmp_path_factory.mktemp("heater")
    tree = plant(HOST, folder / "tree")
    project = Project(folder / "project", folder / "outside", harness="builtin")
    bench = Bench(project)
    port = Port(bench.heater, tree / "dev" / "ttyACM0")
    port.start()
    project.environ["OCTOFORM_SYSROOT"] = str(tree)
    project.manifest = {
        "profiles": "[profiles/heater.md]",
        "answers": f"{{{DEVICE}: the bench heater}}",
        "policy": "{actuate: allow}",
    }
    (project.folder / "profiles").mkdir(parents=True)
    (project.folder / "profiles" / "heater.md").write_text(PROFILE)
    project.share_environments(packaged("pyserial"))
    bench.heater.speaks = True  # each tool that reads is called once before the endpoint is accepted
    done = project.apply()
    assert done.status == 0, done.text
    bench.heater.speaks = False
    yield bench
    project.run("stop")
    port.stop()


@pytest.fixture(autouse=True)
def quiet(bench: Bench) -> None:
    bench.heater.speaks = bench.heater.refuses = bench.heater.breaks_off = False
    bench.heater.lines.clear()


def test_the_tools_are_typed_as_the_profile_says(bench: Bench) -> None:
    tools = {
        tool["name"]: tool
        for tool in json.loads((bench.project.state / "interface" / "output.json").read_text())["tools"]
    }
    assert {"heater_switch", "heater_state", "heater_report"} <= set(tools)
    assert tools["heater_switch"]["input_schema"]["properties"]["on"]["type"] == "boolean"
    assert "acknowledges nothing" in tools["heater_switch"]["description"]
    assert tools["heater_state"]["output_schema"]["properties"]["on"]["type"] == "boolean"
    assert "send it by itself" in tools["heater_report"]["description"]


def test_a_boolean_goes_out_as_its_word_and_what_is_not_acknowledged_is_told_so(bench: Bench) -> None:
    for on, line in ((True, "HEAT ON"), (False, "HEAT OFF")):
        fields = {"device": DEVICE, "command": line, "acknowledged": False}
        assert bench.ask("heater_switch", on=on) == (True, fields)
    assert bench.heater.lines == ["HEAT ON", "HEAT OFF"] and not bench.heater.heats
    layout = Layout(bench.project.folder, bench.project.host)
    result, (found,) = call(layout, ToolCall("heater_switch", {"on": "OFF; HEAT ON"}))
    assert result is None and found.code == "ENDPOINT-BAD-ARGUMENT"
    assert bench.heater.lines == ["HEAT ON", "HEAT OFF"]


def test_what_it_refuses_is_told_although_it_acknowledges_nothing(bench: Bench) -> None:
    bench.heater.refuses = True
    assert bench.ask("heater_switch", on=True) == (False, f"{DEVICE} refused 'HEAT ON': 'too hot'")


def test_an_answer_of_several_lines_is_one_record(bench: Bench) -> None:
    bench.ask("heater_switch", on=True)
    assert bench.ask("heater_state") == (True, {"device": DEVICE, "celsius": 19.5, "on": True})
    bench.heater.breaks_off = True
    assert bench.ask("heater_state") == (False, f"{DEVICE} ended its answer to 'STATE?' after 1 of 3 lines")


def test_what_it_says_by_itself_is_heard_whole_and_nothing_is_sent(bench: Bench) -> None:
    bench.heater.speaks = True
    assert bench.ask("heater_report") == (True, {"device": DEVICE, "celsius": 22.5, "percent": 41})
    bench.heater.speaks = False
    assert bench.ask("heater_report") == (
        False,
        f"{DEVICE} answered nothing within 2 s that its protocol definition knows",
    )
    assert bench.heater.lines == []
