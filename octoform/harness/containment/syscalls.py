"""The system calls that no confined agent needs, as the program by which the kernel refuses them (seccomp(2)).

Namespaces and file modes decide what an agent reaches through files. They leave what is reached without one: the key
rings of the user's session, the memory of other processes of the user, keystrokes put into a terminal, a machine's
host behind a virtual one; and the parts of the kernel by which a sandbox is usually left. The numbers are those of the
kernel's own tables (arch/*/entry/syscalls, asm-generic/unistd.h); from 424 on all architectures count alike.
"""

import errno
import struct
from collections.abc import Iterator, Mapping

_LOAD, _EQUAL, _AT_LEAST, _ANY_BIT, _JUMP, _RETURN = 0x20, 0x15, 0x35, 0x45, 0x05, 0x06
_ALLOW, _ERRNO = 0x7FFF0000, 0x00050000
_NUMBER, _ARCHITECTURE, _FIRST, _SECOND = 0, 4, 16, 24
"""Places in `struct seccomp_data`; of an argument its lower half, in which the kernel itself looks for these."""
_X32 = 0x40000000
"""Begins the numbers of a second table of x86-64, by which every rule could be gone around."""
_NAMESPACES = 0x7E020000
_TIOCSTI, _TIOCLINUX = 0x5412, 0x541C
_AF_VSOCK = 40

_COMMON = {
    **{"io_uring_setup": 425, "io_uring_enter": 426, "io_uring_register": 427, "open_tree": 428, "move_mount": 429},
    **{"fsopen": 430, "fsconfig": 431, "fsmount": 432, "fspick": 433, "pidfd_getfd": 438, "mount_setattr": 442},
    "open_tree_attr": 467,
}
_CLONE3 = 435

_X86_64 = {
    **{"ptrace": 101, "process_vm_readv": 310, "process_vm_writev": 311, "kcmp": 312, "perf_event_open": 298},
    **{"add_key": 248, "request_key": 249, "keyctl": 250, "bpf": 321, "userfaultfd": 323, "acct": 163},
    **{"unshare": 272, "setns": 308, "mount": 165, "umount2": 166, "pivot_root": 155, "chroot": 161},
    **{"name_to_handle_at": 303, "open_by_handle_at": 304, "swapon": 167, "swapoff": 168, "reboot": 169},
    **{"kexec_load": 246, "kexec_file_load": 320, "init_module": 175, "finit_module": 313, "delete_module": 176},
    **{"iopl": 172, "ioperm": 173},
}
_I386 = {
    **{"ptrace": 26, "process_vm_readv": 347, "process_vm_writev": 348, "kcmp": 349, "perf_event_open": 336},
    **{"add_key": 286, "request_key": 287, "keyctl": 288, "bpf": 357, "userfaultfd": 374, "acct": 51},
    **{"unshare": 310, "setns": 346, "mount": 21, "umount": 22, "umount2": 52, "pivot_root": 217, "chroot": 61},
    **{"name_to_handle_at": 341, "open_by_handle_at": 342, "swapon": 87, "swapoff": 115, "reboot": 88},
    **{"kexec_load": 283, "init_module": 128, "finit_module": 350, "delete_module": 129, "iopl": 110, "ioperm": 101},
}
_ARM = {
    **{"ptrace": 26, "process_vm_readv": 376, "process_vm_writev": 377, "kcmp": 378, "perf_event_open": 364},
    **{"add_key": 309, "request_key": 310, "keyctl": 311, "bpf": 386, "userfaultfd": 388, "acct": 51},
    **{"unshare": 337, "setns": 375, "mount": 21, "umount2": 52, "pivot_root": 218, "chroot": 61},
    **{"name_to_handle_at": 370, "open_by_handle_at": 371, "swapon": 87, "swapoff": 115, "reboot": 88},
    **{"kexec_load": 347, "kexec_file_load": 401, "init_module": 128, "finit_module": 379, "delete_module": 129},
}
_GENERIC = {
    **{"ptrace": 117, "process_vm_readv": 270, "process_vm_writev": 271, "kcmp": 272, "perf_event_open": 241},
    **{"add_key": 217, "request_key": 218, "keyctl": 219, "bpf": 280, "userfaultfd": 282, "acct": 89},
    **{"unshare": 97, "setns": 268, "mount": 40, "umount2": 39, "pivot_root": 41, "chroot": 51},
    **{"name_to_handle_at": 264, "open_by_handle_at": 265, "swapon": 224, "swapoff": 225, "reboot": 142},
    **{"kexec_load": 104, "kexec_file_load": 294, "init_module": 105, "finit_module": 273, "delete_module": 106},
}
TABLES: Mapping[int, tuple[Mapping[str, int], int, int, int]] = {
    0xC000003E: (_X86_64, 56, 16, 41),
    0x40000003: (_I386, 120, 54, 359),
    0xC00000B7: (_GENERIC, 220, 29, 198),
    0xC00000F3: (_GENERIC, 220, 29, 198),
    0x40000028: (_ARM, 120, 54, 281),
}
"""By the kernel's name of the architecture (linux/audit.h): what is refused, and the numbers of clone, ioctl, socket.

x86-64, i386, arm64, riscv64, arm.
"""


def program() -> bytes:
    """The filter for all architectures, as an array of `struct sock_filter`; another one's calls do not exist."""
    out: list[bytes] = [_do(_LOAD, _ARCHITECTURE)]
    for architecture, (refused, clone, ioctl, socket) in TABLES.items():
        block = list(_block({*refused.values(), *_COMMON.values()}, clone, ioctl, socket))
        out += [_do(_EQUAL, architecture, 1, 0), _do(_JUMP, len(block)), *block]
    return b"".join([*out, _fail(errno.ENOSYS)])


def _block(refused: set[int], clone: int, ioctl: int, socket: int) -> Iterator[bytes]:
    """The rules of one architecture; each ends with an answer, so that nothing goes on behind them."""
    yield _do(_LOAD, _NUMBER)
    yield from (_do(_AT_LEAST, _X32, 0, 1), _fail(errno.ENOSYS))
    # There is no looking into the memory that it points to; without it a C library takes the older call.
    yield from (_do(_EQUAL, _CLONE3, 0, 1), _fail(errno.ENOSYS))
    yield from _argument(clone, _FIRST, (_do(_ANY_BIT, _NAMESPACES, 0, 1), _fail(errno.EPERM)))
    typed = (_do(_EQUAL, _TIOCSTI, 1, 0), _do(_EQUAL, _TIOCLINUX, 0, 1), _fail(errno.EPERM))
    yield from _argument(ioctl, _SECOND, typed)
    yield from _argument(socket, _FIRST, (_do(_EQUAL, _AF_VSOCK, 0, 1), _fail(errno.EAFNOSUPPORT)))
    numbers = sorted(refused)
    for index, number in enumerate(numbers):
        yield _do(_EQUAL, number, len(numbers) - index, 0)
    yield _do(_RETURN, _ALLOW)
    yield _fail(errno.EPERM)


def _argument(number: int, place: int, rule: tuple[bytes, ...]) -> Iterator[bytes]:
    """A rule on one argument of one call; what it does not refuse is allowed."""
    yield _do(_EQUAL, number, 0, len(rule) + 2)
    yield from (_do(_LOAD, place), *rule, _do(_RETURN, _ALLOW))


def _fail(number: int) -> bytes:
    return _do(_RETURN, _ERRNO | number)


def _do(code: int, value: int, if_true: int = 0, if_false: int = 0) -> bytes:
    """One instruction; jumps count the instructions that are omitted."""
    return struct.pack("=HBBI", code, if_true, if_false, value)
