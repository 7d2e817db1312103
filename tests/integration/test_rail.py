"""A person's sentence and a profile with a command grammar are enough: the embedded agent drives a line protocol.

One live endpoint for all tests of the file: the real command line onboards a planted host whose board is a simulated
firmware on a pseudo terminal. What counts is what that firmware saw.
"""

import asyncio
import json
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from fastmcp import Client
from fastmcp.client.transports import StdioTransport
from hosts.plant import plant
from projects import AGENT, Project
from rig.rail import ANSWER, DEVICE, FARTHEST, HOST, HOT, MOST, Board, Rail

from octoform.apply.repair_outcome import RepairOutcome
from octoform.claims.ledger import Ledger
from octoform.claims.model import Channel, Claim, Reading, Signal, State
from octoform.claims.readings import to_json
from octoform.claims.settings import settings_of
from octoform.daemon.evidence import Evidence
from octoform.daemon.observe.clock_jumps import SystemClock
from octoform.diagnostics import Diagnostic
from octoform.endpoint.client.jsonrpc import ToolCall
from octoform.endpoint.client.terminal import CallResult, call
from octoform.engine.unattended.heal import heal
from octoform.engine.unattended.session import diagnose
from octoform.state.layout import Layout

pytestmark = pytest.mark.dear

SHIPPED = Path(__file__).parents[2] / "profiles"


@dataclass
class Bench:
    project: Project
    board: Board
    applied: str

    @property
    def rail(self) -> Rail:
        return self.board.rail

    def ask(self, tool: str, **arguments: object) -> tuple[CallResult | None, tuple[Diagnostic, ...]]:
        """What comes of a call, as any client would make it."""
        return call(Layout(self.project.folder, self.project.host), ToolCall(tool, arguments))

    def call(self, tool: str, **arguments: object) -> dict[str, object]:
        """The result of a call that goes well."""
        result, found = self.ask(tool, **arguments)
        assert result is not None and not result.is_error, (result, found)
        return result.structured or {}

    def fails(self, tool: str, **arguments: object) -> str:
        """The client's error of a call that fails."""
        result, found = self.ask(tool, **arguments)
        assert result is None or result.is_error
        return result.message if result else found[0].summary


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory, packaged: Callable[..., Path]) -> Iterator[Bench]:
    folder = tmp_path_factory.mktemp("rail")
    tree = plant(HOST, folder / "tree")
    board = Board(tree, Rail())
    board.plug()
    project = Project(folder / "project", folder / "outside", harness="builtin")
    project.environ["OCTOFORM_SYSROOT"] = str(tree)
    project.manifest = {
        "profiles": "[profiles/camera-rail.md]",
        "answers": f"{{{DEVICE}: {ANSWER}}}",
        "policy": "{actuate: allow}",
    }
    (project.folder / "profiles").mkdir(parents=True)
    text = (SHIPPED / "camera-rail.md").read_text()
    assert "timeout: 25s" in text
    (project.folder / "profiles" / "camera-rail.md").write_text(text.replace("timeout: 25s", "timeout: 1s"))
    project.share_environments(packaged("pyserial"))
    done = project.apply(status=0)
    yield Bench(project, board, done.out)
    board.unplug()


@pytest.fixture(autouse=True)
def whole(bench: Bench) -> Iterator[None]:
    """Each test begins with the carriage at home and a firmware that answers."""
    yield
    bench.rail.manner = "well"
    bench.call("rail_home")
    bench.rail.lines.clear()


def test_the_tools_move_the_rail(bench: Bench) -> None:
    assert bench.call("rail_move_x", steps=200) == {"device": DEVICE, "command": "MOVE_X 200", "answer": "OK"}
    bench.call("rail_move_y", steps=-1500)
    assert bench.rail.position == {"X": 200, "Y": -1500}
    bench.call("rail_home")
    assert bench.rail.lines == ["MOVE_X 200", "MOVE_Y -1500", "HOME"]


