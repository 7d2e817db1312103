"""What a pipe must know of a conversation to go on with another endpoint: by rules, with endpoints played by a test."""

import json
import os
import select
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from octoform.endpoint.mcp_session import HEAD, Conversation
from octoform.endpoint.sockets import GREETING
from octoform.endpoint.stdio import pipe

INITIALIZE = {"id": 0, "method": "initialize", "params": {"protocolVersion": "2025-11-25"}}


def line(message: dict[str, Any]) -> bytes:
    """As the endpoint writes it."""
    return json.dumps({"jsonrpc": "2.0", **message}, separators=(",", ":")).encode() + b"\n"


def call(number: object, method: str = "tools/call") -> bytes:
    return line({"id": number, "method": method, "params": {"name": "move"}})


def answer(number: object, **result: Any) -> bytes:
    return line({"id": number, "result": result})


def parsed(lines: list[bytes]) -> list[dict[str, Any]]:
    return [json.loads(each) for each in lines]


def introduced() -> Conversation:
    conversation = Conversation()
    conversation.sent(line(INITIALIZE))
    conversation.heard(answer(0, protocolVersion="2025-11-25"))
    conversation.sent(line({"method": "notifications/initialized"}))
    return conversation


def test_what_was_answered_is_over_and_what_was_not_gets_an_error() -> None:
    conversation = Conversation()
    for number in (1, "1", 2, 'a"b'):
        conversation.sent(call(number))
    conversation.heard(answer("1", text="x" * 10_000)[:HEAD])
    conversation.heard(line({"method": "notifications/progress", "params": {"progressToken": 1}}))
    conversation.heard(line({"id": 2, "error": {"code": 1, "message": "no"}}))
    found = parsed(conversation.lost())
    assert [each["id"] for each in found] == [1, 'a"b']
    assert all("is unknown" in each["error"]["message"] for each in found)
    assert conversation.lost() == []
    assert conversation.found() == []


def test_what_changes_nothing_is_sent_again() -> None:
    conversation = Conversation()
    conversation.sent(call(1, "tools/list"))
    conversation.sent(call(2, "subscriptions/listen"))
    conversation.sent(call(3, "resources/subscribe"))
    assert [each["id"] for each in parsed(conversation.lost())] == [3]
    assert conversation.found() == [call(1, "tools/list"), call(2, "subscriptions/listen")]
    [renewed] = parsed(conversation.renewed())
    assert renewed["params"]["_meta"] == {"io.modelcontextprotocol/subscriptionId": 2}


def test_an_introduction_is_repeated_and_its_answer_kept_back() -> None:
    conversation = introduced()
    conversation.sent(call(1, "tools/list"))
    conversation.lost()
    [again] = parsed(conversation.found())
    assert (again["method"], again["params"]) == ("initialize", INITIALIZE["params"])
    assert again["id"] != 0
    assert conversation.shaking
    found, back = conversation.from_endpoint(answer(again["id"], protocolVersion="2025-11-25"))
    assert json.loads(found)["method"] == "notifications/tools/list_changed"
    assert parsed(back)[0]["method"] == "notifications/initialized"
    assert back[1:] == [call(1, "tools/list")]
    assert not conversation.careful


def test_an_introduction_that_was_never_answered_is_sent_as_it_was() -> None:
    conversation = Conversation()
    conversation.sent(line(INITIALIZE))
    assert conversation.lost() == []
    assert conversation.found() == [line(INITIALIZE)]
    assert not conversation.careful


@pytest.mark.parametrize("result", [{"protocolVersion": "2024-11-05"}, {}])
def test_a_client_does_not_go_on_in_another_protocol(result: dict[str, Any]) -> None:
    conversation = introduced()
    conversation.lost()
    [again] = parsed(conversation.found())
    with pytest.raises(ValueError, match="protocol"):
        conversation.from_endpoint(answer(again["id"], **result))


