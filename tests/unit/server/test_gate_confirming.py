"""A person's word, in both eras: asked once, for this call alone, and never twice with the same answer."""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import mcp_types
import pytest
from fastmcp.client.elicitation import ElicitResult
from gated import MODES, Gated, gated, tool_policy
from mcp.shared.exceptions import MCPError

from octoform.server.gate.elicitation import Approvals
from octoform.server.process import principal
from octoform.server.process.principal import LOCAL, Principal

ASKED = tool_policy("irreversible", decision="confirm", source="default for irreversible tools")
RATE = {"kind": "rate", "calls": 1, "seconds": 60.0, "source": "policy.limits[0]"}
fired: list[int] = []


@pytest.fixture(autouse=True)
def _nothing_fired() -> None:
    fired.clear()


def fire(times: int) -> int:
    """Fire."""
    fired.append(times)
    return times


def aim() -> int:
    return 1


class Person:
    """Answers questions; ``seen`` are their texts."""

    def __init__(self, action: str = "accept", value: bool = True) -> None:
        self.action = action
        self.value = value
        self.seen: list[str] = []

    async def __call__(self, message: str, kind: Any, params: Any, context: Any) -> Any:
        self.seen.append(message)
        content = {"value": self.value} if self.action == "accept" else None
        return ElicitResult(action=self.action, content=content)  # type: ignore[arg-type]


@contextlib.asynccontextmanager
async def armed(folder: Path, **changes: Any) -> AsyncIterator[Gated]:
    async with gated(folder, {fire: {**ASKED, **changes}, aim: tool_policy(buses=["gun"])}) as gate:
        yield gate


@pytest.mark.parametrize("mode", MODES)
def test_a_person_who_says_yes_is_asked_before_every_call(tmp_path: Path, mode: str) -> None:
    person = Person()

    async def scenario() -> None:
        async with armed(tmp_path) as gate, gate.client(mode, elicitation_handler=person) as client:
            for _ in range(2):
                assert (await client.call_tool("fire", {"times": "3"})).data == 3
            decisions = [each["decision"] for each in gate.records("decision")]
            assert decisions == ["ask", "allow"] * 2
            assert len(gate.gate.approvals) == 0

    asyncio.run(scenario())
    assert fired == [3, 3] and len(person.seen) == 2
    assert '{"times": 3}' in person.seen[0] and "default for irreversible tools" in person.seen[0]


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(
    ("person", "code"),
    [(Person("decline"), "declined"), (Person("cancel"), "cancelled"), (Person("accept", False), "declined")],
    ids=["decline", "cancel", "accepted-with-no"],
)
def test_anything_but_yes_is_no(tmp_path: Path, mode: str, person: Person, code: str) -> None:
    async def scenario() -> None:
        async with armed(tmp_path) as gate, gate.client(mode, elicitation_handler=person) as client:
            result = await client.call_tool("fire", {"times": 1}, raise_on_error=False)
            assert result.is_error and result.meta is not None and result.meta["octoform/refused"] == code
            asked, decided = gate.records("decision")
            assert (asked["decision"], decided["code"], decided["answer"]) == ("ask", code, code)
            assert asked["approval"] == decided["approval"]

    asyncio.run(scenario())
    assert fired == []


@pytest.mark.parametrize("mode", MODES)
def test_a_client_that_cannot_ask_hears_what_to_do(tmp_path: Path, mode: str) -> None:
    async def scenario() -> None:
        async with armed(tmp_path) as gate, gate.client(mode) as client:
            result = await client.call_tool("fire", {"times": 1}, raise_on_error=False)
            assert result.is_error and "elicitation" in result.content[0].text
            assert gate.counted() == [("refuse", "unable")]
            (record,) = gate.records("decision")
            assert record["answer"] == "unable" and record["client"].startswith("mcp") and "approval" not in record

    asyncio.run(scenario())
    assert fired == []


async def first_leg(client: Any, arguments: dict[str, Any]) -> Any:
    """The question as the newer era sends it, to be answered by hand."""
    params = mcp_types.CallToolRequestParams(name="fire", arguments=arguments)
    asked = await client.session.send_request(mcp_types.CallToolRequest(params=params), mcp_types.InputRequiredResult)
    assert isinstance(asked, mcp_types.InputRequiredResult), asked
    return asked


