"""Loads what scripts of one purpose import, once, and runs them as forks of itself.

Run as ``python -I fork_server.py FD PURPOSE``, where FD is a socket (SOCK_SEQPACKET) and PURPOSE is ``servers`` (what
every server and every client imports) or ``pictures``. It sends ``ready`` there once it has loaded, which also leaves
the bytecode for every later start. An order is one JSON object ``{"argv": ["script.py", "..."], "cwd": "...",
"environ": {...}}`` with four descriptors: an answer socket, and the script's standard streams. The answers are the id
of the fork together with a descriptor of it (pidfd_open(2)), and its exit status once it has ended; the fork begins
when a byte is sent to the answer socket. This process ends with the socket FD, and after a minute in which there is
nothing to do.
"""

import gc
import importlib
import json
import os
import runpy
import selectors
import signal
import socket
import sys
import traceback
from contextlib import suppress
from pathlib import Path

LARGEST = 1 << 20
IDLE_SECONDS = 60.0
STREAMS = 3


def load(purpose: str) -> None:
    """Import it. A collection would find no garbage in what stays, neither now nor in a fork, which it would copy."""
    gc.disable()
    if purpose == "pictures":
        load_pictures()
    else:
        load_servers()
    gc.freeze()
    gc.enable()


def load_servers() -> None:
    """FastMCP, and what it imports late: what reads the docstring of a tool, and what an event loop needs."""
    import anyio
    import jsonschema  # noqa: F401
    from fastmcp import Client, FastMCP  # noqa: F401

    server = FastMCP("loaded")
    server.tool(described)
    anyio.run(server.list_tools)


def load_pictures() -> None:
    """The library with which picture.py looks: the first that is here."""
    for names in (("PIL.Image", "PIL.ImageChops", "PIL.ImageFilter", "PIL.ImageStat"), ("cv2",)):
        with suppress(ImportError):
            for name in names:
                importlib.import_module(name)
            return


def described(value: int = 0) -> dict[str, int]:
    """Give a value back.

    Args:
        value: The value.

    """
    return {"value": value}


def serve(orders: socket.socket) -> None:
    """Fork for each order until no client is left, or nothing to do."""
    with selectors.DefaultSelector() as selector:
        selector.register(orders, selectors.EVENT_READ)
        while True:
            ready = selector.select(IDLE_SECONDS)
            if not ready and len(selector.get_map()) == 1:
                return
            for key, _ in ready:
                if key.data:
                    selector.unregister(key.fd)
                    os.close(key.fd)
                    report(*key.data)
                    continue
                order, descriptors, _, _ = socket.recv_fds(orders, LARGEST, 1 + STREAMS)
                if not order:
                    return
                pid, answers = fork(json.loads(order), descriptors)
                if pid:
                    pidfd = os.pidfd_open(pid)
                    with suppress(BrokenPipeError):  # who ordered it has gone, and the fork sees the same
                        socket.send_fds(answers, [str(pid).encode()], [pidfd])
                    selector.register(pidfd, selectors.EVENT_READ, (pid, answers))


def fork(order: dict[str, object], descriptors: list[int]) -> tuple[int, socket.socket]:
    """The new process and the socket for its answers; (0, _) where there is no other process to be had."""
    answers = socket.socket(fileno=descriptors[0])
    try:
        pid = os.fork()
    except OSError as problem:
        answers.send(f"- {problem.errno}".encode())
        pid = 0
        answers.close()
    else:
        if not pid:
            become(order, answers, descriptors[1:])
    for descriptor in descriptors[1:]:
        os.close(descriptor)
    return pid, answers


def report(pid: int, answers: socket.socket) -> None:
    """Report how a fork has ended."""
    status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    with answers, suppress(BrokenPipeError):  # who ordered it waited no longer
        answers.send(str(status).encode())


def become(order: dict[str, object], answers: socket.socket, streams: list[int]) -> None:
    """In the fork: take on streams, folder, environment and arguments as a new program has them; run the script."""
    status = 1
    try:
        os.setsid()
        signal.signal(signal.SIGINT, signal.default_int_handler)
        if not answers.recv(1):
            os._exit(status)
        for number, descriptor in enumerate(streams):
            os.dup2(descriptor, number)
        # The orders are nothing for a script: what it started through them would bear no mark.
        os.closerange(STREAMS, 1 + max(int(entry.name) for entry in Path("/proc/self/fd").iterdir()))
        environ, argv = order["environ"], order["argv"]
        assert isinstance(environ, dict) and isinstance(argv, list)
        os.environ.clear()
        os.environ.update(environ)
        os.chdir(str(order["cwd"]))
        sys.argv = argv
        runpy.run_path(argv[0], run_name="__main__")
        status = 0
    except SystemExit as left:
        status = left.code if isinstance(left.code, int) else int(left.code is not None)
        if isinstance(left.code, str):
            print(left.code, file=sys.stderr)
    except BaseException:  # noqa: BLE001 - the end of a program: what is raised goes to stderr
        traceback.print_exc()
    finally:
        with suppress(OSError):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(status)


def main() -> None:
    """Load, say so, serve."""
    orders = socket.socket(fileno=int(sys.argv[1]))
    load(sys.argv[2])
    orders.send(b"ready")
    serve(orders)
    os._exit(0)  # there is nothing to put in order, and to take apart what is loaded takes a while


if __name__ == "__main__":
    main()
