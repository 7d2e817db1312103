"""What the agents of the daemon may do wrong: each report and each repair that must not count, through real processes.

One live endpoint for the whole file, with one tool whose code fails for one argument alone. What is refused must leave
it as it was, the very process too; what is accepted must leave nothing for a plan to do.
"""

import json
import signal
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import warm
from projects import AGENT, Done, Project

from octoform.apply.repair_outcome import RepairOutcome
from octoform.daemon.store import instance_lock
from octoform.endpoint.process import start_stop
from octoform.endpoint.process.record import running
from octoform.engine.unattended.heal import heal, roll_back, settle
from octoform.engine.unattended.session import diagnose
from octoform.perception.capture import THUMB_BYTES, Picture, Taken
from octoform.perception.frames import keep
from octoform.state.layout import Layout, is_left
from octoform.state.store.lock import acquire

pytestmark = pytest.mark.dear

TOOL, TARGET = "read_temperature", "tool:read_temperature"
GOOD = (AGENT.parent / "good" / "server.py").read_text()
READ = "        return Temperature(celsius=round(value / 1000, digits))"
GUARD = '        if not 0 <= digits <= 3:\n            raise ValueError("so many digits there are not")\n'
WRONG = "        value = value / 1000 if digits < 3 else value.exactly\n"
BROKEN = GOOD.replace(READ, f"{GUARD}{WRONG}        return Temperature(celsius=round(value, digits))")
MEND = [["value.exactly", "value / 1000"]]
AT = "2026-11-22T10:00:00Z"
FAILURE = {
    "id": "f1",
    "tool": TOOL,
    "error": "AttributeError",
    "message": "exactly",
    "count": 3,
    "first": AT,
    "last": AT,
}
READING = {"id": "r1", "at": AT, "channel": "log", "source": TOOL, "path": "/ok", "value": False, "why": ""}
ERROR = {
    "tool": TOOL,
    "device": "hwmon-benchtemp",
    "class": "broken_tool",
    "message": "it asks a number for a name that numbers do not have",
    "severity": "recoverable",
    "suggested_fix": None,
    "cites": ["f1"],
}
REPORT = {
    "format": 1,
    "stage": "watch",
    "status": "error",
    "summary": "One tool fails for three digits; the rest is unknown.",
    "physical_state": {"available": False, "seen": None, "reason": "perception is off"},
    "errors": [ERROR],
    "claims": [],
    "declarations": [],
}
REPAIR: dict[str, Any] = {
    "format": 1,
    "stage": "heal",
    "class": "broken_tool",
    "target": TARGET,
    "status": "repaired",
    "reason": "A float has no such name.",
    "action": "rewrite",
    "functions": [TOOL],
    "server": "server.py",
    "cites": ["f1"],
    "claims": [],
}
EVIDENCE = {"readings": [READING], "failures": [FAILURE], "since": "2026-11-22T00:00:00Z"}


