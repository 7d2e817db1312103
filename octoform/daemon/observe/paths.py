"""What of a deployment is watched on disk, and what each change means. (Light.)

Left out is whatever the daemon, the endpoint in everyday work or a client write: counters, tokens, the audit log,
episodes, readings, attempts. A daemon that woke itself would never sleep again.
"""

import os
from collections.abc import Iterator
from pathlib import Path

from octoform.daemon.model import Cause
from octoform.daemon.observe.inotify import Watch
from octoform.endpoint.environment.model import packages_of
from octoform.endpoint.files import read_manifest
from octoform.endpoint.process.estop import LATCH
from octoform.endpoint.process.record import RECORD
from octoform.state.layout import Layout

MANIFEST = "octopus.yaml"
ASKED = ("paused.json", "asked.json")
"""What commands write into the daemon's folder to be noticed by it."""
MOST_FOLDERS = 300


def logs(layout: Layout) -> Iterator[Watch]:
    """The two logs in which trouble is told."""
    names = {layout.call_log.name: Cause.LOG, layout.server_log.name: Cause.LOG}
    yield Watch(layout.logs, Cause.FILES, names, written=True)


def signs(layout: Layout) -> Iterator[Watch]:
    """Small files by which other processes say something: who serves, who stopped it, who holds the state."""
    local = dict.fromkeys((layout.lock.name, layout.instances.name, layout.fingerprint.name), Cause.FILES)
    folders = dict.fromkeys(("endpoint", "run", "log", "daemon", "environments", "kept"), Cause.FILES)
    yield Watch(layout.local, Cause.FILES, {**local, **folders})
    run = {RECORD: Cause.PROCESS, layout.stop_mark.name: Cause.FILES, LATCH: Cause.FILES}
    yield Watch(layout.run, Cause.FILES, run)
    yield Watch(layout.daemon, Cause.FILES, dict.fromkeys(ASKED, Cause.ASKED))


def standing(layout: Layout) -> Iterator[Watch]:
    """What the endpoint stands on: manifest, accepted files, its own files, the serving environment's packages."""
    yield Watch(layout.project, Cause.FILES, dict.fromkeys((MANIFEST, "state"), Cause.FILES))
    yield Watch(layout.committed.parent, Cause.FILES, {layout.host: Cause.FILES})
    for folder in (layout.committed, layout.endpoint):
        yield from (Watch(each, Cause.FILES) for each in _below(folder))
    manifest = read_manifest(layout)
    if manifest is not None:
        environment = Path(str(manifest.get("environment")))
        for each in (environment, environment / "bin", packages_of(environment)):
            yield Watch(each, Cause.FILES)


def _below(folder: Path) -> Iterator[Path]:
    """The folder and those in it, hidden ones and bytecode left out; the folder also when it is not there."""
    yield folder
    count = 0
    for root, folders, _ in os.walk(folder):
        folders[:] = [name for name in folders if not name.startswith(".") and name != "__pycache__"]
        for name in folders:
            count += 1
            if count > MOST_FOLDERS:
                return
            yield Path(root, name)
