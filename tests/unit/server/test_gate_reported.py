"""What a device reports after a call, held against the ranges of its units."""

import asyncio
from pathlib import Path
from typing import Any

from gated import gated, tool_policy

from octoform.policy import published as policies
from octoform.policy.enforce import Ledger

factor = 1


def move(joint: str, position: int) -> dict[str, Any]:
    """Move a joint."""
    return {"joint": joint, "position": position * factor}


def move_all(pan: int | None = None, elbow: int | None = None) -> dict[str, Any]:
    """Move joints."""
    fields = {"pan": pan, "elbow": elbow}
    return {"joints": [{"joint": name, "position": place} for name, place in fields.items() if place is not None]}


def silent(joint: str, position: int) -> dict[str, Any]:
    """Move a joint, and say nothing."""
    return {"done": True}


def look() -> int:
    """Read the arm."""
    return 7


def stop() -> bool:
    """Stop the arm."""
    return True


def limp() -> bool:
    """Let all of the arm go."""
    return True


NAMES = {"pan": ["1"], "elbow": ["3"]}
PLACES = [{"kind": "goal", "of": "elbow", "maximum": 1000, "unit": "raw", "source": "policy.limits[0]"}]
GOAL = {"of": "position", "parameter": "position"}
REPORTS = {"field": "position", "unit": "joint", "within": 20}
MOVE = {"names": NAMES, "parameter": "joint", "goal": GOAL}
TOOLS = {
    move: tool_policy(buses=["arm"], units={**MOVE, "reports": REPORTS}, places=PLACES),
    move_all: tool_policy(
        buses=["arm"],
        units={
            "names": NAMES,
            "parameters": {"pan": "pan", "elbow": "elbow"},
            "goal": {"of": "position"},
            "reports": {**REPORTS, "records": "joints"},
        },
        places=PLACES,
    ),
    silent: tool_policy(buses=["arm"], units=MOVE, places=PLACES),
    look: tool_policy("read", buses=["arm"]),
    stop: tool_policy(buses=["arm"], stops=True),
    limp: tool_policy(buses=["arm"], units={"names": NAMES}),
}


def test_a_report_outside_of_the_range_keeps_the_unit_still_until_a_person_sets_it_back(tmp_path: Path) -> None:
    async def talk() -> None:
        global factor
        factor = 10
        async with gated(tmp_path, TOOLS) as here, here.client() as client:

            async def told(name: str, **arguments: Any) -> str:
                done = await client.call_tool(name, arguments, raise_on_error=False)
                return str(done.content[0].text) if done.is_error else ""

            assert await told("move", joint="elbow", position=102) == ""  # devices do not stop exactly
            assert "1030 raw" in await told("move", joint="3", position=103)
            here.ledger.reset("move")
            assert await told("move", joint="elbow", position=100) == ""
            assert await told("move", joint="pan", position=900) == ""
            found = await told("move", joint="elbow", position=900)
            assert "has moved its device" in found and "9000 raw" in found and "policy.limits[0]" in found
            assert "octoform limits -reset move" in found
            for name, arguments in (
                ("move", {"joint": "3", "position": 1}),
                ("move_all", {"elbow": 1}),
                ("silent", {"joint": "elbow", "position": 1}),
                ("limp", {}),
            ):
                assert "the device reported elbow at 9000 raw" in await told(name, **arguments), name
            assert [await told("move", joint="pan", position=1), await told("stop"), await told("look")] == ["", "", ""]
            assert here.records("outside")[-1]["units"]["elbow"].startswith("at 9000 raw")
            again = Ledger(
                policies.parse({"format": 1, "mode": "enforce", "tools": _named()}), tmp_path / "run/limits.json"
            )
            refusal = again.judge("limp", {})
            assert refusal is not None and refusal.code == "reported"
            assert again.used()["move"]["outside"] == here.ledger.used()["move"]["outside"] != {}
            here.ledger.reset("move")
            factor = 1
            assert await told("move", joint="elbow", position=900) == ""
            assert await told("move_all", pan=5000) == ""
            assert "5000 raw" in await told("move_all", pan=5000, elbow=5000)

    asyncio.run(talk())


def test_a_result_that_says_nothing_is_told_as_unknown(tmp_path: Path) -> None:
    async def talk() -> None:
        async with gated(tmp_path, TOOLS) as here, here.client() as client:
            await client.call_tool("silent", {"joint": "elbow", "position": 5})
            await client.call_tool("silent", {"joint": "pan", "position": 5})
            assert [each["units"] for each in here.records("place_unknown")] == [["elbow"]]

    asyncio.run(talk())


def test_shadow_mode_tells_and_lets_pass(tmp_path: Path) -> None:
    async def talk() -> None:
        async with gated(tmp_path, TOOLS, "shadow") as here, here.client() as client:
            for _ in range(2):
                await client.call_tool("move", {"joint": "elbow", "position": 5000})
            assert len(here.records("outside")) == 2

    asyncio.run(talk())


def _named() -> dict[str, Any]:
    return {each.__name__: what for each, what in TOOLS.items()}
