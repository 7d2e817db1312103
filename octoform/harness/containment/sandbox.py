"""Confinement of an agent by bubblewrap: it sees the machine read-only and writes only in its attempt's folder.

What it sees is decided in one order: the whole file system read-only; then the places hidden where people and other
programs keep what is theirs (homes, temporary folders, sessions); then, read-only, what the agent's program itself
needs of those; the project without its private parts; last the attempt's folder, to write in. Devices stay as the
user may use them, since hardware is what the agent is asked about. Disks as a whole do not, nor the sockets of
services that write wherever a client asks: each of them would be a way around.

Where octoform runs as root the agent is another user (`agent_user`), because what root may do a file mode lets it do.
"""

import ctypes
import errno
import os
import shutil
import stat
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import octoform
from octoform.base import shortage
from octoform.base.files import head, parse, read_plain, walk
from octoform.diagnostics import Diagnostic, error
from octoform.harness.containment import syscalls
from octoform.harness.containment.agent_user import AgentUser, agent_user, hand_over
from octoform.manifest.model import Sandbox
from octoform.records import dataclass

# What of the hidden places a program needs to run: itself, its interpreter, their libraries, what it has to read.
#
# Programs are installed below homes all the time: in octoform's own cache, by version managers, in virtual
# environments. A folder of programs is shown with the libraries beside it and nothing else of the home that it lies in.

BESIDE = ("lib", "lib64", "libexec")
MODULES = "node_modules"
ENVIRONMENT = "pyvenv.cfg"
SHIMS = "shims"
FIRST_LINE = 4096


def belongings(argv: Sequence[str], variables: Mapping[str, str]) -> Iterator[Path]:
    """The paths that a command and its variables speak of, and what belongs to the programs among them."""
    yield from (Path(sys.prefix), Path(sys.base_prefix), Path(octoform.__file__).parent)
    yield from _program(Path(argv[0]))
    for item in argv[1:]:
        path = Path(item)
        if path.is_absolute() and path.exists():
            # A script brings its neighbours along.
            yield from (path, path if path.is_dir() else path.parent)
    for folder in variables.get("PATH", "").split(os.pathsep):
        if Path(folder).is_absolute():
            yield from _folder(Path(folder))
    for name, value in variables.items():
        if name not in ("PATH", "HOME", "TMPDIR") and value.startswith("/") and "\0" not in value:
            yield Path(value)


def _program(path: Path) -> Iterator[Path]:
    """A program, what its links lead to, and the interpreter in its first line."""
    for place in dict.fromkeys((path, _real(path))):
        yield place
        yield from _folder(place.parent)
        if MODULES in place.parts:
            yield Path(*place.parts[: place.parts.index(MODULES) + 1])
    interpreter = _interpreter(path)
    if interpreter is not None:
        for place in dict.fromkeys((interpreter, _real(interpreter))):
            yield from _folder(place.parent)


def _real(path: Path) -> Path:
    """The path without links; of a link to itself as it is, where `Path.resolve` raises."""
    return Path(os.path.realpath(path))


def _folder(folder: Path) -> Iterator[Path]:
    """A folder of programs with the libraries beside it; the whole of a virtual environment."""
    yield folder
    above = folder.parent
    if folder.name == SHIMS or (above / ENVIRONMENT).is_file():
        yield above
        python = _real(folder / "python")
        yield from (python.parent, *(python.parent.parent / name for name in BESIDE))
    elif folder.name in ("bin", "sbin"):
        yield from (above / name for name in BESIDE)


def _interpreter(path: Path) -> Path | None:
    try:
        line = head(path, FIRST_LINE, follow=True).partition(b"\n")[0]
    except OSError:
        return None
    words = line[2:].split() if line.startswith(b"#!") else []
    found = Path(os.fsdecode(words[0])) if words else None
    return found if found is not None and found.is_absolute() else None