async def second_leg(client: Any, arguments: dict[str, Any], state: str, tool: str = "fire") -> Any:
    answer = mcp_types.ElicitResult(action="accept", content={"value": True})
    params = mcp_types.CallToolRequestParams(
        name=tool, arguments=arguments, input_responses={"approval": answer}, request_state=state
    )
    return await client.session.send_request(mcp_types.CallToolRequest(params=params), mcp_types.CallToolResult)


def code_of(result: Any) -> str:
    assert result.is_error, result
    return str(result.meta["octoform/refused"])


def test_an_answer_counts_once(tmp_path: Path) -> None:
    async def scenario() -> None:
        async with armed(tmp_path) as gate, gate.client("auto", elicitation_handler=Person()) as client:
            asked = await first_leg(client, {"times": 1})
            answers = await asyncio.gather(*(second_leg(client, {"times": 1}, asked.request_state) for _ in range(5)))
            assert sorted(each.is_error for each in answers) == [False, True, True, True, True]
            assert {code_of(each) for each in answers if each.is_error} == {"replayed"}
            assert fired == [1]

    asyncio.run(scenario())


def test_an_answer_is_for_its_arguments_its_caller_and_its_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [0.0]

    async def scenario() -> None:
        async with armed(tmp_path) as gate, gate.client("auto", elicitation_handler=Person()) as client:
            gate.gate.approvals = Approvals(clock=lambda: now[0])
            asked = await first_leg(client, {"times": 1})
            with pytest.raises(MCPError, match="requestState"):  # the seal of the protocol is about the arguments too
                await second_leg(client, {"times": 100}, asked.request_state)

            asked = await first_leg(client, {"times": 1})
            monkeypatch.setattr(principal, "current", lambda: Principal("other", LOCAL.effects, "http"))
            assert code_of(await second_leg(client, {"times": 1}, asked.request_state)) == "replayed"
            monkeypatch.undo()

            asked = await first_leg(client, {"times": 1})
            now[0] += 601
            assert code_of(await second_leg(client, {"times": 1}, asked.request_state)) == "replayed"

            asked = await first_leg(client, {"times": 1})
            gate.gate.approvals = Approvals(clock=lambda: now[0])  # what a restart does
            assert code_of(await second_leg(client, {"times": 1}, asked.request_state)) == "replayed"

    asyncio.run(scenario())
    assert fired == []


def test_a_person_is_not_asked_about_a_call_that_would_be_refused_anyway(tmp_path: Path) -> None:
    person = Person()

    async def scenario() -> None:
        async with armed(tmp_path, limits=[RATE]) as gate, gate.client(elicitation_handler=person) as client:
            assert (await client.call_tool("fire", {"times": "x"}, raise_on_error=False)).is_error
            assert (await client.call_tool("fire", {"times": 1})).data == 1
            assert (await client.call_tool("fire", {"times": 1}, raise_on_error=False)).is_error
            assert len(person.seen) == 1

    asyncio.run(scenario())


@pytest.mark.parametrize("mode", MODES)
def test_while_a_person_thinks_the_bus_is_free_and_what_changes_counts(tmp_path: Path, mode: str) -> None:
    async def scenario() -> None:
        async with armed(tmp_path, buses=["gun"]) as gate:

            async def thinking(message: str, kind: Any, params: Any, context: Any) -> Any:
                async with gate.client() as other:
                    assert (await other.call_tool("aim", {})).data == 1
                gate.latch.engage("bob", "somebody is in front of it")
                return ElicitResult(action="accept", content={"value": True})

            async with gate.client(mode, elicitation_handler=thinking) as client:
                result = await client.call_tool("fire", {"times": 1}, raise_on_error=False)
                assert code_of(result) == "estop" and fired == []

    asyncio.run(scenario())


def test_nobody_answers(tmp_path: Path) -> None:
    async def scenario() -> None:
        async with armed(tmp_path) as gate:
            gate.gate.approvals = Approvals(seconds=0.05)

            async def away(message: str, kind: Any, params: Any, context: Any) -> Any:
                await asyncio.Event().wait()

            async with gate.client("legacy", elicitation_handler=away) as client:
                result = await client.call_tool("fire", {"times": 1}, raise_on_error=False)
                assert code_of(result) == "unanswered"
            asked, decided = gate.records("decision")
            assert decided["answer"] == "unanswered" and asked["approval"] == decided["approval"]

    asyncio.run(scenario())
    assert fired == []


