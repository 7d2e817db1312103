"""One daemon for each host, and a person's orders to it: to pause, to go on, to try again.

The kernel's lock on a file states that a daemon lives, so a killed one needs no clearing up; the record beside it
states which process that is. What a person wants lies in small files of the same folder, which the daemon notices as it
notices every other file, so that asking works whether or not it runs. Light.
"""

import contextlib
import json
import os
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from octoform.base.files import parse, private_folder
from octoform.base.locks import acquire, held, is_locked, lock_file
from octoform.base.place import KEY, is_from, place_of
from octoform.diagnostics import Diagnostic, error
from octoform.records import dataclass
from octoform.state.files import display, hide_from_git, read_regular, refused, write_atomic
from octoform.state.layout import Layout
from octoform.state.store.lock import Liveness, Process, from_json, liveness, myself, to_json

FORMAT = 1
LOCK = "daemon.lock"
RECORD = "daemon.json"
PAUSED = "paused.json"
ASKED = "asked.json"
TAKEN = "DAEMON-RUNNING"
_LIMIT = 64 * 1024
_TARGETS = 64


@dataclass(frozen=True, slots=True)
class Record:
    """A daemon's process; ``since`` is RFC 3339, ``uptime`` seconds of CLOCK_BOOTTIME when it started."""

    process: Process
    since: str
    uptime: float
    version: str


class Owned:
    """This process is the host's daemon until `release`, or until it ends."""

    def __init__(self, layout: Layout, descriptor: int, record: dict[str, Any]) -> None:
        """``descriptor`` is open on the lock file and carries the kernel's lock."""
        self._layout = layout
        self._descriptor: int | None = descriptor
        self._record = record

    def keep(self) -> Diagnostic | None:
        """Write again what somebody deleted, and keep git out; DAEMON-RUNNING when another one is the daemon by now."""
        folder = self._layout.daemon
        gone = self._descriptor is not None and not _same(folder / LOCK, self._descriptor)
        if gone:
            descriptor, problem = _lock(self._layout)
            if descriptor is None:
                return problem
            self._exchange(descriptor)
        if gone or not (folder / RECORD).exists():
            try:
                record = _placed(self._layout, self._record)  # the folder may be another one by now
                self._signed(record)
            except OSError as refusal:
                return refused(refusal, folder)
            if unwritten := write_atomic(folder / RECORD, record, 0o600):
                return unwritten
        return hide_from_git(self._layout.project)

    def _exchange(self, descriptor: int) -> None:
        if self._descriptor is not None:
            os.close(self._descriptor)
        self._descriptor = descriptor

    def _signed(self, record: bytes) -> None:
        if self._descriptor is not None:
            _sign(self._descriptor, record)

    def release(self) -> None:
        """Take the record away and let go."""
        if self._descriptor is None:
            return
        if _same(self._layout.daemon / LOCK, self._descriptor):  # else the record is of another one
            with contextlib.suppress(OSError):  # readers ignore a record without the lock
                (self._layout.daemon / RECORD).unlink(missing_ok=True)
        os.close(self._descriptor)
        self._descriptor = None


def take(layout: Layout, since: str, uptime: float, version: str) -> tuple[Owned | None, Diagnostic | None]:
    """Become the host's daemon; DAEMON-RUNNING names the one that is it already."""
    descriptor, problem = _lock(layout)
    if descriptor is None:
        return None, problem
    document = {"format": FORMAT, **to_json(myself()), "since": since, "uptime": uptime, "version": version}
    document["argv"] = [sys.executable, *sys.argv]
    record = _placed(layout, document)
    _sign(descriptor, record)
    if unwritten := write_atomic(layout.daemon / RECORD, record, 0o600):
        os.close(descriptor)
        return None, unwritten
    return Owned(layout, descriptor, document), None


def _placed(layout: Layout, document: dict[str, Any]) -> bytes:
    """The record with the folder that it lies in, so that in a copy of it no one takes it for a daemon's."""
    return _encoded({**document, KEY: place_of(layout.daemon)})


def alive(layout: Layout) -> Record | None:
    """The host's daemon, when one lives: the kernel's lock and the process of its record both say so."""
    document = _read(layout.daemon / RECORD)
    if document is None or not is_from(document, layout.daemon) or not _locked(layout.daemon / LOCK):
        return None
    try:
        process = from_json(document)
        found = Record(process, str(document["since"]), float(document["uptime"]), str(document["version"]))
    except (ValueError, KeyError, TypeError):
        return None
    return found if liveness(process, myself()) in (Liveness.ALIVE, Liveness.HIDDEN) else None


