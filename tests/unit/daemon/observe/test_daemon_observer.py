"""A look at a live endpoint: what is there, what is new, and only as much work as the causes are worth."""

import json
import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from launched import Launched, launched, tool

from octoform.daemon.model import Cause, Facts
from octoform.daemon.observe import process
from octoform.daemon.observe.altered_files import Standing, damaged
from octoform.daemon.observe.clock_jumps import SystemClock
from octoform.daemon.observe.log_events import Hearing, Tail
from octoform.daemon.observe.observer import Looker, busy, open_look
from octoform.state.files import write_atomic
from octoform.state.layout import Layout
from octoform.state.store.lock import acquire

SERVER = '''
import os, time
from fastmcp import FastMCP
import runtime
mcp = FastMCP("bench")

@mcp.tool
@runtime.logged
def value() -> dict[str, int]:
    """A value."""
    return {"value": 1}

@mcp.tool
@runtime.logged
def broken() -> dict[str, int]:
    """Fails."""
    raise ValueError("no \\x1b[31mvalue")
'''
TOOLS = [tool("value"), tool("broken")]
START, PING, LOG, FILES = (frozenset((each,)) for each in (Cause.START, Cause.PING, Cause.LOG, Cause.FILES))


@pytest.fixture(scope="module")
def endpoint(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launched]:
    folder = tmp_path_factory.mktemp("looked")
    (folder / "root/sys").mkdir(parents=True)
    with launched(folder / "bench", SERVER, TOOLS) as found:
        yield found


@pytest.fixture
def look(endpoint: Launched) -> Looker:
    root = str(endpoint.layout.project.parent / "root")
    return open_look(endpoint.layout, {"PATH": os.environ["PATH"], "OCTOFORM_SYSROOT": root}, SystemClock())


def call(endpoint: Launched, name: str) -> None:
    from octoform.endpoint.client.jsonrpc import ToolCall
    from octoform.endpoint.client.terminal import call as call_tool

    call_tool(endpoint.layout, ToolCall(name))


def test_a_live_endpoint(endpoint: Launched, look: Looker) -> None:
    facts = look(START)
    assert facts.applied
    assert facts.process == endpoint.process
    assert facts.answers is True
    assert facts.reported is not None
    assert facts.reported["pid"] == endpoint.process.pid
    assert (facts.busy, facts.stopped_by, facts.latched, facts.start_failed) == (None, None, False, None)
    assert facts.disk_free is not None
    assert facts.disk_free > 0
    assert "server.log" in facts.log_bytes


def test_calls_are_told_once_with_their_text_made_harmless(endpoint: Launched, look: Looker) -> None:
    look(START)
    call(endpoint, "value")
    call(endpoint, "broken")
    facts = look(LOG)
    assert facts.worked == ("value",)
    [failure] = facts.failures
    assert (failure.tool, failure.error, failure.message) == ("broken", "ValueError", "no \\x1b[31mvalue")
    again = look(LOG)
    assert (again.worked, again.failures) == ((), ())


def test_a_call_that_worked_after_a_failure_ends_it_also_when_both_are_read_at_once(tmp_path: Path) -> None:
    layout = Layout(tmp_path, "bench")
    layout.logs.mkdir(parents=True)
    layout.call_log.touch()
    hearing = Hearing(layout, SystemClock().uptime)
    hearing()
    ends = [("value", False), ("value", False), ("value", True), ("broken", True), ("broken", False), ("value", False)]
    lines = [
        {"event": "result", "id": str(at), "tool": name, "ok": ok, "error": f"E{at}"}
        for at, (name, ok) in enumerate(ends)
    ]
    layout.call_log.write_text("".join(json.dumps(line) + "\n" for line in lines))
    heard = hearing()
    assert set(heard.worked) == {"value", "broken"}
    assert [(each.tool, each.error) for each in heard.failures] == [("broken", "E4"), ("value", "E5")]


