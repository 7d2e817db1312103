"""The supervisor process between octoform and an agent: no process of the agent's tree outlives it.

Killing a process group does not end what moved to a session of its own, and nothing that octoform does in its own
process helps when octoform itself is killed. So every agent runs below this one small program, which has a process of
its own (`contained_run`). It uses the standard library alone and few modules of it, because it starts at every attempt;
it is a *child subreaper*, so that each orphan of the tree becomes its child and "no children left" is the proof that
nothing runs on.

Arguments: ``REPORT_FD CONTROL_FD WALL_SECONDS GRACE_SECONDS FILE_BYTES PROGRAM [ARGUMENT ...]``. The agent is started
when a byte arrives on the control descriptor. The tree is ended (SIGTERM, then SIGKILL) when the agent has ended, when
the wall limit has passed, on a second byte, on SIGTERM, or when the control descriptor closes, which is how the death
of octoform shows on every system; on Linux the kernel's parent-death signal states the same. One JSON line on the
report descriptor shows how it went. Where there is no subreaper (not Linux) only the agent's process group is ended,
and the report states that.
"""

import ctypes
import os
import resource
import select
import sys
import time

TYPE_CHECKING = False  # not that of `typing`, which takes longer than all the rest
if TYPE_CHECKING:
    import signal
else:
    import _signal as signal  # `signal` makes enumerations of its numbers, which takes a third of a start

PR_SET_PDEATHSIG = 1
PR_SET_CHILD_SUBREAPER = 36
STEP_SECONDS = 0.02
HASTE_SECONDS = 0.5
KILL_LIMIT_SECONDS = 10.0
SNATCHES = 200
STOP_SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)


class Bell:
    """One descriptor that becomes readable at any signal, and the control descriptor beside it."""

    def __init__(self, control: int) -> None:
        self.stopped = False
        self.control: int | None = control
        self.wake, writer = os.pipe()
        os.set_blocking(self.wake, False)
        os.set_blocking(writer, False)
        signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
        for number in (*STOP_SIGNALS, signal.SIGCHLD):
            signal.signal(number, self._ring)

    def _ring(self, number: int, _frame: object) -> None:
        """Without a handler a signal would not reach the wake-up descriptor at all."""
        self.stopped = self.stopped or number in STOP_SIGNALS

    def wait(self, seconds: float) -> bytes:
        """Sleep until a signal, a byte on the control descriptor (returned) or its end, or the time is over."""
        watched = [self.wake] if self.control is None else [self.wake, self.control]
        ready, _, _ = select.select(watched, [], [], max(0.0, seconds))
        if self.wake in ready:
            os.read(self.wake, 4096)
        if self.control is not None and self.control in ready:
            data = os.read(self.control, 64)
            if not data:
                self.control = None
            return data
        return b""

    @property
    def orphaned(self) -> bool:
        """True once octoform's end of the control pipe is closed."""
        return self.control is None


