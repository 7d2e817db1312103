"""Which files an agent may not touch while it runs, whatever it is asked: sources, what was accepted, what is served.

Guarded is what nobody else has a reason to write meanwhile, since the state's lock is held: a difference is the
agent's, and so is a new file where one is read as instruction (`instructions`). What the endpoint, a daemon and a
person write at any time (logs, counters, latches, what a person asks for) is not guarded here. The daemon's memory is,
as long as none has been there; one that lives knows itself what it wrote.
"""

import fcntl
import os
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import octoform
from octoform.apply import audit, instructions
from octoform.apply.context import Context
from octoform.diagnostics import Diagnostic, warning
from octoform.harness.port import Task
from octoform.state.artifacts import attempts
from octoform.state.git.head import head_revision
from octoform.state.layout import Layout
from octoform.state.store.lock import is_locked

UNDONE = "undone"
"""Folder of an attempt with what files had become that were not the agent's to change."""


@dataclass(frozen=True, slots=True)
class Guard:
    """What lay there when the agent began. ``daemon`` tells which daemon was there last; None while one lives.

    ``specs`` are those that come with octoform, ``installation`` is what tells one installation of it from another.
    """

    watch: audit.Watch
    layout: Layout
    daemon: bytes | None
    revision: str | None
    specs: frozenset[Path]
    installation: object

    def end(self, undone: Path) -> list[Diagnostic]:
        """Put back what was changed and say so; an empty list when the attempt kept to its folder.

        ``undone`` is a folder, made when it is needed, for what the changed files had become.
        """
        watch = self.watch
        if self.daemon is None or _daemon(self.layout) != self.daemon:
            # A daemon that came meanwhile wrote its own files, and goes on from what it finds.
            memory = self.layout.memory()
            watch = replace(watch, guarded={path: it for path, it in watch.guarded.items() if path not in memory})
        if _installation() == self.installation:
            # Nobody has brought it up to date meanwhile, so a difference is the agent's.
            watch = replace(watch, installed=watch.installed - self.specs)
        return [*audit.end(watch, undone), *self._moved()]

    def _moved(self) -> list[Diagnostic]:
        """A commit may be a person's, who would lose it: it is told and stays."""
        now = head_revision(self.layout.project)
        if now == self.revision:
            return []
        return [
            warning(
                "APPLY-OUTSIDE-WRITE",
                "the repository's HEAD was moved while the agent ran; it was left as it is",
                detail=f"from {self.revision or 'no commit'} to {now or 'no commit'}",
                hint="`git log` shows what was committed; if that was not you, `git reset --soft` to the former",
            )
        ]


def begin(context: Context, task: Task) -> Guard:
    """Remember all that the agent of this attempt may not touch."""
    layout, read = context.layout, instructions.sources(context)
    files = [*read.files, *layout.records(), *(layout.endpoint / name for name in instructions.SERVED)]
    files += [folder / attempts.FILE_NAME for folder in attempts.folders(layout) if folder != task.workdir]
    folders = [*read.folders, layout.committed, *instructions.records(layout)]
    sign = _daemon(layout)
    watch = _begun(context, [*files, *layout.memory()], folders, read.rooms)
    return Guard(watch, layout, sign, head_revision(layout.project), _installed(context), _installation())


def of_sources(context: Context) -> audit.Watch:
    """Remember only what is read as instruction: for the time in which an agent's code is run to judge it."""
    read = instructions.sources(context)
    return _begun(context, read.files, read.folders, read.rooms)


def _begun(context: Context, files: Iterable[Path], folders: Iterable[Path], rooms: Iterable[Path]) -> audit.Watch:
    project, own = context.layout.project, context.layout.host
    started = instructions.of_octoform()
    installed = _installed(context) | {*started.files, *started.rooms}
    wanted = audit.Guarded(
        [*files, *started.files],
        folders,
        [*rooms, *started.rooms],
        instructions.home(context.environ),
        installed,
        lambda: _at_work(project, own),
        instructions.starts(context.environ),
    )
    return audit.begin(project, wanted)


def _at_work(project: Path, own: str) -> tuple[Path, ...]:
    """What belongs to other hosts of this folder that a run or a daemon is changing right now."""
    others = [Layout(project, path.parent.name) for path in (project / ".octoform").glob("*/lock.guard")]
    busy = [other for other in others if other.host != own and (is_locked(other) or _daemon(other) is None)]
    return tuple(place for other in busy for place in (other.committed, other.local))


def _installed(context: Context) -> frozenset[Path]:
    """The specs and schemas that come with octoform: other projects read them as well."""
    paths = (path for spec in context.specs.values() for path in (spec.path, spec.schema) if path is not None)
    return frozenset(path for path in paths if not path.is_relative_to(context.layout.project))


def _installation() -> object:
    """What another version of octoform would change: its package's own files, the record of its install, the commit."""
    own = Path(octoform.__file__)
    files = (own, *sorted(own.parents[1].glob("octoform-*.dist-info/RECORD")))
    try:
        facts = [(path.name, path.stat().st_mtime_ns, path.stat().st_size) for path in files]
    except OSError:
        return object()  # it is being changed right now: like no other
    return facts, head_revision(own.parents[1])


def _daemon(layout: Layout) -> bytes | None:
    """Which daemon was there last (empty: none ever was); None while one lives, or where that cannot be told."""
    try:
        descriptor = os.open(layout.daemon_lock, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
    except FileNotFoundError:
        return b""
    except OSError:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
        return os.read(descriptor, 4096)
    except OSError:
        return None
    finally:
        os.close(descriptor)
