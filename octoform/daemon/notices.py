"""Delivers alerts to a program, a webhook or the desktop; none of them can block the daemon.

Each way has its own queue and its own thread, and every message is carried by a child process with a time limit: a
slow name server or a program that hangs costs that child and nothing else, and the libraries that a POST needs never
stay in the daemon. An alert that could not be delivered is kept and shown (`octoform health`), since no one may believe
that somebody was notified. The webhook's URL is resolved for its child alone and is in no argument, log or file. Light.
"""

import contextlib
import json
import os
import select
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from html import escape as for_markup
from pathlib import Path

from octoform.base import shortage
from octoform.base.escaping import escaped
from octoform.base.files import parse
from octoform.base.processes import signal_group
from octoform.daemon.model import Alert, Kind
from octoform.daemon.store.json_store import FORMAT, Shelf
from octoform.manifest.model import Notify
from octoform.manifest.references import names, resolve
from octoform.records import dataclass
from octoform.redaction import found_in
from octoform.state.files import read_regular
from octoform.state.layout import Layout

SECONDS = 10.0
"""Seconds that one message may take."""
WAITS = (5.0, 30.0)
"""Seconds before it is tried again."""
MAX_WAITING = 50
"""Messages of one way that may wait; when there are more, the oldest is given up, and that is stated."""
_LISTEN_SECONDS = 0.05
FILE = "notified.json"
MAX_LENGTH = 300
_NOTIFY_SEND = "notify-send"
_URGENT = ("frozen", "surfaced", "confirm", "asks")
_PLAIN = ("PATH", "HOME", "USER", "LANG", "LC_ALL", "TZ")
_DESKTOP = (*_PLAIN, "DISPLAY", "WAYLAND_DISPLAY", "XDG_RUNTIME_DIR", "DBUS_SESSION_BUS_ADDRESS")
_NETWORK = (*_PLAIN, "SSL_CERT_FILE", "SSL_CERT_DIR")
_PROXIES = ("http_proxy", "https_proxy", "no_proxy")
_POSTING = (sys.executable, "-P", "-m", "octoform.daemon.webhook")

Deliver = Callable[[Alert], str | None]
"""Delivers one alert; returns None, or why it failed, without any secret."""
Wait = Callable[[float], bool]
"""Waits so many seconds; True when the daemon ends."""


def document_of(alert: Alert) -> dict[str, object]:
    """The document on a program's standard input or in a webhook's body; all texts are escaped."""
    fields = {name: escaped(str(value)) for name, value in asdict(alert).items()}
    return {"format": FORMAT, "octoform": "alert", **fields}


class Notifier:
    """Delivers alerts. Calling it only puts them into queues."""

    def __init__(self, ways: Mapping[str, Deliver], shelf: Shelf, wait: Wait | None = None) -> None:
        """``ways`` by name: ``command``, ``webhook``, ``desktop``. ``shelf`` keeps which of them fail."""
        self._ended = threading.Event()
        self._record = _Record(shelf)
        self._ways = [_Way(name, deliver, self._record, wait or self._ended.wait) for name, deliver in ways.items()]

    def __call__(self, alert: Alert) -> None:
        """Let everybody know; returns at once."""
        for way in self._ways:
            way.put(alert)

    def close(self, seconds: float = SECONDS) -> None:
        """Deliver what waits, within so many seconds in all; the rest is dropped and reported."""
        end = time.monotonic() + seconds
        for way in self._ways:
            way.close()
        for way in self._ways:
            way.join(max(0.0, end - time.monotonic()))
        self._ended.set()
        for way in self._ways:
            way.give_up()


@dataclass(frozen=True, slots=True)
class Failing:
    """A way that does not work: since when (RFC 3339), why, and how many messages were lost."""

    way: str
    since: str
    why: str
    lost: int


def failing(layout: Layout) -> tuple[Failing, ...]:
    """The ways of telling that failed when they were used last; also while no daemon runs."""
    data, _ = read_regular(layout.daemon / FILE, 64 * 1024)
    try:
        ways = parse(data or b"{}").get("ways", {})
        return tuple(
            Failing(str(name), str(each["since"]), str(each["why"]), int(each["lost"])) for name, each in ways.items()
        )
    except (ValueError, LookupError, TypeError, AttributeError):
        return ()


