"""Agents that attack the machine from inside the sandbox, as root and as an ordinary user."""

import ctypes
import json
import os
import shutil
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from harness_confined import Host
from projects import Project

from octoform.harness.containment import syscalls

USERS = [0, 1000] if os.getuid() == 0 else [os.getuid()]
ON: dict[str, bool] = {"network": True}

WRITES = r"""
import glob, os, stat
walks = [os.path.join(top, name) for place in ("/proc/sys", "/proc/irq", "/proc/bus", "/proc/fs", "/sys")
         for top, _, names in os.walk(place) for name in names]
more = ["/proc/sysrq-trigger", "/proc/kmsg", "/proc/mtrr", "/proc/scsi/scsi", "/dev/mem", "/dev/kmsg", "/dev/port"]
opened = []
for path in walks + more:
    try:
        if not stat.S_ISREG(os.stat(path).st_mode) and not path.startswith("/dev/"): continue
        os.close(os.open(path, os.O_WRONLY | os.O_NONBLOCK))
        opened.append(path)
    except OSError:
        pass
print("looked at", len(walks) > 500)
print("opened", opened)
"""

PRIVATE = r"""
import os
for path in PATHS:
    try:
        print("read", path, open(path, "rb").read(1))
    except OSError as problem:
        pass
words = dict(line.split(":\t", 1) for line in open("/proc/self/status").read().splitlines() if ":\t" in line)
print("capabilities", int(words["CapEff"], 16) | int(words["CapPrm"], 16) | int(words["CapAmb"], 16))
print("user", os.getuid(), os.geteuid(), "can be root again", end=" ")
for act in (lambda: os.setuid(0), lambda: os.seteuid(0), lambda: os.setgid(0), lambda: os.setgroups([0])):
    try:
        act()
        print(act, end=" ")
    except OSError:
        pass
"""


@pytest.fixture(params=USERS, ids=lambda uid: f"uid{uid}")
def host(request: pytest.FixtureRequest) -> Iterator[Host]:
    assert shutil.which("bwrap"), "bubblewrap is missing; `make setup` installs it"
    root = Path(tempfile.mkdtemp(prefix="octoform-sandbox-"))
    try:
        yield Host(root, request.param)
    finally:
        shutil.rmtree(root)


def attack(host: Host, code: str) -> list[str]:
    done = host.run(["/usr/bin/python3", "-I", "-S", "-c", code], ON)
    assert done["outcome"]["reason"] == "finished", done["outcome"]["detail"]
    lines: list[str] = done["log"].splitlines()
    return lines


def test_no_setting_of_the_kernel_can_be_opened_for_writing(host: Host) -> None:
    assert attack(host, WRITES) == ["looked at True", "opened []"]


def test_what_is_roots_alone_stays_closed_and_nobody_becomes_root(host: Host) -> None:
    private = Path("/var/octoform-sandbox-private")
    paths = ["/etc/shadow", "/etc/gshadow", "/proc/kcore"]
    if os.getuid() == 0:
        private.write_text("SECRET")
        private.chmod(0o600)
        paths.append(str(private))
    try:
        lines = attack(host, f"PATHS = {paths!r}\n{PRIVATE}")
    finally:
        private.unlink(missing_ok=True)
    assert lines[0] == "capabilities 0"
    user = lines[1].split()
    assert "0" not in user[1:3]
    assert lines[1].endswith("can be root again ")
    assert len(lines) == 2


def test_the_attempts_folder_is_octoforms_again(host: Host) -> None:
    attack(host, "import os; os.mkdir('made'); open('made/file', 'w').close(); os.symlink('/etc/passwd', 'made/link')")
    owners = {path.lstat().st_uid for path in (host.workdir, *host.workdir.rglob("*"))}
    assert owners == {host.uid}
    assert Path("/etc/passwd").stat().st_uid == 0


def test_a_closed_project_of_root_shows_its_input_and_not_its_secrets(host: Host) -> None:
    host.write(host.project / "state" / "bench" / "probe" / "output.json", "INPUT")
    host.write(host.project / ".env", "SECRET")
    host.write(host.project / "notes", "SECRET").chmod(0o600)
    host.project.chmod(0o700)
    places = [str(host.project / name) for name in ("state/bench/probe/output.json", ".env")]
    code = f"for path in {places!r}:\n try: print(open(path).read())\n except OSError: print('closed')"
    assert attack(host, code)[0] == "INPUT"
    assert "SECRET" not in "".join(attack(host, code))


@pytest.mark.parametrize("required", [True, False])
def test_where_user_namespaces_are_refused_it_is_required_or_reported(host: Host, required: bool) -> None:
    broken = host.write(host.root / "broken" / "bwrap", "#!/bin/sh\necho 'bwrap: No permissions' >&2\nexit 1\n")
    broken.chmod(0o755)
    agent = ["sh", "-c", "echo ran > ran"]
    done = host.run(agent, {"network": True, "required": required}, PATH=f"{broken.parent}:/usr/bin:/bin")
    outcome = done["outcome"]
    assert (host.workdir / "ran").exists() is not required
    assert outcome["reason"] == ("not_installed" if required else "finished")
    assert "No permissions" in outcome["detail"]
    assert bool(outcome["unconfined"]) is not required


