"""Strangers and broken clients at the HTTP door: no one gets in, nothing hangs for the others."""

import asyncio
import contextlib
import json
import resource
import socket
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import anyio
import pytest
from starlette.applications import Starlette
from web_doors import ALL, INITIALIZE, Door, bearer, door, server, until, write_tokens

from octoform.server.notifications import Changes
from octoform.server.transport.authentication import LEAST_OPEN, MAX_OPEN, Open, Tokens
from octoform.server.transport.http import LOGGER, MAX_CONNECTIONS, Connection

MEGABYTE = 1 << 20


@pytest.fixture
def opened(tmp_path: Path) -> Iterator[Door]:
    (tmp_path / "run").mkdir()
    write_tokens(tmp_path / "run", {"all": ("secret", ALL, None)})
    with door(tmp_path) as found:
        yield found


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Door]:
    folder = tmp_path_factory.mktemp("door")
    (folder / "run").mkdir()
    write_tokens(folder / "run", {"all": ("secret", ALL, None)})
    with door(folder) as found:
        yield found


def serves(opened: Door) -> float:
    """A real client's call; the seconds that it took."""

    async def call() -> None:
        async with opened.client("secret") as client:
            assert (await client.call_tool("who")).data["name"] == "all"

    began = time.monotonic()
    asyncio.run(call())
    return time.monotonic() - began


def head(opened: Door, *lines: str, token: str | None = "secret") -> bytes:
    given = ["POST /mcp HTTP/1.1", f"Host: 127.0.0.1:{opened.port}", "Content-Type: application/json"]
    given.append("Accept: application/json, text/event-stream")
    given += [f"Authorization: Bearer {token}"] if token else []
    return "\r\n".join([*given, *lines, "", ""]).encode()


def pour(connection: socket.socket, megabytes: int, chunked: bool) -> None:
    """Send a body of so many MB, unless the other side has enough before."""
    block = b"x" * MEGABYTE
    framed = b"%x\r\n%s\r\n" % (len(block), block) if chunked else block
    connection.settimeout(10)
    with contextlib.suppress(ConnectionError, TimeoutError):
        for _ in range(megabytes):
            connection.sendall(framed)


@pytest.mark.parametrize("token", ["secret", None])
@pytest.mark.parametrize("chunked", [False, True])
def test_body_of_100_mb_is_refused_and_not_kept(opened: Door, token: str | None, chunked: bool) -> None:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    length = "Transfer-Encoding: chunked" if chunked else f"Content-Length: {100 * MEGABYTE}"
    with opened.connect() as connection:
        connection.sendall(head(opened, length, token=token))
        if not chunked or token is None:
            # The answer does not wait for the body.
            connection.settimeout(10)
            assert connection.recv(4096).startswith(b"HTTP/1.1 413" if token else b"HTTP/1.1 401")
            pour(connection, 100, chunked)
        else:
            pour(connection, 100, chunked)
            assert connection.recv(4096).startswith(b"HTTP/1.1 413")
    assert serves(opened) < 10
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 40_000
    until(lambda: len(opened.web._uvicorn.server_state.connections) <= 1)


def test_sender_who_goes_on_after_the_answer_is_cut_off(opened: Door, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Connection, "seconds", {**Connection.seconds, "linger": 0.2})
    with opened.connect() as connection:
        connection.sendall(head(opened, "Transfer-Encoding: chunked", token=None))
        assert connection.recv(4096).startswith(b"HTTP/1.1 401")
        began = time.monotonic()
        with pytest.raises(ConnectionError):
            while time.monotonic() - began < 20:
                connection.sendall(b"1\r\nx\r\n")
                time.sleep(0.01)


def test_half_open_connections_keep_nobody_out(opened: Door, monkeypatch: pytest.MonkeyPatch) -> None:
    with contextlib.ExitStack() as stack:
        silent = [stack.enter_context(opened.connect()) for _ in range(200)]
        for connection in silent[::2]:
            connection.sendall(b"POST /mcp HTTP/1.1\r\nHost: 127")
        assert max(serves(opened) for _ in range(3)) < 10


