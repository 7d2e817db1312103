"""The scripted model server: its replies as the clients of each service read them, and its ways to fail."""

import http.client
import json
import threading
import time
from typing import Any
from urllib.parse import urlsplit

import pytest
from model_server import ModelServer, serve

SHELL = {"type": "object", "properties": {"command": {"type": "string"}}, "required": ["command"]}
PATHS = {
    "chat": "/v1/chat/completions",
    "responses": "/v1/responses",
    "messages": "/v1/messages?beta=true",
    "gemini": "/v1beta/models/scripted:generateContent",
    "ollama": "/api/chat",
}
TOOLS: dict[str, Any] = {
    "chat": [{"type": "function", "function": {"name": "bash", "parameters": SHELL}}],
    "responses": [{"type": "function", "name": "bash", "parameters": SHELL}, {"type": "web_search"}],
    "messages": [{"name": "bash", "input_schema": SHELL}],
    "gemini": [{"functionDeclarations": [{"name": "bash", "parametersJsonSchema": SHELL}]}],
    "ollama": [{"type": "function", "function": {"name": "bash", "parameters": SHELL}}],
}
SCRIPT = {
    "turns": [{"shell": "echo {turn}", "text": "a moment"}, {"text": "done " * 20}],
    "usage": {"input": 100, "cached": 40, "output": 7},
}


def send(server: ModelServer, path: str, body: Any = None, **headers: str) -> tuple[int, str]:
    """Status and text of one request; a broken reply raises what http.client raises."""
    connection = http.client.HTTPConnection(urlsplit(server.url).netloc, timeout=10)
    try:
        connection.request("GET" if body is None else "POST", path, body and json.dumps(body), headers)
        answer = connection.getresponse()
        return answer.status, answer.read().decode()
    finally:
        connection.close()


def ask(server: ModelServer, api: str, stream: bool = False, seen: str = "", **headers: str) -> tuple[int, str]:
    """One request for a reply; ``seen`` stands for the conversation so far."""
    path = PATHS[api].replace("generate", "streamGenerate") if stream and api == "gemini" else PATHS[api]
    body = {"model": "m", "tools": TOOLS[api], "stream": stream, "seen": seen}
    if stream and api == "chat":
        body["stream_options"] = {"include_usage": True}
    return send(server, path, body, **headers)


def events(text: str) -> list[Any]:
    """The data of a stream of events."""
    found = [line.removeprefix("data: ") for line in text.splitlines() if line.startswith("data: ")]
    return [json.loads(item) for item in found if item != "[DONE]"]


@pytest.mark.parametrize("stream", [False, True])
def test_chat_completions(stream: bool) -> None:
    with serve(SCRIPT) as server:
        text = ask(server, "chat", stream)[1]
    if stream:
        deltas = [item["choices"][0]["delta"] for item in events(text) if item["choices"]]
        called = [item["tool_calls"][0] for item in deltas if "tool_calls" in item]
        call = {"name": called[0]["function"]["name"], "id": called[0]["id"]}
        arguments = "".join(item["function"]["arguments"] for item in called)
        assert "".join(item.get("content", "") for item in deltas) == "a moment"
        usage = events(text)[-1]["usage"]
    else:
        message = json.loads(text)["choices"][0]["message"]
        call = {"name": message["tool_calls"][0]["function"]["name"], "id": message["tool_calls"][0]["id"]}
        arguments = message["tool_calls"][0]["function"]["arguments"]
        assert message["content"] == "a moment"
        usage = json.loads(text)["usage"]
    assert call == {"name": "bash", "id": "call_t0n0"}
    assert json.loads(arguments) == {"command": "echo 0"}
    assert (usage["prompt_tokens"], usage["prompt_tokens_details"]["cached_tokens"]) == (100, 40)
    assert usage["completion_tokens"] == 7


