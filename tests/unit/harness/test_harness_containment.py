"""The process tree of an agent, with real processes: what it prints, how it ends, and that nothing is left."""

import ast
import json
import os
import py_compile
import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest
from unit.harness.harness_agents import alive, noted, python
from waiting import until

from octoform.harness.containment import contained_run, reaper
from octoform.harness.containment.contained_run import Ended

Contained = Callable[..., Ended]


def test_exit_status_log_and_record(contained: Contained, tmp_path: Path) -> None:
    ended = contained(("sh", "-c", "echo out; echo err >&2; exit 3"))
    assert (ended.reason, ended.status, ended.survivors, ended.remaining) == ("ended", 3, 0, 0)
    log = tmp_path / "task.log"
    assert sorted(log.read_text().split()) == ["err", "out"]
    assert stat.S_IMODE(log.stat().st_mode) == 0o600
    record = json.loads((tmp_path / "process.json").read_text())
    assert record["ended"] is True
    assert record["supervisor"]["pid"] > 1


def test_the_record_stands_before_the_agent_starts(contained: Contained, tmp_path: Path) -> None:
    code = """
import json
import py_compile
record = json.load(open("process.json"))
print(record["attempt"] == os.environ["OCTOFORM_ATTEMPT"], record["ended"])
"""
    contained(python(code))
    assert (tmp_path / "task.log").read_text().split() == ["True", "False"]


def test_death_by_signal(contained: Contained) -> None:
    ended = contained(("sh", "-c", "kill -9 $$"))
    assert (ended.reason, ended.status) == ("ended", -9)


def test_the_agent_is_the_first_to_go_when_memory_runs_out(contained: Contained, tmp_path: Path) -> None:
    contained(("cat", "/proc/self/oom_score_adj"))
    assert int((tmp_path / "task.log").read_text()) >= 500


def test_missing_program(contained: Contained) -> None:
    ended = contained(("/nonexistent/agent",))
    assert (ended.reason, ended.errno) == ("not_started", 2)


def test_a_grandchild_in_its_own_session_that_ignores_sigterm_dies_with_the_limit(
    contained: Contained, tmp_path: Path
) -> None:
    code = """
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        note("grandchild")
        while True: time.sleep(60)
    os._exit(0)
note("agent")
time.sleep(600)
"""
    ended = contained(python(code), wall_seconds=2.5)
    assert ended.reason == "wall"
    assert ended.status == -15
    assert ended.survivors >= 1
    assert ended.remaining == 0
    assert not alive(noted(tmp_path / "grandchild"))
    assert not alive(noted(tmp_path / "agent"))


def test_a_daemon_left_behind_by_an_agent_that_ended_well_is_ended(contained: Contained, tmp_path: Path) -> None:
    code = """
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        for number in (0, 1, 2): os.close(number)
        note("daemon")
        time.sleep(600)
    os._exit(0)
os.wait()
wait_for("daemon")
"""
    ended = contained(python(code))
    assert (ended.reason, ended.status, ended.survivors, ended.remaining) == ("ended", 0, 1, 0)
    assert not alive(noted(tmp_path / "daemon"))


def test_processes_that_keep_forking_are_caught(contained: Contained, tmp_path: Path) -> None:
    code = """
if os.fork() == 0:
    os.setsid()
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    note("first")
    end = time.monotonic() + 60
    while time.monotonic() < end:
        if os.fork():
            os._exit(0)
        time.sleep(0.001)
wait_for("first")
"""
    ended = contained(python(code))
    assert ended.status == 0
    assert ended.survivors >= 1
    assert ended.remaining == 0


def test_an_agent_that_kills_its_supervisor_does_not_free_its_tree(contained: Contained, tmp_path: Path) -> None:
    code = """
supervisor = os.getppid()
if os.fork() == 0:
    os.setsid()
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    note("runaway")
    time.sleep(600)
wait_for("runaway")
os.kill(supervisor, signal.SIGKILL)
time.sleep(600)
"""
    ended = contained(python(code))
    assert ended.reason == "lost"
    assert ended.remaining == 0
    assert not alive(noted(tmp_path / "runaway"))