def test_more_connections_than_there_is_room_for(opened: Door) -> None:
    with contextlib.ExitStack() as stack:
        silent = [stack.enter_context(opened.connect()) for _ in range(MAX_CONNECTIONS + 60)]
        assert serves(opened) < 10
        # The oldest of those that only wait made room; what was taken is bounded.
        until(lambda: len(opened.web._uvicorn.server_state.connections) <= MAX_CONNECTIONS, seconds=5)
        silent[0].settimeout(5)
        with contextlib.suppress(ConnectionError):
            assert silent[0].recv(1) == b""


def test_one_token_cannot_take_the_room_of_the_others(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    write_tokens(tmp_path / "run", {"all": ("secret", ALL, None), "guest": ("other", ("read",), None)})
    meta = {
        "io.modelcontextprotocol/protocolVersion": "2026-07-28",
        "io.modelcontextprotocol/clientInfo": {"name": "test", "version": "1"},
        "io.modelcontextprotocol/clientCapabilities": {},
    }
    params = {"notifications": {"toolsListChanged": True}, "_meta": meta}
    body = json.dumps({"jsonrpc": "2.0", "id": 1, "method": "subscriptions/listen", "params": params}).encode()
    era = ["MCP-Protocol-Version: 2026-07-28", "Mcp-Method: subscriptions/listen", f"Content-Length: {len(body)}"]
    mcp = server()
    Changes(mcp)
    with door(tmp_path, mcp=mcp) as opened, contextlib.ExitStack() as stack:

        def stream() -> bytes:
            connection = stack.enter_context(opened.connect())
            connection.sendall(head(opened, *era, token="other") + body)
            return connection.recv(4096)

        answers = [stream() for _ in range(MAX_OPEN)]
        taken = sum(answer.startswith(b"HTTP/1.1 200") for answer in answers)
        assert taken == MAX_OPEN // 2, answers[0]
        assert all(answer.startswith(b"HTTP/1.1 429") for answer in answers[taken:])
        assert serves(opened) < 10
        assert opened.ask("GET", "/health")[0] == 200


@pytest.mark.anyio
async def test_however_many_tokens_take_what_they_can_one_more_finds_room() -> None:
    opened = Open(Starlette(), Tokens(Path("nowhere")))
    for number in range(12):
        mine = opened._requests.setdefault(str(number), set())
        while opened._has_room(str(number)):
            mine.add(anyio.CancelScope())
        assert len(mine) >= LEAST_OPEN
    assert opened._has_room("one more")
    assert sum(map(len, opened._requests.values())) < MAX_CONNECTIONS


def test_request_under_way_is_never_the_one_that_makes_room(opened: Door) -> None:
    _, headers, _ = opened.ask("POST", "/mcp", body=INITIALIZE, headers=bearer("secret"))
    lines = [f"Host: 127.0.0.1:{opened.port}", "Accept: text/event-stream", "Authorization: Bearer secret"]
    lines.append(f"Mcp-Session-Id: {headers['mcp-session-id']}")
    with contextlib.ExitStack() as stack:
        stream = stack.enter_context(opened.connect())
        stream.sendall("\r\n".join(["GET /mcp HTTP/1.1", *lines, "", ""]).encode())
        assert stream.recv(4096).startswith(b"HTTP/1.1 200")
        silent = [stack.enter_context(opened.connect()) for _ in range(MAX_CONNECTIONS + 20)]
        silent[0].settimeout(5)
        with contextlib.suppress(ConnectionError):
            assert silent[0].recv(1) == b""
        stream.settimeout(0.3)
        with pytest.raises(TimeoutError):
            while stream.recv(4096):
                pass


@pytest.mark.parametrize(
    ("sent", "phase"),
    [
        (b"", "head"),
        (b"POST /mcp HTTP/1.1\r\nHost: 127.0.0.1\r\n", "head"),
        (
            b"POST /mcp HTTP/1.1\r\nHost: 127.0.0.1\r\nAuthorization: Bearer secret\r\nContent-Length: 9\r\n\r\n{",
            "body",
        ),
    ],
)
def test_what_does_not_come_in_time_is_not_waited_for(
    opened: Door, monkeypatch: pytest.MonkeyPatch, sent: bytes, phase: str
) -> None:
    monkeypatch.setattr(Connection, "seconds", {**Connection.seconds, phase: 0.3})
    with opened.connect() as connection:
        connection.sendall(sent)
        connection.settimeout(10)
        with contextlib.suppress(ConnectionError):
            while connection.recv(4096):
                pass
    assert serves(opened) < 10


@pytest.mark.parametrize("version", [None, "2025-11-25", "2026-07-28"])
@pytest.mark.parametrize("framing", ["Content-Length: 90", "Transfer-Encoding: chunked"])
def test_a_client_that_hangs_up_within_a_body_is_one_line_in_the_log(
    opened: Door,
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
    version: str | None,
    framing: str,
) -> None:
    monkeypatch.setattr(LOGGER, "filters", [])
    with opened.connect() as connection:
        lines = [framing, *([f"MCP-Protocol-Version: {version}"] if version else [])]
        connection.sendall(head(opened, *lines) + b'5\r\n{"id"\r\n')
    until(lambda: any("hung up" in record.getMessage() for record in caplog.records), seconds=5)
    assert serves(opened) < 10
    wrong = [record for record in caplog.records if record.exc_info or record.levelname == "ERROR"]
    assert not wrong, wrong
    (line,) = (record.getMessage() for record in caplog.records if "hung up" in record.getMessage())
    assert line == "POST '/mcp' from 127.0.0.1: the client hung up before its body was whole"


def test_a_body_that_does_not_come_is_one_line_in_the_log(
    opened: Door, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Connection, "seconds", {**Connection.seconds, "body": 0.3})
    monkeypatch.setattr(LOGGER, "filters", [])
    with opened.connect() as connection:
        connection.sendall(head(opened, "Content-Length: 90") + b"{")
        connection.settimeout(10)
        with contextlib.suppress(ConnectionError):
            while connection.recv(4096):
                pass
    assert serves(opened) < 10
    lines = [record.getMessage() for record in caplog.records if record.levelname == "WARNING"]
    assert lines == ["POST '/mcp' from 127.0.0.1: the connection was closed: its body did not come in time"]


def test_headers_that_drip_do_not_move_the_deadline(opened: Door, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Connection, "seconds", {**Connection.seconds, "head": 0.5})
    with opened.connect() as connection:
        began = time.monotonic()
        with pytest.raises(ConnectionError):
            while time.monotonic() - began < 20:
                connection.sendall(b"X")
                time.sleep(0.02)
        assert time.monotonic() - began < 10


def test_deadline_holds_for_the_second_request_too(opened: Door, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Connection, "seconds", {**Connection.seconds, "head": 0.5})
    with opened.connect() as connection:
        connection.sendall(b"GET /health HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        assert connection.recv(4096).startswith(b"HTTP/1.1 200")
        connection.sendall(b"GET /hea")
        connection.settimeout(10)
        with contextlib.suppress(ConnectionError):
            while connection.recv(4096):
                pass


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"{",
        b"\xff\xfe",
        b"null",
        b"[]",
        b'"text"',
        b"123",
        b'{"jsonrpc": "1.0", "id": 1, "method": "ping"}',
        b'{"jsonrpc": "2.0"}',
        b'{"jsonrpc": "2.0", "id": {}, "method": "ping"}',
        b'{"jsonrpc": "2.0", "id": 1, "method": 5}',
        b'{"jsonrpc": "2.0", "id": 1, "method": "initialize", "params": []}',
        b'{"jsonrpc": "2.0", "id": 1, "method": "tools/call", "params": {"name": "who"}}',
        b"[" * 100_000,
        b'{"a":' * 50_000,
        b"9" * 100_000,
    ],
)
@pytest.mark.parametrize("version", [None, "2025-11-25", "2026-07-28", "nonsense"])
def test_what_is_no_message_is_refused(shared: Door, body: bytes, version: str | None) -> None:
    headers = bearer("secret") | ({"MCP-Protocol-Version": version} if version else {})
    status, _, answer = shared.ask("POST", "/mcp", body=body, headers=headers)
    assert 400 <= status < 500, answer
    assert b"Traceback" not in answer