@pytest.mark.parametrize("stream", [False, True])
def test_responses(stream: bool) -> None:
    with serve(SCRIPT) as server:
        text = ask(server, "responses", stream)[1]
    final = events(text)[-1]["response"] if stream else json.loads(text)
    result, called = final["output"]
    assert result["content"][0]["text"] == "a moment"
    assert (called["name"], json.loads(called["arguments"])) == ("bash", {"command": "echo 0"})
    assert (final["usage"]["input_tokens"], final["usage"]["input_tokens_details"]["cached_tokens"]) == (100, 40)
    if stream:
        found = events(text)
        assert [item["sequence_number"] for item in found] == list(range(len(found)))
        assert "".join(item["delta"] for item in found if item["type"] == "response.output_text.delta") == "a moment"


@pytest.mark.parametrize("stream", [False, True])
def test_messages_count_cached_input_apart(stream: bool) -> None:
    with serve(SCRIPT) as server:
        text = ask(server, "messages", stream)[1]
    if stream:
        found = events(text)
        usage = found[-2]["usage"]
        deltas = [item["delta"] for item in found if item["type"] == "content_block_delta"]
        assert "".join(item.get("text", "") for item in deltas) == "a moment"
        assert json.loads("".join(item.get("partial_json", "") for item in deltas)) == {"command": "echo 0"}
    else:
        usage = json.loads(text)["usage"]
        assert json.loads(text)["content"][1]["input"] == {"command": "echo 0"}
    assert (usage["input_tokens"], usage["cache_read_input_tokens"], usage["output_tokens"]) == (60, 40, 7)


@pytest.mark.parametrize("stream", [False, True])
def test_generate_content(stream: bool) -> None:
    with serve(SCRIPT) as server:
        text = ask(server, "gemini", stream)[1]
        assert server.requests[0]["model"] == "m"
    final = events(text)[0] if stream else json.loads(text)
    parts = final["candidates"][0]["content"]["parts"]
    assert parts[1]["functionCall"] == {"id": "call_t0n0", "name": "bash", "args": {"command": "echo 0"}}
    assert final["usageMetadata"]["promptTokenCount"] == 100


@pytest.mark.parametrize("stream", [False, True])
def test_ollama(stream: bool) -> None:
    with serve(SCRIPT) as server:
        final = json.loads(ask(server, "ollama", stream)[1])
    assert final["message"]["tool_calls"] == [{"function": {"name": "bash", "arguments": {"command": "echo 0"}}}]
    assert (final["prompt_eval_count"], final["eval_count"], final["done"]) == (100, 7, True)


@pytest.mark.parametrize("api", PATHS)
def test_the_turn_is_read_off_the_request_and_the_last_one_repeats(api: str) -> None:
    with serve(SCRIPT) as server:
        for seen in ("", "call_t0n0", "call_t0n0", "call_t7n0"):
            assert ask(server, api, seen=seen)[0] == 200
        assert [item["turn"] for item in server.replies] == [0, 1, 1, 8]
        assert [item["kind"] for item in server.replies] == ["shell", "text", "text", "text"]


def test_results_count_where_a_client_drops_the_ids() -> None:
    with serve(SCRIPT) as server:
        send(server, PATHS["ollama"], {"tools": TOOLS["ollama"], "messages": [{"role": "tool"}, {"role": "user"}]})
        parts: list[dict[str, Any]] = [{"functionResponse": {}}]
        send(server, PATHS["gemini"], {"tools": TOOLS["gemini"], "contents": [{"parts": parts}, {"parts": parts}]})
        assert [item["turn"] for item in server.replies] == [1, 2]


def test_a_request_beside_the_conversation_does_not_count() -> None:
    with serve({**SCRIPT, "index": "counter"}) as server:
        send(server, PATHS["chat"], {"model": "title"})
        ask(server, "chat")
        ask(server, "chat")
        assert [item["turn"] for item in server.requests] == [None, 0, 1]
        assert [item["kind"] for item in server.requests] == ["side", "shell", "text"]
    with serve({**SCRIPT, "side": False}) as server:
        send(server, PATHS["chat"], {"model": "title"})
        assert server.requests[0]["turn"] == 0


def test_failures_come_once_each_and_then_the_turn() -> None:
    failing = {"text": "ok", "fail_first": [{"status": 500}, {"status": 429, "headers": {"retry-after": "0"}}]}
    with serve([failing]) as server:
        assert [ask(server, "chat")[0] for _ in range(3)] == [500, 429, 200]
        assert [item["status"] for item in server.requests] == [500, 429, 200]


