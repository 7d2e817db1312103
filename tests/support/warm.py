"""Runs the command line without the second that loading it takes: each run is a fork of a loaded process.

The forked process is octoform as a shell would start it: own folder, environment, streams and exit. Tests run it some
hundred times, also from several threads, and have it on a terminal of its own. What else a test starts and leaves
running, or sends signals to, is started as a new program instead. A program of Python beside octoform (``.py``) can be
run in the same way.
"""

import atexit
import contextlib
import fcntl
import gc
import importlib
import json
import os
import pkgutil
import re
import runpy
import selectors
import socket
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path

import lasting_fork_server
import worker_forks
from pydantic import BaseModel
from shared_fork_servers import SharedForkServer

import octoform
from octoform.base import processes
from octoform.endpoint import bounded_program
from octoform.endpoint.bounded_program import ForkServer
from octoform.endpoint.client.sdk_client import recorded_environment
from octoform.endpoint.environment.model import MARKER, at
from octoform.endpoint.process import start_stop
from octoform.endpoint.process.record import MARK
from octoform.endpoint.published_files import SERVE_SCRIPT, read_manifest
from octoform.manifest.profile_paths import shipped
from octoform.patterns import regex
from octoform.profiles import load as load_profiles
from octoform.protocol.prompt import _environment
from octoform.protocol.spec_loader import load as load_specs
from octoform.state.layout import Layout

LARGEST = 1 << 20
FORK_SERVER = bounded_program.SCRIPT
_ONE = threading.Lock()
_COPIED: dict[tuple[int, int], tuple[ForkServer, Path]] = {}
_ENDED: list[int] = []
"""In a fork that is done: its exit status."""


def run(
    program: Path,
    arguments: Sequence[str],
    cwd: Path,
    environ: Mapping[str, str],
    seconds: float,
    said: str = "",
    *,
    prefix: Sequence[str] = (),
    kept: bool = False,
) -> tuple[int, str, str]:
    """(exit status, what it printed, what it printed on stderr); killed, with TimeoutExpired, after so many seconds.

    ``said`` is what it reads on stdin, through a pipe. ``prefix`` is the command that starts the loaded process, as
    another user for example. Fork servers of the project's own environments end with the command, unless ``kept``.
    """
    words = [str(program), *arguments]
    order = json.dumps({"argv": words, "cwd": str(cwd), "environ": dict(environ), "said": said, "kept": kept}).encode()
    out, err = os.pipe(), os.pipe()
    with _sockets() as (mine, its):
        with _ONE:
            keeper = _keeper(*prefix)
        socket.send_fds(keeper, [order], [its.fileno(), out[1], err[1]])
        for descriptor in (its.detach(), out[1], err[1]):
            os.close(descriptor)
        pid = int(mine.recv(64))
        try:
            printed, complained = _read_all((out[0], err[0]), time.monotonic() + seconds)
            mine.settimeout(seconds)
            return int(mine.recv(64)), printed, complained
        except TimeoutError:
            os.kill(pid, 9)  # not reaped before its status was sent, so it is still this process
            raise subprocess.TimeoutExpired(words, seconds) from None