def open_notifier(layout: Layout, settings: Notify, environ: Mapping[str, str]) -> Notifier:
    """The ways that a manifest names."""
    ways: dict[str, Deliver] = {}
    if settings.command:
        ways["command"] = Command(settings.command, layout.project, environ)
    if settings.webhook is not None:
        ways["webhook"] = Webhook(settings.webhook, environ)
    if settings.desktop:
        ways["desktop"] = Desktop(environ)
    return Notifier(ways, Shelf(layout))


class _Way:
    """One queue with its thread."""

    def __init__(self, name: str, deliver: Deliver, record: "_Record", wait: Wait) -> None:
        self._name, self._deliver, self._record, self._wait = name, deliver, record, wait
        self._queue: deque[Alert] = deque()
        self._changed = threading.Condition()
        self._closing = False
        self._thread: threading.Thread | None = None

    def put(self, alert: Alert) -> None:
        with self._changed:
            if len(self._queue) >= MAX_WAITING:
                lost = self._queue.popleft()
                self._record.failed(self._name, lost.stamp, "too many notifications at once; the oldest is dropped")
            self._queue.append(alert)
            if self._thread is None:  # the thread starts with the first alert
                thread = threading.Thread(target=self._work, name=f"octoform-{self._name}", daemon=True)
                with contextlib.suppress(BlockingIOError):  # the queue is kept, and the next alert tries again
                    shortage.start(thread)
                    self._thread = thread
            self._changed.notify()

    def close(self) -> None:
        with self._changed:
            self._closing = True
            self._changed.notify()

    def join(self, seconds: float) -> None:
        if self._thread is not None:
            self._thread.join(seconds)

    def give_up(self) -> None:
        with self._changed:
            for alert in self._queue:
                self._record.failed(self._name, alert.stamp, "the daemon ended before it was sent")
            self._queue.clear()

    def _work(self) -> None:
        while True:
            with self._changed:
                while not self._queue and not self._closing:
                    self._changed.wait()
                if not self._queue:
                    return
                alert = self._queue.popleft()
            self._send(alert)

    def _send(self, alert: Alert) -> None:
        why = self._deliver(alert)
        for seconds in WAITS:
            if why is None or self._closing or self._wait(seconds):
                break
            why = self._deliver(alert)
        if why is None:
            self._record.worked(self._name)
        else:
            self._record.failed(self._name, alert.stamp, why)


class _Record:
    """Which ways fail, for anyone who asks how the host is."""

    def __init__(self, shelf: Shelf) -> None:
        self._shelf = shelf
        self._guard = threading.Lock()
        self._failing = {each.way: each for each in failing(shelf.layout)}

    def worked(self, way: str) -> None:
        with self._guard:
            if self._failing.pop(way, None) is not None:
                self._write()

    def failed(self, way: str, stamp: str, why: str) -> None:
        with self._guard:
            before = self._failing.get(way)
            since, lost = (before.since, before.lost) if before is not None else (stamp, 0)
            self._failing[way] = Failing(way, since, why[:MAX_LENGTH], lost + 1)
            self._write()

    def _write(self) -> None:
        ways = {each.way: {"since": each.since, "why": each.why, "lost": each.lost} for each in self._failing.values()}
        self._shelf.write(FILE, {"ways": ways})


class Command:
    """Delivers to a program of the person's: the alert is one JSON object on its standard input."""

    def __init__(self, command: Sequence[str], project: Path, environ: Mapping[str, str]) -> None:
        program = command[0]
        if "/" in program and not Path(program).is_absolute():
            program = str(project / program)
        self._argv = [program, *command[1:]]
        self._project = project
        self._environ = _only(environ, _PLAIN)

    def __call__(self, alert: Alert) -> str | None:
        return run(self._argv, json.dumps(document_of(alert)).encode() + b"\n", self._environ, self._project)