@pytest.mark.parametrize(
    "sent",
    [
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
        b"HELLO\r\n\r\n",
        b"GET / HTTP/9.9\r\n\r\n",
        b"GET /health HTTP/1.1\r\n\r\n",
        b"GET /health HTTP/1.1\r\nHost: 127.0.0.1\r\nHost: evil.example.com\r\n\r\n",
        b"POST /mcp HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 1\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n",
        b"POST /mcp HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: -1\r\n\r\n",
        b"GET /health HTTP/1.1\r\nHost: 127.0.0.1\r\nX: " + b"y" * 400_000 + b"\r\n\r\n",
        b"GET /" + b"a" * 100_000,
    ],
)
def test_what_is_no_request_is_refused(shared: Door, sent: bytes) -> None:
    with shared.connect() as connection:
        with contextlib.suppress(ConnectionError):
            connection.sendall(sent)
        connection.settimeout(15)
        answer = b""
        with contextlib.suppress(ConnectionError):
            answer = connection.recv(4096)
        assert answer[9:12] in (b"400", b"401", b"421", b""), answer
    assert shared.ask("GET", "/health")[0] == 200


@pytest.mark.parametrize(
    ("lines", "status"),
    [
        (("Host: 127.0.0.1:{port}@evil.example",), 421),
        (("Host: 127.0.0.1:{port}.evil.example",), 421),
        (("Host: localhost:x",), 421),
        (("Host: localhost:1", "Origin: http://127.0.0.1:{port}.evil.example"), 403),
        (("Host: localhost:1", "Origin: http://127.0.0.1:{port}, http://evil.example"), 403),
        (("Host: localhost:1", "Origin: http://127.0.0.1:{port}@evil.example"), 403),
        (("Host: localhost:1", "Origin: http://localhost:1", "Origin: http://evil.example"), 403),
        (("Host: localhost:1", "Origin: file://"), 403),
        (("Host: localhost:1", "Origin: http://localhost:1"), 200),
        (("Host: localhost",), 200),
        (("Host: [::1]:{port}",), 200),
        (("Host: 127.0.0.1:{port}",), 200),
    ],
)
def test_a_name_with_a_rest_that_the_guard_would_not_read_is_none_of_ours(
    shared: Door, lines: tuple[str, ...], status: int
) -> None:
    given = [line.format(port=shared.port) for line in lines]
    with shared.connect() as connection:
        connection.sendall("\r\n".join(["GET /health HTTP/1.1", *given, "Connection: close", "", ""]).encode())
        connection.settimeout(15)
        answer = b"".join(iter(partial(connection.recv, 4096), b""))
    answered = int(answer[9:12])
    assert (200 if answered == 503 else answered) == status
    assert (b"the Origin header is not one origin" in answer) == (status == 403)