def test_an_answer_to_a_former_question_approves_nothing_now() -> None:
    """Both endpoints count their questions from one."""
    conversation = introduced()
    conversation.heard(line({"id": 1, "method": "elicitation/create", "params": {}}))
    [cancelled] = parsed(conversation.lost())
    assert (cancelled["method"], cancelled["params"]) == ("notifications/cancelled", {"requestId": 1})
    [again] = parsed(conversation.found())
    conversation.from_endpoint(answer(again["id"], protocolVersion="2025-11-25"))
    question = line({"id": 1, "method": "elicitation/create", "params": {}})
    found, back = conversation.from_endpoint(question)
    assert found == b""
    assert parsed(back)[0]["error"]
    assert conversation.from_client(answer(1, action="accept")) == b""
    assert conversation.from_endpoint(question) == (question, [])
    assert conversation.from_client(answer(1, action="accept")) == answer(1, action="accept")


def test_without_an_endpoint_only_requests_are_answered() -> None:
    conversation = Conversation()
    refused = conversation.refused(call(7), "it is gone")
    assert refused is not None
    assert json.loads(refused)["error"]["message"] == "it is gone"
    assert conversation.refused(line({"method": "notifications/cancelled"}), "it is gone") is None
    assert conversation.refused(b"no JSON\n", "it is gone") is None


@pytest.mark.parametrize("number", ["1.5", "null", "true", "[1]", "{}", "1e400", "NaN"])
def test_a_request_whose_id_is_none_is_refused_at_once_and_waits_for_nothing(number: str) -> None:
    conversation = introduced()
    asked = call("ID").replace(b'"ID"', number.encode())
    conversation.sent(asked)
    conversation.heard(b'{"jsonrpc": "2.0", "id": null, "error": {"code": -32600, "message": "no message"}}\n')
    conversation.heard(line({"id": None, "error": {"code": -32600, "message": "this is no JSON-RPC message"}}))
    assert conversation.lost() == []
    assert not conversation._waiting
    refused = conversation.refused(asked, "it is gone")
    assert refused is None or json.loads(refused)["id"] is None


@pytest.mark.parametrize("method", [None, 5, [], {}, ["initialize"], {"a": []}])
def test_a_request_whose_method_is_no_text_breaks_no_pipe(method: object) -> None:
    conversation = introduced()
    conversation.sent(line({"id": 1, "method": method}))
    conversation.sent(line({"id": [], "method": method}))
    conversation.heard(line({"id": 1, "error": {"code": -32600, "message": "this is no JSON-RPC message"}}))
    assert conversation.lost() == []
    conversation.refused(line({"id": 1, "method": method}), "it is gone")


IDS = st.integers() | st.text(max_size=20)


@given(st.lists(st.tuples(IDS, st.booleans()), unique_by=lambda each: repr(each[0]), max_size=1200))
def test_exactly_what_has_no_answer_gets_an_error(calls: list[tuple[object, bool]]) -> None:
    conversation = Conversation()
    for number, answered in calls:
        conversation.sent(call(number))
        if answered:
            conversation.heard(answer(number, text="x" * 600)[:HEAD])
    found = parsed(conversation.lost())
    assert [each["id"] for each in found] == [number for number, answered in calls if not answered]


