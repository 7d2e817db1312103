"""Which files an agent may not touch while it runs, whatever it is asked: sources, what was accepted, what is served.

Guarded is what nobody else has a reason to write meanwhile, since the state's lock is held: a difference is the
agent's. What the endpoint, a daemon and a person write at any time (logs, counters, latches, what a person asks for)
is not guarded here. The daemon's memory is, as long as none has been there; one that lives knows itself what it wrote.
"""

import fcntl
import os
from dataclasses import dataclass, replace
from pathlib import Path

from octoform.apply import audit
from octoform.apply.context import Context
from octoform.apply.endpoint_node import CANDIDATE
from octoform.apply.healing_record import FOLDER as HEALED
from octoform.diagnostics import Diagnostic
from octoform.endpoint.files import CLIENTS, CONNECTION, LAUNCHER, LAUNCHER_PACKAGE, MANIFEST, POLICY, SERVE_SCRIPT
from octoform.harness.port import Task
from octoform.state import attempts
from octoform.state.layout import Layout

_SERVED = (LAUNCHER, CONNECTION, SERVE_SCRIPT, MANIFEST, POLICY)


@dataclass(frozen=True, slots=True)
class Guard:
    """What lay there when the agent began. ``daemon`` tells which daemon was there last; None while one lives."""

    watch: audit.Watch
    layout: Layout
    daemon: bytes | None

    def end(self, undone: Path) -> list[Diagnostic]:
        """Put back what was changed and say so; an empty list when the attempt kept to its folder.

        ``undone`` is a folder, made when it is needed, for what the changed files had become.
        """
        watch = self.watch
        if self.daemon is None or _daemon(self.layout) != self.daemon:
            # A daemon that came meanwhile wrote its own files, and goes on from what it finds.
            memory = self.layout.memory()
            watch = replace(watch, guarded={path: it for path, it in watch.guarded.items() if path not in memory})
        return audit.end(watch, undone)


def begin(context: Context, task: Task) -> Guard:
    """Remember all that the agent of this attempt may not touch."""
    layout, manifest = context.layout, context.manifest
    files = [manifest.path, *manifest.profile_files, *(spec.path for spec in context.specs.values())]
    files += [*layout.records(), *(layout.endpoint / name for name in _SERVED)]
    files += [folder / attempts.FILE_NAME for folder in attempts.folders(layout) if folder != task.workdir]
    folders = [layout.committed, layout.spec_edits, layout.kept, layout.local / HEALED, layout.local / CANDIDATE]
    folders += [layout.endpoint / name for name in (CLIENTS, LAUNCHER_PACKAGE)]
    sign = _daemon(layout)
    return Guard(audit.begin(layout.project, [*files, *layout.memory()], folders), layout, sign)


def _daemon(layout: Layout) -> bytes | None:
    """Which daemon was there last (empty: none ever was); None while one lives, or where that cannot be told."""
    try:
        descriptor = os.open(layout.daemon_lock, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
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
