"""The end of the endpoint's process, told by the kernel at the moment at which it happens. (Light.)

A process descriptor names one process for ever, so that a pid that was given again is never taken for it.
"""

import os
from contextlib import suppress

from octoform.daemon.model import Cause
from octoform.endpoint.process.record import Running, is_it

_ENDED = frozenset((Cause.PROCESS,))


class ProcessEar:
    """Listens to one process at a time."""

    hold = 0.0
    every = None

    def __init__(self) -> None:
        self._process: Running | None = None
        self._handle: int | None = None

    def follow(self, process: Running | None) -> bool:
        """Listen to this process from now on; False when it has ended already, and nobody will be told of it."""
        if process == self._process and self._handle is not None:
            return True
        self._release()
        self._process = process
        if process is None:
            return True
        try:
            self._handle = os.pidfd_open(process.pid)
        except OSError:
            return False
        if is_it(process):
            return True
        self._release()
        return False

    def fileno(self) -> int | None:
        """Readable once the process has ended."""
        return self._handle

    def hear(self) -> frozenset[Cause]:
        """That it has ended; said once."""
        if self._handle is not None:
            with suppress(OSError):  # mostly it is nobody's child, or another's
                os.waitid(os.P_PIDFD, self._handle, os.WEXITED | os.WNOHANG)
        self._release()
        return _ENDED

    def close(self) -> None:
        """Let go of the process, which goes on."""
        self._release()

    def _release(self) -> None:
        if self._handle is not None:
            os.close(self._handle)
        self._handle = self._process = None