PROGRAM = "bwrap"
TRIAL_SECONDS = 20.0
LOCAL = ".octoform"
"""The project's folder of attempts, instances, logs and tokens."""
PRIVATE = (LOCAL, ".git", ".env", ".envrc")
"""What of a project an agent has no business with: other attempts, and where passwords of remotes and services lie."""
PARTS = ("octopus.yaml", "protocol", "profiles", "state")
"""The parts of a project that are shown where the project is a home folder itself."""
PLACES = ("/home", "/root", "/tmp", "/var/tmp", "/run/user")
DOORS = (
    "/dev/mqueue",
    *("/run/docker.sock", "/run/podman", "/run/containerd", "/run/libvirt", "/run/snapd.socket", "/run/lxd"),
    *("/run/crio", "/run/buildkit", "/run/incus", "/run/lxc", "/run/k3s", "/var/lib/lxd", "/var/lib/incus"),
    *("/var/snap/lxd/common/lxd", "/run/screen", "/run/screens", "/run/tmux", "/nix/var/nix/daemon-socket"),
)
SERVICES = Path("/run")
"""Where the services of a machine have their sockets."""
OPEN_SERVICES = (
    *("/run/nscd", "/run/systemd/resolve", "/run/systemd/userdb", "/run/systemd/journal", "/run/avahi-daemon"),
    *("/run/dbus", "/run/udev", "/run/pcscd", "/run/gpsd.sock", "/run/cups"),
)
"""Names, logs and hardware; every other service does for its user whatever it is asked, as a database does."""
ROOT_DOORS = ("/run/dbus/system_bus_socket", "/run/systemd/private", "/run/systemd/io.systemd.Manager")
SYSTEM = frozenset({"usr", "bin", "sbin", "lib", "lib64", "etc", "dev", "proc", "sys", "boot", "nix", "snap"})
SHALLOW = frozenset({"run", "var", "opt", "srv", "mnt", "media", "tmp"})
TASK_BYTES = 8 << 20
ENTRY = Path(__file__).resolve().with_name("sandbox_entry.py")
LENT = {"CAP_SETUID": 7, "CAP_SETGID": 6, "CAP_SYS_ADMIN": 21}
"""The capabilities that root gives the first program inside, each by its bit (linux/capability.h)."""
CLOSED = "its user cannot read "
UNREADABLE = f"""for path; do [ -r "$path" ] || {{ echo "{CLOSED}$path" >&2; exit 1; }}; done"""
OF_PROCESSES = frozenset({"self", "thread-self", "mounts", "net"})
"""The entries of /proc about the process that reads them."""


@dataclass(frozen=True, slots=True)
class Confinement:
    """The settings of one agent's sandbox: its attempt's folder and task, its variables, those of octoform."""

    workdir: Path
    document: Path
    variables: Mapping[str, str]
    caller: Mapping[str, str]


def wrap(argv: Sequence[str], sandbox: Sandbox, around: Confinement) -> tuple[str, ...] | Diagnostic:
    """The command that runs ``argv`` (its program an absolute path) confined; what is wrong where that cannot be.

    Tried out first with a program that does nothing, so that a refusal is reported before the agent's time runs. As
    root the attempt's folder belongs to the agent's user from then on; `released` gives it back.
    """
    program = shutil.which(PROGRAM, path=around.caller.get("PATH"))
    if program is None:
        return _none("bubblewrap (bwrap) is not installed")
    user = agent_user()
    if user is not None:
        hand_over(around.workdir, user.uid, user.groups[0])
    options = (*_options(program, sandbox, user), *_views(argv, around, user), "--chdir", "/")
    prefix = (program, *options, "--", *_entry(user, around.workdir))
    problem = _tried(prefix, _readable(argv, around) if user is not None else ())
    if problem is None:
        return (*prefix, *argv)
    released(around.workdir)
    return problem


def released(workdir: Path) -> None:
    """The attempt's folder is octoform's again; call it when no process of the agent is left."""
    if agent_user() is not None and not workdir.is_symlink():
        hand_over(workdir, os.geteuid(), os.getegid())


def available(caller: Mapping[str, str], sandbox: Sandbox) -> Diagnostic | None:
    """Why no agent can be confined on this machine by this user; None when one can."""
    program = shutil.which(PROGRAM, path=caller.get("PATH"))
    if program is None:
        return _none("bubblewrap (bwrap) is not installed")
    user = agent_user()
    return _tried((program, *_options(program, sandbox, user), "--", *_entry(user, Path("/"))))


def unconfined(caller: Mapping[str, str], sandbox: Sandbox | None) -> str:
    """Why an agent with this setting runs without a sandbox here; empty when it is confined, or does not run at all."""
    if sandbox is None:
        return "octopus.yaml has `sandbox: false`"
    problem = None if sandbox.required else available(caller, sandbox)
    return problem.summary if problem is not None else ""


def _none(why: str, hint: str | None = None) -> Diagnostic:
    return error(
        "HARNESS-NO-SANDBOX",
        f"the agent cannot be confined: {why}",
        hint=hint or "install it (Debian: apt-get install bubblewrap) and allow user namespaces, or set sandbox: auto",
    )


