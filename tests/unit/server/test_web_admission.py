"""Who gets in over HTTP, and what ends when a token ends."""

import asyncio
import hashlib
import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from web_doors import ALL, INITIALIZE, INSTANCE, Door, bearer, door, until, write_tokens

from octoform.server.process.stderr_log import Throttle
from octoform.server.transport.http import LOGGER

TOKENS = {
    "all": ("value-of-all", ALL, None),
    "other": ("value-of-other", ALL, None),
    "reader": ("value-of-reader", ("read",), None),
    "past": ("value-of-past", ALL, "2026-01-02T00:00:00Z"),
}


@pytest.fixture
def opened(tmp_path: Path) -> Iterator[Door]:
    (tmp_path / "run").mkdir()
    write_tokens(tmp_path / "run", TOKENS)
    with door(tmp_path) as found:
        yield found


@pytest.mark.parametrize("mode", ["auto", "legacy"])
def test_caller_is_the_token_with_its_effects(opened: Door, mode: str) -> None:
    async def who(value: str) -> dict[str, object]:
        async with opened.client(value, mode) as client:
            return dict((await client.call_tool("who")).data)

    assert asyncio.run(who("value-of-all")) == {"name": "all", "effects": sorted(ALL), "transport": "http"}
    assert asyncio.run(who("value-of-reader")) == {"name": "reader", "effects": ["read"], "transport": "http"}


@pytest.mark.parametrize("mode", ["auto", "legacy"])
def test_callers_at_once_are_told_apart(opened: Door, mode: str) -> None:
    async def ask(value: str, name: str) -> None:
        async with opened.client(value, mode) as client:
            for _ in range(10):
                assert (await client.call_tool("who")).data["name"] == name

    async def all_of_them() -> None:
        pairs = (("value-of-all", "all"), ("value-of-reader", "reader"), ("value-of-other", "other"))
        await asyncio.gather(*(ask(*pair) for pair in pairs * 2))

    asyncio.run(all_of_them())


@pytest.mark.parametrize(
    "authorization",
    [
        None,
        "",
        "Bearer",
        "Bearer ",
        "Bearer wrong",
        "Bearer value-of-past",
        "Basic dXNlcjpwYXNz",
        "value-of-all",
        "Bearer value-of-all value-of-all",
        "Bearer " + "x" * 8000,
    ],
)
def test_no_or_another_token_is_refused(opened: Door, authorization: str | None) -> None:
    given = bearer("") | {"Authorization": authorization or ""}
    if authorization is None:
        del given["Authorization"]
    for method in ("POST", "GET", "DELETE"):
        status, headers, _ = opened.ask(method, "/mcp", body=INITIALIZE, headers=given)
        assert status == 401
        assert headers["www-authenticate"].startswith("Bearer")


@pytest.mark.parametrize("query", ["token=value-of-all", "access_token=value-of-all", "x=1&TOKEN=", "Authorization=a"])
def test_token_in_the_address_is_refused(opened: Door, query: str) -> None:
    assert opened.ask("POST", f"/mcp?{query}", body=INITIALIZE)[0] == 400
    assert opened.ask("POST", f"/mcp?{query}", body=INITIALIZE, headers=bearer("value-of-all"))[0] == 400
    assert opened.ask("POST", "/mcp?x=1", body=INITIALIZE, headers=bearer("value-of-all"))[0] == 200


def test_session_belongs_to_the_value_that_opened_it(opened: Door) -> None:
    _, headers, _ = opened.ask("POST", "/mcp", body=INITIALIZE, headers=bearer("value-of-all"))
    session = {"Mcp-Session-Id": headers["mcp-session-id"]}
    ping = json.dumps({"jsonrpc": "2.0", "id": 2, "method": "ping"})
    assert opened.ask("POST", "/mcp", body=ping, headers=bearer("value-of-all") | session)[0] == 200
    for other in ("value-of-other", "value-of-reader"):
        assert opened.ask("POST", "/mcp", body=ping, headers=bearer(other) | session)[0] == 404
        assert opened.ask("DELETE", "/mcp", headers=bearer(other) | session)[0] == 404
    write_tokens(opened.run, {**TOKENS, "all": ("new-value-of-all", ALL, None)})
    assert opened.ask("POST", "/mcp", body=ping, headers=bearer("value-of-all") | session)[0] == 401
    assert opened.ask("POST", "/mcp", body=ping, headers=bearer("new-value-of-all") | session)[0] == 404


