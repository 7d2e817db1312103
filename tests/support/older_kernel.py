"""A kernel that lacks something: ``older_kernel.py WITHOUT PROGRAM [ARGUMENT ...]`` runs a program that sees it so.

WITHOUT is ``landlock`` or ``seccomp``. The kernel itself refuses the calls, by a filter that is put on before.
"""

import ctypes
import errno
import os
import platform
import struct
import sys

PRCTL = {"x86_64": 157, "aarch64": 167, "riscv64": 167}
LANDLOCK = 444
SET_SECCOMP = 22
LOAD, EQUAL, RETURN = 0x20, 0x15, 0x06
ALLOW, REFUSE = 0x7FFF0000, 0x00050000


class Program(ctypes.Structure):
    _fields_ = (("count", ctypes.c_ushort), ("instructions", ctypes.c_char_p))


def do(code: int, value: int, if_true: int = 0, if_false: int = 0) -> bytes:
    return struct.pack("=HBBI", code, if_true, if_false, value)


def rules(without: str) -> bytes:
    if without == "landlock":
        lines = [do(LOAD, 0), do(EQUAL, LANDLOCK, 0, 1), do(RETURN, REFUSE | errno.ENOSYS), do(RETURN, ALLOW)]
        return b"".join(lines)
    number = PRCTL[platform.machine()]
    lines = [do(LOAD, 0), do(EQUAL, number, 0, 3), do(LOAD, 16), do(EQUAL, SET_SECCOMP, 0, 1)]
    return b"".join([*lines, do(RETURN, REFUSE | errno.EINVAL), do(RETURN, ALLOW)])


def main() -> None:
    given = rules(sys.argv[1])
    libc = ctypes.CDLL(None, use_errno=True)
    libc.prctl(38, 1, 0, 0, 0)  # PR_SET_NO_NEW_PRIVS, which a filter needs without root
    program = Program(len(given) // 8, given)
    if libc.prctl(SET_SECCOMP, 2, ctypes.byref(program), 0, 0) != 0:
        raise OSError(ctypes.get_errno(), "no filter can be put on")
    os.execvp(sys.argv[2], sys.argv[2:])


if __name__ == "__main__":
    main()
