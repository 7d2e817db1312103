"""Archives of logs: one that has grown large makes room for a new one, and nothing of it is lost. Light.

The calls' log is opened for every line, so it is renamed and the next line begins a new one. The log of the endpoint's
process stays open in that process, so its bytes are copied and the file is cut: the process goes on at its beginning.
Older archives are compressed, and only once the compressed one is whole on the disk; the newest archive never is, since
a line may still come into it. The oldest one goes, but its error lines outlive it.
"""

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

from octoform.base.files import TEMPORARY, move, publish, read, replace, stream, stream_to
from octoform.state.layout import Layout

ARCHIVES = 5
"""How many are kept of each log."""
MAX_ERROR_BYTES = 4_000_000
"""Bytes of errors of archives that are gone; the newest stay."""
_CHUNK = 1 << 20
_LINE = 64 * 1024
_ERROR_MARKS = (b'"ok": false', b'"ok":false', b"Traceback", b"rror", b"refused", b"Exception")


def rotate(path: Path, *, held_open: bool) -> int:
    """Make ``path`` its own first archive, and give its size in bytes; OSError when the system refuses.

    ``held_open``: a process has it open and goes on writing to it.
    """
    size = path.lstat().st_size
    make_way(path)
    if held_open:
        _copy_and_cut(path, _archive(path, 1))
    else:
        move(path, _archive(path, 1))
    _compress(path)
    return size


def archives(layout: Layout) -> list[Path]:
    """The archives of all logs but those of the audit, which has its own rule; oldest first."""
    found = [path for name in (layout.call_log, layout.server_log) for path in name.parent.glob(f"{name.name}.*")]
    return sorted((path for path in found if not path.is_symlink()), key=lambda path: path.stat().st_mtime)


def drop(path: Path) -> None:
    """Remove an archive; its error lines are kept beside it."""
    _keep_errors(path, path.with_name(f"{path.name.partition('.')[0]}.errors"))
    path.unlink(missing_ok=True)


def make_way(path: Path) -> None:
    """Number every archive one higher; the one behind the last goes."""
    for number in range(ARCHIVES, 0, -1):
        for archive in (_archive(path, number), _archive(path, number, packed=True)):
            if not os.path.lexists(archive):
                continue
            if number == ARCHIVES:
                drop(archive)
            else:
                move(archive, _archive(path, number + 1, packed=archive.suffix == ".gz"))


def _archive(path: Path, number: int, *, packed: bool = False) -> Path:
    return path.with_name(f"{path.name}.{number}{'.gz' if packed else ''}")


def _copy_and_cut(path: Path, target: Path) -> None:
    """Copy what the process has written, and cut the file once the copy is whole and what came meanwhile is in it."""
    draft = target.with_name(f".{target.name}{TEMPORARY}")
    try:
        with stream(path) as source, stream_to(draft) as copy:
            shutil.copyfileobj(source, copy, _CHUNK)
            copy.flush()
            os.fsync(copy.fileno())
            publish(draft, target)
            shutil.copyfileobj(source, copy, _CHUNK)  # what came during the sync
            copy.flush()
            os.truncate(path, 0)
    finally:
        draft.unlink(missing_ok=True)


def _compress(path: Path) -> None:
    """Compress what is older than the newest archive."""
    import gzip  # here, so that a client's pipe does not load it

    for number in range(2, ARCHIVES + 1):
        plain, packed = _archive(path, number), _archive(path, number, packed=True)
        if not plain.is_file():
            continue
        draft = packed.with_name(f".{packed.name}{TEMPORARY}")
        try:
            with stream(plain) as source, stream_to(draft) as file:
                with gzip.GzipFile(packed.name, "wb", 6, file) as target:
                    shutil.copyfileobj(source, target, _CHUNK)
                file.flush()
                os.fsync(file.fileno())
            publish(draft, packed)
            plain.unlink()
        finally:
            draft.unlink(missing_ok=True)


def _keep_errors(archive: Path, errors: Path) -> None:
    """Append an archive's error lines to what is kept of former ones, whole lines, the newest first to stay."""
    found = b"".join(line for line in _lines(archive) if any(mark in line for mark in _ERROR_MARKS))
    if not found:
        return
    former = read(errors, follow=False) if errors.exists() else b""
    kept = (former + found)[-MAX_ERROR_BYTES:]
    if len(former) + len(found) > MAX_ERROR_BYTES:
        kept = kept.partition(b"\n")[2]
    replace(errors, kept)


def _lines(archive: Path) -> Iterator[bytes]:
    """The lines of an archive, the long ones cut; one that is damaged as far as it can be read."""
    import gzip

    try:
        with stream(archive) as log, gzip.open(log) if archive.suffix == ".gz" else log as file:
            for line in iter(lambda: file.readline(_LINE), b""):
                yield line if line.endswith(b"\n") else line + b"\n"
    except (OSError, EOFError):
        return