def pause(layout: Layout, stamp: str) -> Diagnostic | None:
    """Let no repair be begun until `resume`; looking and saying go on."""
    document = {"format": FORMAT, "since": stamp, "by": os.environ.get("USER") or str(os.getuid())}
    try:
        private_folder(layout.daemon)
    except OSError as problem:
        return refused(problem, layout.daemon)
    return write_atomic(layout.daemon / PAUSED, _encoded(document), 0o600)


def resume(layout: Layout) -> tuple[bool, Diagnostic | None]:
    """Let repairs be made again: False when nothing was paused, and why what pauses them cannot be removed."""
    path = layout.daemon / PAUSED
    try:
        path.unlink()
    except FileNotFoundError:
        return False, None
    except OSError as problem:
        return True, refused(problem, path)
    return True, None


def paused_since(layout: Layout) -> str | None:
    """Since when repairs are paused (RFC 3339, or empty where the file does not have it); None when they are not.

    A file that cannot be read pauses all the same: somebody wanted it.
    """
    path = layout.daemon / PAUSED
    document = _read(path)
    if document is not None:
        return str(document.get("since", ""))
    return "" if os.path.lexists(path) else None


def ask(layout: Layout, targets: Iterable[str]) -> Diagnostic | None:
    """Ask the daemon to thaw these targets and to try again; ``*`` is every one of them."""
    try:
        private_folder(layout.daemon)
        with _turn(layout):
            wanted = list(dict.fromkeys([*_asked(layout.daemon / ASKED), *targets]))[:_TARGETS]
            return write_atomic(layout.daemon / ASKED, _encoded({"format": FORMAT, "targets": wanted}), 0o600)
    except OSError as problem:
        return refused(problem, layout.daemon / ASKED)


def taken_up(layout: Layout) -> tuple[str, ...]:
    """The targets that were asked for since the last time, which is now."""
    path = layout.daemon / ASKED
    if not os.path.lexists(path):
        return ()
    with _turn(layout):
        wanted = _asked(path)
        path.unlink(missing_ok=True)
    return wanted


def _asked(path: Path) -> tuple[str, ...]:
    targets = (_read(path) or {}).get("targets")
    return tuple(str(target)[:500] for target in targets[:_TARGETS]) if isinstance(targets, list) else ()


@contextlib.contextmanager
def _turn(layout: Layout, seconds: float = 2.0) -> Iterator[None]:
    """One at a time asks or takes up; TimeoutError (an OSError) when another one stands still in between."""
    with held(layout.daemon / "asked.lock", seconds) as mine:
        if not mine:
            raise TimeoutError(None, "another octoform is asking")
        yield


def _lock(layout: Layout) -> tuple[int | None, Diagnostic | None]:
    """The lock file, open and locked."""
    try:
        private_folder(layout.daemon)
        descriptor = lock_file(layout.daemon / LOCK)
    except OSError as problem:
        return None, refused(problem, layout.daemon / LOCK)
    with contextlib.suppress(OSError):
        if acquire(descriptor):
            return descriptor, None
    os.close(descriptor)
    return None, _running(layout)


def _sign(descriptor: int, record: bytes) -> None:
    """Leave in the lock file which daemon was there last: anyone who finds another text knows that one was."""
    with contextlib.suppress(OSError):  # a full disk; the next write, of the record, reports it
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, record, 0)


def _same(path: Path, descriptor: int) -> bool:
    """Whether the file of that name is the one that is open."""
    try:
        found = path.stat(follow_symlinks=False)
    except OSError:
        return False
    return os.path.samestat(found, os.fstat(descriptor))


def _locked(path: Path) -> bool:
    try:
        return is_locked(path)
    except OSError:
        return False


def _running(layout: Layout) -> Diagnostic:
    found = alive(layout)
    who = "another process" if found is None else f"process {found.process.pid} on {found.process.host}"
    since = "" if found is None else f", since {found.since}"
    return error(
        TAKEN,
        f"the daemon of {layout.host} runs already: {who}{since}",
        path=display(layout.daemon / LOCK),
        hint="octoform health shows its findings; end it there, or let systemd do so, before you start another",
    )


def _read(path: Path) -> dict[str, Any] | None:
    data, _ = read_regular(path, _LIMIT)
    try:
        document = parse(data or b"")
    except ValueError:
        return None
    return document if isinstance(document, dict) else None


def _encoded(document: object) -> bytes:
    return json.dumps(document, indent=1).encode() + b"\n"
