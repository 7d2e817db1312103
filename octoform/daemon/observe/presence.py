"""Which of the endpoint's devices are there, and which kinds of hardware came or went since PROBE. (Light.)

Kinds are counted here, by the same fingerprint that a plan uses. Which unit a device is, only the runtime of the
generated server decides; it is asked in a process of its own, and only when a name in sysfs or in the ledger moved.
On a slow computer the answer takes seconds: when the endpoint's process ends meanwhile, no one waits for it.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from io import FileIO
from pathlib import Path
from typing import Any

from octoform import host
from octoform.base.files import parse, read_json
from octoform.daemon.model import LastSeen
from octoform.daemon.observe.event_queue import wait_readable
from octoform.daemon.observe.hardware import names
from octoform.daemon.observe.process import ProcessEar
from octoform.endpoint.process.record import Running, is_it
from octoform.endpoint.published_files import describe_closed, served_nodes
from octoform.host import SYSROOT_VARIABLE
from octoform.records import dataclass, field
from octoform.state.artifact_cache import classes_of, read_instances
from octoform.state.layout import Layout

WHERE_SECONDS = 30.0
WHERE = (sys.executable, "-I", "-m", "octoform.runtime.where")
Where = Callable[[Sequence[str], Running | None], Mapping[str, Mapping[str, Any]] | None]
"""Device ids to what `octoform.runtime.where` answers; None when it did not before the given process ended."""


@dataclass(frozen=True, slots=True)
class Seen:
    """``appeared`` and ``gone`` are fingerprint entries against the last accepted PROBE."""

    appeared: tuple[str, ...] = ()
    gone: tuple[str, ...] = ()
    devices: Mapping[str, LastSeen] = field(default_factory=dict)


class Presence:
    """Looks at the hardware of one deployment again and again."""

    def __init__(self, layout: Layout, environ: Mapping[str, str], where: Where | None = None) -> None:
        self._layout = layout
        self._root = host.root_from_environment(environ)
        self._where = where or Asked(layout, environ)
        self._signature: object = None
        self._devices: Mapping[str, LastSeen] = {}
        self._nodes: tuple[Path, ...] = ()
        self._met: set[str] = set()

    def __call__(self, *, again: bool = False, process: Running | None = None) -> Seen | None:
        """The devices that are present; with ``again`` the runtime is asked although no name moved.

        None when ``process`` ended before that was known: then the next look asks again.
        """
        acting = served_nodes(self._layout)
        ids = tuple(acting)
        ledger = read_instances(self._layout)[0] or {}
        recorded = {name: _recorded(ledger.get(name)) for name in ids}
        signature = (names(self._root), tuple(recorded.items()), tuple(map(_rights, self._nodes)))
        if again or signature != self._signature:
            answers = self._where(ids, process) if ids else {}
            if answers is None and process is not None and not is_it(process):
                self._signature = None
                return None
            found = answers or {}
            self._devices = {
                name: self._last_seen(name, found.get(name), recorded[name], acts=acts) for name, acts in acting.items()
            }
            nodes = [node for each in found.values() for node in each.get("nodes") or ()]
            self._nodes = tuple(self._root / node.lstrip("/") for node in nodes)
            signature = (*signature[:2], tuple(map(_rights, self._nodes)))
            self._signature = signature if answers is not None else None
        # After the devices: one that came back meanwhile is neither absent nor gone, and nothing to discover again.
        appeared, gone = self._kinds()
        # What went is no news while it is unknown whether it is one of the endpoint's devices.
        return Seen(appeared, gone if self._signature is not None else (), self._devices)

    def _last_seen(self, name: str, answer: Mapping[str, Any] | None, recorded: str | None, *, acts: bool) -> LastSeen:
        """Absent is only what is known to have been there; a doubt counts only for what something is moved with."""
        if answer is None:
            return LastSeen(None, recorded=recorded)
        if not answer.get("attached"):
            return LastSeen(False if recorded or name in self._met else None, recorded=recorded)
        self._met.add(name)
        doubt = str(answer.get("doubt") or "") if acts else ""
        shut = [describe_closed(each) for each in answer.get("refused") or ()]
        return LastSeen(True, str(answer.get("sysfs") or "") or None, doubt or None, recorded, "; ".join(shut) or None)

    def _kinds(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        try:
            before = read_json(self._layout.fingerprint)["entries"]
            return host.difference([str(each) for each in before], host.fingerprint(self._root).entries)
        except (OSError, ValueError, KeyError, TypeError):
            return (), ()  # nothing is remembered of what PROBE saw


class Asked:
    """The runtime, asked in a process of its own."""

    def __init__(self, layout: Layout, environ: Mapping[str, str], command: Sequence[str] = WHERE) -> None:
        self._layout = layout
        self._command = command
        self._environment = {"PATH": environ.get("PATH", ""), "OCTOFORM_INSTANCES": str(layout.instances)}
        if environ.get(SYSROOT_VARIABLE):
            self._environment[SYSROOT_VARIABLE] = environ[SYSROOT_VARIABLE]

    def __call__(self, ids: Sequence[str], process: Running | None = None) -> Mapping[str, Mapping[str, Any]] | None:
        """Where each device is now; None when the runtime does not answer in time, or ``process`` ends first."""
        ear = ProcessEar()
        try:
            if not ear.follow(process):
                return None
            ledger = read_instances(self._layout)[0] or {}
            asked = {name: classes_of(ledger.get(name)) for name in ids}
            answers = parse(self._answer(json.dumps(asked).encode(), ear.fileno()))
        except (OSError, ValueError):
            return None
        finally:
            ear.close()
        return answers if isinstance(answers, dict) else None

    def _answer(self, question: bytes, ending: int | None) -> bytes:
        """The runtime's answer; empty when its time is over, or ``ending`` can be read first."""
        with _memory() as asked, _memory() as found:  # no file: the disk may be full
            asked.write(question)
            asked.seek(0)
            child = subprocess.Popen(
                self._command, env=self._environment, stdin=asked, stdout=found, stderr=subprocess.DEVNULL
            )
            try:
                _either(child.pid, ending)
            finally:
                child.kill()  # does nothing to one that has ended
                child.wait()
            found.seek(0)
            return found.read() if child.returncode == 0 else b""


def _memory() -> FileIO:
    return FileIO(os.memfd_create("octoform"), "r+")


def _either(pid: int, ending: int | None) -> None:
    """Wait for the end of a child of ours, or until ``ending`` can be read, at most WHERE_SECONDS."""
    child = os.pidfd_open(pid)
    try:
        wait_readable([child] if ending is None else [child, ending], WHERE_SECONDS)
    finally:
        os.close(child)


def _rights(node: Path) -> tuple[int, ...]:
    """The stamp that changes when a node is opened or closed to a user."""
    try:
        found = node.stat()
    except OSError:
        return ()
    return found.st_mode, found.st_uid, found.st_gid, found.st_ctime_ns


def _recorded(instance: object) -> str | None:
    place = instance.get("sysfs") if isinstance(instance, Mapping) else None
    return str(place) if place else None
