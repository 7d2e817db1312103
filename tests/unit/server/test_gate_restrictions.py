"""A restriction at the gate: for every caller, never for readings and stops, and looked at again when a call runs."""

import asyncio
import json
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest
from fastmcp.client.elicitation import ElicitResult
from gated import MODES, Gated, gated, tool_policy

from octoform.server.execution.bus_queue import Holder, release, take_free
from octoform.server.restrictions import NAME, WITNESS, Forbidden, Restrictions, Standing, Subject

moved: list[Any] = []


@pytest.fixture(autouse=True)
def _still() -> None:
    moved.clear()


def move(joint: str, position: int = 0) -> str:
    """Move a joint."""
    moved.append(joint)
    return joint


def look() -> int:
    """Read the arm."""
    return 7


def stop() -> bool:
    """Stop the arm."""
    moved.append("stop")
    return True


TOOLS = {
    move: tool_policy(buses=["arm"]),
    look: tool_policy("read", buses=["arm"]),
    stop: tool_policy(buses=["arm"], stops=True),
}
NOW = 100.0


def restrict(folder: Path, *tools: str, effect: str = "deny", joint: str = "elbow") -> None:
    entries = [
        {
            "claim": "c1",
            "tool": tool,
            "arguments": {"joint": [joint]} if tool == "move" else {},
            "effect": effect,
            "target": "device:arm/elbow",
            "statement": "the elbow is hot",
            "expires": NOW + 60,
            "expires_at": "2026-11-22T16:30:00Z",
        }
        for tool in tools
    ]
    new = folder / "run" / "new"
    new.write_text(json.dumps({"format": 1, "boot": "b", "restrictions": entries}))
    new.replace(folder / "run" / NAME)


class Clock:
    now = NOW

    def __call__(self) -> float:
        return self.now


def of(gate: Gated, clock: Clock) -> None:
    def tell(event: str, fields: Any) -> None:
        gate.gate._records.write(event, **fields)

    # Outside of a test the endpoint writes these on its own audit log.
    gate.gate.restrictions = Restrictions(gate.folder / "run" / NAME, tell, clock, "b")


def run(folder: Path, scenario: Callable[[Gated, Clock], Awaitable[None]], mode: str = "enforce") -> None:
    async def whole() -> None:
        clock = Clock()
        async with gated(folder, TOOLS, mode=mode) as gate:
            of(gate, clock)
            await scenario(gate, clock)

    asyncio.run(whole())


async def said(gate: Gated, mode: str, name: str, arguments: dict[str, Any] | None = None, **more: Any) -> str:
    async with gate.client(mode, **more) as client:
        result = await client.call_tool(name, arguments or {}, raise_on_error=False)
    return str(result.content[0].text) if result.is_error else "ok"


@pytest.mark.parametrize("mode", MODES)
def test_a_restricted_call_is_refused_until_its_moment_and_both_are_on_the_audit_log(tmp_path: Path, mode: str) -> None:
    async def scenario(gate: Gated, clock: Clock) -> None:
        restrict(tmp_path, "move")
        text = await said(gate, mode, "move", {"joint": "elbow"})
        assert "c1" in text and "the elbow is hot" in text and "2026-11-22T16:30:00Z" in text
        assert await said(gate, mode, "move", {"joint": "wrist"}) == "ok"
        clock.now += 60  # nothing was written
        assert await said(gate, mode, "move", {"joint": "elbow"}) == "ok"
        events = [each["event"] for each in gate.records() if each["event"].startswith("restriction")]
        assert events == ["restriction", "restriction_over"]
        (refused,) = [each for each in gate.records("decision") if each["decision"] == "refuse"]
        assert refused["code"] == "restricted" and refused["arguments"]["joint"] == "elbow"

    run(tmp_path, scenario)
    assert moved == ["wrist", "elbow"]


def test_readings_and_what_stops_are_never_restricted_whatever_the_file_says(tmp_path: Path) -> None:
    async def scenario(gate: Gated, clock: Clock) -> None:
        restrict(tmp_path, "move", "look", "stop")
        assert await said(gate, "auto", "look") == await said(gate, "auto", "stop") == "ok"
        assert "restricted" in await said(gate, "auto", "move", {"joint": "elbow"})

    run(tmp_path, scenario)
    assert moved == ["stop"]


def test_what_the_policy_only_watches_is_noted(tmp_path: Path) -> None:
    async def scenario(gate: Gated, clock: Clock) -> None:
        restrict(tmp_path, "move")
        assert await said(gate, "auto", "move", {"joint": "elbow"}) == "ok"
        (allowed,) = gate.records("decision")[:1]
        assert allowed["decision"] == "allow" and allowed["shadow"][0].startswith("restricted: ")

    run(tmp_path, scenario, mode="shadow")
    assert moved == ["elbow"]


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("yes", [True, False])
def test_a_person_is_asked_where_the_claim_says_so(tmp_path: Path, mode: str, yes: bool) -> None:
    asked: list[str] = []

    async def answer(message: str, *_: Any) -> ElicitResult[Any]:
        asked.append(message)
        return ElicitResult(action="accept", content={"value": yes})

    async def scenario(gate: Gated, clock: Clock) -> None:
        restrict(tmp_path, "move", effect="confirm")
        text = await said(gate, mode, "move", {"joint": "elbow"}, elicitation_handler=answer)
        assert (text == "ok") is yes
        assert "the elbow is hot" in asked[0]
        assert await said(gate, mode, "move", {"joint": "wrist"}) == "ok" and len(asked) == 1
        assert "elicitation" in await said(gate, mode, "move", {"joint": "elbow"})

    run(tmp_path, scenario)
    assert moved == (["elbow", "wrist"] if yes else ["wrist"])


