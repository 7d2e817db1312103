"""The workers of a daemon that is a fork of the loaded command line (see `warm`): forks as well, and all else as it is.

A worker is a child of its daemon, which waits for it and whose end it follows. What forks here is therefore a child of
the daemon that begins before the daemon has threads, and its forks have the daemon for their parent (CLONE_PARENT of
clone(2)). They read the job, and end, as the program that a daemon starts.
"""

import ctypes
import json
import os
import socket
import subprocess
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any, NoReturn

from octoform.daemon.repair import worker
from octoform.endpoint.bounded_program import ForkServer

LARGEST = 1 << 20
_CLONE = {"x86_64": 56, "aarch64": 220}
_CLONE_PARENT, _SIGCHLD = 0x8000, 17
Become = Callable[..., None]


def install(become: Become) -> None:
    """In a daemon that has not begun yet; on a machine whose clone(2) is not known here it starts programs."""
    number = _CLONE.get(os.uname().machine)
    if number is None:
        return
    mine, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    if not os.fork():
        mine.close()
        _fork_each(its, number, become)
    its.close()

    class Worker(subprocess.Popen[bytes]):
        def _execute_child(self, args: Sequence[str], *more: Any) -> None:
            cwd, environ = more[4:6]
            feed, _, _, out, _, err = more[9:15]  # both ends of each stream, of which only the child's are there
            order = {"argv": list(args), "cwd": str(cwd), "environ": environ, "said": ""}
            socket.send_fds(mine, [json.dumps(order).encode()], [feed, out, err])
            self.pid = int(mine.recv(64))
            self._child_created = True

    ports: Any = worker
    ports.subprocess = SimpleNamespace(Popen=Worker, TimeoutExpired=subprocess.TimeoutExpired)


def _fork_each(orders: socket.socket, number: int, become: Become) -> NoReturn:
    """Fork for each order until the daemon has ended."""
    python = ctypes.PyDLL(None)
    flags = [ctypes.c_long(value) for value in (number, _CLONE_PARENT | _SIGCHLD, 0, 0, 0, 0)]
    while True:
        order, streams, _, _ = socket.recv_fds(orders, LARGEST, 3)
        if not order:
            os._exit(0)
        python.PyOS_BeforeFork()
        pid = python.syscall(*flags)
        if not pid:
            python.PyOS_AfterFork_Child()
            _work(json.loads(order), streams, become)
        python.PyOS_AfterFork_Parent()
        for descriptor in streams:
            os.close(descriptor)
        orders.send(str(pid).encode())


def _work(order: Mapping[str, object], streams: Sequence[int], become: Become) -> NoReturn:
    """Be a worker."""
    status = 1
    try:
        os.setsid()
        os.dup2(streams[0], 0)
        become(order, *streams[1:], *(server._orders.fileno() for server in ForkServer._kept.values()))
        sys.stdin = open(0, encoding="utf-8", closefd=False)  # noqa: SIM115
        status = worker.main()
    except BaseException:  # noqa: BLE001 - the end of a program: what is raised goes to stderr
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