class Tree:
    """The facts of the agent's processes: the agent's own status, and the resources of all that were reaped."""

    def __init__(self, agent: int, contained: bool) -> None:
        self.agent = agent
        self.contained = contained
        self.status: int | None = None
        self.cpu_seconds = 0.0
        self.peak_rss = 0
        self.signalled: set[int] = set()

    def reap(self) -> bool:
        """Collect every child that has ended; False when there is no child left at all."""
        while True:
            try:
                pid, status, used = os.wait4(-1, os.WNOHANG)
            except ChildProcessError:
                return False
            if pid == 0:
                return True
            self.cpu_seconds += used.ru_utime + used.ru_stime
            self.peak_rss = max(self.peak_rss, used.ru_maxrss)
            if pid == self.agent:
                self.status = os.waitstatus_to_exitcode(status)

    def living(self) -> set[int]:
        """Every process below this one that the system shows now."""
        if self.contained:
            return _descendants(os.getpid())
        return {self.agent} if self.status is None else set()

    def end(self, grace: float, bell: Bell) -> int:
        """SIGTERM to all, SIGKILL to those that stay, until no child is left; how many could not be ended."""
        kill_at = time.monotonic() + grace
        give_up_at = kill_at + KILL_LIMIT_SECONDS
        while self.reap():
            now = time.monotonic()
            if now > give_up_at:
                return len(self.living())
            if now >= kill_at:
                self._snatch()
            fresh = self._signal(signal.SIGTERM if now < kill_at else signal.SIGKILL)
            # A tree that makes new processes faster than it is read must find no pause to do so.
            if not (fresh and now >= kill_at):
                bell.wait(STEP_SECONDS)
        return 0

    def _snatch(self) -> None:
        """SIGKILL to the children, quicker than one of them can become another process by forking and leaving."""
        for _ in range(SNATCHES):
            found = children()
            if not found:
                return
            self.signalled |= found
            for pid in found:
                _send(pid, signal.SIGKILL)
            self.reap()

    def _signal(self, number: int) -> bool:
        """Send it to each (SIGTERM only once); True when a process was met for the first time."""
        living = self.living()
        fresh = living - self.signalled
        self.signalled |= living
        for pid in living if number == signal.SIGKILL else fresh:
            _send(pid, number)
        if not self.contained:
            _send(-self.agent, number)
        return bool(fresh)

    @property
    def survivors(self) -> int:
        """How many processes besides the agent itself had to be signalled."""
        return len(self.signalled - {self.agent})


def _send(pid: int, number: int) -> None:
    try:
        os.kill(pid, number)
    except (ProcessLookupError, PermissionError):
        # Gone meanwhile; or it changed its user, and then the report counts it as remaining.
        return


def children() -> set[int]:
    """The children of this process, zombies too, without a look at all others; none where the kernel has no list."""
    listed = [b""]
    try:
        tasks = [task.path for task in os.scandir("/proc/self/task")]
    except OSError:
        return set()
    for task in tasks:
        try:
            handle = os.open(f"{task}/children", os.O_RDONLY)
            try:
                while piece := os.read(handle, 1 << 16):
                    listed.append(piece)
                listed.append(b" ")
            finally:
                os.close(handle)
        except OSError:
            continue  # a thread that has just ended, whose children another one has now; or no such list
    return set(map(int, b"".join(listed).split()))


def _descendants(root: int) -> set[int]:
    """All processes below ``root``, from one pass over /proc: the parent in each stat line."""
    children: dict[int, list[int]] = {}
    for entry in os.scandir("/proc"):
        if entry.name.isdigit():
            parent = _parent_of_living(entry.name)
            if parent is not None:
                children.setdefault(parent, []).append(int(entry.name))
    found: set[int] = set()
    pending = [root]
    while pending:
        below = children.get(pending.pop(), [])
        found.update(below)
        pending.extend(below)
    return found


def _parent_of_living(pid: str) -> int | None:
    """The parent's id from /proc/<pid>/stat; None for a process that is gone or a zombie."""
    try:
        handle = os.open(f"/proc/{pid}/stat", os.O_RDONLY)
    except OSError:
        return None
    try:
        text = os.read(handle, 1024)
    except OSError:
        return None
    finally:
        os.close(handle)
    # The command name is in parentheses and may hold anything, parentheses and blanks too.
    fields = text[text.rfind(b")") + 2 :].split()
    # A zombie with threads is a process whose first thread has ended: the others still run.
    if fields[0] in (b"Z", b"X") and int(fields[17]) <= 1:
        return None
    return int(fields[1])


def prctl(option: int, value: int) -> bool:
    """prctl(2) where there is one; False when the system has none or refuses."""
    if sys.platform != "linux":
        return False
    return bool(ctypes.CDLL(None).prctl(option, value, 0, 0, 0) == 0)