@pytest.mark.parametrize("effect", ["deny", "confirm"])
def test_a_call_that_waits_for_its_bus_is_judged_again_when_it_has_it(tmp_path: Path, effect: str) -> None:
    async def scenario(gate: Gated, clock: Clock) -> None:
        entry = gate.gate._entries.get("move")
        assert entry is not None
        bus, other = entry.queues[0], Holder("other", "somebody", "actuate", frozenset())
        assert take_free([bus], other)
        call = asyncio.create_task(said(gate, "auto", "move", {"joint": "elbow"}))
        while not bus._waiting:
            await asyncio.sleep(0.005)
        restrict(tmp_path, "move", effect=effect)
        release([bus], other)
        assert "restricted" in await call
        assert ("refuse", "restricted") in gate.counted()

    run(tmp_path, scenario)
    assert moved == []


UNITS = {"names": {"elbow": ["3"], "wrist": ["4"]}}


def move_many(elbow: int | None = None, wrist: int | None = None) -> str:
    """Move joints."""
    moved.append("many")
    return "done"


def home() -> str:
    """Move all joints."""
    moved.append("home")
    return "done"


def lamp() -> str:
    """Light a lamp of the device, by its description."""
    moved.append("lamp")
    return "done"


OF_UNITS = {
    move: tool_policy(buses=["arm"], units={**UNITS, "parameter": "joint"}),
    move_many: tool_policy(buses=["arm"], units={**UNITS, "parameters": {"elbow": "elbow", "wrist": "wrist"}}),
    home: tool_policy(buses=["arm"], units=UNITS),
    lamp: tool_policy(buses=["arm"]),
    look: tool_policy("read", buses=["arm"]),
    stop: tool_policy(buses=["arm"], stops=True),
}
FOR_GOOD: dict[str, Any] = {
    "claim": "c7",
    "tool": "",
    "arguments": {},
    "effect": "deny",
    "device": "arm",
    "units": ["elbow"],
    "kind": "disable_unit",
    "statement": "the gear is broken",
    "expires": None,
    "expires_at": "",
}


def test_a_restriction_of_a_unit_holds_for_every_tool_that_acts_on_it(tmp_path: Path) -> None:
    calls: list[tuple[str, dict[str, Any]]] = [
        ("move", {"joint": "elbow"}),
        ("move", {"joint": "3"}),
        ("move", {"joint": "something"}),
        ("move_many", {"elbow": 5}),
        ("move_many", {}),
        ("home", {}),
        ("lamp", {}),  # it does not say which units it acts on
    ]
    free: list[tuple[str, dict[str, Any]]] = [("move", {"joint": "4"}), ("move_many", {"wrist": 5}), ("look", {})]

    async def whole() -> None:
        path = tmp_path / "run" / NAME
        async with gated(tmp_path, OF_UNITS) as gate:
            of(gate, Clock())
            path.write_text(json.dumps({"format": 1, "boot": "another", "restrictions": [FOR_GOOD]}))
            for name, given in calls:
                text = await said(gate, "auto", name, given)
                assert "permanent restriction disable_unit" in text and "octoform claims -retire c7" in text, name
                assert "elbow of arm" in text
            for name, given in [*free, ("stop", {})]:
                assert await said(gate, "auto", name, given) == "ok", name
            path.unlink()  # it was not withdrawn
            assert "disable_unit" in await said(gate, "auto", "home")
            path.write_text(json.dumps({"format": 1, "boot": "b", "restrictions": []}))
            assert await said(gate, "auto", "home") == "ok"

    asyncio.run(whole())
    assert moved == ["4", "many", "stop", "home"]


def test_a_unit_that_no_tool_names_keeps_the_whole_device(tmp_path: Path) -> None:
    async def whole() -> None:
        async with gated(tmp_path, OF_UNITS) as gate:
            of(gate, Clock())
            strange = {**FOR_GOOD, "units": ["axis nine"]}
            (tmp_path / "run" / NAME).write_text(json.dumps({"format": 1, "boot": "b", "restrictions": [strange]}))
            assert "axis nine" in await said(gate, "auto", "move", {"joint": "wrist"})

    asyncio.run(whole())
    assert moved == []


