"""The sandbox with real programs: as root and as an ordinary user, what is seen, what can be written, what is left."""

import os
import shutil
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from harness_confined import Host
from unit.harness.harness_agents import PRELUDE
from waiting import until

from octoform.diagnostics import Diagnostic
from octoform.harness.containment import sandbox
from octoform.manifest.model import Sandbox

ORDINARY = 1000
USERS = [0, ORDINARY] if os.getuid() == 0 else [os.getuid()]
ON: dict[str, bool] = {"network": True}
OFF: dict[str, bool] = {"network": False}


@pytest.fixture(params=USERS, ids=lambda uid: f"uid{uid}")
def host(request: pytest.FixtureRequest) -> Iterator[Host]:
    assert shutil.which("bwrap"), "bubblewrap is missing; `make setup` installs it"
    # Not tmp_path: its parents are closed to other users.
    root = Path(tempfile.mkdtemp(prefix="octoform-sandbox-"))
    try:
        yield Host(root, request.param)
    finally:
        shutil.rmtree(root)


def sh(host: Host, script: str, confined: dict[str, bool] | None = None, **environ: Any) -> Any:
    return host.run(["sh", "-c", script], ON if confined is None else confined, **environ)


def removed(paths: list[Path]) -> list[Path]:
    """Those of them that are there, which they should not be; they do not stay."""
    there = [path for path in paths if path.exists()]
    for path in there:
        path.unlink()
    return there


@pytest.fixture
def open_to_all() -> Iterator[Path]:
    """A folder that anybody may write, neither below a home nor where each user has a temporary folder."""
    place = next(Path(name) for name in ("/opt", "/srv", "/var/lib", "/var/tmp") if os.access(name, os.W_OK))
    folder = Path(tempfile.mkdtemp(prefix="octoform-sandbox-", dir=place))
    folder.chmod(0o777)
    yield folder
    shutil.rmtree(folder)


def test_only_the_attempts_folder_can_be_written(host: Host, open_to_all: Path) -> None:
    outside = [
        open_to_all / "of-nobody",
        host.write(open_to_all / "notes.txt"),
        host.write(host.home / "notes.txt"),
        host.write(host.project / "octopus.yaml"),
        host.write(host.project / "state" / "bench" / "state.json"),
        host.write(host.project / ".octoform" / "bench" / "attempts" / "000001-probe-1" / "agent.log"),
        host.root / "elsewhere",
        Path("/var/octoform-sandbox-test"),
        Path("/usr/octoform-sandbox-test"),
    ]
    before = {path: path.read_bytes() if path.exists() else None for path in outside}
    script = "".join(
        f"(echo changed > '{path}') 2>/dev/null\n" + (f"rm -rf '{path}' 2>/dev/null\n" if before[path] else "")
        for path in outside
    )
    script += (
        'echo {} > "$OCTOFORM_OUTPUT"; echo a > "$HOME/a"; echo b > "$TMPDIR/b"; echo c > /tmp/c; pwd; cat "$HOME/a"'
    )
    done = sh(host, script)
    after = {path: path.read_bytes() if path.exists() else None for path in outside}
    removed([path for path in outside if before[path] is None])
    assert done["outcome"]["reason"] == "finished", done
    assert after == before
    assert (host.workdir / "output.json").read_text() == "{}\n"
    assert done["log"].split() == [str(host.workdir), "a"]
    assert not Path("/tmp/c").exists()


def test_what_is_the_users_is_hidden_and_what_the_task_needs_is_there(host: Host) -> None:
    host.write(host.home / ".ssh" / "id_ed25519", "SECRET")
    host.write(host.home / ".config" / "login.json", "SECRET")
    host.write(host.project / ".git" / "config", "SECRET")
    host.write(host.project / ".env", "SECRET")
    host.write(host.project / ".octoform" / "bench" / "token", "SECRET")
    host.write(host.project / ".octoform" / "bench" / "attempts" / "000001-probe-1" / "agent.log", "SECRET")
    host.write(host.project / "state" / "bench" / "probe" / "output.json", "INPUT")
    host.write(host.project / "protocol" / "IDENTIFY.md", "SPEC")
    done = sh(
        host,
        f"cd {host.home}; find . -type f | xargs cat 2>/dev/null | grep -c SECRET\n"
        f"cat {host.project}/state/bench/probe/output.json {host.project}/protocol/IDENTIFY.md; echo\n"
        "ls -a /root /home 2>/dev/null | grep -c -v -e '^\\.' -e '^/' -e '^$'",
    )
    assert done["log"].split() == ["0", "INPUTSPEC", "0"]