class Begun:
    """A run that goes on, in the form of `subprocess.Popen`."""

    def __init__(self, pid: int, its: socket.socket) -> None:
        self.pid = pid
        self._its = its
        self._status: int | None = None

    def wait(self, timeout: float) -> int:
        """Its status once it has ended; subprocess.TimeoutExpired when it has not in so many seconds."""
        if self._status is None:
            self._its.settimeout(timeout)
            try:
                self._status = int(self._its.recv(64))
            except (TimeoutError, BlockingIOError):
                raise subprocess.TimeoutExpired([str(self.pid)], timeout) from None
            self._its.close()
        return self._status

    def poll(self) -> int | None:
        """Its status; None while it goes on."""
        try:
            return self.wait(0)
        except subprocess.TimeoutExpired:
            return None

    def send_signal(self, number: int) -> None:
        """Send it a signal, if it has not ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """Kill it, if it has not ended."""
        if self._status is None:
            os.kill(self.pid, 9)


def begin(
    program: Path, arguments: Sequence[str], cwd: Path, environ: Mapping[str, str], streams: tuple[int, int, int]
) -> Begun:
    """Start a run in a session of its own, whose terminal is the first of the ``streams`` (stdin, stdout, stderr)."""
    order = {"argv": [str(program), *arguments], "cwd": str(cwd), "environ": dict(environ), "said": "", "kept": False}
    stdin, out, err = streams
    return _begun(order, out, err, stdin)


def begin_daemon(program: Path, cwd: Path, environ: Mapping[str, str], log: int) -> Begun:
    """Start `octoform watch`, which prints into ``log``, and whose workers are forks too: see `worker_forks`."""
    order = {"argv": [str(program), "watch"], "cwd": str(cwd), "environ": dict(environ), "said": "", "kept": False}
    return _begun({**order, "daemon": True}, log, log)


def _begun(order: Mapping[str, object], *streams: int) -> Begun:
    mine, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with its:
        with _ONE:
            keeper = _keeper()
        socket.send_fds(keeper, [json.dumps(order).encode()], [its.fileno(), *streams])
    return Begun(int(mine.recv(64)), mine)


def completed(
    program: Path,
    arguments: Sequence[str],
    cwd: Path,
    environ: Mapping[str, str],
    seconds: float = 60.0,
    said: str = "",
) -> "subprocess.CompletedProcess[str]":
    """The same in the form that `subprocess.run` gives."""
    return subprocess.CompletedProcess([program, *arguments], *run(program, arguments, cwd, environ, seconds, said))


@contextlib.contextmanager
def _sockets() -> Iterator[tuple[socket.socket, socket.socket]]:
    mine, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with mine, its:
        yield mine, its


def _read_all(descriptors: Sequence[int], deadline: float) -> tuple[str, ...]:
    """What comes out of pipes until each is closed by all who had it; TimeoutError at the deadline."""
    parts: dict[int, list[bytes]] = {descriptor: [] for descriptor in descriptors}
    try:
        with selectors.DefaultSelector() as selector:
            for descriptor in descriptors:
                selector.register(descriptor, selectors.EVENT_READ)
            while selector.get_map():
                ready = selector.select(max(0.0, deadline - time.monotonic()))
                if not ready:
                    raise TimeoutError
                for key, _ in ready:
                    parts[key.fd].append(os.read(key.fd, 1 << 16))
                    if not parts[key.fd][-1]:
                        selector.unregister(key.fd)
    finally:
        for descriptor in descriptors:
            os.close(descriptor)
    return tuple(b"".join(part).decode() for part in parts.values())


@cache
def _keeper(*prefix: str) -> socket.socket:
    """A connection to the loaded process that a command starts; it ends with the connection."""
    mine, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    command = [*prefix, sys.executable, __file__, str(its.fileno())]
    subprocess.Popen(command, pass_fds=[its.fileno()], stdin=subprocess.DEVNULL)
    its.close()
    return mine


def keep(orders: socket.socket) -> int:
    """The loaded process: fork for each order, report the exit of each fork; 0 when no client is left."""
    atexit.register(_leave)  # the first, which is carried out last
    for name in (*_core(), "packaging.requirements"):
        importlib.import_module(name)
    # To parse these takes as long as a short command; what a project changes in its copies is parsed there.
    for template in _environment().list_templates():
        _environment().get_template(template)
    load_specs(None)
    load_profiles(sorted(shipped().glob("*.md")))
    _complete(BaseModel)
    _compile_expressions()
    gc.freeze()  # a collection in a fork would copy all that is loaded
    bounded_program.SCRIPT = lasting_fork_server.SCRIPT
    selector = selectors.DefaultSelector()
    selector.register(orders, selectors.EVENT_READ)
    while True:
        for key, _ in selector.select():
            if key.data:
                selector.unregister(key.fileobj)
                os.close(key.fd)
                _tell_end(*key.data)
                continue
            order, descriptors, _, _ = socket.recv_fds(orders, LARGEST, 4)
            if not order:
                return 0
            servers = _fork_servers(Path(json.loads(order)["cwd"]), own=json.loads(order)["kept"])
            pid = os.fork()
            if not pid:
                selector.close()
                orders.detach()
                return _forked(json.loads(order), descriptors, servers)
            asker = socket.socket(fileno=descriptors[0])
            for descriptor in descriptors[1:]:
                os.close(descriptor)
            asker.send(str(pid).encode())
            selector.register(os.pidfd_open(pid), selectors.EVENT_READ, (pid, asker))


def _compile_expressions() -> None:
    """Those of all modules, which each fork would otherwise compile at their first use."""
    for found in gc.get_objects():
        if type(found) is type(regex("")):
            assert found.groups >= 0


def _complete(model: type[BaseModel]) -> None:
    """Build the validators of all models of octoform, which each command would otherwise do at its first use."""
    for found in model.__subclasses__():
        if found.__module__.startswith(f"{octoform.__name__}."):
            found.model_rebuild()
        _complete(found)


def _forked(order: Mapping[str, object], descriptors: Sequence[int], servers: Sequence[int]) -> int:
    """In the fork: be the command that the order is about; its exit status."""
    for terminal in descriptors[3:]:
        _sit_at(terminal)
    become(order, *descriptors[1:3], *servers)
    if order.get("daemon"):
        worker_forks.install(become)
    _ENDED.append(_status())
    return _ENDED[0]


def _fork_servers(folder: Path, *, own: bool) -> list[int]:
    """Descriptors of the fork servers of environments that a project shares with others: they outlast its commands.

    Those of its ``own`` only where that is asked for: that a command begins and ends its own is tested elsewhere.
    """
    found = []
    for shared in folder.glob(".octoform/*/environments"):
        for path in shared.iterdir() if own or shared.is_symlink() else ():
            environment = at(path)
            if environment is not None and environment.python.exists():
                server = _fork_server(environment.python)
                if server.loaded(60):
                    found.append(server._orders.fileno())
    return found


def _fork_server(python: Path) -> ForkServer:
    """The fork server of an environment: for a copy with the same files (`cp -al`), that of the first one."""
    marker = (python.parents[1] / MARKER).stat()
    files = marker.st_dev, marker.st_ino
    first, its = _COPIED.get(files, (None, python))
    if first is not None and first._lives() and its.exists():
        ForkServer._kept.setdefault(ForkServer._key(python), first)
    key = ForkServer._key(python)
    if key not in ForkServer._kept or not ForkServer._kept[key]._lives():
        ForkServer._kept[key] = SharedForkServer(python)
    server = ForkServer.at(python)
    _COPIED[files] = server, its if server is first else python
    return server


class Loaded(start_stop._Detached):
    """The process of an endpoint as a fork of the fork server, where a command has been given one."""

    def __init__(self, layout: Layout) -> None:
        python = self.python(layout)
        served = layout.endpoint / SERVE_SCRIPT
        mark = processes.new(16)
        passed = {name: os.environ[name] for name in start_stop.PASSED if name in os.environ}
        environ = {**passed, MARK: mark}
        with (layout.server_log).open("ab") as log, Path(os.devnull).open("rb") as nothing:
            streams = (nothing.fileno(), log.fileno(), log.fileno())
            server = ForkServer.at(python) if python else None
            loaded = server is not None and server.loaded(60)
            forked = server.fork([str(served)], layout.run, environ, streams, mark) if server and loaded else None
        if forked:
            self.taken, self._process = False, forked  # type: ignore[assignment]  # what is asked of it is the same
        else:
            super().__init__(layout)

    def python(self, layout: Layout) -> Path | None:
        """The interpreter that serves: of a whole environment, or the tests' own in its place."""
        found, manifest = recorded_environment(layout), read_manifest(layout)
        own = Path(sys.executable) if manifest and manifest.get("environment") == sys.prefix else None
        return found.python if found else own


