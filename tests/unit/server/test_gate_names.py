"""A caller that may not know of a tool does not learn its name, nor its caller's, from a bus that the tool holds."""

import threading
from pathlib import Path

import anyio
import pytest
from gated import MODES, gated, tool_policy

from octoform.server.process import principal
from octoform.server.process.principal import LOCAL, Principal

GUEST = Principal("guest", frozenset({"read"}), "http")
HELD: list[threading.Event] = []
MAY_GO: list[threading.Event] = []


def secret_arm() -> str:
    """Moves until it may go."""
    HELD[-1].set()
    MAY_GO[-1].wait(20)
    return "moved"


def look() -> int:
    """Looks."""
    return 1


@pytest.mark.parametrize(("caller", "named"), [(GUEST, False), (LOCAL, True)], ids=["guest", "local"])
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.anyio
async def test_who_holds_a_bus_is_named_to_those_alone_who_may_know(
    caller: Principal, named: bool, mode: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    HELD.append(threading.Event())
    MAY_GO.append(threading.Event())
    who = {"now": LOCAL}
    monkeypatch.setattr(principal, "current", lambda: who["now"])
    tools = {secret_arm: tool_policy(buses=["rail"]), look: tool_policy("read", buses=["rail"], timeout=1.3)}
    heard: list[str] = []

    async def progress(_: float, __: float | None, message: str | None) -> None:
        heard.append(message or "")

    async with (
        gated(tmp_path, tools) as gate,
        gate.client(mode) as first,
        gate.client(mode) as second,
        anyio.create_task_group() as group,
    ):
        group.start_soon(first.call_tool, "secret_arm")
        await anyio.to_thread.run_sync(HELD[-1].wait, 20)
        who["now"] = caller
        answer = await second.call_tool("look", raise_on_error=False, progress_handler=progress)
        MAY_GO[-1].set()

    lines = [answer.content[0].text, *heard]
    assert len(lines) > 1 and all("rail is busy" in text for text in lines), lines
    assert all(("secret_arm (called by local)" in text) == named for text in lines), lines
    assert all(("secret_arm" in text) == named for text in lines), lines
