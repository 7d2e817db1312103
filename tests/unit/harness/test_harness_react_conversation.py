"""The conversation of the small agent: its size, what goes first, what always stays."""

import json
from typing import Any

import pytest

from octoform.harness.llm.client import Call, Reply, size_of
from octoform.harness.react.chat_history import LIMIT_BYTES, RECENT, Conversation

INSTRUCTIONS, TASK = "You are an engineer.", "Do the thing. " * 100


def step(conversation: Conversation, number: int, result: str, arguments: str = '{"command": "ls"}') -> None:
    call = Call(f"id{number}", "shell", arguments)
    written = {"id": call.id, "type": "function", "function": {"name": "shell", "arguments": arguments}}
    conversation.replied(Reply(f"step {number}", (call,), {"role": "assistant", "tool_calls": [written]}))
    conversation.returned(call.id, "shell", result)


def content(messages: list[dict[str, Any]]) -> str:
    return "\n".join(str(message["content"]) for message in messages)


def test_what_fits_is_sent_as_it_is() -> None:
    conversation = Conversation(INSTRUCTIONS, TASK)
    step(conversation, 1, "result 1")
    conversation.replied(Reply("what now", message={"role": "assistant", "content": "what now"}))
    conversation.reply("go on")
    assert conversation.messages() == [
        {"role": "system", "content": INSTRUCTIONS},
        {"role": "user", "content": TASK},
        {
            "role": "assistant",
            "content": "step 1",
            "tool_calls": [
                {"id": "id1", "type": "function", "function": {"name": "shell", "arguments": '{"command": "ls"}'}}
            ],
        },
        {"role": "tool", "tool_call_id": "id1", "name": "shell", "content": "result 1"},
        {"role": "assistant", "content": "what now"},
        {"role": "user", "content": "go on"},
    ]


def test_old_results_give_way_and_the_rest_stays() -> None:
    conversation = Conversation(INSTRUCTIONS, TASK)
    for number in range(20):
        step(conversation, number, f"result {number} " + "x" * 20_000)
    messages = conversation.messages()
    text = content(messages)
    assert size_of(messages) <= LIMIT_BYTES
    assert messages[0]["content"] == INSTRUCTIONS and messages[1]["content"] == TASK
    assert "result 0 " not in text and "[20009 bytes of this result are omitted here" in text
    assert all(f"step {number}\n" in text for number in range(20))
    assert all(f"result {number} " in text for number in range(20 - RECENT, 20))


@pytest.mark.parametrize(("size", "steps"), [(100, 600), (5_000, 600), (1_000_000, 100)])
def test_however_long_the_run_a_request_stays_bounded(size: int, steps: int) -> None:
    conversation = Conversation(INSTRUCTIONS, TASK)
    largest = 0
    arguments = json.dumps({"path": "a", "content": "c" * (size // 2)})
    for number in range(steps):
        step(conversation, number, f"<result {number}>" + "x" * size, arguments)
        if number % 10 == 9:
            largest = max(largest, size_of(conversation.messages()))
    messages = conversation.messages()
    assert largest <= LIMIT_BYTES
    assert messages[0]["content"] == INSTRUCTIONS and messages[1]["content"] == TASK
    assert f"<result {steps - 1}>" in content(messages)
    asked = [call["id"] for message in messages for call in message.get("tool_calls", ())]
    assert asked == [message["tool_call_id"] for message in messages if message["role"] == "tool"]


def test_steps_that_went_are_told_of() -> None:
    conversation = Conversation(INSTRUCTIONS, TASK)
    for number in range(3000):
        step(conversation, number, "r" * 190)
    messages = conversation.messages()
    assert "earlier steps of this conversation are omitted.]" in messages[2]["content"]
    assert size_of(messages) <= LIMIT_BYTES


@pytest.mark.parametrize("arguments", ['{"command": "echo hi', "[1]", "[" * 50_000, json.dumps({"a": "x" * 200_000})])
def test_arguments_that_are_none_are_not_repeated(arguments: str) -> None:
    conversation = Conversation(INSTRUCTIONS, TASK)
    step(conversation, 1, "the arguments are no JSON object", arguments)
    assert conversation.messages()[2]["tool_calls"][0]["function"] == {"name": "shell", "arguments": "{}"}


def test_one_step_of_many_large_results_fits() -> None:
    conversation = Conversation(INSTRUCTIONS, TASK)
    calls = tuple(Call(f"id{number}", "shell", "{}") for number in range(16))
    conversation.replied(Reply("", calls))
    for call in calls:
        conversation.returned(call.id, call.name, "x" * 1_000_000, len(calls))
    assert size_of(conversation.messages()) < LIMIT_BYTES // 4


def test_the_bound_of_a_smaller_model_and_of_one_that_finds_it_too_long() -> None:
    small = Conversation(INSTRUCTIONS, TASK, tokens=60_000)
    for number in range(30):
        step(small, number, "x" * 20_000)
    assert size_of(small.messages()) <= 120_000
    sizes = [size_of(small.messages())]
    while small.shrink():
        sizes.append(size_of(small.messages()))
    assert sizes == sorted(sizes, reverse=True) and sizes[-1] < sizes[0] / 2
    assert small.messages()[1]["content"] == TASK


def test_what_came_with_a_reply_goes_back_with_it() -> None:
    conversation = Conversation(INSTRUCTIONS, TASK)
    call = Call("id1", "shell", "{}")
    mark = {"provider_specific_fields": {"thought_signature": "abc"}}
    message = {"role": "assistant", "tool_calls": [{"id": "id1", **mark}], "thinking_blocks": [{"thinking": "hm"}]}
    conversation.replied(Reply("", (call,), message))
    sent = conversation.messages()[2]
    assert sent["tool_calls"][0]["provider_specific_fields"] == mark["provider_specific_fields"]
    assert sent["thinking_blocks"] == [{"thinking": "hm"}]
    assert sent["content"] is None
