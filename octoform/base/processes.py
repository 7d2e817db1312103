"""Which process is meant, and the end of exactly that one: its line in /proc, and a mark that a whole run carries.

A process id alone names nothing: ids are recycled. A process is known by its id together with the tick at which the
kernel started it (proc(5), ``/proc/PID/stat``).

A variable in the environment is lost to a program that starts another with an empty one. So the mark of a run is also a
resource limit that Linux has not enforced since 2.4.25 (RLIMIT_LOCKS, setrlimit(2)): each process inherits it, whatever
it does with its parent, its session and its environment, and an ordinary user can lower it but not raise it, so no one
comes to bear the mark of another run. What root started outside of a sandbox can take the limit off. Standard library
only; where there is no /proc, nothing bears a mark and nothing is known of a process.
"""

import os
import re
import resource
import signal
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:  # who only asks what lives starts nothing
    import subprocess

_LIMIT = 10  # RLIMIT_LOCKS, asm-generic/resource.h; Python has no name for it
_DIGITS = 15
_TOP = 16**_DIGITS
_FORM = rf"[0-9a-f]{{{_DIGITS},}}"
PROC = Path("/proc")
_LIMIT_LINE = b"Max file locks"
_MAX_BYTES = 1 << 20
"""Read of an environment, which may be larger (execve(2)): the limit is there too."""
_PIECE = 1 << 15
"""Read at once: nearly every file of /proc is smaller, and room for a large one is new memory for each."""


def new(digits: int = 32) -> str:
    """A mark of so many hexadecimal digits, of which the first 15 are the limit: a number that this process may set."""
    hard = resource.getrlimit(_LIMIT)[1]
    top = _TOP if hard == resource.RLIM_INFINITY else min(hard, _TOP)
    # Room below it for the runs that this one starts, and enough above it that no two are the same.
    # Not of `secrets`, which loads OpenSSL: a sixth of what a small program takes to start.
    number = top // 4 + int.from_bytes(os.urandom(16)) % max(1, top // 4)
    return f"{number:0{_DIGITS}x}{os.urandom(digits).hex()}"[:digits]


def put_on(mark: str, pid: int = 0) -> bool:
    """Give a process of this user (0: this one) the mark as its limit; what it starts from now on inherits it.

    False when the process is gone, or when this system or a lower limit does not allow it.
    """
    number = _number(mark)
    if number is None:
        return False
    try:
        resource.prlimit(pid, _LIMIT, (number, number))
    except (OSError, ValueError, AttributeError):
        return False
    return True


def bears(pid: int, mark: str, variable: str) -> bool:
    """Whether a process has the mark as its limit, or in the environment that it was started with."""
    number = _number(mark)
    if number is not None and _limit(pid) == number:
        return True
    sought, environ = f"{variable}={mark}".encode(), _read(pid, "environ")
    return sought in environ and sought in environ.split(b"\0")


def _number(mark: str) -> int | None:
    """None for what is no mark: a record may have been damaged."""
    return int(mark[:_DIGITS], 16) if re.fullmatch(_FORM, mark) else None


def _limit(pid: int) -> int | None:
    """Its hard limit; None where there is none, or the process is gone."""
    try:
        hard = resource.prlimit(pid, _LIMIT)[1]
    except ProcessLookupError:
        return None
    except (OSError, AttributeError):  # another user's, whose limits prlimit(2) refuses, and proc(5) shows
        return _limit_shown(pid)
    return None if hard == resource.RLIM_INFINITY else hard


def _limit_shown(pid: int) -> int | None:
    """The same from /proc/<pid>/limits."""
    for line in _read(pid, "limits").splitlines():
        if line.startswith(_LIMIT_LINE):
            hard = line[len(_LIMIT_LINE) :].split()[1]
            return int(hard) if hard.isdigit() else None
    return None


def _read(pid: int, name: str) -> bytes:
    try:
        return _whole(PROC, pid, name)
    except OSError:
        return b""


def _whole(proc: Path, pid: int, name: str) -> bytes:
    """A file of /proc, bounded. Hundreds are read at once, for which a stream and a path each would be too dear."""
    descriptor = os.open(f"{proc}/{pid}/{name}", os.O_RDONLY | os.O_CLOEXEC)
    try:
        found = b""
        while len(found) < _MAX_BYTES and (piece := os.read(descriptor, min(_PIECE, _MAX_BYTES - len(found)))):
            found += piece
        return found
    finally:
        os.close(descriptor)


class ProcessStat(NamedTuple):
    """State (one letter), ids of parent and group, number of threads, start in clock ticks since boot."""

    state: str
    parent: int
    group: int
    threads: int
    start: int

    @property
    def is_over(self) -> bool:
        """Whether it has ended, and only its parent has not asked for its status yet (a zombie)."""
        return self.state in "ZX"

    @property
    def is_stopped(self) -> bool:
        """Whether it stands still because of a signal or a debugger."""
        return self.state in "Tt"


def process_stat(pid: int, proc: Path = PROC) -> ProcessStat | None:
    """The present facts of a process; None when there is none, or where there is no /proc."""
    try:
        text = _whole(proc, pid, "stat").decode(errors="replace")
        # The command name is in parentheses and may hold anything, parentheses and blanks too.
        fields = text[text.rindex(")") + 2 :].split()
        return ProcessStat(fields[0], int(fields[1]), int(fields[2]), int(fields[17]), int(fields[19]))
    except (OSError, ValueError, IndexError):
        return None


def start_of(pid: int, proc: Path = PROC) -> int | None:
    """When a process started, in clock ticks since boot; None when it is gone, a zombie, or /proc is not there."""
    found = process_stat(pid, proc)
    return None if found is None or found.is_over else found.start


def is_alive(pid: int, start: int | None, proc: Path = PROC) -> bool:
    """Whether exactly that process still runs: a zombie does not, and neither does another one with its id."""
    return start is not None and start_of(pid, proc) == start


def command_line(pid: int, proc: Path = PROC) -> tuple[str, ...]:
    """The arguments that a process was started with; empty when it is gone."""
    try:
        data = (proc / str(pid) / "cmdline").read_bytes()
    except OSError:
        return ()
    return tuple(os.fsdecode(word) for word in data.split(b"\0")[:-1])


def signal_one(pid: int, start: int | None, number: int = signal.SIGKILL) -> bool:
    """Send a signal to exactly that process; False when it is gone, is another one by now, or may not be signalled.

    Its id may be recycled between a look and a signal, so the look is at a process that is held already (pidfd).
    """
    try:
        handle = os.pidfd_open(pid)
    except OSError:
        return False
    try:
        if not is_alive(pid, start):
            return False
        signal.pidfd_send_signal(handle, number)
    except OSError:
        return False
    finally:
        os.close(handle)
    return True


def signal_group(leader: "subprocess.Popen[bytes]", number: int = signal.SIGKILL) -> None:
    """Send a signal to the process group that a child of ours leads, as long as the child was not waited for.

    Until then its id, which is that of the group, cannot be another's.
    """
    if leader.returncode is None:
        try:
            os.killpg(leader.pid, number)
        except ProcessLookupError:
            return