def _tried(prefix: Sequence[str], readable: Sequence[str] = ()) -> Diagnostic | None:
    """The error of a trivial program behind that prefix, which only checks that files can be read; None without."""
    nothing: tuple[str, ...] = (shutil.which("true") or "/bin/true",)
    if readable:
        nothing = ("/bin/sh", "-c", UNREADABLE, "sh", *readable)
    try:
        done = subprocess.run(
            [*prefix, *nothing], stdin=subprocess.DEVNULL, capture_output=True, timeout=TRIAL_SECONDS, check=False
        )
    except BlockingIOError:
        raise  # a shortage of processes is no evidence about sandboxes
    except (OSError, subprocess.TimeoutExpired) as problem:
        return _none(f"{PROGRAM}: {problem}")
    if done.returncode == 0:
        return None
    lines = done.stderr.decode("utf-8", "replace").strip().splitlines()
    if lines and lines[-1].startswith(CLOSED):
        path = lines[-1].removeprefix(CLOSED)
        return _none(lines[-1], f"the agent's user is not root: `chmod o+r {path}`, or set sandbox: false")
    if lines and shortage.printed(lines[-1]):
        raise BlockingIOError(errno.EAGAIN, shortage.TEXT)
    return _none(lines[-1] if lines else f"{PROGRAM} left with status {done.returncode}")


def _readable(argv: Sequence[str], around: Confinement) -> tuple[str, ...]:
    """The files without which the agent cannot begin."""
    named = [item for item in argv if item.startswith("/") and Path(item).is_file()]
    return (*named, *map(str, _named_in_task(around.document)))


def _entry(user: AgentUser | None, folder: Path) -> tuple[str, ...]:
    """The first program inside, which runs the agent's own in a folder."""
    who = (str(user.uid), ",".join(map(str, user.groups))) if user is not None else ("-", "-")
    return (sys.executable, "-I", "-S", str(ENTRY), syscalls.program().hex(), *who, str(folder))


def _options(program: str, sandbox: Sandbox, user: AgentUser | None) -> list[str]:
    """The options for each agent: its own process ids, a file system to read, devices, and an end with its parent."""
    out = ["--die-with-parent", "--unshare-pid", "--unshare-ipc", "--unshare-uts"]
    out += [] if sandbox.network else ["--unshare-net"]
    # Root needs no user namespace to make this one.
    out += ["--unshare-user"] if user is None else ["--cap-drop", "ALL"]
    out += [option for name in _capabilities(program, user) for option in ("--cap-add", name)]
    out += ["--ro-bind", "/", "/", "--dev-bind", "/dev", "/dev", "--tmpfs", "/dev/shm", "--proc", "/proc"]
    for name in _of_the_kernel():
        out += ["--ro-bind", name, name]
    for path in (*_disks(), *_keyboards(user)):
        out += ["--dev-bind", "/dev/null", str(path)]
    doors = [Path(name) for name in (*DOORS, *(ROOT_DOORS if os.geteuid() == 0 else ()))]
    spared = (*doors, *map(Path, (*OPEN_SERVICES, *PLACES)))
    doors += [path for path in _sockets(user) if not any(path.is_relative_to(place) for place in spared)]
    for path in doors:
        out += _covered(path)
    return out


def _capabilities(program: str, user: AgentUser | None) -> Iterator[str]:
    """The powers that the first program inside needs, and gives up before the agent begins.

    To become an ordinary user, and to make terminals.
    """
    if user is None:
        # A bubblewrap with the set-user-ID bit hands out none to others.
        yield from () if Path(program).stat().st_mode & stat.S_ISUID else ("CAP_SYS_ADMIN",)
        return
    held = _held()
    yield from (name for name, bit in LENT.items() if held >> bit & 1)


def _held() -> int:
    """The capabilities of this process as a set of bits (proc(5)); all where that is unknown."""
    try:
        lines = Path("/proc/self/status").read_text("ascii").splitlines()
    except OSError:
        return -1
    return next((int(line.split()[1], 16) for line in lines if line.startswith("CapPrm:")), -1)


def _keyboards(user: AgentUser | None) -> Iterator[Path]:
    """Where this agent could type for a person or read what a person types: consoles, and devices that make keyboards.

    Terminals of windows and of logins over a network are no concern: it has a set of its own.
    """
    for entry in os.scandir("/dev"):
        if entry.name in ("console", "uinput", "uhid") or (entry.name[:3] == "tty" and entry.name[3:].isdigit()):
            path = Path(entry.path)
            try:
                opens = (
                    os.access(path, os.R_OK) or os.access(path, os.W_OK) if user is None else user.may_open(path.stat())
                )
            except OSError:
                continue  # gone since the folder was read
            if opens:
                yield path


