"""Take the endpoint away: exactly what apply made, nothing that a person put beside it."""

import os
import shutil
from pathlib import Path

from octoform.endpoint.environment.model import FOLDER_NAME, MARKER
from octoform.endpoint.files import (
    CHECK,
    CLIENTS,
    CONNECTION,
    LAUNCHER,
    MANIFEST,
    POLICY,
    PROGRAM,
    SERVE_SCRIPT,
)
from octoform.endpoint.process.estop import LATCH
from octoform.endpoint.process.lifecycle import stop
from octoform.endpoint.publish.snippets import snippets
from octoform.state.artifacts.cache import ENDPOINT, forget
from octoform.state.layout import Layout

STOPS = "stopped-*.json"  # what the runtime writes for a device that was stopped until a command of its own


def remove(layout: Layout) -> list[Path]:
    """Remove endpoint and environments of this host; gives the files and folders that are not ours and stayed.

    The launcher goes first, so that no client starts a server from what is being removed; then the process is ended,
    and its tokens and counters go with it. The logs stay, and so do an emergency stop and the stop of a device: what
    was stopped for a reason must not move after the next apply because nobody remembers it. OSError when the system
    refuses.
    """
    folder = layout.endpoint
    _unlink(folder, LAUNCHER)
    stop(layout)
    _empty(layout.run)
    for name in (SERVE_SCRIPT, CONNECTION, POLICY, CHECK, MANIFEST):
        _unlink(folder, name)
    for name in snippets("", []):
        _unlink(folder / CLIENTS, name)
    shutil.rmtree(folder / PROGRAM, ignore_errors=True)
    for path in sorted(layout.environments.glob("*")):
        if FOLDER_NAME.fullmatch(path.name) and ((path / MARKER).is_file() or (path / "pyvenv.cfg").is_file()):
            shutil.rmtree(path)
    for path in sorted(layout.environments.glob(".*.lock")):
        path.unlink()
    forget(layout, (ENDPOINT,))
    return [*_sweep(folder / CLIENTS), *_sweep(folder), *_sweep(layout.environments)]


def stopped_devices(layout: Layout) -> tuple[Path, ...]:
    """The stops of single devices, which the runtime keeps until the command that ends each went well."""
    return tuple(sorted(layout.run.glob(STOPS)))


def _empty(run: Path) -> None:
    """Remove what the process kept, but for the latch of the emergency stop and the stops of devices."""
    kept = {path.name for path in run.glob(STOPS)} | ({LATCH} if os.path.lexists(run / LATCH) else set())
    if not kept:
        shutil.rmtree(run, ignore_errors=True)
        return
    for path in run.iterdir():
        if path.name in kept:
            continue
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)


def _unlink(folder: Path, name: str) -> None:
    """The file, and whatever a cut-off write left of it."""
    (folder / name).unlink(missing_ok=True)
    for path in folder.glob(f".{name}.*"):
        path.unlink()


def _sweep(folder: Path) -> list[Path]:
    """Remove the folder when it is empty, else tell what is in it."""
    if not folder.is_dir():
        return []
    left = sorted(folder.iterdir())
    if not left:
        folder.rmdir()
    return left