VALUE = hashlib.sha256(b"value-of-all").hexdigest()
NO_ZONE = {"name": "all", "sha256": VALUE, "effects": ["read"], "created": "", "expires": "2036-01-01T00:00:00"}
DAMAGED = {
    "damaged": "{",
    "nested without end": "[" * 200_000,
    "an end without a time zone": json.dumps({"format": 1, "tokens": [NO_ZONE]}),
}


@pytest.mark.parametrize("mode", ["auto", "legacy"])
@pytest.mark.parametrize("change", ["revoked", "rotated", "expired", *DAMAGED])
def test_ended_token_ends_what_is_under_way(opened: Door, mode: str, change: str) -> None:
    async def call() -> bool:
        async with opened.client("value-of-all", mode) as client:
            waiting = asyncio.ensure_future(client.call_tool("wait"))
            await asyncio.to_thread(until, opened.mcp.slow.is_set)  # type: ignore[attr-defined]
            _end_token(opened.run, change)
            await asyncio.to_thread(until, opened.mcp.ended.is_set, 5.0)  # type: ignore[attr-defined]
            waiting.cancel()
            await asyncio.gather(waiting, return_exceptions=True)
        return True

    async def bounded() -> None:
        try:
            await asyncio.wait_for(call(), 20)
        except Exception:  # noqa: BLE001 - how a client takes its loss is its own affair
            assert opened.mcp.ended.is_set()  # type: ignore[attr-defined]

    asyncio.run(bounded())
    assert opened.ask("POST", "/mcp", body=INITIALIZE, headers=bearer("value-of-all"))[0] == 401
    other = opened.ask("POST", "/mcp", body=INITIALIZE, headers=bearer("value-of-other"))[0]
    assert other == (401 if change in DAMAGED else 200)
    write_tokens(opened.run, TOKENS)
    assert opened.ask("POST", "/mcp", body=INITIALIZE, headers=bearer("value-of-all"))[0] == 200, "the door goes on"


def _end_token(run: Path, change: str) -> None:
    tokens = dict(TOKENS)
    if change in DAMAGED:
        (run / "tokens.json").write_text(DAMAGED[change])
        return
    del tokens["all"]
    if change == "rotated":
        tokens["all"] = ("another-value", ALL, None)
    if change == "expired":
        tokens["all"] = ("value-of-all", ALL, "2026-01-02T00:00:00Z")
    write_tokens(run, tokens)


def test_ended_token_ends_its_open_stream_and_no_other(opened: Door) -> None:
    streams = {}
    for value in ("value-of-all", "value-of-other"):
        _, headers, _ = opened.ask("POST", "/mcp", body=INITIALIZE, headers=bearer(value))
        connection = opened.connect()
        lines = [
            "GET /mcp HTTP/1.1",
            f"Host: 127.0.0.1:{opened.port}",
            "Accept: text/event-stream",
            f"Authorization: Bearer {value}",
            f"Mcp-Session-Id: {headers['mcp-session-id']}",
        ]
        connection.sendall("\r\n".join([*lines, "", ""]).encode())
        assert connection.recv(4096).startswith(b"HTTP/1.1 200")
        streams[value] = connection
    sessions = opened.web._open.sessions  # type: ignore[union-attr]
    assert len(sessions._server_instances) == 2
    write_tokens(opened.run, {name: token for name, token in TOKENS.items() if name != "all"})
    streams["value-of-all"].settimeout(1.5)
    seen = b""
    while not seen.endswith(b"0\r\n\r\n"):
        part = streams["value-of-all"].recv(4096)
        assert part
        seen += part
    until(lambda: len(sessions._server_instances) == 1)
    streams["value-of-other"].settimeout(0.3)
    with pytest.raises(TimeoutError):
        while streams["value-of-other"].recv(4096):
            pass
    for connection in streams.values():
        connection.close()