@dataclass
class Bench:
    project: Project

    @property
    def layout(self) -> Layout:
        return Layout(self.project.folder, "bench")

    @property
    def server(self) -> str:
        return self.layout.output("serve").read_text()

    @property
    def process(self) -> int:
        found = running(self.layout)
        assert found is not None
        return found.pid

    def duty(self, duty: str, *behaviours: object, **budget: object) -> None:
        """The duty's agent does so at each attempt."""
        found = json.dumps({"attempts": len(behaviours), **budget})
        self.project.manifest["stages"] = f"{{{duty}: {{budget: {found}}}}}"
        self.project.script[duty] = list(behaviours)
        self.project.write()

    def watch(self, **more: Any) -> RepairOutcome:
        brief = {**EVIDENCE, "causes": ["log"], "claims": [], "summary": None, "target": TARGET, **more}
        return diagnose(self.project.folder, self.project.environment(), brief)

    def heal(self, episode: str = "e1") -> RepairOutcome:
        brief = {**EVIDENCE, "error": ERROR, "target": TARGET, "episode": episode}
        return heal(self.project.folder, self.project.environment(), brief)

    def back(self, episode: str = "e1") -> RepairOutcome:
        brief = {"episode": episode, "reason": "the readings are worse"}
        return roll_back(self.project.folder, self.project.environment(), brief)

    def ended(self, script: str, *words: str) -> Done:
        """How a script ends that does something to the project."""
        path = self.project.outside / "script.py"
        path.write_text(script)
        folder = self.project.folder
        return Done(*warm.run(path, (str(folder), *words), folder, self.project.environment(), 120))

    def refusals(self, duty: str, count: int) -> list[set[str]]:
        """The codes of the last attempts' errors."""
        records = [json.loads((path / "attempt.json").read_text()) for path in self.project.attempts(duty)[-count:]]
        return [{item["code"] for item in one["diagnostics"] if item["severity"] == "error"} for one in records]

    def works(self) -> bool:
        return bool(self.project.run("call", TOOL, "-arg", "digits=3").status == 0)

    def in_sync(self) -> bool:
        self.project.manifest.pop("stages", None)
        self.project.write()
        return bool(self.project.run("plan", "-detailed-exitcode").status == 0)


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory, environments: Path) -> Iterator[Bench]:
    folder = tmp_path_factory.mktemp("duties")
    project = Project(folder / "project", folder / "outside")
    project.share_environments(environments)
    project.write()
    (project.outside / "server.py").write_text(BROKEN)
    project.script = {"serve": [{"copy": str(project.outside / "server.py")}]}
    project.apply(status=0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(start_stop, "_Detached", warm.Loaded)
        yield Bench(project)
    project.run("stop")


MALFORMED: dict[str, tuple[dict[str, Any], str]] = {
    "F14 no JSON": ({"write": '{"status": "healthy"'}, "ARTIFACT-NOT-JSON"),
    "F14b nothing": ({"exit": 0}, "ARTIFACT-MISSING"),
    "F14c no status": ({"report": {name: REPORT[name] for name in REPORT if name != "status"}}, "WATCH-SCHEMA"),
    "F14c a list": ({"report": [REPORT]}, "WATCH-SCHEMA"),
    "F14d another status": ({"report": {**REPORT, "status": "HEALTHY"}}, "WATCH-SCHEMA"),
    "an invented reading": ({"report": {**REPORT, "errors": [{**ERROR, "cites": ["r9"]}]}}, "WATCH-UNKNOWN-READING"),
    "exit 3": ({"report": REPORT, "exit": 3}, "APPLY-AGENT-FAILED"),
    "F38 not UTF-8": ({"bytes": "7b22ff", "shout": "ff00fe"}, "ARTIFACT-NOT-UTF8"),
}


def test_f14_a_report_that_is_none_is_unknown_and_never_healthy(bench: Bench) -> None:
    bench.duty("watch", *(behaviour for behaviour, _ in MALFORMED.values()))
    result = bench.watch()
    assert (result.ok, result.report, result.spent.calls) == (False, None, len(MALFORMED))
    found = dict(zip(MALFORMED, bench.refusals("watch", len(MALFORMED)), strict=True))
    assert {name: codes for name, codes in found.items() if MALFORMED[name][1] not in codes} == {}


def test_watch_gets_both_pictures_their_readings_and_the_summary_of_all_looks(bench: Bench) -> None:
    camera = {"device": "usb-1234-0001", "tool": "take_picture", "arguments": {}}
    for number, data in enumerate((b"one", b"two", b"three")):
        taken = Taken(data, "image/png", Picture(90.0 + 40 * number, 40.0, bytes([number * 80]) * THUMB_BYTES), 4, 3)
        assert keep(bench.layout, camera, taken, f"2026-11-22T10:00:0{number}Z")[1] == []
    seen = {"channel": "frame", "source": "usb-1234-0001", "path": "/trouble", "value": "", "why": ""}
    readings = [READING, *({"id": f"v{number}", "at": f"2026-11-22T10:00:0{number}Z", **seen} for number in (1, 2))]
    bench.project.manifest["perception"] = "{enabled: true}"
    bench.duty("watch", {"report": REPORT})
    assert bench.watch(readings=readings).ok
    del bench.project.manifest["perception"]
    attempt = bench.project.attempts("watch")[-1]
    (given,) = [json.loads(path.read_text()) for path in attempt.rglob("input.json")]
    frames = [{"reading": "v2", "file": "current.png"}, {"reading": "v1", "file": "previous.png"}]
    assert given["frames"] == frames
    assert [next(attempt.rglob(each["file"])).read_bytes() for each in frames] == [b"three", b"two"]
    assert given["perception"]["summary"].startswith("3 looks since") and len(given["perception"]["summary"]) < 3000


def test_a_report_is_held_to_what_was_given_and_changes_nothing(bench: Bench) -> None:
    server, pid = bench.layout.output("serve"), bench.process
    with bench.layout.call_log.open("ab") as log:
        log.write(b'{"event": "result", "id": "x", "tool": "t", "ok": false, "error": "OSError", "message": "\xff"}\n')
    layout = bench.layout
    layout.daemon.mkdir(mode=0o700, exist_ok=True)
    touched = [server, layout.endpoint / "policy.json", layout.endpoint / "octoform/server/gate/gate.py"]
    touched += [layout.daemon / "claims.json", layout.daemon / "breakers.json", layout.local / "adopting.json"]
    touched += [layout.kept / "index.json"]
    before = {path: path.read_bytes() if path.exists() else None for path in touched}
    bench.duty("watch", {"report": REPORT, "touch": [str(path) for path in touched]}, {"report": REPORT})
    result = bench.watch()
    assert {path: path.read_bytes() if path.exists() else None for path in touched} == before
    refused = json.loads((bench.project.attempts("watch")[-2] / "attempt.json").read_text())["diagnostics"]
    assert len({item["path"] for item in refused if item["code"] == "APPLY-OUTSIDE-WRITE"}) == len(touched)
    assert result.ok and result.report == REPORT and result.spent.calls == 2
    assert bench.refusals("watch", 2) == [{"APPLY-OUTSIDE-WRITE"}, set()]
    assert server.read_text() == BROKEN and bench.process == pid
    given = json.loads((bench.project.attempts("watch")[-1] / "input.json").read_text())
    assert given["readings"] == [READING] and given["failures"] == [FAILURE]
    reason = "perception is off: no one looks through a camera"
    assert given["perception"] == {"available": False, "reason": reason, "summary": None}
    assert "OSError" in given["log"] and len(given["log"].encode()) <= 16384
    assert [tool["name"] for tool in given["tools"]] == [TOOL]


def test_a_living_daemon_knows_itself_what_it_wrote_and_nobody_decides_while_an_agent_works(bench: Bench) -> None:
    claims = bench.layout.daemon / "claims.json"
    owned, _ = instance_lock.take(bench.layout, AT, 1.0, "1")
    assert owned is not None
    bench.duty("watch", {"report": REPORT, "touch": [str(claims)]})
    assert bench.watch().ok and claims.exists()
    claims.unlink()
    owned.release()
    with acquire(bench.layout, "heal").lock or pytest.fail("the lock is held"):
        for words in (("claims", "-retire", "c1"), ("confirm", "c1", "-auto-approve"), ("confirm", "c1", "-reject")):
            assert "CLAIM-AGENT-AT-WORK" in bench.project.run(*words, "-json", status=1).text
    assert "CLAIM-NOT-FOUND" in bench.project.run("confirm", "c1", "-auto-approve", "-json", status=1).text


def test_an_agent_that_hangs_blocks_no_longer_than_its_budget(bench: Bench) -> None:
    bench.duty("watch", {"sleep": 300}, attempt_timeout="1s", stage_timeout="2s")
    began = time.monotonic()
    result = bench.watch()
    assert time.monotonic() - began < 20
    assert (result.ok, result.report, result.again) == (False, None, True)
    assert "APPLY-TIMEOUT" in result.detail


def test_an_agent_is_asked_no_more_often_than_the_hour_has_left(bench: Bench) -> None:
    bench.duty("watch", *([{"exit": 3}] * 4))
    assert bench.watch(calls=1).spent.calls == 1


REFUSED: dict[str, tuple[list[list[str]], dict[str, Any], str]] = {
    "F15 no Python": ([["def read_temperature(", "def read_temperature(("]], {}, "SERVE-SYNTAX"),
    "F16 no tool": ([["@mcp.tool", "@print"]], {}, "SERVE-TOOLS-DIFFER"),
    "another schema": ([["le=3", "le=9"]], {}, "HEAL-BEYOND"),
    "a limit": ([["digits <= 3", "digits <= 30"], *MEND], {}, "HEAL-WEAKENS"),
    "no limit": ([["raise ValueError(", "str("], *MEND], {}, "HEAL-WEAKENS"),
    "another lock": ([['bus("hwmon-benchtemp")', 'bus("other")'], *MEND], {}, "HEAL-WEAKENS"),
    "an import": ([["        value", "        import ctypes\n        value"], *MEND], {}, "HEAL-BEYOND"),
    "the module": ([['FastMCP("bench")', 'FastMCP("mine")'], *MEND], {}, "HEAL-BEYOND"),
    "nothing": ([], {}, "HEAL-UNCHANGED"),
    "a call out": (
        [["        value", '        __import__("socket")\n        value'], *MEND],
        {},
        "SERVE-DYNAMIC-CODE",
    ),
    "a foreign function": (MEND, {"functions": ["main"]}, "HEAL-FOREIGN-FUNCTION"),
    "another class": (MEND, {"class": "dependency"}, "HEAL-CLASS-DIFFERS"),
}


def test_f15_f16_a_repair_that_goes_too_far_changes_nothing(bench: Bench) -> None:
    pid = bench.process
    lines: list[dict[str, Any]] = [
        {"rewrite": changes, "report": {**REPAIR, **more}} for changes, more, _ in REFUSED.values()
    ]
    bench.duty("heal", *lines)
    result = bench.heal()
    assert (result.ok, result.changed, result.spent.calls) == (False, False, len(REFUSED))
    found = dict(zip(REFUSED, bench.refusals("heal", len(REFUSED)), strict=True))
    assert {name: codes for name, codes in found.items() if REFUSED[name][2] not in codes} == {}
    assert bench.server == BROKEN and bench.process == pid
    assert bench.in_sync()


def test_a_repair_that_also_writes_the_manifest_the_policy_or_the_interface_changes_nothing(bench: Bench) -> None:
    layout, pid = bench.layout, bench.process
    mine = [layout.project / "octopus.yaml", layout.endpoint / "policy.json", layout.output("interface")]
    bench.duty("heal", {"rewrite": MEND, "report": REPAIR, "touch": [str(path) for path in mine]})
    before = [path.read_bytes() for path in mine]
    result = bench.heal()
    assert (result.ok, result.changed) == (False, False)
    assert bench.refusals("heal", 1) == [{"APPLY-OUTSIDE-WRITE"}]
    assert [path.read_bytes() for path in mine] == before
    assert bench.server == BROKEN and bench.process == pid


def test_nothing_is_tried_behind_an_emergency_stop(bench: Bench) -> None:
    """The agent has begun before the stop was given; it is asked once and no more."""
    pid = bench.process
    bench.duty("heal", *([{"rewrite": MEND, "report": REPAIR}] * 3))
    bench.project.run("estop", "-reason", "hot", status=0)
    result = bench.heal()
    bench.project.run("estop", "-clear", status=0)
    assert (result.ok, result.again, result.changed) == (False, True, False)
    assert result.spent.calls == 1 and "HEAL-ESTOPPED" in result.detail
    assert bench.server == BROKEN and bench.process == pid


@pytest.mark.parametrize("status", ["failed", "not_mine"])
def test_f33_an_honest_failure_is_for_a_person(bench: Bench, status: str) -> None:
    none: dict[str, Any] = {"status": status, "action": "none", "functions": [], "server": None}
    bench.duty("heal", {"report": {**REPAIR, **none}})
    result = bench.heal()
    assert (result.ok, result.again, result.changed) == (False, False, False)
    assert (result.report or {})["status"] == status and result.detail.startswith(status)


def test_a_repair_waits_for_a_change_that_a_person_has_begun(bench: Bench) -> None:
    bench.duty("heal", {"rewrite": MEND, "report": REPAIR})
    bench.project.manifest["policy"] = "{read: deny, actuate: allow}"
    bench.project.write()
    result = bench.heal()
    bench.project.manifest.pop("policy")
    bench.project.write()
    assert (result.ok, result.again, result.spent.calls) == (False, True, 0)
    assert "DUTY-CHANGED" in result.detail


KILLED = """
import os, signal, sys
from pathlib import Path
from octoform.engine.unattended.heal import roll_back
from octoform.state.store.store import Ports

def checkpoint(name):
    if name == "artifact.renamed":
        os.kill(os.getpid(), signal.SIGKILL)

roll_back(Path(sys.argv[1]), os.environ, {"episode": "e1", "reason": "x"}, Ports(checkpoint=checkpoint))
"""


TRIED = """
import os, signal, sys
from pathlib import Path
from octoform.apply.rewrite import promotion
from octoform.daemon.repair import worker
from octoform.engine.unattended.heal import heal
import json

offer = promotion.offer

def offered(*given):
    found = offer(*given)
    os.kill(os.getpid(), int(sys.argv[2]))
    return found

signal.signal(signal.SIGTERM, worker._end)
promotion.offer = offered
heal(Path(sys.argv[1]), os.environ, json.loads(sys.argv[3]))
"""
"""A repair whose process gets a signal while its candidate is in service."""


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_a_repair_that_is_ended_during_its_trial_leaves_the_accepted_server_in_service(
    bench: Bench, number: signal.Signals
) -> None:
    bench.duty("heal", {"rewrite": MEND, "report": REPAIR})
    brief = {**EVIDENCE, "error": ERROR, "target": TARGET, "episode": "e7"}
    done = bench.ended(TRIED, str(int(number)), json.dumps(brief))
    assert done.status == (-9 if number is signal.SIGKILL else 1), done.err
    if number is signal.SIGKILL:
        assert is_left(bench.layout) and bench.works(), "the candidate serves"
        found = settle(bench.layout, bench.project.environment())
        assert found is not None and found.ok, found
    assert not is_left(bench.layout) and not bench.layout.lock.exists()
    assert bench.server == BROKEN and bench.process and not bench.works() and bench.in_sync()


@pytest.mark.slow
def test_a_repair_that_holds_takes_the_place_and_is_taken_back_also_after_a_kill(bench: Bench) -> None:
    before, nodes = bench.process, bench.project.nodes()
    worse = {"rewrite": [["value / 1000 if digits < 3", "[][0] if digits < 3"]], "report": REPAIR}
    bench.duty("heal", worse, {"rewrite": MEND, "report": REPAIR})
    result = bench.heal()
    assert (result.ok, result.changed, (result.report or {})["action"]) == (True, True, "rewrite"), result
    assert "HEAL-NOT-HELPED" in bench.refusals("heal", 2)[0]
    assert bench.server == BROKEN.replace("value.exactly", "value / 1000") and bench.process != before
    assert bench.works() and bench.in_sync()
    after = bench.project.nodes()
    assert {name: state["attempts"] for name, state in after.items()} == {
        name: state["attempts"] for name, state in nodes.items()
    }
    assert after["serve"]["detail"]["rewritten"]["by"] == "heal"

    bench.duty("heal", "good")
    assert bench.ended(KILLED).status == -9
    result = bench.back()
    assert (result.ok, result.spent.calls) == (True, 0), result
    assert bench.server == BROKEN and bench.in_sync() and not bench.works()
    again = bench.back()
    assert (again.ok, again.changed) == (True, False)
    assert bench.back("e9").again is False
