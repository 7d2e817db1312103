"""The small client by itself: what it sends, and what it makes of whatever comes back."""

import contextlib
import json
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

import octoform
from octoform.endpoint.client import jsonrpc
from octoform.endpoint.client.jsonrpc import Wire, WireError

Heard = list[dict[str, Any]]
OK = {"jsonrpc": "2.0", "id": 1, "result": {"resultType": "complete", "n": 1}}


@contextmanager
def answered(*pieces: bytes, ends: bool = True) -> Iterator[tuple[Wire, Callable[[], Heard]]]:
    """A client whose first request is answered with these pieces; what the other side heard, once it is closed."""
    ours, theirs = socket.socketpair()
    heard: Heard = []

    def serve() -> None:
        with theirs, theirs.makefile("rb") as lines:
            heard.append(json.loads(lines.readline()))
            with contextlib.suppress(BrokenPipeError):
                for piece in pieces:
                    theirs.sendall(piece)
            if ends:
                theirs.shutdown(socket.SHUT_WR)
            heard.extend(json.loads(line) for line in lines)

    thread = threading.Thread(target=serve)
    thread.start()
    client = Wire(ours)

    def closed() -> Heard:
        client.close()
        thread.join(10)
        assert not thread.is_alive()
        return heard

    try:
        yield client, closed
    finally:
        closed()


def lines(*messages: object) -> bytes:
    return b"".join(json.dumps(message).encode() + b"\n" for message in messages)


def test_each_request_says_all_that_the_stateless_protocol_asks_for() -> None:
    with answered(lines(OK)) as (client, heard):
        result = client.ask("tools/call", {"name": "x"}, 5, meta={"octoform/dry_run": True})
        assert result == OK["result"]
        assert heard() == [
            {
                "jsonrpc": "2.0",
                "id": 1,
                "method": "tools/call",
                "params": {
                    "name": "x",
                    "_meta": {
                        "io.modelcontextprotocol/protocolVersion": "2026-07-28",
                        "io.modelcontextprotocol/clientInfo": {"name": "octoform", "version": octoform.__version__},
                        "io.modelcontextprotocol/clientCapabilities": {"elicitation": {"form": {}}},
                        "octoform/dry_run": True,
                    },
                },
            }
        ]


def test_an_answer_in_pieces_among_other_messages_is_found_and_progress_is_told() -> None:
    def progress(token: object, **told: object) -> dict[str, object]:
        return {"jsonrpc": "2.0", "method": "notifications/progress", "params": {"progressToken": token, **told}}

    others = (
        progress(1, progress=1, total=4, message="one"),
        progress(7, progress=9),
        progress(1, progress="many"),
        {"jsonrpc": "2.0", "method": "notifications/message", "params": [1]},
        {"jsonrpc": "2.0", "id": 1, "method": "ping"},
        {"jsonrpc": "2.0", "id": 9, "result": {}},
        [1, 2],
        progress(1, progress=2.5),
    )
    text = lines(*others, OK)
    seen: list[tuple[float, float | None, str]] = []
    with answered(*(text[at : at + 7] for at in range(0, len(text), 7))) as (client, heard):
        result = client.ask("x", {}, 5, progress=lambda *told: seen.append(told))
        assert result == OK["result"]
        assert heard()[0]["params"]["_meta"]["progressToken"] == 1
    assert seen == [(1, 4, "one"), (2.5, None, "")]


@pytest.mark.parametrize(
    ("pieces", "kind", "words"),
    [
        ((), "closed", "ended before the answer"),
        ((b'{"jsonrpc"',), "closed", "ended before the answer"),
        ((b"hello\n",), "closed", "no message"),
        ((lines({"id": 1, "result": 3}),), "closed", "no result"),
        ((lines({"id": 1, "error": {"code": -32602, "message": "expired"}}),), "refused", "expired"),
        ((lines({"id": 1, "error": "odd"}),), "refused", "odd"),
        ((lines({"id": None, "error": {"code": -32000, "message": "full"}}),), "refused", "full"),
        ((lines({"id": None, "result": {}}),), "closed", "ended before the answer"),
    ],
)
def test_what_is_no_result_is_told_apart(pieces: tuple[bytes, ...], kind: str, words: str) -> None:
    with answered(*pieces) as (client, heard), pytest.raises(WireError, match=words) as caught:
        client.ask("x", {}, 5)
    assert caught.value.kind == kind
    assert len(heard()) == 1, "there is nothing to cancel"


def test_a_greeting_that_came_late_is_passed_over() -> None:
    with answered(b"\n" + lines(OK)) as (client, _):
        assert client.ask("x", {}, 5) == OK["result"]


def test_a_request_without_an_answer_is_cancelled() -> None:
    with answered(ends=False) as (client, heard):
        with pytest.raises(WireError) as caught:
            client.ask("x", {}, 0.05)
        assert caught.value.kind == "timeout"
        assert heard()[1] == {
            "jsonrpc": "2.0",
            "method": "notifications/cancelled",
            "params": {"requestId": 1, "reason": "it took too long"},
        }


def test_an_interrupted_request_is_cancelled() -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    fields = {"method": "notifications/progress", "params": {"progressToken": 1, "progress": 1}}
    with answered(lines(fields), ends=False) as (client, heard):
        with pytest.raises(KeyboardInterrupt):
            client.ask("x", {}, 5, progress=interrupt)
        assert heard()[1]["params"] == {"requestId": 1, "reason": "it was interrupted"}


def test_a_message_without_end_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jsonrpc, "MAX_BYTES", 100_000)
    with answered(b"x" * 300_000, ends=False) as (client, _), pytest.raises(WireError, match="more than 100000 bytes"):
        client.ask("x", {}, 5)