def test_health_needs_no_token_and_tells_no_names(opened: Door) -> None:
    status, headers, body = opened.ask("GET", "/health")
    assert (status, json.loads(body)) == (200, {"status": "healthy", "tools": 1, "instance": INSTANCE})
    assert headers["cache-control"] == "no-store"
    assert "server" not in headers
    assert opened.ask("POST", "/health")[0] == 405
    assert opened.ask("GET", "/health", headers={"Host": "evil.example.com"})[0] == 421


@pytest.mark.parametrize("word", ["unknown", "degraded", "error", "down"])
def test_health_that_is_not_healthy_is_503_and_no_refusal(
    opened: Door, word: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(opened.web, "verdict", lambda: word)
    status, _, body = opened.ask("GET", "/health")
    assert (status, json.loads(body)["status"]) == (503, word)
    assert not [each for each in caplog.records if "/health" in each.getMessage()]


@pytest.mark.parametrize("path", ["/", "/private", "/sse", "/messages", "/mcp/x", "/docs", "/.well-known/openid"])
def test_nothing_else_is_there(opened: Door, path: str) -> None:
    assert opened.ask("GET", path, headers=bearer("value-of-all"))[0] == 404


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Host": "evil.example.com"}, 421),
        ({"Host": "evil.example.com:17770"}, 421),
        ({"Host": "127.0.0.1.evil.example.com"}, 421),
        ({"Host": ""}, 421),
        ({"Host": "bench.example.org"}, 200),
        ({"Host": "localhost"}, 200),
        ({"Origin": "https://evil.example.com"}, 403),
        ({"Origin": "null"}, 403),
        ({"Origin": "http://127.0.0.1.evil.example.com"}, 403),
        ({"Origin": "https://app.example.org"}, 200),
        ({"Origin": "https://app.example.org.evil.example.com"}, 403),
    ],
)
def test_foreign_host_and_origin_are_turned_away_before_the_token(
    tmp_path: Path, headers: dict[str, str], status: int
) -> None:
    (tmp_path / "run").mkdir()
    write_tokens(tmp_path / "run", TOKENS)
    network = {"hosts": ["bench.example.org"], "origins": ["https://app.example.org"]}
    with door(tmp_path, network) as opened:
        given = bearer("value-of-all") | headers
        assert opened.ask("POST", "/mcp", body=INITIALIZE, headers=given)[0] == status
        del given["Authorization"]
        refused = 401 if status == 200 else status
        assert opened.ask("POST", "/mcp", body=INITIALIZE, headers=given)[0] == refused


def test_public_address_is_answered_while_it_is_published(opened: Door) -> None:
    def ask(host: str) -> int:
        return opened.ask("GET", "/health", headers={"Host": host})[0]

    assert ask("words.example.net") == 421
    opened.web.published("https://words.example.net")
    assert (ask("words.example.net"), ask("other.example.net")) == (200, 421)
    opened.web.published("https://other.example.net")
    assert (ask("words.example.net"), ask("other.example.net")) == (421, 200)
    opened.web.published(None)
    assert ask("other.example.net") == 421


def test_refusals_are_told_without_tokens_and_are_few(
    opened: Door, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(LOGGER, "filters", [Throttle()])
    for _ in range(200):
        opened.ask("POST", "/mcp?token=value-of-all", body=INITIALIZE, headers=bearer("value-of-other-thing"))
    lines = [record.getMessage() for record in caplog.records if record.name == "octoform.web"]
    assert 0 < len(lines) <= 61
    assert not any("value-of" in record.getMessage() for record in caplog.records)
    assert any("POST '/mcp' from 127.0.0.1: 400" in line for line in lines)
