"""The first program in an agent's sandbox: it gives up what the agent may not have, and becomes the agent.

Started as ``python -I -S sandbox_entry.py FILTER USER GROUP[,GROUP ...] FOLDER PROGRAM [ARGUMENT ...]``; USER is ``-``
for an agent that stays who it is, FILTER the system calls that are refused, in hexadecimal digits, FOLDER where the
agent begins, which is closed to everybody but the agent's user. For good it gets terminals
of its own, so that no one types or reads in the person's; it becomes that user; no socket without a file leads to
another program of the user; and the kernel refuses the calls of the filter. Older kernels lack some of this; what they
have holds. It uses the standard library alone, because that is all that is certain to be seen in there.
"""

import ctypes
import os
import sys
from pathlib import Path

SCRATCH = ("/tmp", "/var/tmp", "/dev/shm")
TERMINALS = b"/dev/pts"
_OWN = b"newinstance,ptmxmode=0666,mode=620"
_MS_NOSUID_NOEXEC = 2 | 8
_PR_SET_SECCOMP, _SECCOMP_MODE_FILTER = 22, 2
_PR_CAP_AMBIENT, _CLEAR_ALL = 47, 4
_LANDLOCK_CREATE, _LANDLOCK_RESTRICT = 444, 446
"""Numbers of the system calls, which are the same on every architecture."""
_ABI_OF_SCOPES = 6
_ABSTRACT_SOCKETS = 1


class _Program(ctypes.Structure):
    """`struct sock_fprog` of linux/filter.h."""

    _fields_ = (("count", ctypes.c_ushort), ("instructions", ctypes.c_char_p))


class _Ruleset(ctypes.Structure):
    """`struct landlock_ruleset_attr` of linux/landlock.h."""

    _fields_ = (("files", ctypes.c_uint64), ("network", ctypes.c_uint64), ("scopes", ctypes.c_uint64))


def own_terminals(libc: ctypes.CDLL) -> None:
    """Pseudo terminals of a set of their own in place of everybody's; where that is refused they stay."""
    if Path(os.fsdecode(TERMINALS)).is_dir():
        libc.mount(b"devpts", TERMINALS, b"devpts", _MS_NOSUID_NOEXEC, _OWN)


def become(uid: int, groups: list[int]) -> None:
    """Be that user for good: with the last id goes every capability."""
    for name in SCRATCH:
        folder = Path(name)
        if os.access(folder, os.W_OK) and folder.stat().st_uid == os.geteuid():
            folder.chmod(0o1777)
    os.setgroups(groups)
    os.setresgid(groups[0], groups[0], groups[0])
    os.setresuid(uid, uid, uid)


def close_sockets_without_files(libc: ctypes.CDLL) -> None:
    """Only what is started in here is reached by a name of no file (landlock(7), scopes): displays, buses, daemons."""
    if libc.syscall(_LANDLOCK_CREATE, None, ctypes.c_size_t(0), ctypes.c_uint32(1)) < _ABI_OF_SCOPES:
        return
    wanted = _Ruleset(0, 0, _ABSTRACT_SOCKETS)
    size = ctypes.c_size_t(ctypes.sizeof(wanted))
    rules = libc.syscall(_LANDLOCK_CREATE, ctypes.byref(wanted), size, ctypes.c_uint32(0))
    if rules >= 0:
        libc.syscall(_LANDLOCK_RESTRICT, rules, ctypes.c_uint32(0))
        os.close(rules)


def refuse_calls(libc: ctypes.CDLL, program: bytes) -> None:
    """Have the kernel refuse the calls of a compiled filter, here and in all that is started from here."""
    given = _Program(len(program) // 8, program)
    libc.prctl(_PR_SET_SECCOMP, _SECCOMP_MODE_FILTER, ctypes.byref(given), 0, 0)


def main(arguments: list[str]) -> None:
    """Give up, become and run; OSError where the user cannot be had or the program not be started."""
    libc = ctypes.CDLL(None)
    own_terminals(libc)
    # An ordinary user's capability for that goes with the next program, unless it is passed on.
    libc.prctl(_PR_CAP_AMBIENT, _CLEAR_ALL, 0, 0, 0)
    if arguments[1] != "-":
        become(int(arguments[1]), [int(group) for group in arguments[2].split(",")])
    close_sockets_without_files(libc)
    refuse_calls(libc, bytes.fromhex(arguments[0]))
    os.chdir(arguments[3])
    os.execvp(arguments[4], arguments[4:])


if __name__ == "__main__":
    main(sys.argv[1:])
