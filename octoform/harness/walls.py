"""What the kernel contributes to an agent's sandbox, and what a sandbox on a kernel without it does not hold.

Namespaces and bind mounts are tried out as a whole (`sandbox.available`). The filter of system calls and the scopes of
Landlock are put on by the first program inside, which goes on without where the kernel has none.
"""

import ctypes
import errno
import sys
from dataclasses import dataclass

_PR_SET_SECCOMP, _SECCOMP_MODE_FILTER = 22, 2
_LANDLOCK_CREATE, _LANDLOCK_VERSION = 444, 1
ABI_OF_SCOPES = 6


@dataclass(frozen=True, slots=True)
class Kernel:
    """Whether it filters system calls (seccomp), and the version of its Landlock, 0 for none."""

    filters: bool
    landlock: int


def kernel() -> Kernel:
    """What this machine's kernel has; asked without changing anything for this process."""
    if sys.platform != "linux":
        return Kernel(False, 0)
    libc = ctypes.CDLL(None, use_errno=True)
    # No filter lies at this address: a kernel that could take one says so (EFAULT), one without knows no such mode.
    libc.prctl(_PR_SET_SECCOMP, _SECCOMP_MODE_FILTER, None, 0, 0)
    filters = ctypes.get_errno() in (errno.EFAULT, errno.EACCES)
    version = libc.syscall(_LANDLOCK_CREATE, None, ctypes.c_size_t(0), ctypes.c_uint32(_LANDLOCK_VERSION))
    return Kernel(filters, max(0, version))


def missing(found: Kernel) -> tuple[str, ...]:
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