def _of_the_kernel() -> Iterator[str]:
    """The files in /proc besides processes, as far as it could be written: settings of the whole machine."""
    for entry in os.scandir("/proc"):
        if entry.name.isdigit() or entry.name in OF_PROCESSES or entry.is_symlink():
            continue
        try:
            mode = entry.stat(follow_symlinks=False).st_mode
        except OSError:
            continue  # gone since the folder was read
        if stat.S_ISDIR(mode) or mode & 0o222:
            yield entry.path


def _disks() -> Iterator[Path]:
    """The devices that are whole disks, as far as the user may write them, and with them any file."""
    for entry in os.scandir("/dev"):
        try:
            mode = entry.stat(follow_symlinks=False).st_mode
        except OSError:
            continue  # gone since the folder was read
        is_raw = stat.S_ISCHR(mode) and entry.name.startswith("sg") and entry.name[2:].isdigit()
        if (stat.S_ISBLK(mode) or is_raw) and os.access(entry.path, os.W_OK):
            yield Path(entry.path)


def _sockets(user: AgentUser | None) -> Iterator[Path]:
    """The sockets of services that this agent could connect to."""
    for place, _, names in walk(SERVICES):
        for path in (place / name for name in names):
            try:
                facts = path.lstat()
            except OSError:
                continue  # gone since the folder was read
            opens = os.access(path, os.W_OK) if user is None else user.may_open(facts)
            if stat.S_ISSOCK(facts.st_mode) and opens:
                yield path


def _covered(path: Path) -> list[str]:
    """Hide what lies there; nothing to do where nothing does."""
    if path.is_symlink() or not path.exists():
        return []
    if path.is_dir():
        return ["--tmpfs", str(path), "--remount-ro", str(path)]
    return ["--ro-bind", "/dev/null", str(path)]


def _views(argv: Sequence[str], around: Confinement, user: AgentUser | None) -> list[str]:
    """The further mounts of this agent: places hidden, what it needs of them, its project, its own folder."""
    project = _project(around.workdir)
    hidden = _hidden(around.caller)
    wanted = [*belongings(argv, around.variables), *_named_in_task(around.document)]
    if user is not None:
        # Closed to the agent's user, who needs parts of it.
        needed = (*wanted, project / LOCAL if project is not None else around.workdir)
        closed = {place for path in needed for form in _forms(path) for place in _closed_above(form, user)}
        hidden = sorted({*hidden, *closed})
    wanted += _of_project(project, hidden) if project is not None else []
    outermost = [path for path in hidden if not any(path != other and path.is_relative_to(other) for other in hidden)]
    # A project that is a home itself is hidden already but for the parts that are shown.
    open_places = [place for place in (_forms(project) if project is not None else ()) if place not in hidden]
    masks = [*outermost, *(place / LOCAL for place in open_places)]
    out = [option for path in outermost for option in ("--tmpfs", str(path))]
    for path in _visible(wanted, hidden):
        out += [*_way(path, masks), "--ro-bind", str(path), str(path)]
    for place in open_places:
        out += [option for name in PRIVATE if name != LOCAL for option in _covered(place / name)]
        out += ["--tmpfs", str(place / LOCAL)]
    for place in _forms(around.workdir):
        out += [*_way(place, masks), "--bind", str(place), str(place)]
    return out + [option for path in masks if not _is_scratch(path) for option in ("--remount-ro", str(path))]


def _closed_above(path: Path, user: AgentUser) -> Iterator[Path]:
    """The folders above a path that the user cannot pass through, but for those of the system."""
    for place in filter(_may_be_hidden, path.parents):
        with suppress(OSError):
            # What is octoform's own in a project is hidden anyway.
            if LOCAL not in place.parts and not user.may_pass(place.stat()):
                yield place


def _way(path: Path, masks: Iterable[Path]) -> Iterator[str]:
    """Folders on the way to what is shown below a mask; bubblewrap would close those that it makes itself."""
    nearest = max((mask for mask in masks if path.is_relative_to(mask)), key=lambda mask: len(mask.parts), default=None)
    if nearest is not None:
        for above in reversed([place for place in path.parents if place != nearest and place.is_relative_to(nearest)]):
            yield from ("--dir", str(above))