@pytest.mark.parametrize("identity", ["1.5", "null", "true", "[1]", "{}", "1e400", "NaN"])
def test_a_request_of_a_session_whose_id_is_none_is_refused_and_not_taken_for_a_notification(
    shared: Door, identity: str
) -> None:
    status, headers, _ = shared.ask("POST", "/mcp", body=INITIALIZE, headers=bearer("secret"))
    assert status == 200
    session = bearer("secret") | {"Mcp-Session-Id": headers["mcp-session-id"]}
    asked = json.dumps({"jsonrpc": "2.0", "id": "ID", "method": "tools/call", "params": {"name": "who"}})
    body = asked.replace('"ID"', identity)
    status, _, answer = shared.ask("POST", "/mcp", body=body, headers=session)
    assert (status, json.loads(answer)["error"]["code"]) == (400, -32600)
    told = '{"jsonrpc": "2.0", "method": "notifications/cancelled", "params": {"requestId": 9}}'
    assert shared.ask("POST", "/mcp", body=told, headers=session)[0] == 202


def test_a_request_with_a_length_and_chunks_is_refused_and_nothing_behind_it_is_read(shared: Door) -> None:
    ping = b'{"jsonrpc":"2.0","id":1,"method":"ping"}'
    first = head(shared, "Content-Length: 4", "Transfer-Encoding: chunked") + b"0\r\n\r\n"
    hidden = head(shared, f"Content-Length: {len(ping)}") + ping
    with shared.connect() as connection:
        connection.sendall(first + hidden)
        connection.settimeout(15)
        answer = b""
        while data := connection.recv(65536):
            answer += data
    assert answer.startswith(b"HTTP/1.1 400 ") and answer.count(b"HTTP/1.1 ") == 1