def test_a_daemon_that_is_started_again_goes_on_where_the_last_one_was(endpoint: Launched, look: Looker) -> None:
    endpoint.layout.daemon.mkdir(exist_ok=True)
    look(START)
    call(endpoint, "broken")
    later = open_look(endpoint.layout, {}, SystemClock())
    assert [each.tool for each in later(START).failures] == ["broken"]
    assert open_look(endpoint.layout, {}, SystemClock())(START).failures == ()


def test_lines_that_were_set_aside_are_read_and_none_twice(endpoint: Launched, look: Looker) -> None:
    look(START)
    call(endpoint, "broken")
    log = endpoint.layout.call_log
    log.rename(log.with_name(f"{log.name}.1"))
    call(endpoint, "broken")
    call(endpoint, "broken")
    assert len(look(LOG).failures) == 3
    assert look(LOG).failures == ()


def test_bytes_that_are_no_text_blind_nobody(endpoint: Launched, look: Looker) -> None:
    look(START)
    with endpoint.layout.call_log.open("ab") as log:
        log.write(b'\xff\xfe{"event": "result"\n[1]\nnull\n{"event": "result", "tool": 5, "ok": "yes"}\n')
    with endpoint.layout.server_log.open("ab") as log:
        log.write(b'caf\xe9 \x07\nINFO: 127.0.0.1:1 - "POST /mcp HTTP/1.1" 200 OK\n')
    call(endpoint, "broken")
    facts = look(LOG)
    assert [each.tool for each in facts.failures] == ["5", "broken"]
    assert facts.printed[0] == "caf\ufffd \\x07"
    assert not any("POST" in line for line in facts.printed)


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir])
def test_what_is_no_file_in_a_logs_place_has_no_lines_and_ends_nobody(
    tmp_path: Path, make: Callable[[Path], None]
) -> None:
    log = tmp_path / "log"
    log.write_text("one\n")
    tail = Tail(log)
    log.unlink()
    make(log)
    assert tail.lines() == []
    log.unlink() if log.is_fifo() else log.rmdir()
    log.write_text("two\n")
    assert tail.lines() == ["two"]


def test_what_is_called_while_the_state_is_held_is_the_holders_to_judge(endpoint: Launched, look: Looker) -> None:
    look(START)
    taken = acquire(endpoint.layout, "apply")
    assert taken.lock is not None
    with taken.lock:
        call(endpoint, "broken")
        facts = look(LOG)
        assert (facts.busy, facts.failures, facts.worked) == ("apply", (), ())
        call(endpoint, "value")
        facts = look(LOG)
        assert (facts.busy, facts.worked) == ("apply", ("value",)), "that a tool works is true for all"
    assert look(FILES).busy is None
    assert look(LOG).failures == ()


def test_a_stop_that_a_person_wanted_and_an_emergency_stop(endpoint: Launched, look: Looker) -> None:
    layout = endpoint.layout
    write_atomic(layout.stop_mark, json.dumps({"format": 1, "by": "ann\x1b"}).encode(), 0o600)
    assert look(FILES).stopped_by == "ann\\x1b"
    layout.stop_mark.write_bytes(b"\xff")
    assert look(FILES).stopped_by == "a person"
    layout.stop_mark.unlink()
    assert look(FILES).stopped_by is None
    (layout.run / "estop.json").write_text("?")
    assert look(PING).latched
    (layout.run / "estop.json").unlink()
    assert not look(PING).latched


def test_files_are_read_only_when_one_of_them_moved(endpoint: Launched) -> None:
    standing = Standing(endpoint.layout)
    first = standing()
    assert standing() == first
    assert standing.hashed == 1
    launcher = endpoint.layout.endpoint / "launch"
    text = launcher.read_bytes()
    launcher.write_bytes(text + b"#")
    assert "the launcher was changed" in standing().endpoint
    launcher.write_bytes(text)
    assert standing().endpoint == first.endpoint
    assert standing.hashed == 3