def test_what_the_ledger_says_holds_where_the_file_is_gone_or_damaged(tmp_path: Path) -> None:
    run = tmp_path / "run"
    run.mkdir()
    ledger = tmp_path / "claims.json"
    claim: dict[str, Any] = {
        "id": "c7",
        "target": "device:arm/elbow",
        "statement": "its gear is broken",
        "state": "active",
        "irreversible": "disable_unit",
        "expires": None,
        "expires_at": "",
        "restrictions": [],
    }
    temporary = claim | {"id": "c8", "irreversible": None, "expires": NOW + 60}
    temporary |= {"restrictions": [{"tool": "move", "arguments": {"joint": "elbow"}, "effect": "confirm"}]}

    def keep(*claims: Any) -> None:
        new = tmp_path / "new"
        new.write_text(json.dumps({"format": 1, "boot": "b", "claims": claims}))
        new.replace(ledger)

    keep(claim, temporary)
    clock = Clock()
    restrictions = Restrictions(run / NAME, clock=lambda: clock.now, boot="b", ledger=Standing(ledger, "b"))
    call = Subject("move", {"joint": "elbow"}, ("arm",))
    assert [entry.claim for entry in restrictions.in_force()] == ["c7", "c8"]
    assert "permanent restriction disable_unit" in restrictions.against(call).words  # type: ignore[union-attr]
    assert restrictions.against(Subject("move", {}, ("rail",))) is None
    (run / NAME).write_text("{")
    assert [entry.claim for entry in restrictions.in_force()] == ["c7", "c8"]
    assert "ledger of claims is in force" in str(restrictions.problem)
    clock.now = NOW + 61
    assert [entry.claim for entry in restrictions.in_force()] == ["c7"]
    keep(claim | {"state": "retired"})
    assert restrictions.in_force() == ()
    other = Restrictions(run / NAME, clock=lambda: NOW, boot="c", ledger=Standing(ledger, "c"))
    keep(claim, temporary)
    assert [entry.claim for entry in other.in_force()] == ["c7"]  # the machine was started anew


def test_nothing_moves_while_nobody_can_read_what_a_person_has_forbidden(tmp_path: Path) -> None:
    run, ledger, clock = tmp_path / "run", tmp_path / "claims.json", Clock()
    run.mkdir()
    call = Subject("move", {"joint": "elbow"}, ("arm",))
    assert Restrictions(run / NAME, clock=lambda: clock.now, boot="b", ledger=Standing(ledger, "b")).in_force() == ()
    ledger.write_text("[" * 900)
    gone = Restrictions(run / NAME, clock=lambda: clock.now, boot="b", ledger=Standing(ledger, "b"))
    assert "cannot be read" in gone.against(call).words  # type: ignore[union-attr]
    (run / NAME).write_text("{")
    damaged = Restrictions(run / NAME, clock=lambda: clock.now, boot="b", ledger=Standing(ledger, "b"))
    assert "octoform claims, which starts both again" in damaged.against(call).words  # type: ignore[union-attr]
    assert "nothing moves" in str(damaged.problem)
    ledger.write_text(json.dumps({"format": 1, "boot": "b", "claims": []}))
    assert damaged.in_force() == ()


def test_a_restriction_that_is_in_none_of_its_files_any_more_stops_all_that_moves(tmp_path: Path) -> None:
    run, ledger, witness = tmp_path / "run", tmp_path / "claims.json", tmp_path / WITNESS
    run.mkdir()
    call = Subject("move", {"joint": "elbow"}, ("arm",))

    def begun() -> Restrictions:
        made = Restrictions(run / NAME, clock=lambda: NOW, boot="b", ledger=Standing(ledger, "b"))
        made.forbidden = Forbidden(witness)
        return made

    assert begun().in_force() == ()
    for written in ({"format": 1, "claims": ["c7"]}, {"format": 1}, ["c7"]):
        witness.write_text(json.dumps(written))
        stood = begun().against(call)
        assert stood is not None and "what a person has forbidden cannot be read" in stood.words, written
    witness.write_text(json.dumps({"format": 1, "claims": ["c7"]}))
    (run / NAME).write_text(json.dumps({"format": 1, "boot": "b", "restrictions": [FOR_GOOD]}))
    assert [entry.claim for entry in begun().in_force()] == ["c7"]
    (run / NAME).write_text(json.dumps({"format": 1, "boot": "b", "restrictions": []}))
    kept = begun()
    assert kept.against(call) is not None
    witness.unlink()
    assert kept.against(call) is None


def test_a_process_that_has_read_the_list_goes_on_with_what_it_knows(tmp_path: Path) -> None:
    run, ledger = tmp_path / "run", tmp_path / "claims.json"
    run.mkdir()
    (run / NAME).write_text(json.dumps({"format": 1, "boot": "b", "restrictions": [FOR_GOOD]}))
    restrictions = Restrictions(run / NAME, clock=lambda: NOW, boot="b", ledger=Standing(ledger, "b"))
    assert [entry.claim for entry in restrictions.in_force()] == ["c7"]
    ledger.write_text("{")
    (run / NAME).write_text("{")
    assert [entry.claim for entry in restrictions.in_force()] == ["c7"]
    assert "only the permanent restrictions from before hold" in str(restrictions.problem)