def test_a_project_that_is_the_home_itself_shows_only_its_own_parts(host: Host) -> None:
    host.write(host.project / ".ssh" / "id_ed25519", "SECRET")
    host.write(host.project / "letters" / "private", "SECRET")
    host.write(host.project / "state" / "bench" / "probe" / "output.json", "INPUT")
    done = sh(
        host,
        f"cd {host.project}; cat .ssh/* letters/* state/bench/probe/*; ls -A; touch x",
        HOME=str(host.project),
    )
    assert "SECRET" not in done["log"]
    assert "INPUT" in done["log"]
    assert not (host.project / "x").exists()


def test_programs_below_the_home_run_with_what_belongs_to_them(host: Host) -> None:
    modules = host.home / ".cache" / "octoform" / "agents" / "pi-1" / "node_modules"
    host.write(modules / "pkg" / "part.sh", "echo from the package")
    main = host.write(
        modules / "pkg" / "main.sh", '#!/usr/bin/env own-shell\n. "$(dirname "$(readlink -f "$0")")/part.sh"\n'
    )
    main.chmod(0o755)
    (modules / ".bin").mkdir()
    (modules / ".bin" / "pi").symlink_to("../pkg/main.sh")
    tools = host.home / "tools"
    (tools / "bin").mkdir(parents=True)
    (tools / "bin" / "own-shell").symlink_to("/bin/sh")
    host.write(tools / "lib" / "data", "library")
    host.write(tools / "private", "SECRET")
    host.write(host.home / ".cache" / "private", "SECRET")
    path = f"{tools}/bin:/usr/bin:/bin"
    done = host.run([str(modules / ".bin" / "pi")], ON, PATH=path)
    assert done["log"] == "from the package\n", done
    done = sh(host, f"cat {tools}/lib/data {tools}/private {host.home}/.cache/private", PATH=path)
    assert "library" in done["log"] and "SECRET" not in done["log"]


def test_a_virtual_environment_below_the_home(host: Host) -> None:
    subprocess.run([host.python, "-m", "venv", "--without-pip", str(host.home / "venv")], check=True)
    packages = next((host.home / "venv" / "lib").glob("python*")) / "site-packages"
    host.write(packages / "inside.py", "NAME = 'found'")
    program = host.write(
        host.home / "venv" / "bin" / "tool", f"#!{host.home}/venv/bin/python\nimport inside\nprint(inside.NAME)"
    )
    program.chmod(0o755)
    assert host.run([str(program)], ON)["log"] == "found\n"


def test_devices_work_and_disks_do_not(host: Host) -> None:
    code = """
import os, pty, stat
print(open("/dev/null").read() == "", open("/dev/zero", "rb").read(2) == bytes(2), len(os.urandom(3)))
leader, follower = pty.openpty()
os.write(leader, b"x\\n")
print(os.read(follower, 9))
disks = [e.path for e in os.scandir("/dev") if stat.S_ISBLK(e.stat(follow_symlinks=False).st_mode)]
print([path for path in disks if os.access(path, os.W_OK)])
open("/dev/shm/mine", "w").close()
print(os.listdir("/dev/shm"), os.path.isdir("/sys/class"))
"""
    done = host.run(["/usr/bin/python3", "-I", "-c", code], ON)
    assert done["log"].splitlines() == ["True True 3", "b'x\\n'", "[]", "['mine'] True"]
    assert not Path("/dev/shm/mine").exists()


@pytest.mark.parametrize(("confined", "reached"), [(ON, True), (OFF, False)])
def test_the_network_is_there_or_not(host: Host, confined: dict[str, bool], reached: bool) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        code = (
            "import socket\n"
            f"try: socket.create_connection(('127.0.0.1', {server.getsockname()[1]}), 5); print('reached')\n"
            "except OSError as problem: print(type(problem).__name__)\n"
            "own = socket.create_server(('127.0.0.1', 0)); socket.create_connection(own.getsockname(), 5); print('own')"
        )
        done = host.run(["/usr/bin/python3", "-I", "-c", code], confined)
    assert done["log"].split() == ["reached" if reached else "ConnectionRefusedError", "own"]


def test_it_sees_no_process_but_its_own(host: Host) -> None:
    done = sh(host, "ls /proc | grep -c '^[0-9]*$'; cat /proc/1/comm; ls /proc/1/root/home 2>/dev/null | wc -l")
    assert int(done["log"].split()[0]) <= 8
    assert done["log"].split()[1] == "bwrap"


