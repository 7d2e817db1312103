"""One live deployment with a real daemon beside it, and everything that is seen of both from outside.

Nothing here asks the daemon how it is: time is this process's own monotonic clock, episodes are read from the file in
which they are written down, and whether the endpoint works is tried as a client.
"""

import json
import os
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

import warm
from projects import OCTOFORM, Project
from replugged import Host

from octoform.base.digest import of_bytes
from octoform.endpoint.client.jsonrpc import ToolCall
from octoform.endpoint.client.terminal import call
from octoform.endpoint.environment.model import packages_of
from octoform.endpoint.process import record
from octoform.endpoint.process.record import Running, running
from octoform.endpoint.sockets import greeted
from octoform.state.layout import Layout

STEP = 0.005
LONG = 60.0
PATIENCE = 10.0
"""Seconds in which calm has to come back by itself after a case."""
REMEMBERED = ("breakers.json", "starts.json", "recall.json", "spend.json")
"""What the daemon knows of former troubles; a fault that is injected again is meant to be a first one each time."""
OPEN = ("open", "frozen", "surfaced")
_UNWATCHED = ("check.json",)
"""Published files that a repair may write with other bytes: the time of the last check."""


class Bench:
    """A project that is applied, its host, and its daemon."""

    def __init__(self, project: Project, host: Host, plug: Callable[[Host], None]) -> None:
        self.project, self.host, self._plug = project, host, plug
        self.layout = Layout(project.folder, project.host)
        self.daemon: subprocess.Popen[bytes] | warm.Begun | None = None
        self.loaded = False
        """True where daemons and their workers are forks of the loaded command line: nothing about their size shows."""
        self.log = project.outside / "watch.log"
        """What the daemons have printed."""
        self.undo: list[Callable[[], object]] = []
        """What a case made of the world and its `mend` takes back."""
        self.daemons_started = 0
        self.before: dict[str, str] = {}
        """Digests of what is protected, before the fault."""
        self.nodes: dict[str, Any] = {}
        """The state's nodes before the fault."""
        self.strays: list[subprocess.Popen[bytes]] = []
        self.holder: socket.socket | None = None
        self.forgets = True
        """False where no fault comes twice, so that none looks like the return of one before."""
        self.closing: Callable[[], object] = lambda: None
        self.unwritten = False
        """True while the daemon can write nothing down, so that what it prints counts."""
        self.spent = 0.0
        """Seconds of a core that the daemon had used before the fault, where a case asks for that."""
        self.session: Any = None
        """A client that stays connected over the case, and the server info that it got."""

    # The daemon's process

    def watch(self, *below: str) -> None:
        """Start `octoform watch` and wait until it has looked once; ``below`` is a command that executes another."""
        self.daemons_started += 1
        health = self.layout.daemon / "health.json"
        health.unlink(missing_ok=True)
        with self.log.open("ab") as log:
            daemon = self.daemon = self._begun(below, log)
        assert until(lambda: health.exists() or daemon.poll() is not None, LONG), "the daemon does not look"
        assert daemon.poll() is None, self.said()

    def _begun(self, below: Sequence[str], log: IO[bytes]) -> "subprocess.Popen[bytes] | warm.Begun":
        if self.loaded:
            return warm.begin_daemon(OCTOFORM, self.project.folder, self.project.environment(), log.fileno())
        return subprocess.Popen(
            [*below, str(OCTOFORM), "watch"],
            cwd=self.project.folder,
            env=self.project.environment(),
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
        )

    def end_daemon(self, number: int = signal.SIGTERM) -> int:
        """End it and give back its status."""
        assert self.daemon is not None
        self.daemon.send_signal(number)
        return self.daemon.wait(LONG)

    def said(self) -> str:
        """The last words of the daemon."""
        return self.log.read_text(errors="replace")[-4000:]

    def printed(self) -> dict[str, dict[str, Any]]:
        """Every episode as the daemons have printed it last, by id."""
        found: dict[str, dict[str, Any]] = {}
        for line in self.log.read_bytes().split(b"\n"):
            with suppress(ValueError, LookupError, TypeError):  # a line without an episode, or one just being written
                entry = json.loads(line)["episode"]
                found[entry["id"]] = entry
        return found

    # What is seen from outside

    def process(self) -> Running | None:
        """The endpoint's process."""
        return running(self.layout)

    def serves(self) -> bool:
        """Whether a process runs, takes clients and answers."""
        if self.process() is None or record.ask(self.layout, {"op": "status"}, 0.5) is None:
            return False
        try:
            greeted(self.layout.socket, 0.5).close()
        except OSError:
            return False
        return True

    def call(self, tool: str, seconds: float = 20.0, **arguments: Any) -> tuple[bool, str]:
        """Whether a call works, and its text; the endpoint is not started for it."""
        if self.process() is None:
            return False, "nothing runs"
        done, problems = call(self.layout, ToolCall(tool, arguments, seconds=seconds))
        if done is None:
            return False, "; ".join(each.summary for each in problems)
        return not done.is_error, str((done.structured or {}).get("text", done.message))

    def episodes(self) -> dict[str, dict[str, Any]]:
        """Every episode as it was last written down, by id; as it was last printed, where nothing can be written."""
        found = self.printed() if self.unwritten else {}
        with suppress(FileNotFoundError):
            for line in (self.layout.daemon / "episodes.jsonl").read_bytes().split(b"\n"):
                with suppress(ValueError):  # a line that is just being written
                    entry = json.loads(line)
                    found[entry["id"]] = entry
        return found

    def open_episodes(self) -> list[dict[str, Any]]:
        """Those that last."""
        return [each for each in self.episodes().values() if each["closed"] is None]

    def health(self) -> dict[str, Any]:
        """The daemon's own record of health; empty while there is none."""
        with suppress(OSError, ValueError):
            return dict(json.loads((self.layout.daemon / "health.json").read_bytes()))
        return {}

    def protected(self) -> dict[str, str]:
        """Digests of everything that was accepted or published, by path below the project."""
        return dict(self._digests())

    def _digests(self) -> Iterator[tuple[str, str]]:
        layout, project = self.layout, self.project.folder
        single = [project / "octopus.yaml", layout.instances, layout.fingerprint]
        for path in [*single, *_files(layout.committed), *_files(layout.endpoint)]:
            if path.name in _UNWATCHED or "__pycache__" in path.parts:
                continue
            with suppress(FileNotFoundError):
                how = f"link {path.readlink()}" if path.is_symlink() else of_bytes(path.read_bytes())
                mode = path.lstat().st_mode & 0o111
                yield path.relative_to(project).as_posix(), f"{mode:o} {how}"

    def state(self) -> dict[str, Any]:
        """Each node as the state knows it."""
        return dict(json.loads(self.layout.snapshot.read_bytes())["nodes"])

    def starts(self) -> int:
        """How often the daemon has started the endpoint, by its own record."""
        with suppress(OSError, ValueError):
            return len(json.loads((self.layout.daemon / REMEMBERED[1]).read_bytes())["starts"])
        return 0

    def attempts(self) -> int:
        """How many attempts of agents there are."""
        with suppress(OSError):
            return sum(path.is_dir() and path.name[:1].isdigit() for path in self.layout.attempts.iterdir())
        return 0

    def strangers(self) -> list[int]:
        """Processes that belong to this deployment and to neither its endpoint nor its daemon nor their children."""
        ours = {os.getpid()} | ({self.daemon.pid} if self.daemon else set())
        served = self.process()
        known = ours | ({served.pid} if served else set())
        folder = os.fsencode(self.project.folder)
        return [pid for pid in _processes() if pid not in known and not _below(pid, known) and _names(pid, folder)]

    def environment(self) -> Path:
        """The serving environment that is published."""
        return Path(json.loads((self.layout.endpoint / "manifest.json").read_bytes())["environment"])

    def packages(self) -> Path:
        """The folder of its packages."""
        return packages_of(self.environment())

    # From case to case

    def ready(self) -> bool:
        """All is well: the daemon lives, the endpoint serves, no episode is open."""
        alive = self.daemon is not None and self.daemon.poll() is None
        return alive and self.serves() and not self.open_episodes()

    def reset(self) -> None:
        """Put the world right, and wait for calm; AssertionError where it does not come."""
        while self.undo:
            self.undo.pop()()
        self._plug(self.host)
        if until(self.ready, PATIENCE):
            if self.forgets and self._remembers():
                self._forget()
            return
        raise AssertionError(f"no calm before the fault: {[each['summary'] for each in self.open_episodes()]}")

    def _remembers(self) -> bool:
        """Whether a trouble of before would make the next one look like its return, which is another fault."""
        return any((self.layout.daemon / name).exists() for name in REMEMBERED[:2])

    def _forget(self) -> None:
        """Another daemon, which knows of no former trouble."""
        if self.daemon is not None and self.daemon.poll() is None:
            self.end_daemon()
        for name in REMEMBERED:
            (self.layout.daemon / name).unlink(missing_ok=True)
        self.watch()
        assert until(self.ready, LONG), self.said()

    def close(self) -> None:
        """End everything."""
        while self.undo:
            self.undo.pop()()
        if self.daemon is not None and self.daemon.poll() is None:
            self.end_daemon()
        self.project.run("stop")
        self.host.clear()
        self.closing()