def _start(arguments: list[str], file_bytes: int) -> tuple[int, int]:
    """Fork and execute the agent in a session of its own: (pid, 0), or (pid of the dead child, errno)."""
    reader, writer = os.pipe()
    me = os.getpid()
    try:
        pid = os.fork()
    except OSError as problem:
        os.close(reader)
        os.close(writer)
        return 0, problem.errno or 1
    if pid == 0:
        _become_agent(arguments, file_bytes, me, writer)
    os.close(writer)
    found = os.read(reader, 16)
    os.close(reader)
    return pid, int(found or b"0")


def _become_agent(arguments: list[str], file_bytes: int, supervisor: int, failure: int) -> None:
    """The child's side of the fork; never returns."""
    number = 0
    try:
        signal.set_wakeup_fd(-1)
        for name in (*STOP_SIGNALS, signal.SIGCHLD, signal.SIGPIPE, signal.SIGXFSZ):
            signal.signal(name, signal.SIG_DFL)
        os.setsid()
        prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() == supervisor:
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            resource.setrlimit(resource.RLIMIT_FSIZE, (file_bytes, file_bytes))
            _first_to_go()
            os.execvp(arguments[0], arguments)
    except OSError as problem:
        number = problem.errno or 1
    except ValueError:
        number = 22
    finally:
        os.write(failure, str(number).encode("ascii"))
        os._exit(127)


def _first_to_go() -> None:
    """When memory runs out, the kernel shall end the agent and not octoform or the owner's own work."""
    try:
        descriptor = os.open("/proc/self/oom_score_adj", os.O_WRONLY)
    except OSError:
        return  # no such file on this system: the kernel decides as it does for everybody
    try:
        os.write(descriptor, b"500")
    finally:
        os.close(descriptor)


def _supervise(tree: Tree, wall: float, bell: Bell) -> str:
    """Wait for the agent's end, the limit, an order, a stop or the death of octoform; which of them it was."""
    deadline = time.monotonic() + wall
    while True:
        tree.reap()
        if tree.status is not None:
            return "ended"
        if bell.stopped:
            return "stopped"
        if bell.orphaned:
            return "orphaned"
        left = deadline - time.monotonic()
        if left <= 0:
            return "wall"
        if bell.wait(left):
            return "ordered"


def _report(descriptor: int, **fields: object) -> None:
    """One JSON line; every value is a number, null or a word of ours, so it needs no encoder."""
    shown = []
    for name, value in fields.items():
        text = f'"{value}"' if isinstance(value, str) else "null" if value is None else str(value)
        shown.append(f'"{name}":{text}')
    line = "{" + ",".join(shown) + "}\n"
    try:
        os.write(descriptor, line.encode("ascii"))
    except BrokenPipeError:
        return  # octoform is gone: no reader is left


def main(arguments: list[str]) -> int:
    """Run the agent as the arguments say; 0 when the tree is gone, 1 when something of it remains."""
    report, control = int(arguments[0]), int(arguments[1])
    wall, grace, file_bytes = float(arguments[2]), float(arguments[3]), int(arguments[4])
    for descriptor in (report, control):
        os.set_inheritable(descriptor, False)
    contained = prctl(PR_SET_CHILD_SUBREAPER, 1)
    # It watches the thread that started us; that thread waits for our end, so it cannot be gone before the process.
    prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    bell = Bell(control)
    while not bell.wait(wall):
        if bell.stopped or bell.orphaned:
            return 0
    started = time.monotonic()
    agent, failure = _start(arguments[5:], file_bytes)
    tree = Tree(agent, contained)
    reason = _supervise(tree, wall, bell)
    remaining = tree.end(min(grace, HASTE_SECONDS) if reason in ("orphaned", "stopped") else grace, bell)
    _report(
        report,
        reason="not_started" if failure else reason,
        errno=failure,
        status=tree.status,
        seconds=round(time.monotonic() - started, 4),
        cpu_seconds=round(tree.cpu_seconds, 4),
        peak_rss=tree.peak_rss,
        survivors=tree.survivors,
        remaining=remaining,
        containment="subreaper" if contained else "process_group",
    )
    return 1 if remaining else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