CALLS = r"""
import ctypes, errno, os
libc = ctypes.CDLL(None, use_errno=True)
def asked(number, *arguments):
    ctypes.set_errno(0)
    done = libc.syscall(ctypes.c_long(number), *map(ctypes.c_long, arguments))
    return "done" if done >= 0 else errno.errorcode[ctypes.get_errno()]
for name, (number, arguments) in NUMBERS.items():
    print(name, asked(number, *arguments), flush=True)
"""


def numbers() -> tuple[dict[str, int], int, int, int]:
    """The kernel's numbers of this machine's architecture: of what is refused, of clone, of ioctl, of socket."""
    refused, clone, ioctl, socket_ = syscalls.TABLES[{"x86_64": 0xC000003E, "aarch64": 0xC00000B7}[os.uname().machine]]
    return dict(refused), clone, ioctl, socket_


def test_calls_that_lead_around_files_are_refused_by_the_kernel(host: Host) -> None:
    refused, clone, ioctl, socket_ = numbers()
    asked = {name: (number, [0] * 6) for name, number in refused.items()}
    asked |= {"io_uring_setup": (425, [1, 0]), "fsopen": (430, [0] * 6), "mount_setattr": (442, [0] * 6)}
    for name, flag in (("files", 0x20000), ("users", 0x10000000), ("processes", 0x20000000), ("network", 0x40000000)):
        asked[f"clone with {name} of its own"] = (clone, [flag | 17, 0, 0, 0, 0])
    asked |= {"type into a terminal": (ioctl, [0, 0x5412, 0]), "paste into a console": (ioctl, [0, 0x541C, 0])}
    fields = dict(line.rsplit(" ", 1) for line in attack(host, f"NUMBERS = {asked!r}\n{CALLS}"))
    assert fields == dict.fromkeys(asked, "EPERM")
    others = {"clone3": (435, [0, 0]), "vsock": (socket_, [40, 1, 0]), "x32": (0x40000000 + 101, [0] * 4)}
    fields = dict(line.rsplit(" ", 1) for line in attack(host, f"NUMBERS = {others!r}\n{CALLS}"))
    assert fields == {"clone3": "ENOSYS", "vsock": "EAFNOSUPPORT", "x32": "ENOSYS"}


def test_what_agents_do_all_day_still_works(host: Host) -> None:
    code = """
import fcntl, multiprocessing.pool, socket, subprocess, termios, threading
print(subprocess.run(["sh", "-c", "echo from a shell | cat"], capture_output=True, text=True).stdout.strip())
with multiprocessing.pool.ThreadPool(2) as pool: print(sum(pool.map(int, "12")))
import os, pty, tty
leader, follower = pty.openpty()
tty.setraw(follower); fcntl.ioctl(follower, termios.TIOCGWINSZ, bytes(8))
os.write(leader, b"typed"); print(os.read(follower, 9), os.ttyname(follower))
here, there = socket.socketpair(); here.send(b"x"); print(there.recv(9))
"""
    lines = attack(host, code)
    assert lines == ["from a shell", "3", "b'typed' /dev/pts/0", "b'x'"]


TERMINAL = """
import fcntl, os, termios
for name in os.listdir("/dev/pts"):
    if name.isdigit(): print("another's terminal", name)
try: os.write(os.open(PATH, os.O_RDWR | os.O_NOCTTY), b"typed")
except OSError: print("closed")
leader, follower = os.openpty()
try: fcntl.ioctl(follower, termios.TIOCSTI, b"x")
except PermissionError: print("refused")
"""


def test_a_persons_terminal_is_neither_read_nor_typed_into(host: Host) -> None:
    leader, follower = os.openpty()
    try:
        path = os.ttyname(follower)
        os.chown(path, host.uid, -1)
        lines = attack(host, f"PATH = {path!r}\n{TERMINAL}")
        os.set_blocking(leader, False)
        with pytest.raises(BlockingIOError):
            os.read(leader, 9)
    finally:
        os.close(leader)
        os.close(follower)
    assert lines == ["closed", "refused"]


REACHED = """
import socket
for name in (NAME, "octoform-test-own"):
    with socket.socket(socket.AF_UNIX) as own, socket.socket(socket.AF_UNIX) as caller:
        try:
            if name != NAME: own.bind(chr(0) + name); own.listen()
            caller.connect(chr(0) + name); print("reached", name)
        except OSError as problem: print(type(problem).__name__)
"""


def _scopes() -> bool:
    """Whether the kernel can keep sockets without a file apart (Landlock, ABI 6)."""
    return int(ctypes.CDLL(None).syscall(444, None, ctypes.c_size_t(0), ctypes.c_uint32(1))) >= 6