def test_limits_are_kept_before_anything_is_sent(bench: Bench) -> None:
    assert "3000" in bench.fails("rail_move_x", steps=3000)
    for _ in range(FARTHEST // MOST):
        bench.call("rail_move_x", steps=MOST)
    found = bench.fails("rail_move_x", steps=1)
    assert "since rail_home" in found and "A call of rail_home that goes well sets the sum to zero" in found
    assert bench.rail.position["X"] == FARTHEST and len(bench.rail.lines) == FARTHEST // MOST
    bench.call("rail_home")
    bench.call("rail_move_x", steps=-MOST)
    assert bench.rail.position["X"] == -MOST


def test_the_position_is_counted_from_what_was_acknowledged(bench: Bench) -> None:
    bench.call("rail_home")
    bench.call("rail_move_x", steps=200)
    bench.call("rail_move_y", steps=-30)
    known = {"device": DEVICE, "x": 200, "y": -30, "unknown": None}
    assert bench.call("rail_position") == known and bench.rail.position == {"X": 200, "Y": -30}
    bench.fails("rail_move_x", steps=HOT)
    lost = bench.call("rail_position")
    assert lost["x"] is None and "a movement failed" in str(lost["unknown"])


def test_after_a_stop_nothing_but_home_reaches_the_firmware(bench: Bench) -> None:
    assert "goes on to its end" in str(bench.call("rail_stop")["note"])
    assert "is stopped: nothing is sent to it until rail_home went well" in bench.fails("rail_move_x", steps=5)
    bench.project.run("restart", status=0)
    assert "is stopped: nothing is sent to it until rail_home went well" in bench.fails("rail_move_y", steps=5)
    assert bench.rail.lines == []
    bench.call("rail_home")
    bench.call("rail_move_x", steps=5)
    assert bench.rail.lines == ["HOME", "MOVE_X 5"]


def test_what_the_device_refuses_is_told(bench: Bench) -> None:
    assert bench.fails("rail_move_x", steps=HOT) == f"{DEVICE} refused 'MOVE_X {HOT}': 'motor driver is hot'"
    for _ in range(FARTHEST // MOST):
        bench.call("rail_move_x", steps=-MOST)
    assert "Calls failed, so that it may really be" in bench.fails("rail_move_x", steps=-1)
    assert bench.rail.position["X"] == -FARTHEST


def test_an_answer_outside_the_grammar_is_shown_and_harmless(bench: Bench) -> None:
    bench.rail.manner = "odd"
    found = bench.fails("rail_move_x", steps=1)
    assert r"'boot v3 \x1b[31m'" in found and "\x1b" not in found


def test_silence_ends_and_its_late_answer_is_not_taken_for_the_next_one(bench: Bench) -> None:
    bench.rail.manner = "mute"
    assert "did not answer 'MOVE_X 5' within 1 s" in bench.fails("rail_move_x", steps=5)
    bench.board.say("ERR jammed")
    bench.rail.manner = "well"
    assert bench.call("rail_move_x", steps=7)["answer"] == "OK"


def test_a_device_that_goes_away_in_the_middle(bench: Bench) -> None:
    bench.rail.manner = "gone"
    found = bench.fails("rail_move_y", steps=5)
    assert found.startswith(DEVICE) and "whether it did 'MOVE_Y 5' is not known" in found
    assert "MOVE" not in bench.fails("rail_home")  # nothing could be sent
    bench.board.unplug()
    bench.rail.manner = "well"
    bench.board.plug()
    assert bench.call("rail_position")["x"] is None
    bench.call("rail_move_y", steps=6)
    assert bench.rail.position["Y"] == 6


def test_the_device_is_named_by_the_profile_and_the_adapter_beside_it_asks_one_question(bench: Bench) -> None:
    devices = json.loads((bench.project.state / "identify" / "output.json").read_text())["devices"]
    rail, adapter = (next(item for item in devices if item["id"] == name) for name in (DEVICE, "usb-1a86-7523"))
    assert (rail["method"], rail["profile"], rail["category"]) == ("profile", "camera-rail", "bidirectional")
    assert rail["identified_as"].startswith("Camera rail")
    assert adapter["category"] == "unknown" and adapter["missing"].startswith("What is connected")


AWAY = Signal(Channel.SENSOR, "rail_position", "/x")


def connected(bench: Bench, *tools: tuple[str, dict[str, object]]) -> list[str]:
    """The answer to a client of another maker for each call; empty where it goes well."""
    layout = Layout(bench.project.folder, bench.project.host)
    program, *arguments = json.loads((layout.endpoint / "connection.json").read_bytes())["command"]

    async def calls() -> list[str]:
        async with Client(StdioTransport(program, arguments)) as client:
            done = [await client.call_tool(name, given, raise_on_error=False) for name, given in tools]
            return [each.content[0].text if each.is_error else "" for each in done]

    return asyncio.run(calls())


def seen(bench: Bench) -> tuple[Ledger, Reading]:
    """Where the carriage is, as a reading of the ledger."""
    layout = Layout(bench.project.folder, bench.project.host)
    ledger = Ledger.open(layout, SystemClock(), settings_of(layout, 600.0))
    reading = ledger.make(AWAY, bench.call("rail_position")["x"])  # type: ignore[arg-type]
    ledger.record([reading])
    return ledger, reading


def reported(bench: Bench, *, claims: list[dict[str, object]], declarations: list[dict[str, object]]) -> Ledger:
    """The ledger after an agent of WATCH was given a reading of the carriage and said this, citing it."""
    ledger, reading = seen(bench)
    cited = [{**each, "cites": [reading.id]} for each in [*claims, *declarations]]
    report = {
        "format": 1,
        "stage": "watch",
        "status": "degraded",
        "summary": "The carriage is far out.",
        "physical_state": {"available": False, "seen": None, "reason": "perception is off"},
        "errors": [],
        "claims": cited[: len(claims)],
        "declarations": cited[len(claims) :],
    }
    bench.project.script = {"watch": [{"report": report}]}
    command = json.dumps([sys.executable, str(AGENT), str(bench.project.outside / "script.json")])
    bench.project.manifest["stages"] = f"{{watch: {{harness: {{name: command, command: {command}, sandbox: false}}}}}}"
    bench.project.write()
    brief = {"readings": [to_json(reading)], "failures": [], "claims": [], "since": "", "target": "endpoint"}
    result = diagnose(bench.project.folder, bench.project.environment(), brief)
    assert result.ok, result
    _, refused = Evidence(ledger).offer(result.report or {}, "watch")
    assert refused == ()
    return ledger


def test_what_watch_claims_keeps_any_client_from_the_call_and_never_from_a_stop_until_a_person_retires_it(
    bench: Bench,
) -> None:
    bench.call("rail_home")
    seen(bench)  # a clean one, which shows when the claim will be over
    bench.rail.lines.clear()
    bench.call("rail_move_x", steps=200)
    held = {
        "target": f"device:{DEVICE}",
        "fault": "none",
        "statement": "The carriage is too far out to go on.",
        "signal": {"channel": "sensor", "source": "rail_position", "path": "/x"},
        "condition": {"op": ">", "value": 100},
        "seconds": 600,
        "restrictions": [{"tool": "rail_move_x", "arguments": {}, "effect": "deny"}],
    }
    (claim,) = reported(bench, claims=[held], declarations=[]).active()
    found, stopped = connected(bench, ("rail_move_x", {"steps": 5}), ("rail_stop", {}))
    assert claim.id in found and claim.statement in found and claim.expires_at in found and "octoform claims" in found
    assert stopped == "" and bench.rail.lines == ["MOVE_X 200"]
    bench.project.run("claims", "-retire", claim.id, status=0)
    assert connected(bench, ("rail_home", {}), ("rail_move_x", {"steps": 5})) == ["", ""]
    assert bench.rail.lines == ["MOVE_X 200", "HOME", "MOVE_X 5"]


def test_what_holds_for_good_waits_for_a_person_who_can_also_take_it_back(bench: Bench) -> None:
    fields: dict[str, object] = {
        "kind": "disable_unit",
        "target": f"device:{DEVICE}",
        "statement": "The rail is worn out.",
    }
    ledger = reported(bench, claims=[], declarations=[fields])
    assert ledger.active() == ()
    (waiting,) = ledger.pending()
    assert waiting.irreversible == "disable_unit" and waiting.id in bench.project.run("claims", status=0).out
    assert f"octoform confirm {waiting.id}" in bench.project.run("health").out
    assert "CLAIM-NOT-APPROVED" in bench.project.run("confirm", waiting.id, status=1).text
    bench.project.run("confirm", waiting.id, "-auto-approve", status=0)
    (claim,) = ledger.active()
    assert (claim.id, claim.state) == (waiting.id, State.ACTIVE) and claim.data["confirmed_by"]
    bench.project.run("claims", "-retire", waiting.id, status=0)
    over = ledger.recent()[-1]
    assert isinstance(over, Claim) and over.id == waiting.id and ledger.active() == ()


TIMES_TEN = [['line = f"MOVE_X {steps:d}"', 'line = f"MOVE_X {steps * 10:d}"']]
HIDDEN_TEN = [['line = f"MOVE_X {steps:d}"', 'line = f"MOVE_X {max(steps, steps * 10, key=abs):d}"']]
"""The same in words that are not computed before anything runs."""


def healed(bench: Bench, *rewrites: list[list[str]]) -> list[RepairOutcome]:
    """What became of a repair of rail_move_x for each of these rewrites of the server by an agent."""
    reading = {"channel": "log", "source": "rail_move_x", "path": "/ok", "value": False, "why": ""}
    failure = {"id": "f1", "tool": "rail_move_x", "error": "DeviceFault", "message": "no answer", "count": 3}
    broken = {"tool": "rail_move_x", "device": DEVICE, "class": "broken_tool", "message": "it moves too little"}
    fields = {
        "format": 1,
        "stage": "heal",
        "class": "broken_tool",
        "target": "tool:rail_move_x",
        "status": "repaired",
        "reason": "The firmware counts in tenths.",
        "action": "rewrite",
        "functions": ["rail_move_x"],
        "server": "server.py",
        "cites": ["f1"],
        "claims": [],
    }
    brief = {
        "error": {**broken, "severity": "recoverable", "suggested_fix": None, "cites": ["f1"]},
        "readings": [{"id": "r1", "at": "2026-11-22T10:00:00Z", **reading}],
        "failures": [{**failure, "first": "2026-11-22T10:00:00Z", "last": "2026-11-22T10:00:00Z"}],
        "since": "2026-11-22T00:00:00Z",
        "target": "tool:rail_move_x",
        "episode": "e1",
    }
    command = json.dumps([sys.executable, str(AGENT), str(bench.project.outside / "script.json")])
    bench.project.manifest["stages"] = f"{{heal: {{harness: {{name: command, command: {command}, sandbox: false}}}}}}"
    done = []
    for rewrite in rewrites:
        bench.project.script = {"heal": [{"rewrite": rewrite, "report": fields}]}
        bench.project.write()
        done.append(heal(bench.project.folder, bench.project.environment(), brief))
    return done


def test_a_rewrite_that_contradicts_the_profile_is_refused(bench: Bench) -> None:
    server = Layout(bench.project.folder, bench.project.host).output("serve")
    before = server.read_text()
    (done,) = healed(bench, TIMES_TEN)
    assert (done.ok, done.changed) == (False, False) and server.read_text() == before
    assert "SERVE-PROFILE-CONTRADICTED" in str(done.detail) and "MOVE_X 70" in str(done.detail)


def test_a_rewrite_that_would_move_more_than_the_caller_says_waits_for_a_person(bench: Bench) -> None:
    server = Layout(bench.project.folder, bench.project.host).output("serve")
    before = server.read_text()
    (done,) = healed(bench, HIDDEN_TEN)
    assert (done.ok, done.changed, done.again) == (False, False, False), done
    found = re.search(r"octoform confirm (r\w+)", str(done.detail))
    assert found is not None and "rail_move_x" in str(done.detail), done
    bench.call("rail_move_x", steps=20)
    assert bench.rail.lines == ["MOVE_X 20"] and server.read_text() == before
    bench.project.run("confirm", found[1], status=1)
    assert server.read_text() == before
    bench.project.run("confirm", found[1], "-auto-approve", status=0)
    assert "steps * 10" in server.read_text()
    bench.call("rail_move_x", steps=20)
    assert bench.rail.lines[-1] == "MOVE_X 200"
