"""Scope internet: an outbound tunnel through a program of the person's choice, watched, shown, and ended on request.

Any program will do that prints the address which it opened. It has a thread of its own here, so that it can be revoked
whatever the event loop is doing. Without the program, or without a network, scope intranet goes on and the reason is
reported. Standard library only.
"""

import ipaddress
import os
import re
import select
import shutil
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from octoform.base import clock, processes
from octoform.base.processes import start_of
from octoform.server import tunnel_termination
from octoform.server.process import instance_lock
from octoform.server.process.stderr_log import write_line
from octoform.server.tunnel_termination import MARK, Proof

FIRST_DELAY, MAX_DELAY = 1.0, 300.0
STEADY_SECONDS = 60.0
"""A program that ran so long is started again at once when it ends."""
LOOK_SECONDS = 0.25
HEAR_SECONDS = (3.0, 5.0, 10.0, 20.0, 40.0, 80.0, 160.0, 300.0)
"""Pauses between the tries to hear the endpoint through its address; a provider's names take a moment to be there."""
REVOKED = ("revoked", "revoked; octoform start opens a new one")
"""State and reason of a tunnel that a person has ended."""
_LINE_BYTES = 4096
_LINES_KEPT = 20
_ADDRESS = re.compile(r"https?://[^\s|\"'`<>()\[\]{},;]+")
_ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
_HOST = re.compile(r"[a-z0-9]([a-z0-9.-]*[a-z0-9])?")
_WARDEN = Path(__file__).with_name("tunnel_warden.py")


class Tunnel:
    """The tunnel of one start of the endpoint; all methods may be called from any thread.

    ``changed`` is called with the public URL whenever it is another, with None when there is none.
    """

    def __init__(
        self, command: Sequence[str], run: Path, *, local_url: str, instance: str, changed: Callable[[str | None], None]
    ) -> None:
        self._command = [word.replace("{url}", local_url) for word in command]
        self._run = run
        self._local_url = local_url
        self._instance = instance
        self._changed = changed
        self._lock = threading.Lock()
        self._stopping = threading.Event()
        self._wake = threading.Event()
        self._thread = threading.Thread(target=self._keep, name="tunnel", daemon=True)
        self._facts: dict[str, Any] = {"state": "starting", "url": None, "since": None, "reason": None, "starts": 0}

    def start(self) -> None:
        """Start it and keep it; one that was revoked is reported as that from the first moment on."""
        if tunnel_termination.forbidden(self._run):
            self._publish(*REVOKED)
        self._thread.start()

    def stop(self) -> None:
        """End it with the endpoint; the next start of the endpoint may start it again."""
        self._stopping.set()
        self._wake.set()
        record = tunnel_termination.read(self._run)
        if record is not None and record["instance"] == self._instance:
            tunnel_termination.end(record)
        self._thread.join(tunnel_termination.GRACE_SECONDS)

    def status(self) -> Mapping[str, Any]:
        """``state`` (starting, running, not running, revoked), ``url``, ``since``, ``reason``, ``starts``."""
        return dict(self._facts)

    def revoke(self) -> Proof:
        """End it at once and for good, with proof; takes up to some seconds."""
        with self._lock:
            tunnel_termination.forbid(self._run)
        self._changed(None)
        self._wake.set()
        proof = tunnel_termination.revoke(self._run)
        self._publish(*REVOKED)
        return proof

    def _keep(self) -> None:
        former = tunnel_termination.read(self._run)
        if former is not None and former["instance"] != self._instance:
            tunnel_termination.end(former)  # of a process that could not end it any more
        delay = FIRST_DELAY
        while not self._stopping.is_set():
            if tunnel_termination.forbidden(self._run):
                self._publish(*REVOKED)
                self._stopping.wait(LOOK_SECONDS)
                delay = FIRST_DELAY
                continue
            began = time.monotonic()
            self._once()
            if time.monotonic() - began > STEADY_SECONDS:
                delay = FIRST_DELAY
            self._wake.clear()
            if not self._over():
                self._wake.wait(delay)
            delay = min(delay * 2, MAX_DELAY)

    def _over(self) -> bool:
        return self._stopping.is_set() or tunnel_termination.forbidden(self._run)

    def _once(self) -> None:
        """One run of the program, from its start to its end."""
        program = shutil.which(self._command[0])
        if program is None:
            name = self._command[0]
            self._publish("not running", f"there is no program {name!r}; install it, or name another as tunnel.command")
            return
        started = self._spawn([program, *self._command[1:]])
        if started is None:
            return
        process, record = started
        lines: deque[str] = deque(maxlen=_LINES_KEPT)
        for line in _lines_of(process):
            lines.append(line)
            if record["url"] is None:
                self._look_for_address(line, record)
        tunnel_termination.end(record)
        status = process.wait()
        _close(process)
        # The record stays: a later revocation checks whether that address is really silent.
        tunnel_termination.publish(self._run, {**record, "ended": clock.stamp()})
        self._changed(None)
        if not self._over():
            last = next((line for line in reversed(lines) if line.strip()), "it printed nothing")
            shown = ascii(_ESCAPES.sub("", last).strip())[1:-1][:300]
            self._publish("not running", f"{self._command[0]} ended with status {status}: {shown}")

    def _spawn(self, command: Sequence[str]) -> tuple["subprocess.Popen[bytes]", dict[str, Any]] | None:
        """Start the program below its warden; None when the tunnel was revoked in this very moment."""
        mark = processes.new(16)
        with self._lock:
            if self._over():
                return None
            process = subprocess.Popen(
                [sys.executable, "-I", "-S", str(_WARDEN), *command],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                env={**{key: value for key, value in os.environ.items() if key != instance_lock.MARK}, MARK: mark},
                start_new_session=True,
            )
            processes.put_on(mark, process.pid)  # it outlives the endpoint's end, whose mark it has inherited
            record: dict[str, Any] = {
                "format": 1,
                "pid": process.pid,
                "start": start_of(process.pid) or 0,  # one that has ended already is known by its mark alone
                "boot": clock.boot_id(),
                "mark": mark,
                "instance": self._instance,
                "command": list(command),
                "url": None,
                "since": clock.stamp(),
            }
            tunnel_termination.publish(self._run, record)
            self._facts = {**self._facts, "starts": self._facts["starts"] + 1}
        self._publish("starting", "it has printed no address yet", since=record["since"])
        if tunnel_termination.forbidden(self._run):
            # Revoked from outside of this process between the look and the start.
            tunnel_termination.end(record)
        return process, record

    def _look_for_address(self, line: str, record: dict[str, Any]) -> None:
        url = public_address(line, self._local_url)
        if url is None:
            return
        with self._lock:
            if tunnel_termination.forbidden(self._run):
                return
            record["url"] = url
            tunnel_termination.publish(self._run, record)
            self._changed(url)
        self._publish("running", None, url=url, since=record["since"])
        threading.Thread(target=self._hear, args=(url, record), name="tunnel-heard", daemon=True).start()

    def _hear(self, url: str, record: dict[str, Any]) -> None:
        """See whether the address leads here, so that its silence means something when the tunnel is revoked."""
        for pause in HEAR_SECONDS:
            if self._stopping.wait(pause) or self._facts["url"] != url:
                return
            if tunnel_termination.answers(url, self._instance):
                with self._lock:
                    if self._facts["url"] == url:
                        record["answered"] = True
                        tunnel_termination.publish(self._run, record)
                return

    def _publish(self, state: str, reason: str | None, *, url: str | None = None, since: str | None = None) -> None:
        before = self._facts
        self._facts = {**before, "state": state, "reason": reason, "url": url, "since": since}
        if (before["state"], before["reason"], before["url"]) != (state, reason, url):
            write_line(f"tunnel: {state}: {url or reason}")