def test_it_cannot_make_what_it_sees_writable_again(host: Host) -> None:
    tries = (
        "for way in 'mount -o remount,rw /' 'unshare -Ur mount -o remount,rw /' 'unshare -Urm umount -l /home'; do\n"
    )
    tries += "$way 2>/dev/null && echo worked; done; echo x > /usr/octoform-x 2>/dev/null; ls -A /home /root; echo end"
    done = sh(host, tries)
    assert "worked" not in done["log"] and done["log"].split()[-1] == "end"
    assert removed([Path("/usr/octoform-x")]) == []


def test_its_exit_status_is_told(host: Host) -> None:
    assert sh(host, "exit 7")["outcome"]["exit_status"] == 7


STUBBORN = """
if os.fork() == 0:
    os.setsid()
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    if os.fork() == 0:
        for number in (0, 1, 2): os.close(number)
        open("daemon", "w").close()
        time.sleep(600)
    open("child", "w").close()
    time.sleep(600)
wait_for("daemon"); wait_for("child")
"""


def marked(host: Host) -> list[int]:
    """The processes that carry this attempt in their environment, seen from outside."""
    wanted = f"OCTOFORM_OUTPUT={host.workdir}/output.json".encode()
    found = []
    for entry in Path("/proc").iterdir():
        try:
            if entry.name.isdigit() and wanted in (entry / "environ").read_bytes().split(b"\0"):
                found.append(int(entry.name))
        except (OSError, ProcessLookupError):
            continue
    return found


@pytest.mark.parametrize("confined", [ON, OFF, None], ids=["network", "no-network", "unconfined"])
@pytest.mark.parametrize("ending", ["", "time.sleep(600)"], ids=["ends", "limit"])
def test_nothing_is_left(host: Host, confined: dict[str, bool] | None, ending: str) -> None:
    agent = ["/usr/bin/python3", "-I", "-S", "-c", PRELUDE + STUBBORN + ending]
    done = host.run(agent, confined, seconds=3 if ending else 60)
    assert done["outcome"]["reason"] == ("timeout" if ending else "finished"), done
    assert "could not be ended" not in done["outcome"]["detail"]
    assert (host.workdir / "daemon").exists()
    until(lambda: not marked(host))


@pytest.mark.parametrize("confined", [ON, None], ids=["confined", "unconfined"])
def test_the_death_of_octoform_ends_it(host: Host, confined: dict[str, bool] | None) -> None:
    agent = ["/usr/bin/python3", "-I", "-S", "-c", PRELUDE + STUBBORN + "time.sleep(600)"]
    process = host.start(agent, confined)
    try:
        until(lambda: (host.workdir / "daemon").exists() and (host.workdir / "child").exists())
        assert len(marked(host)) >= 3
    finally:
        process.kill()
        process.communicate()
    until(lambda: not marked(host))


def test_a_program_that_is_refused_is_not_run_unconfined(host: Host) -> None:
    broken = host.write(
        host.root / "broken" / "bwrap",
        "#!/bin/sh\necho 'bwrap: No permissions to create a new namespace' >&2\nexit 1\n",
    )
    broken.chmod(0o755)
    done = sh(host, "echo ran > ran", PATH=f"{broken.parent}:/usr/bin:/bin")
    assert done["outcome"]["reason"] == "not_installed"
    assert "No permissions to create a new namespace" in done["outcome"]["detail"]
    assert not (host.workdir / "ran").exists()


def test_without_bubblewrap_it_is_said_what_to_do() -> None:
    found = sandbox.available({"PATH": "/nonexistent"}, Sandbox())
    assert isinstance(found, Diagnostic)
    assert found.code == "HARNESS-NO-SANDBOX"
    assert "bubblewrap" in (found.hint or "")


def test_this_machine_can_confine() -> None:
    assert sandbox.available(os.environ, Sandbox()) is None
    assert sandbox.available(os.environ, Sandbox(network=False)) is None


@pytest.mark.parametrize("home", ["/", "/usr", "/bin", "/usr/sbin", "/var", "/dev", "/nonexistent", ""])
def test_a_home_that_is_the_system_is_not_hidden(home: str) -> None:
    assert Path(home or "/") not in sandbox._hidden({"HOME": home})


def test_a_variable_may_name_a_link_to_itself(host: Host) -> None:
    loop = host.home / "loop"
    loop.symlink_to("loop")
    (host.home / "tools" / "bin").mkdir(parents=True)
    (host.home / "tools" / "pyvenv.cfg").touch()
    (host.home / "tools" / "bin" / "python").symlink_to("python")
    path = f"{host.home / 'tools' / 'bin'}:/usr/bin:/bin"
    assert sh(host, "echo runs", PATH=path, SOME_FILE=str(loop))["log"].split() == ["runs"]
