"""Agents that end or stop their supervisor and hide a process, as root and as an ordinary user.

And tools that start a process without any variable: none outlives the check, a stop, a start or the project.
"""

import json
import os
import runpy
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import pytest
from bench_host import bench_host
from harness_confined import Host
from ordinary import OPEN_PYTHON, POSSIBLE, ordinary_user
from projects import AGENT, Project
from waiting import until

USERS = [0, 1000] if os.getuid() == 0 else [os.getuid()]
CONFINED: Mapping[str, bool] = {"network": True}
SECONDS = 6.0

HIDE = r"""
import os, signal, sys, time
HIDDEN = '''
import os, signal, sys, time
signal.signal(signal.SIGTERM, signal.SIG_IGN)
spoilt = open(sys.argv[1], "a", buffering=1)
spoilt.write(f"{os.getpid()}\\n")
while True:
    time.sleep(0.05)
    spoilt.write("planted\\n")
'''

def hide(path):
    # A process without a parent, a terminal or a variable of ours.
    if os.fork() == 0:
        os.setsid()
        if os.fork() == 0:
            os.execve(sys.executable, [sys.executable, "-I", "-S", "-c", HIDDEN, path], {})
        os._exit(0)
    os.wait()
    while not (os.path.exists(path) and os.path.getsize(path)):
        time.sleep(0.01)

def above():
    # Every process between this one and the first, the nearest first.
    found, pid = [], os.getppid()
    while pid > 1:
        found.append(pid)
        pid = int(open(f"/proc/{pid}/stat").read().rpartition(")")[2].split()[1])
    return found

hide("server.py")
"""

ATTACKS = {
    "killed": "os.kill(os.getppid(), signal.SIGKILL); time.sleep(60)",
    "killed and its own group too": "os.kill(os.getppid(), signal.SIGKILL); os.killpg(0, signal.SIGKILL)",
    "stopped": "os.kill(os.getppid(), signal.SIGSTOP); time.sleep(60)",
    "stopped by tracing it": "import ctypes; ctypes.CDLL(None).ptrace(16, os.getppid(), 0, 0); time.sleep(60)",
    "stopped by a hidden one": """
if os.fork() == 0:
    os.setsid()
    time.sleep(0.3)
    os.kill(SUPERVISOR, signal.SIGSTOP)
    time.sleep(60)
time.sleep(60)
""",
}


DISGUISES = {
    "another mark": "import resource; resource.setrlimit(10, (7, 7))",
    "no look into it": "import ctypes; ctypes.CDLL(None).prctl(4, 0, 0, 0, 0)",
    "another name": "import ctypes; ctypes.CDLL(None).prctl(15, b'kworker/0:1', 0, 0, 0); os.closerange(0, 3)",
    "another process all the time": "while os.fork(): os._exit(0)",
    "many": "for _ in range(4): os.fork()",
    "another user": "os.getuid() == 0 and os.setuid(65534)",
}
"""What a hidden process does beside having no variable: so that nothing of it shows whose it is."""
DISGUISED = r"""
import os, signal, sys, time
for number in (signal.SIGTERM, signal.SIGHUP): signal.signal(number, signal.SIG_IGN)
spoilt = os.open("hidden", os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)
if os.fork(): os._exit(0)
os.setsid()
if os.fork(): os._exit(0)
DISGUISE
while True:
    os.write(spoilt, f"{os.getpid()}\n".encode())
    time.sleep(0.02)
    FORTH
"""


@pytest.fixture(params=USERS, ids=lambda uid: f"uid{uid}")
def host(request: pytest.FixtureRequest) -> Iterator[Host]:
    assert shutil.which("bwrap"), "bubblewrap is missing; `make setup` installs it"
    root = Path(tempfile.mkdtemp(prefix="octoform-supervision-"))
    try:
        yield Host(root, request.param)
    finally:
        shutil.rmtree(root)


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except (FileNotFoundError, ProcessLookupError):
        return False


def planted(host: Host) -> Path:
    return host.workdir / "server.py"


def stands(path: Path) -> bool:
    """Whether it has no writer any more: looked at for as long as five of its writer's turns."""
    before = path.stat().st_size
    end = time.monotonic() + 0.25
    while time.monotonic() < end:
        if path.stat().st_size != before:
            return False
        time.sleep(0.02)
    return True