def public_address(line: str, local_url: str) -> str | None:
    """The address in a line of output that leads here from outside; None when there is none.

    Programs print other addresses as well: their terms, their documentation, their own status page, and the one that
    was given to them. What they open for us has no path, and is not on this machine's loopback.
    """
    for found in _ADDRESS.findall(_ESCAPES.sub("", line)):
        try:
            parts = urlsplit(found.rstrip(".:!?"))
            port = parts.port
        except ValueError:
            continue
        host = (parts.hostname or "").lower()
        plain = parts.path in ("", "/") and not parts.query and not parts.fragment and "@" not in parts.netloc
        if plain and _HOST.fullmatch(host) and not _is_here(host, port, local_url):
            return f"{parts.scheme}://{host}" + (f":{port}" if port is not None else "")
    return None


def _is_here(host: str, port: int | None, local_url: str) -> bool:
    local = urlsplit(local_url)
    if (host, port) == (local.hostname, local.port) or host == "localhost":
        return True
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return False
    return address.is_loopback or address.is_unspecified


def _close(process: "subprocess.Popen[bytes]") -> None:
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            pipe.close()


def _lines_of(process: "subprocess.Popen[bytes]") -> Iterator[str]:
    """The program's output, line by line, each of bounded length, until it has ended and the pipe is empty."""
    if process.stdout is None:
        return
    descriptor = process.stdout.fileno()
    watched = select.poll()  # `select` takes no descriptor above 1023
    watched.register(descriptor, select.POLLIN)
    rest = b""
    while True:
        readable = watched.poll(LOOK_SECONDS * 1000)
        part = os.read(descriptor, 65536) if readable else b""
        if (readable and not part) or (not readable and process.poll() is not None):
            break
        *lines, rest = (rest + part).split(b"\n")
        if len(rest) > _LINE_BYTES:
            lines, rest = [*lines, rest], b""
        for line in lines:
            yield line[:_LINE_BYTES].decode("utf-8", "replace")
    if rest:
        yield rest[:_LINE_BYTES].decode("utf-8", "replace")
