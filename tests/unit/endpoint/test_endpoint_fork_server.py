"""The fork server: scripts run as forks of an interpreter that has loaded, and are bounded as other programs are."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from unit.endpoint.test_endpoint_bounded_program import BARE, DETACHED
from waiting import until

import octoform.endpoint.bounded_program as bounded_program
from octoform.base.processes import is_alive, start_of
from octoform.endpoint.bounded_program import Finished, ForkServer, base_environment, run
from octoform.endpoint.environment.model import Environment

LOOKS = """
import json, os, sys
loaded = "fastmcp" in sys.modules
print(json.dumps({
    "argv": sys.argv[1:], "read": sys.stdin.read(), "cwd": os.getcwd(), "environ": dict(os.environ),
    "parent": os.getppid(), "loaded": loaded, "leads": os.getsid(0) == os.getpid(),
    "descriptors": sorted(map(int, os.listdir("/proc/self/fd"))),
}))
print("no", file=sys.stderr)
sys.exit(3)
"""


@pytest.fixture
def server(serving: Environment) -> Iterator[ForkServer]:
    found = ForkServer.at(serving.python)
    assert found.loaded(60)
    yield found


def bare(serving: Environment) -> ForkServer:
    """One that loads nothing, since the environment has no library for pictures: tests end several of them."""
    return ForkServer.at(serving.python, "pictures")


def forked(
    server: ForkServer | None, python: Path, folder: Path, source: str, *words: str, **named: object
) -> Finished:
    script = folder / "script.py"
    script.write_text(source)
    given: dict[str, object] = {"environment": {**base_environment(), "A": "1"}, "timeout": 20.0, **named}
    return run([str(python), "-I", str(script), *words], cwd=folder, fork_server=server, **given)  # type: ignore[arg-type]


def test_a_script_finds_what_a_program_of_its_own_would(
    server: ForkServer, serving: Environment, tmp_path: Path
) -> None:
    done = forked(server, serving.python, tmp_path, LOOKS, "one", "two words", stdin="the task")
    alone = forked(None, serving.python, tmp_path, LOOKS, "one", "two words", stdin="the task")
    assert (done.status, done.stderr, done.survivors) == (alone.status, alone.stderr, alone.survivors) == (3, "no\n", 0)
    seen, expected = json.loads(done.stdout), json.loads(alone.stdout)
    for found in (seen, expected):
        found["environ"].pop("OCTOFORM_RUN")  # each run has its own
        found["environ"].pop("LC_CTYPE", None)  # set by an interpreter at its start (PEP 538)
    assert (seen.pop("loaded"), expected.pop("loaded")) == (True, False)
    program = Path(f"/proc/{seen.pop('parent')}/cmdline").read_bytes().split(b"\0")
    assert os.fsencode(bounded_program.SCRIPT) in program and expected.pop("parent") == os.getpid()
    assert seen == expected and seen["descriptors"] == [0, 1, 2, 3], "the last is that of the listing itself"


@pytest.mark.usefixtures("thousand_descriptors")
def test_a_process_with_a_thousand_files_open_runs_a_script(serving: Environment, tmp_path: Path) -> None:
    server = bare(serving)
    assert server.loaded(60)
    assert forked(server, serving.python, tmp_path, "print(7)").stdout == "7\n"


def test_what_it_loads_has_no_checks_that_are_made_for_each_call(
    server: ForkServer, serving: Environment, tmp_path: Path
) -> None:
    looks = "from key_value.aio.stores.memory.store import MemoryStore; print(MemoryStore._setup.__code__.co_filename)"
    assert forked(server, serving.python, tmp_path, looks).stdout.endswith("key_value/aio/stores/memory/store.py\n")


def test_an_exception_of_a_script_is_told_on_stderr(server: ForkServer, serving: Environment, tmp_path: Path) -> None:
    done = forked(server, serving.python, tmp_path, "print('begun'); raise LookupError('no such thing')")
    assert (done.status, done.stdout) == (1, "begun\n")
    assert done.stderr.rstrip().endswith("LookupError: no such thing") and "script.py" in done.stderr


@pytest.mark.parametrize("source", [DETACHED, BARE], ids=["its own session", "without any variable"])
def test_what_a_script_detaches_ends_with_it(
    server: ForkServer, serving: Environment, tmp_path: Path, source: str
) -> None:
    done = forked(server, serving.python, tmp_path, source)
    assert (done.status, done.stdout, done.survivors) == (0, "started\n", 1)
    bounded = forked(server, serving.python, tmp_path, DETACHED, "stay", timeout=1.5)
    assert bounded.timed_out and bounded.seconds < 10 and bounded.survivors == 1


def test_a_script_that_kills_its_server_ends_and_the_next_one_has_another(serving: Environment, tmp_path: Path) -> None:
    server = bare(serving)
    killing = "import os, signal, time; os.kill(os.getppid(), signal.SIGKILL); time.sleep(600)"
    done = forked(server, serving.python, tmp_path, killing, timeout=3.0)
    assert done.timed_out and done.seconds < 10
    quick = "import os, signal; os.kill(os.getppid(), signal.SIGKILL); print('done')"
    another = bare(serving)
    assert another is not server
    done = forked(another, serving.python, tmp_path, quick)
    assert (done.status, done.stdout) == (1, "done\n"), "how it ended is not known, so it did not end well"
    last = bare(serving)
    assert forked(last, serving.python, tmp_path, "print('well')").stdout == "well\n"
    assert forked(another, serving.python, tmp_path, "print('well')").stdout == "well\n", "as a program of its own"


def test_one_that_was_ended_is_used_no_more(serving: Environment, tmp_path: Path) -> None:
    first = bare(serving)
    assert first.loaded(60)
    first.end()
    assert not first.loaded(0)
    assert forked(first, serving.python, tmp_path, "print(1)").stdout == "1\n"
    assert bare(serving) is not first


def test_a_script_that_stops_its_server_holds_nobody_up(
    serving: Environment, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bounded_program, "FORK_SECONDS", 0.5)
    server = bare(serving)
    stopping = "import os, signal; os.kill(os.getppid(), signal.SIGSTOP); print('done')"
    done = forked(server, serving.python, tmp_path, stopping)
    assert (done.status, done.stdout) == (1, "done\n") and done.seconds < 10
    assert forked(server, serving.python, tmp_path, "print('alone')").stdout == "alone\n"
    another = bare(serving)
    assert another is not server and server._process.poll() is not None
    assert forked(another, serving.python, tmp_path, "print('well')").stdout == "well\n"


def test_an_environment_that_was_built_again_gets_another_server(tmp_path: Path) -> None:
    python = tmp_path / "environment" / "bin" / "python"

    def build() -> None:
        python.parent.mkdir(parents=True)
        python.symlink_to(sys.executable)

    build()
    first = ForkServer.at(python)
    (tmp_path / "environment" / "bytecode").mkdir()  # as the first script leaves it there
    assert ForkServer.at(python) is first
    python.parents[1].rename(tmp_path / "former")
    build()
    second = ForkServer.at(python)
    assert second is not first


def test_where_nothing_loads_a_script_runs_alone(tmp_path: Path) -> None:
    python = tmp_path / "environment" / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.symlink_to("/usr/bin/false")
    server = ForkServer.at(python)
    assert not server.loaded(20)
    done = forked(server, Path(sys.executable), tmp_path, "import os; print(os.getppid())")
    assert done.stdout == f"{os.getpid()}\n"


HOLDS = """
import sys, time
from pathlib import Path
from octoform.endpoint.bounded_program import ForkServer
server = ForkServer.at(Path(sys.argv[1]), 'pictures')
assert server.loaded(60)
print(server._process.pid, flush=True)
time.sleep(600 if "stays" in sys.argv else 0)
"""


@pytest.mark.parametrize("word", ["stays", "ends"])
def test_it_ends_with_who_began_it(serving: Environment, word: str) -> None:
    command = [sys.executable, "-c", HOLDS, str(serving.python), word]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        pid = int(process.stdout.readline())
        start = start_of(pid)
        if word == "stays":
            assert is_alive(pid, start)
            process.send_signal(signal.SIGKILL)
        process.wait(20)
    until(lambda: not is_alive(pid, start))


def test_it_ends_when_there_is_nothing_to_do(tmp_path: Path) -> None:
    program = """
import socket, sys
sys.path.insert(0, sys.argv[1])
import fork_server
fork_server.IDLE_SECONDS = 0.05
mine, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
fork_server.serve(its)
"""
    folder = Path(bounded_program.__file__).parent / "scripts"
    started = time.monotonic()
    done = run([sys.executable, "-c", program, str(folder)], cwd=tmp_path, environment={}, timeout=20)
    assert (done.status, done.stderr) == (0, "") and time.monotonic() - started < 10
