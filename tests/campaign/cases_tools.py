"""Faults of tools, and of the agents that are asked about them."""

import json
from collections.abc import Callable
from typing import Any

from campaign.bench import Bench
from campaign.model import SURFACED, Case
from campaign.rig import SENSOR, report

from octoform.daemon.model import Kind, Repair

FAILING = frozenset({Kind.TOOL_FAILING})
ASKED = frozenset({Repair.WATCH, Repair.PERSON})
HEALING = ASKED | {Repair.HEAL, Repair.ROLL_BACK}
MAX_CALLS = 8
BROKEN = {
    "tool": "weigh",
    "device": SENSOR,
    "class": "broken_tool",
    "message": "a weight that the table does not have",
    "severity": "recoverable",
    "suggested_fix": "a default",
}


def _sensor(bench: Bench, value: str) -> None:
    for path in bench.host.tree.root.glob("sys/class/hwmon/*/temp1_input"):
        path.write_text(f"{value}\n")


def _script(bench: Bench, **behaviours: Any) -> None:
    path = bench.project.outside / "repairer.json"
    before = path.read_text()
    bench.undo.append(lambda: path.write_text(before))
    path.write_text(json.dumps({**json.loads(before), **behaviours}))


def broken(bench: Bench, **behaviours: Any) -> None:
    """The tool fails in its own code from now on, and the agents do this."""
    if behaviours:
        _script(bench, **behaviours)
    _sensor(bench, "13")
    bench.undo.append(lambda: _sensor(bench, "21500"))
    assert not bench.call("weigh")[0]


def mended(bench: Bench) -> None:
    _sensor(bench, "21500")
    assert bench.call("weigh") == (True, "a cup")


def told(
    name: str,
    rows: str = "",
    repairs: frozenset[Repair] = ASKED,
    after: Callable[[Bench], list[str]] | None = None,
    **behaviours: Any,
) -> Case:
    """A broken tool about which the agents say or do this, and which a person has to hear of."""

    def inject(bench: Bench) -> None:
        served = str(bench.layout.output("serve"))
        broken(bench, **json.loads(json.dumps(behaviours).replace("{server}", served)))

    return Case(
        name,
        inject,
        FAILING,
        repairs,
        SURFACED,
        mend=mended,
        repair=60.0,
        calls=MAX_CALLS,
        rows=rows,
        after=after,
    )


def watch(**more: Any) -> dict[str, Any]:
    """WATCH reports the broken tool."""
    return {"report": report("error", {**BROKEN, **more})}


def heal(how: str, status: str = "repaired") -> dict[str, Any]:
    """HEAL answers with a server of this kind."""
    document = {
        "format": 1,
        "stage": "heal",
        "class": "broken_tool",
        "target": "tool:weigh",
        "status": status,
        "reason": "the table has no such weight",
        "action": "rewrite",
        "functions": ["weigh"],
        "server": "server.py",
        "cites": [],
        "claims": [],
    }
    return {"report": document, "server": how}


def _overdue(bench: Bench) -> None:
    """A tool that does not come back: two calls until the endpoint ends them."""
    _sensor(bench, "200000")
    bench.undo.append(lambda: _sensor(bench, "21500"))
    for _ in range(2):
        assert not bench.call("wait_for_sensor")[0]


def _mend_wait(bench: Bench) -> None:
    _sensor(bench, "21500")
    assert bench.call("wait_for_sensor")[0]


def _garbled(text: str) -> dict[str, Any]:
    return {"write": text}


_works: Callable[[Bench], bool] = lambda bench: bench.call("weigh")[0]  # noqa: E731
CASES = (
    told("tool fails, agent knows nothing"),
    told("agent's report is no JSON", "F14", watch=_garbled('{"status": "healthy"')),
    told("agent writes nothing", "F14b", watch={}),
    told("report is a list", "F14c", watch=_garbled("[]")),
    told("report without status", "F14c", watch=_garbled('{"format": 1, "stage": "watch"}')),
    told("status outside of the enum", "F14d", watch={"report": report("HEALTHY")}),
    told("agent reports it as fatal", "F33", watch=watch(severity="fatal")),
    told(
        "agent changes the server while it looks", "row 102", watch={**watch(severity="fatal"), "touch": ["{server}"]}
    ),
    told("agent prints bytes that are no text, and fails", "F38", watch={"shout": "fffe80", "exit": 1}),
    told("agent prints one line of 20 MB, and fails", "F37", watch={"flood": 20_000_000, "exit": 1}),
    told("HEAL fails", "F33", HEALING, watch=watch(), heal={"exit": 1}),
    told("HEAL writes a server that does not compile", "F15", HEALING, watch=watch(), heal=heal("broken")),
    told("HEAL deletes a tool", "F16", HEALING, watch=watch(), heal=heal("without_tool")),
    Case(
        "HEAL fixes the tool",
        lambda bench: broken(bench, watch=watch(), heal=heal("mended")),
        FAILING,
        HEALING,
        right=_works,
        repair=60.0,
        may_change=("state/bench/", ".octoform/bench/endpoint/"),
        calls=MAX_CALLS,
        spoils=True,
    ),
    Case(
        "tool that does not come back",
        _overdue,
        FAILING | {Kind.PROCESS_HUNG},
        ASKED | {Repair.RESTART},
        SURFACED,
        mend=_mend_wait,
        repair=60.0,
        calls=MAX_CALLS,
    ),
)