@pytest.mark.parametrize("api", PATHS)
def test_a_status_is_answered_in_the_words_of_the_service(api: str) -> None:
    with serve([{"status": 401}]) as server:
        status, text = ask(server, api, stream=True)
    assert status == 401
    assert "This API key is not valid." in json.dumps(json.loads(text)["error"])


@pytest.mark.parametrize("stream", [False, True])
@pytest.mark.parametrize("api", PATHS)
@pytest.mark.parametrize("place", ["head", "mid"])
def test_a_dropped_connection_is_an_error_of_the_client(api: str, place: str, stream: bool) -> None:
    with serve([{"text": "half of this", "drop": place}]) as server:
        with pytest.raises((http.client.IncompleteRead, http.client.RemoteDisconnected, ConnectionResetError)):
            ask(server, api, stream)
        assert len(server.requests) == 1


@pytest.mark.parametrize(("kind", "tool", "arguments"), [
    ("json", "bash", '{"command": "echo hi'),
    ("unknown_tool", "no_such_tool", '{"x": 1}'),
    ("missing_args", "bash", "{}"),
])  # fmt: skip
def test_malformed_calls(kind: str, tool: str, arguments: str) -> None:
    with serve([{"malformed": kind}]) as server:
        message = json.loads(ask(server, "chat")[1])["choices"][0]["message"]
        assert server.requests[0]["calls"] == [(tool, arguments)]
    assert message["tool_calls"][0]["function"] == {"name": tool, "arguments": arguments}


def test_several_calls_and_required_arguments_filled_in() -> None:
    schema = {
        "properties": {"cmd": {"type": "array"}, "why": {"type": "string"}, "risk": {"enum": ["low", "high"]}},
        "required": ["cmd", "why", "risk"],
    }
    tools = [{"type": "function", "function": {"name": "Shell", "parameters": schema}}]
    with serve([{"calls": [{"shell": "ls"}, {"tool": "read", "args": {"path": "x"}}]}]) as server:
        send(server, PATHS["chat"], {"tools": tools})
        (shell, read) = server.requests[0]["calls"]
    assert json.loads(shell[1]) == {"cmd": ["bash", "-lc", "ls"], "why": "a scripted step", "risk": "low"}
    assert read == ("read", '{"path": "x"}')


def test_the_key_and_other_requests_are_recorded() -> None:
    with serve(SCRIPT) as server:
        ask(server, "chat", Authorization="Bearer one")
        key: dict[str, Any] = {"x-api-key": "two"}
        ask(server, "messages", **key)
        send(server, PATHS["gemini"] + "?key=three", {"tools": TOOLS["gemini"]})
        assert json.loads(send(server, "/v1/models")[1])["data"][0]["id"] == "scripted"
        assert send(server, "/v1/models/scripted")[0] == 200
        assert "input_tokens" in json.loads(send(server, "/v1/messages/count_tokens", {})[1])
        assert send(server, "/elsewhere")[0] == 404
        assert [item["key"] for item in server.requests] == ["one", "two", "three", None, None, None, None]
        assert len(server.replies) == 3


def test_the_list_of_models_can_be_refused() -> None:
    with serve({**SCRIPT, "models_status": 401}) as server:
        assert send(server, "/v1/models")[0] == 401
        assert ask(server, "chat")[0] == 200


@pytest.mark.parametrize("stream", [False, True])
def test_a_stalled_reply_does_not_keep_the_server(stream: bool) -> None:
    ended = threading.Event()

    def client(server: ModelServer) -> None:
        try:
            ask(server, "chat", stream)
        except (http.client.HTTPException, OSError):
            ended.set()

    with serve([{"text": "never whole", "stall": 600}]) as server:
        waiting = threading.Thread(target=client, args=(server,))
        waiting.start()
        deadline = time.monotonic() + 10
        while not server.requests and time.monotonic() < deadline:
            time.sleep(0.01)
        began = time.monotonic()
    waiting.join(10)
    assert time.monotonic() - began < 5
    assert ended.is_set()