class Client:
    """Somebody at the two ends of a pipe whose endpoints a test plays; ``endpoints`` come one after the other."""

    def __init__(self, endpoints: list[Callable[[socket.socket], None]]) -> None:
        self._endpoints = endpoints
        self.stdin, self.stdout = os.pipe(), os.pipe()
        self.ended: list[bool] = []
        self._thread = threading.Thread(target=self._run)
        self._players: list[threading.Thread] = []

    def _connection(self) -> socket.socket:
        mine, its = socket.socketpair()
        play = self._endpoints.pop(0)

        def run() -> None:
            with its:
                play(its)

        self._players.append(threading.Thread(target=run))
        self._players[-1].start()
        return mine

    def _again(self, waits: bool) -> "socket.socket | str | None":
        return self._connection() if self._endpoints else ""

    def _run(self) -> None:
        with self._connection() as first:
            self.ended.append(pipe(first, self.stdin[0], self.stdout[1], lambda: self._again))

    def say(self, data: bytes) -> None:
        os.write(self.stdin[1], data)

    def read(self, seconds: float = 20.0) -> bytes:
        """One line."""
        data = b""
        while not data.endswith(b"\n"):
            assert select.select([self.stdout[0]], [], [], seconds)[0], data
            data += os.read(self.stdout[0], 1)
        return data

    def __enter__(self) -> "Client":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self.stdin[1])
        self._thread.join(20)
        assert not self._thread.is_alive()
        for player in self._players:
            player.join(20)
        for number in (self.stdin[0], *self.stdout):
            os.close(number)


@contextmanager
def lines(its: socket.socket) -> Iterator[Any]:
    with its.makefile("rb") as file:
        yield file


def test_a_message_of_which_an_endpoint_got_only_a_part_is_sent_to_the_next() -> None:
    """Without its end no endpoint can have carried it out; with it, it is never sent again."""
    large = line({"id": 1, "method": "tools/call", "params": {"text": "x" * 3_000_000}})
    got: list[bytes] = []

    def first(its: socket.socket) -> None:
        its.sendall(GREETING)
        while len(b"".join(got)) < 100_000:
            got.append(its.recv(65536))

    def second(its: socket.socket) -> None:
        its.sendall(GREETING)
        with lines(its) as file:
            assert file.readline() == large
            its.sendall(answer(1))
            file.read()

    with Client([first, second]) as client:
        threading.Thread(target=client.say, args=(large,)).start()
        assert client.read() == answer(1)
    assert client.ended == [True]


def test_a_message_that_an_endpoint_did_not_end_is_ended_before_the_next() -> None:
    def first(its: socket.socket) -> None:
        with lines(its) as file:
            its.sendall(GREETING)
            file.readline()
            its.sendall(answer(1)[:20])

    def second(its: socket.socket) -> None:
        its.sendall(GREETING)
        with lines(its) as file:
            assert file.readline() == call(2)
            its.sendall(answer(2))
            file.read()

    with Client([first, second]) as client:
        client.say(call(1))
        assert client.read() == answer(1)[:20] + b"\n"
        assert json.loads(client.read())["id"] == 1
        client.say(call(2))
        assert client.read() == answer(2)


def test_nothing_is_said_to_an_endpoint_before_it_took_the_introduction() -> None:
    items: list[dict[str, Any]] = []
    begun = threading.Event()

    def first(its: socket.socket) -> None:
        with lines(its) as file:
            its.sendall(GREETING)
            file.readline()
            its.sendall(answer(0, protocolVersion="1"))

    def second(its: socket.socket) -> None:
        with lines(its) as file:
            items.append(json.loads(file.readline()))
            begun.set()
            assert not select.select([its], [], [], 0.2)[0], "something came before its answer"
            its.sendall(GREETING + answer(items[0]["id"], protocolVersion="1"))
            items.extend(json.loads(file.readline()) for _ in range(2))
            its.sendall(answer(5))
            file.read()

    with Client([first, second]) as client:
        client.say(line(INITIALIZE))
        assert client.read() == answer(0, protocolVersion="1")
        assert begun.wait(20)
        client.say(call(5))
        assert json.loads(client.read())["method"] == "notifications/tools/list_changed"
        assert client.read() == answer(5)
    assert [each["method"] for each in items] == ["initialize", "notifications/initialized", "tools/call"]


def test_where_there_will_be_none_the_pipe_ends() -> None:
    client = Client([lambda its: its.sendall(GREETING + b"{}\n")])
    with client:
        assert client.read() == b"{}\n"
        client._thread.join(20)
    assert client.ended == [False]