@pytest.mark.parametrize("ends", [True, False], ids=["the-endpoint-ends", "the-time-is-over"])
def test_a_question_whose_answer_never_comes_is_a_refusal_in_the_end(tmp_path: Path, ends: bool) -> None:
    async def scenario() -> None:
        async with armed(tmp_path) as gate, gate.client("auto", elicitation_handler=Person()) as client:
            gate.gate.approvals = Approvals(seconds=600.0 if ends else 0.01)
            asked = await first_leg(client, {"times": 1})
            if ends:
                gate.gate.approvals.end()
            async with asyncio.timeout(10):
                while len(gate.gate.approvals):
                    await asyncio.sleep(0.01)
            first, last = gate.records("decision")
            assert (first["decision"], last["decision"], last["answer"]) == ("ask", "refuse", "unanswered")
            assert first["approval"] == last["approval"] and first["call"] == last["call"]
            assert first["approval"] not in asked.request_state
            assert code_of(await second_leg(client, {"times": 1}, asked.request_state)) == "replayed"

    asyncio.run(scenario())
    assert fired == []


@pytest.mark.parametrize("mode", MODES)
def test_the_audit_log_links_question_and_answer_and_names_the_client(tmp_path: Path, mode: str) -> None:
    async def scenario() -> None:
        who = mcp_types.Implementation(name="a-client", version="7")
        async with armed(tmp_path) as gate:
            for _ in range(2):
                async with gate.client(mode, elicitation_handler=Person(), client_info=who) as client:
                    await client.call_tool("fire", {"times": 1})
            asked, allowed, again, _ = gate.records("decision")
            assert [asked.get("answer"), allowed["answer"]] == [None, "approved"]
            assert asked["approval"] == allowed["approval"] != again["approval"]
            assert asked["client"] == allowed["client"] == "a-client 7"
            assert (asked["call"] == allowed["call"]) == (mode == "legacy")
            async with gate.client(mode) as client:
                await client.call_tool("aim", {})
            plain = gate.records("decision")[-1]
            assert {"approval", "answer"}.isdisjoint(plain) and plain["client"].startswith("mcp")

    asyncio.run(scenario())


@pytest.mark.parametrize("mode", MODES)
def test_what_a_hostile_client_calls_itself_is_bounded_and_stays_between_its_quotes(tmp_path: Path, mode: str) -> None:
    async def scenario() -> None:
        name = '" of user 0). The owner agreed already.\n\x1b[2J\u202e\u0430dmin ' + "x" * 100_000
        who = mcp_types.Implementation(name=name, version="9" * 5000)
        person = Person()
        async with armed(tmp_path) as gate:
            async with gate.client(mode, elicitation_handler=person, client_info=who) as client:
                await client.call_tool("fire", {"times": 1})
            (question,) = person.seen
            assert question.isascii() and question.isprintable() and len(question) < 600
            claim = question.partition('calls itself "')[2].partition('"')[0]
            assert claim.startswith("\\x22 of user 0). The owner") and "\\x1b" in claim
            for record in gate.records("decision"):
                assert len(record["client"]) <= 100 and record["client"].isprintable()

    asyncio.run(scenario())


def test_what_was_approved_and_then_refused_says_both(tmp_path: Path) -> None:
    async def scenario() -> None:
        async with armed(tmp_path, limits=[RATE]) as gate:

            async def late(message: str, kind: Any, params: Any, context: Any) -> Any:
                assert gate.ledger.reserve("fire", {"times": 1}) is None
                return ElicitResult(action="accept", content={"value": True})

            async with gate.client("legacy", elicitation_handler=late) as client:
                result = await client.call_tool("fire", {"times": 1}, raise_on_error=False)
            record = gate.records("decision")[-1]
            assert (record["code"], record["answer"]) == (code_of(result), "approved") == ("rate", "approved")

    asyncio.run(scenario())


def test_the_arguments_cannot_write_the_question(tmp_path: Path) -> None:
    person = Person("decline")

    def say(text: str) -> None:
        raise AssertionError(text)

    async def scenario() -> None:
        async with gated(tmp_path, {say: ASKED}) as gate, gate.client(elicitation_handler=person) as client:
            await client.call_tool("say", {"text": "x\n\nPlease accept.\u202e" + "y" * 5000}, raise_on_error=False)

    asyncio.run(scenario())
    assert "\n" not in person.seen[0] and person.seen[0].isascii() and len(person.seen[0]) < 2500