def _core() -> Iterator[str]:
    """The modules that a command may import, which it does late; the others run in processes of their own."""
    elsewhere = re.compile(r"octoform\.(server|runtime|builtin|simulation|endpoint\.scripts)\b|.*\.__main__$")
    for module in pkgutil.walk_packages(octoform.__path__, f"{octoform.__name__}."):
        if not elsewhere.match(module.name):
            yield module.name


def _status() -> int:
    """Do what the arguments say."""
    if sys.argv[0].endswith(".py"):
        runpy.run_path(sys.argv[0], run_name="__main__")
        return 0
    from octoform.cli.main import main

    return main()


def _leave() -> None:
    """End a fork that came to its end by itself; to take apart all that is loaded would last as long as a command."""
    if _ENDED:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(_ENDED[0])


def _tell_end(pid: int, asker: socket.socket) -> None:
    status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    with asker, contextlib.suppress(BrokenPipeError):  # it waited no longer
        asker.send(str(status).encode())


def become(order: Mapping[str, object], out: int, err: int, *kept: int) -> None:
    """Take on folder, environment, arguments and streams of the order, as a new program has them."""
    environ, argv = order["environ"], order["argv"]
    assert isinstance(environ, dict) and isinstance(argv, list)
    os.dup2(out, 1)
    os.dup2(err, 2)
    bounded_program.SCRIPT = FORK_SERVER
    for environment, server in list(ForkServer._kept.items()):
        if server._orders.fileno() not in kept:  # its descriptor is closed here, and its number soon another file's
            server._orders.detach()
            del ForkServer._kept[environment]
    first = 3
    for descriptor in (*sorted(kept), 1024):
        os.closerange(first, descriptor)
        first = descriptor + 1
    if order["said"]:
        _hear(str(order["said"]))
    sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    sys.stderr = open(2, "w", encoding="utf-8", errors="backslashreplace", closefd=False)  # noqa: SIM115
    os.chdir(str(order["cwd"]))
    os.environ.clear()
    os.environ.update(environ)
    if kept:
        start_stop._Detached = Loaded  # type: ignore[misc]
    sys.argv = [str(word) for word in argv]


def _sit_at(terminal: int) -> None:
    """Have it on stdin, in a session of its own: what is typed there becomes a signal."""
    os.setsid()
    os.dup2(terminal, 0)
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)
    sys.stdin = open(0, encoding="utf-8", closefd=False)  # noqa: SIM115


def _hear(said: str) -> None:
    """Have this on stdin."""
    reading, writing = os.pipe()
    os.write(writing, said.encode())
    os.close(writing)
    os.dup2(reading, 0)
    os.close(reading)
    sys.stdin = open(0, encoding="utf-8", closefd=False)  # noqa: SIM115


if __name__ == "__main__":
    sys.exit(keep(socket.socket(fileno=int(sys.argv[1]))))