@pytest.mark.parametrize("attack", ATTACKS)
def test_without_a_sandbox_the_attempt_ends_with_its_supervisor_and_says_so(host: Host, attack: str) -> None:
    code = HIDE + "SUPERVISOR = os.getppid()\n" + ATTACKS[attack]
    began = time.monotonic()
    done = host.run(["/usr/bin/python3", "-I", "-S", "-c", code], None, seconds=30)
    assert time.monotonic() - began < 20, "the attempt outlived its supervisor"
    hidden = int(planted(host).read_text().splitlines()[0])
    assert not is_alive(hidden)
    assert stands(planted(host))
    detail = done["outcome"]["detail"]
    word = "stopped by a signal" if "stopped" in attack else "killed"
    assert f"its supervisor was {word}, so it was ended" in detail
    assert "without a sandbox it can hide a process from octoform, which may run on" in detail


def disguised(disguise: str, ending: str) -> list[str]:
    """An agent that leaves such a process behind, waits until it is there, and ends that way."""
    act, forth = (DISGUISES[disguise], "pass")[:: -1 if "all the time" in disguise else 1]
    hidden = DISGUISED.replace("DISGUISE", act).replace("FORTH", forth)
    code = f"import os, signal, sys, time\nhidden = {hidden!r}\n"
    code += "if os.fork() == 0: os.execve(sys.executable, [sys.executable, '-I', '-S', '-c', hidden], {})\n"
    code += "while not (os.path.exists('hidden') and os.path.getsize('hidden') > 60): time.sleep(0.01)\n"
    return ["/usr/bin/python3", "-I", "-S", "-c", code + ending]


def nothing_hidden(host: Host) -> None:
    left = [pid for pid in {int(line) for line in (host.workdir / "hidden").read_text().split()} if is_alive(pid)]
    for pid in left:
        os.kill(pid, 9)
    assert left == []
    assert stands(host.workdir / "hidden")


@pytest.mark.parametrize("disguise", DISGUISES)
def test_what_shows_nothing_of_its_attempt_ends_with_its_supervisor_too(host: Host, disguise: str) -> None:
    """Without a sandbox; octoform becomes the parent of what an agent's supervisor leaves behind."""
    ending = "os.kill(os.getppid(), signal.SIGKILL); time.sleep(60)"
    done = host.run(disguised(disguise, ending), None, seconds=30)
    assert "its supervisor was killed, so it was ended" in done["outcome"]["detail"], done
    nothing_hidden(host)


@pytest.mark.parametrize("disguise", ["another process all the time", "many", "another user"])
def test_what_an_agent_leaves_behind_cannot_outrun_its_supervisor(host: Host, disguise: str) -> None:
    done = host.run(disguised(disguise, ""), None, seconds=30)
    assert done["outcome"]["reason"] == "finished", done
    assert "had left running were ended" in done["outcome"]["detail"]
    nothing_hidden(host)


@pytest.mark.parametrize("attack", ATTACKS)
def test_in_the_sandbox_nobody_finds_the_supervisor_and_nothing_is_left(host: Host, attack: str) -> None:
    """The agent's parent is of its own namespace: ending it ends the agent, and the namespace with it."""
    code = HIDE + "SUPERVISOR = os.getppid()\n" + ATTACKS[attack]
    began = time.monotonic()
    done = host.run(["/usr/bin/python3", "-I", "-S", "-c", code], CONFINED, seconds=SECONDS)
    assert time.monotonic() - began < 2 * SECONDS + 4
    assert "its supervisor" not in done["outcome"]["detail"]
    assert planted(host).exists(), done
    assert stands(planted(host))


def test_in_the_sandbox_the_supervisor_cannot_be_named(host: Host) -> None:
    done = host.run(["/usr/bin/python3", "-I", "-S", "-c", HIDE + "print(len(above()))"], CONFINED, seconds=30)
    assert done["outcome"]["reason"] == "finished"
    assert int(done["log"].splitlines()[-1]) <= 1, "processes of the host can be seen"


def test_a_process_without_any_environment_is_ended_with_its_attempt(host: Host) -> None:
    done = host.run(["/usr/bin/python3", "-I", "-S", "-c", HIDE], None, seconds=30)
    assert done["outcome"]["reason"] == "finished"
    assert "1 process(es) that it had left running were ended" in done["outcome"]["detail"]
    assert stands(planted(host))