def test_client_that_ends_no_session_costs_nobody_else_his(opened: Door) -> None:
    write_tokens(opened.run, {"all": ("secret", ALL, None), "other": ("other", ALL, None)})
    sessions = opened.web._open.sessions  # type: ignore[union-attr]
    sessions.max_sessions = 4
    ping = json.dumps({"jsonrpc": "2.0", "id": 2, "method": "ping"})

    def begin(value: str) -> dict[str, str]:
        status, headers, _ = opened.ask("POST", "/mcp", body=INITIALIZE, headers=bearer(value))
        assert status == 200
        return bearer(value) | {"Mcp-Session-Id": headers["mcp-session-id"]}

    other = begin("other")
    mine = [begin("secret") for _ in range(10)]
    assert len(sessions._server_instances) == 4
    assert opened.ask("POST", "/mcp", body=ping, headers=other)[0] == 200
    assert opened.ask("POST", "/mcp", body=ping, headers=mine[0])[0] == 404
    assert opened.ask("POST", "/mcp", body=ping, headers=mine[-1])[0] == 200


def test_sessions_in_use_are_bounded(opened: Door) -> None:
    sessions = opened.web._open.sessions  # type: ignore[union-attr]
    sessions.max_sessions = 2
    with contextlib.ExitStack() as stack:
        for _ in range(2):
            _, headers, _ = opened.ask("POST", "/mcp", body=INITIALIZE, headers=bearer("secret"))
            lines = [f"Host: 127.0.0.1:{opened.port}", "Accept: text/event-stream", "Authorization: Bearer secret"]
            lines.append(f"Mcp-Session-Id: {headers['mcp-session-id']}")
            stream = stack.enter_context(opened.connect())
            stream.sendall("\r\n".join(["GET /mcp HTTP/1.1", *lines, "", ""]).encode())
            assert stream.recv(4096).startswith(b"HTTP/1.1 200")
        assert opened.ask("POST", "/mcp", body=INITIALIZE, headers=bearer("secret"))[0] == 503


def test_pipelined_requests_are_each_checked(opened: Door) -> None:
    body = json.dumps({"jsonrpc": "2.0", "id": 1, "method": "ping"}).encode()
    good = head(opened, f"Content-Length: {len(body)}") + body
    bad = head(opened, f"Content-Length: {len(body)}", "Connection: close", token="wrong") + body
    with opened.connect() as connection:
        connection.sendall(good + bad)
        answer = b""
        connection.settimeout(10)
        while part := connection.recv(65536):
            answer += part
    statuses = [part[:3] for part in answer.split(b"HTTP/1.1 ")[1:]]
    assert statuses == [b"400", b"401"]