class Webhook:
    """Delivers to a URL. Its references are resolved here, and the URL leaves only on the child's input."""

    def __init__(self, url: str, environ: Mapping[str, str]) -> None:
        self._url = url
        self._environ = environ

    def __call__(self, alert: Alert) -> str | None:
        absent = next((name for name in names(self._url) if not self._environ.get(name)), None)
        if absent is not None:
            return f"the variable {absent} is not set"
        asked = {"url": resolve(self._url, self._environ), "body": document_of(alert), "seconds": SECONDS}
        proxies = [name for name in self._environ if name.lower() in _PROXIES]
        return run(_POSTING, json.dumps(asked).encode(), _only(self._environ, (*_NETWORK, *proxies)), Path("/"))


class Desktop:
    """Delivers to the desktop session of the user who runs the daemon."""

    def __init__(self, environ: Mapping[str, str]) -> None:
        self._environ = _only(environ, _DESKTOP)

    def __call__(self, alert: Alert) -> str | None:
        found = document_of(alert)
        title = f"octoform {found['host']}: {found['event']} {found['target']}"
        # A body may hold markup; what devices say must not.
        body = for_markup("\n".join(filter(None, (str(found["summary"]), str(found["hint"])))), quote=False)
        urgency = "critical" if alert.event in _URGENT else "normal"
        argv = [_NOTIFY_SEND, "--app-name=octoform", f"--urgency={urgency}", "--", title[:200], body[:1000]]
        return run(argv, b"", self._environ, Path("/"))


def run(argv: Sequence[str], data: bytes, environ: Mapping[str, str], folder: Path) -> str | None:
    """Run a program to its end, at most `SECONDS`; None when it succeeded, else why not, bounded and redacted.

    What it is given is a file and what it prints is thrown away but for the end: a child that reads nothing and one
    that prints permanently both come to their end, and fill no disk.
    """
    with tempfile.TemporaryFile() as given:
        given.write(data)
        given.seek(0)
        try:
            process = subprocess.Popen(
                argv,
                cwd=folder,
                env=dict(environ),
                stdin=given,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                start_new_session=True,
            )
        except OSError as problem:
            return f"{Path(argv[0]).name} cannot be started: {problem.strerror or type(problem).__name__}"
        assert process.stderr is not None
        with process.stderr as printed:
            words = _listen(process, printed.fileno())
        if words is None:
            _kill(process)
            return f"it took more than {SECONDS:g} s and was ended"
        return None if process.returncode == 0 else f"it ended with status {process.returncode}{_failure_text(words)}"


def _listen(process: "subprocess.Popen[bytes]", descriptor: int) -> bytes | None:
    """The last words of a program that ended; None for one that did not within `SECONDS`."""
    end = time.monotonic() + SECONDS
    os.set_blocking(descriptor, False)
    ears, words, open_ = select.poll(), b"", True
    ears.register(descriptor, select.POLLIN)
    while True:
        ended = process.poll() is not None  # asked before the last look: its output before its end is read
        if open_ and ears.poll(0 if ended else _LISTEN_SECONDS * 1000):
            heard = os.read(descriptor, 65536)
            words, open_ = (words + heard)[-4096:], bool(heard)
        elif not ended:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(_LISTEN_SECONDS)
        if ended:
            return words
        if time.monotonic() >= end:
            return None


def _kill(process: "subprocess.Popen[bytes]") -> None:
    signal_group(process)
    process.wait()


def _failure_text(words: bytes) -> str:
    text = words.decode("utf-8", "replace").strip().rpartition("\n")[2]
    for start, end in found_in(text):
        text = text[:start] + "*" * (end - start) + text[end:]
    return f": {escaped(text)[:200]}" if text else ""


def _only(environ: Mapping[str, str], wanted: Sequence[str]) -> dict[str, str]:
    return {name: environ[name] for name in wanted if name in environ}


# What a person does about a problem that gave up: one text for every view. Light.

_BY_HAND = {
    Kind.HARDWARE_CHANGED: "octoform apply (octoform plan shows first what it would do)",
    Kind.FILE_DAMAGED: "octoform plan shows the edit, octoform apply settles it",
}
"""Where that is another command than one more try."""


def advice(kind: Kind, target: str) -> str:
    """The remedy for a problem that gave up, with the command."""
    return _BY_HAND.get(kind) or f"fix the cause, then: octoform heal -retry {target}"


def hint(kind: Kind, target: str) -> str:
    """The same for a message of one line."""
    return _BY_HAND.get(kind) or f"octoform heal -retry {target} tries again once the cause is fixed"