def test_what_a_dead_octoform_left_is_ended_by_the_next_run(host: Host) -> None:
    """The agent kills everything above it: what it hid lives on until the next run of octoform looks."""
    # Its supervisor and octoform, no more: above these are the tests. Both stand still first, so that neither acts.
    code = HIDE + "for number in (19, 9):\n    for pid in reversed(above()[:2]):\n        os.kill(pid, number)\n"
    process = host.start(["/usr/bin/python3", "-I", "-S", "-c", code], None)
    try:
        process.wait(60)
        until(lambda: planted(host).exists())
        hidden = int(planted(host).read_text().splitlines()[0])
        assert is_alive(hidden), "nothing is left to be swept"
        swept = host.call(
            "from octoform.harness.containment import orphans; from pathlib import Path; import json, sys;"
            "print(json.dumps(orphans.sweep(Path(sys.argv[1])).ended))",
            str(host.workdir.parent),
        )
        assert hidden in json.loads(swept)
        until(lambda: not is_alive(hidden))
        assert stands(planted(host))
    finally:
        process.kill()
        process.communicate()


HIDING = """
_left = subprocess.Popen(["/bin/sleep", "600"], start_new_session=True, env={}).pid
subprocess.run(["awk", "-v", "to=" + PLACE, "{print >> to}"], input=f"{_left}\\n", text=True, check=True)
"""


def hiding(place: Path) -> tuple[Project, Path]:
    """A project whose tool starts a process without any variable at each call, and the file with their pids."""
    project = Project(place / "project", place / "outside")
    pids = place / "pids"
    good = (Path(__file__).parents[1] / "agent" / "good" / "server.py").read_text()
    body = "".join(f"    {line}\n" for line in HIDING.replace("PLACE", repr(str(pids))).strip().splitlines())
    hidden = good.replace("from typing", "import subprocess\nfrom typing", 1).replace(
        "    with bus(", body + "    with bus(", 1
    )
    server = place / "server.py"
    server.write_text(hidden)
    project.script = {"serve": [{"copy": str(server)}]}
    return project, pids


def pids(place: Path) -> list[int]:
    return [int(line) for line in place.read_text().splitlines()]


ENDS = (
    ("stop",),
    ("restart",),
    ("apply", "-auto-approve", "-replace", "endpoint"),
    ("destroy", "-auto-approve"),
)


def attack(project: Project, place: Path, ends: Sequence[Sequence[str]], before_apply: Callable[[], None]) -> None:
    """What the tool leaves at the check and at a call: the check ends the one, and each of these ends the other."""
    done = project.apply(status=0)
    assert "ENDPOINT-LEFT-RUNNING" in done.codes()
    assert pids(place) and not [pid for pid in pids(place) if is_alive(pid)], "the check left it running"
    for end in ends:
        project.run("call", "read_temperature", "-start", status=0)
        left = pids(place)[-1]
        assert is_alive(left)
        if end[0] == "apply":
            before_apply()
        project.run(*end, status=0)
        until(lambda pid=left: not is_alive(pid))  # type: ignore[misc]


def test_what_a_tool_starts_without_any_variable_ends(tmp_path: Path, compiled: Path) -> None:
    project, place = hiding(tmp_path)
    # What an apply builds again, and what is removed after it, is the project's own.
    attack(project, place, ENDS, lambda: project.take_environments(compiled))


@pytest.mark.skipif(not POSSIBLE or not OPEN_PYTHON.exists(), reason="only root can become another user")
def test_what_a_tool_starts_without_any_variable_ends_for_an_ordinary_user(
    compiled: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with ordinary_user() as user:
        project, place = hiding(user.place)
        command = json.dumps([str(OPEN_PYTHON), str(AGENT), str(project.outside / "script.json")])
        project.harness = f"{{name: command, command: {command}, sandbox: false}}"
        # That user's interpreter does not have the packages whose versions the agent writes down.
        (user.place / "task.json").write_text(json.dumps({"input": str(user.place / "server.py")}))
        monkeypatch.setenv("OCTOFORM_TASK", str(user.place / "task.json"))
        project.script["deploy"] = [{"write": runpy.run_path(str(AGENT))["good"]("deploy")}]
        monkeypatch.delenv("OCTOFORM_TASK")
        root = bench_host(user.place / "root")
        project.environ = {"HOME": str(user.place / "home"), "OCTOFORM_SYSROOT": str(root)}
        project.user = user.prefix
        (user.place / "home").mkdir()
        project.write()
        project.take_environments(compiled, linked=False)
        user.owns_all()
        try:
            attack(project, place, [("restart",), ("stop",)], user.owns_all)
        finally:
            project.run("stop")