def test_an_interrupt_ends_the_tree_and_is_passed_on(contained: Contained, tmp_path: Path) -> None:
    def interrupted(text: str, seconds: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        contained(python("note('agent'); print('here', flush=True); time.sleep(600)"), progress=interrupted)
    assert not alive(noted(tmp_path / "agent"))


def test_cpu_seconds_of_the_whole_tree_are_counted(contained: Contained) -> None:
    busy = """
if os.fork() == 0:
    while time.process_time() < 0.3: pass
    os._exit(0)
os.wait()
"""
    ended = contained(python(busy))
    assert 0.3 <= ended.cpu_seconds < 3


def test_a_flood_without_a_line_end_is_cut_and_counted(contained: Contained, tmp_path: Path) -> None:
    lines: list[str] = []
    code = "for _ in range(320): os.write(1, b'x' * 65536)"
    ended = contained(python(code), progress=lambda text, seconds: lines.append(text))
    assert ended.status == 0
    assert ended.log_bytes == 16 << 20
    assert ended.log_dropped == 320 * 65536 - (16 << 20)
    log = (tmp_path / "task.log").read_bytes()
    assert len(log) < (16 << 20) + 200
    assert f"{ended.log_dropped} more were dropped".encode() in log
    assert all(len(text) <= 200 for text in lines)


def test_output_that_is_no_text(contained: Contained, tmp_path: Path) -> None:
    lines: list[str] = []
    raw = b"caf\\xe9 \\x1b[31mred\\x00\\n"
    contained(("printf", raw.decode()), progress=lambda text, seconds: lines.append(text))
    assert (tmp_path / "task.log").read_bytes() == b"caf\xe9 \x1b[31mred\x00\n"
    assert lines == ["caf\ufffd \ufffd[31mred\ufffd"]


def test_progress_of_a_burst_shows_few_lines_and_the_last(contained: Contained) -> None:
    lines: list[tuple[str, float]] = []
    ended = contained(
        python("for n in range(20000): print('step', n)"), progress=lambda text, seconds: lines.append((text, seconds))
    )
    assert lines[-1][0] == "step 19999"
    assert len(lines) <= ended.seconds * 5 + 3


def test_a_file_bomb_is_stopped(contained: Contained, tmp_path: Path) -> None:
    ended = contained(("dd", "if=/dev/zero", "of=output.json", "bs=1M", "count=2048"), file_bytes=4 << 20)
    assert ended.status != 0
    assert (tmp_path / "output.json").stat().st_size == 4 << 20
    assert contained_run.Limits(1).file_bytes == 256 << 20


def test_the_agent_gets_no_core_dumps_no_other_descriptor_and_its_own_session(
    contained: Contained, tmp_path: Path
) -> None:
    code = """
import resource
opened = len(os.listdir("/proc/self/fd")) - 1
print(resource.getrlimit(resource.RLIMIT_CORE)[1], opened, os.getsid(0) == os.getpid())
"""
    contained(python(code))
    assert (tmp_path / "task.log").read_text().split() == ["0", "3", "True"]


def test_standard_input_is_the_file_or_empty(contained: Contained, tmp_path: Path) -> None:
    (tmp_path / "prompt.md").write_text("the prompt")
    contained(("cat",), stdin=tmp_path / "prompt.md")
    assert (tmp_path / "task.log").read_text() == "the prompt"
    contained(("cat",))
    assert (tmp_path / "task.log").read_text() == ""


def test_a_log_that_is_a_link_is_refused(contained: Contained, tmp_path: Path) -> None:
    other = tmp_path / "precious"
    other.write_text("kept")
    (tmp_path / "task.log").symlink_to(other)
    with pytest.raises(OSError, match=r"task\.log"):
        contained(("true",))
    assert other.read_text() == "kept"


def test_a_thread_that_ends_meanwhile_hides_no_child(monkeypatch: pytest.MonkeyPatch) -> None:
    """A child of ours that is not known as one would be ended with what an agent has left."""
    gone, scan = SimpleNamespace(path="/proc/self/task/0"), os.scandir
    monkeypatch.setattr(os, "scandir", lambda path: [gone, *scan(path), gone])
    with subprocess.Popen(["sleep", "60"]) as ours:
        found = reaper.children()
        ours.kill()
    assert ours.pid in found


def test_no_descriptor_of_ours_is_left_open(contained: Contained) -> None:
    contained(("true",))
    before = len(list(Path("/proc/self/fd").iterdir()))
    contained(("true",))
    contained(("/nonexistent/agent",))
    until(lambda: len(list(Path("/proc/self/fd").iterdir())) == before)


def test_the_supervisor_imports_only_small_modules_of_the_standard_library() -> None:
    tree = ast.parse(contained_run.REAPER.read_text())
    imported = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    assert not [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    assert imported == {"ctypes", "os", "resource", "select", "signal", "_signal", "sys", "time"}


def test_the_supervisor_is_not_compiled_at_each_start() -> None:
    cached = py_compile.compile(str(contained_run.REAPER), doraise=True)
    command = [sys.executable, "-v", *contained_run.SUPERVISOR]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert f"# code object from '{cached}'" in ended.stderr
    assert "IndexError" in ended.stderr  # it has no arguments
    assert "import 'signal'" not in ended.stderr and "import 'enum'" not in ended.stderr