def _hidden(caller: Mapping[str, str]) -> list[Path]:
    """The folders to hide; one may lie inside another."""
    homes = [caller.get("HOME") or "", _own_home()]
    found = {Path(path).resolve() for path in (*PLACES, *homes) if Path(path).is_absolute() and Path(path).is_dir()}
    return sorted(path for path in found if _may_be_hidden(path))


def _own_home() -> str:
    """The home that the system knows for this user, whatever HOME states."""
    import pwd  # there is none on some systems

    try:
        return pwd.getpwuid(os.getuid()).pw_dir
    except KeyError:
        return ""  # a user without an entry has no home but HOME


def _may_be_hidden(path: Path) -> bool:
    """Homes of services lie in the system itself; hiding those would take its programs away."""
    parts = path.parts[1:]
    return bool(parts) and parts[0] not in SYSTEM and not (len(parts) == 1 and parts[0] in SHALLOW - {"tmp"})


def _is_scratch(path: Path) -> bool:
    """Temporary folders stay writable: they are the agent's own and empty, and go with it."""
    return path in (Path("/tmp"), Path("/var/tmp"))


def _project(workdir: Path) -> Path | None:
    parts = workdir.parts
    return Path(*parts[: parts.index(LOCAL)]) if LOCAL in parts else None


def _of_project(project: Path, hidden: Sequence[Path]) -> list[Path]:
    if any(home.is_relative_to(place) for home in hidden for place in _forms(project)):
        return [project / name for name in PARTS]
    return [project]


def _named_in_task(document: Path) -> Iterator[Path]:
    """The files that the task instructs the agent to read."""
    try:
        task = parse(read_plain(document, TASK_BYTES) or b"")
    except ValueError:
        return
    for name in ("input", "schema"):
        value = task.get(name) if isinstance(task, dict) else None
        if isinstance(value, str) and Path(value).is_file():
            yield Path(value)


def _forms(path: Path) -> list[Path]:
    """The path as it is written and as it is without links."""
    return list(dict.fromkeys((path.absolute(), _real(path))))


def _visible(wanted: Iterable[Path], hidden: Sequence[Path]) -> list[Path]:
    """The paths to mount again: those below a hidden folder that hold no hidden one."""
    found = {
        place
        for path in wanted
        for place in _forms(path)
        if any(place.is_relative_to(home) for home in hidden)
        and not any(home.is_relative_to(place) for home in hidden)
        and place.exists()
    }
    return sorted(path for path in found if not any(path != other and path.is_relative_to(other) for other in found))


# What the kernel contributes to an agent's sandbox, and what a sandbox on a kernel without it does not hold.
#
# Namespaces and bind mounts are tried out as a whole (`available`). The filter of system calls and the scopes of
# Landlock are put on by the first program inside, which goes on without where the kernel has none.

_PR_SET_SECCOMP, _SECCOMP_MODE_FILTER = 22, 2
_LANDLOCK_CREATE, _LANDLOCK_VERSION = 444, 1
ABI_OF_SCOPES = 6


@dataclass(frozen=True, slots=True)
class Kernel:
    """Whether it filters system calls (seccomp), and the version of its Landlock, 0 for none."""

    filters: bool
    landlock: int


def kernel() -> Kernel:
    """The features of this machine's kernel; asked without changing anything for this process."""
    if sys.platform != "linux":
        return Kernel(False, 0)
    libc = ctypes.CDLL(None, use_errno=True)
    # No filter lies at this address: a kernel that could take one answers EFAULT, one without knows no such mode.
    libc.prctl(_PR_SET_SECCOMP, _SECCOMP_MODE_FILTER, None, 0, 0)
    filters = ctypes.get_errno() in (errno.EFAULT, errno.EACCES)
    version = libc.syscall(_LANDLOCK_CREATE, None, ctypes.c_size_t(0), ctypes.c_uint32(_LANDLOCK_VERSION))
    return Kernel(filters, max(0, version))


def missing_walls(found: Kernel) -> tuple[str, ...]:
    """One sentence for each wall that a sandbox on this kernel does not have."""
    lacks = []
    if not found.filters:
        lacks.append(
            "the kernel has no filter of system calls (seccomp): the agent may use key rings, trace its own user's "
            "processes and try every call of the kernel"
        )
    if found.landlock < ABI_OF_SCOPES:
        has = f"version {found.landlock} of Landlock" if found.landlock else "no Landlock"
        lacks.append(
            f"the kernel has {has}, and scopes begin with version {ABI_OF_SCOPES} (Linux 6.12): the agent may reach "
            "programs that listen at abstract Unix sockets"
        )
    return tuple(lacks)