def test_a_process_that_stands_still_is_told_by_the_ping(
    endpoint: Launched, look: Looker, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(process, "ASK_SECONDS", 1.0)
    assert look(START).answers is True
    pid = endpoint.process.pid
    os.kill(pid, signal.SIGSTOP)
    try:
        facts = look(PING)
        assert (facts.answers, facts.reported) == (False, None)
        assert facts.process is not None
    finally:
        os.kill(pid, signal.SIGCONT)
    assert look(PING).answers is True


def test_a_process_that_is_gone_and_another_one(endpoint: Launched, look: Looker) -> None:
    before = look(START).process
    assert before is not None
    os.kill(before.pid, signal.SIGKILL)
    while endpoint_of(look(PING)) is not None:
        time.sleep(0.001)
    facts = look(frozenset((Cause.PROCESS,)))
    assert (facts.process, facts.answers, facts.reported) == (None, None, None)
    look.start_failed = "it says why"
    assert look(PING).start_failed == "it says why"
    endpoint.start()
    facts = look(PING)
    assert endpoint_of(facts) not in (None, before.instance)
    assert (facts.answers, facts.start_failed) == (True, None)


def test_a_manifest_that_cannot_be_read_is_a_damaged_file_until_it_can(look: Looker) -> None:
    look(START)
    look.manifest = "cannot be read: line 3"
    assert look(FILES).damaged["octopus.yaml"] == "cannot be read: line 3"
    look.manifest = None
    assert "octopus.yaml" not in look(PING).damaged


def endpoint_of(facts: Facts) -> str | None:
    return facts.process.instance if facts.process else None


def test_accepted_files_that_are_not_as_they_were_are_named(tmp_path: Path) -> None:
    from octoform.state.accepted import accept, file_digest
    from octoform.state.artifact_cache import keep

    layout = Layout(tmp_path, "bench")
    files = {"server.py": b"pass\n", "runtime/a.py": b"a\n", "runtime/b.py": b"b\n"}
    assert accept(layout, "serve", files) == []
    keep(layout, "serve", files)
    wanted = file_digest(layout, "serve")
    document = {
        "format": 1,
        "octoform": "1",
        "lineage": "l",
        "serial": 1,
        "host": "bench",
        "nodes": {"serve": {"file_digest": wanted}},
    }
    layout.snapshot.write_text(json.dumps(document))
    assert dict(damaged(layout)) == {}
    folder = layout.folder("serve")
    (folder / "runtime/a.py").write_bytes(b"no\n")
    (folder / "runtime/b.py").unlink()
    changed = {"state/bench/serve/runtime/a.py": "changed", "state/bench/serve/runtime/b.py": "missing"}
    assert dict(damaged(layout)) == changed
    (folder / "notes.txt").write_text("mine\n")
    assert dict(damaged(layout)) == {**changed, "state/bench/serve/notes.txt": "foreign"}
    (folder / "notes.txt").unlink()
    (folder / "server.py").unlink()
    (folder / "server.py").symlink_to("/etc/passwd")
    assert dict(damaged(layout)) == {**changed, "state/bench/serve/server.py": "link"}
    layout.snapshot.write_text("<<<<<<< ours\n")
    assert dict(damaged(layout)) == {"state/bench/state.json": "changed"}


def test_the_lock_of_another_container_counts_only_while_the_kernel_keeps_it(tmp_path: Path) -> None:
    layout = Layout(tmp_path, "bench")
    layout.local.mkdir(parents=True)
    acquired = acquire(layout, "apply")
    assert acquired.lock is not None
    with acquired.lock:
        found = json.loads(layout.lock.read_bytes())
        hidden = json.dumps({**found, "namespace": "pid:[1]"})
        layout.lock.write_text(hidden)
        assert busy(layout) == "apply"
    layout.lock.write_text(hidden)  # its process was killed and left the file
    assert busy(layout) is None