def until(what: Callable[[], object], seconds: float, step: float = STEP) -> bool:
    """Wait until it is true; False when it is not after so many seconds. Looked at all the time, since times count;
    where they do not, each ``step`` seconds."""
    end = time.monotonic() + seconds
    while not what():
        if time.monotonic() > end:
            return False
        time.sleep(step)
    return True


def _files(folder: Path) -> Iterator[Path]:
    return (path for path in sorted(folder.rglob("*")) if path.is_symlink() or path.is_file())


def _processes() -> list[int]:
    return [int(path.name) for path in Path("/proc").iterdir() if path.name.isdigit()]


def _names(pid: int, folder: bytes) -> bool:
    """Whether its command line, its folder or its environment names this deployment."""
    for part in ("cmdline", "environ"):
        with suppress(OSError):
            if folder in Path(f"/proc/{pid}/{part}").read_bytes():
                return True
    with suppress(OSError):
        return os.fsencode(Path(f"/proc/{pid}/cwd").readlink()).startswith(folder)
    return False


def _below(pid: int, known: set[int]) -> bool:
    """Whether one of these is its parent, or its parent's, at any distance."""
    while pid > 1:
        try:
            stat = Path(f"/proc/{pid}/stat").read_text()
        except OSError:
            return False
        pid = int(stat[stat.rindex(")") + 2 :].split()[1])
        if pid in known:
            return True
    return False