@pytest.mark.skipif(not _scopes(), reason="the kernel has no scopes of Landlock (Linux 6.12)")
def test_a_program_behind_a_socket_without_a_file_is_not_reached(host: Host) -> None:
    name = f"octoform-test-{os.getpid()}"
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(f"\0{name}")
        listening.listen()
        lines = attack(host, f"NAME = {name!r}\n{REACHED}")
    assert lines == ["PermissionError", "reached octoform-test-own"]


@pytest.mark.skipif(os.geteuid() != 0, reason="only root has a place for a service")
def test_a_service_behind_a_socket_in_run_is_not_reached(host: Host) -> None:
    """A database, for example, executes any order of its user."""
    with (
        tempfile.TemporaryDirectory(dir="/run", prefix="octoform-test-") as folder,
        socket.socket(socket.AF_UNIX) as service,
    ):
        Path(folder).chmod(0o755)
        service.bind(f"{folder}/service.sock")
        Path(folder, "service.sock").chmod(0o777)
        service.listen()
        code = "import socket\ntry:\n    socket.socket(socket.AF_UNIX).connect(NAME)\n    print('reached')\n"
        lines = attack(
            host, f"NAME = {folder!r} + '/service.sock'\n{code}except OSError as problem:\n    print('closed')\n"
        )
    assert lines == ["closed"]


def test_an_interpreter_that_belongs_to_another_user_can_begin(host: Host) -> None:
    """Root's agents are ordinary users, and root itself without its powers reads no closed folder of anybody else."""
    if host.uid != 0:
        pytest.skip("nobody but root starts an interpreter in a folder that is closed to all but its owner")
    theirs = Path(tempfile.mkdtemp(prefix="octoform-theirs-"))
    try:
        subprocess.run([host.python, "-m", "venv", "--without-pip", str(theirs / "venv")], check=True)
        for path in (theirs, *theirs.rglob("*")):
            os.chown(path, 1000, 1000, follow_symlinks=False)
        host.python = str(theirs / "venv" / "bin" / "python")
        lines = attack(host, "import os; print(os.getuid() != 0)")
    finally:
        shutil.rmtree(theirs)
    assert lines == ["True"]


@pytest.mark.parametrize("mode", [0o755, 0o700])
def test_a_project_below_a_closed_folder_of_root_is_worked_in(mode: int) -> None:
    if os.getuid() != 0:
        pytest.skip("a folder of another user cannot be entered at all")
    root = Path(tempfile.mkdtemp(prefix="octoform-sandbox-", dir="/opt"))  # mkdtemp closes it to everybody else
    try:
        host = Host(root, 0)
        host.write(host.project / "state" / "bench" / "probe" / "output.json", "INPUT")
        host.write(host.root / "beside", "SECRET")
        host.project.chmod(mode)
        code = f"""
import os
print(os.getcwd() == {str(host.workdir)!r}, os.getuid() != 0)
print(open({str(host.project / "state/bench/probe/output.json")!r}).read(), os.path.exists({str(root / "beside")!r}))
open("output.json", "w").close()
"""
        assert attack(host, code) == ["True True", "INPUT False"]
    finally:
        shutil.rmtree(root)


@pytest.mark.skipif(os.getuid() != 0, reason="the agents of an ordinary user are that user")
def test_an_apply_as_root_confines_its_agent(tmp_path: Path) -> None:
    project = Project(tmp_path / "project", tmp_path / "outside")
    project.harness = '{name: command, command: [/bin/sh, -c, "id -u > output.json"]}'
    project.manifest["budget"] = "{attempts: 1}"
    done = project.apply("-target", "probe", status=1)
    (folder,) = project.attempts("probe")
    assert json.loads((folder / "attempt.json").read_text())["unconfined"] == ""
    assert "HARNESS-UNCONFINED" not in done.codes()
    assert (folder / "output.json").read_text() != "0\n"


@pytest.mark.skipif(os.getuid() != 0, reason="the agents of an ordinary user are that user")
def test_a_file_that_is_closed_to_the_agents_user_is_named_with_what_to_do(tmp_path: Path) -> None:
    program = tmp_path / "agent.sh"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o700)
    project = Project(tmp_path / "project", tmp_path / "outside")
    project.harness = f"{{name: command, command: [{program}]}}"
    project.manifest["budget"] = "{attempts: 1}"
    project.write()
    done = project.run("apply", "-auto-approve", "-target", "probe", status=1)
    assert "HARNESS-UNCONFINED" in done.err and f"its user cannot read {program}" in done.err
    project.harness = f"{{name: command, command: [{program}], sandbox: true}}"
    project.write()
    done = project.run("apply", "-auto-approve", "-target", "probe", status=1)
    assert f"its user cannot read {program}" in done.err and f"chmod o+r {program}" in done.err
