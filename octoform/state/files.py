"""Durable files: every byte of state is written and read through these few functions.

A state that can be cut in half by a full disk, a power cut or a kill is no state. So a file is only ever replaced by a
complete, synced one, a file is only ever read when it is a regular file of a sane size (a link could point anywhere),
and every refusal of the operating system becomes a diagnostic that names the disk or folder, why, and what to do.
Light: a no-op plan reads artifacts through this module.
"""

import contextlib
import errno
import os
import stat
from collections.abc import Callable
from pathlib import Path

from octoform.base.files import TEMPORARY, create, read, replace
from octoform.diagnostics import Diagnostic, error
from octoform.state.layout import STAGES, Layout

Checkpoint = Callable[[str], None]
"""Called with a name before and after every durable step; a test may kill the process there."""

SIZE_LIMIT = 64 * 1024 * 1024
WRITE_PROBE_BYTES = 64 * 1024
IGNORES_ALL = b"*\n"
"""The rule of git by which nothing of a folder is ever committed (gitignore(5))."""
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_REFUSED = (errno.EROFS, errno.EACCES, errno.EPERM)
MOVE_AWAY = "move away what is there and run the same command again"
IN_THE_WAY = {
    errno.ELOOP: "a folder on the way to it is a link to itself",
    errno.ENOTDIR: "a folder on the way to it is none",
    errno.EEXIST: "what is there is no folder",
}
_PACKAGE = Path(__file__).resolve().parents[1]
_CLOSED = (errno.EACCES, errno.EPERM)
_NO_SPACE = (errno.ENOSPC, errno.EDQUOT)


def pass_by(name: str) -> None:
    """The checkpoint of a production run: nothing happens at any point."""


def display(path: Path) -> str:
    """The path as the person would type it: relative to the current folder where it lies below it."""
    try:
        return str(path.relative_to(Path.cwd()))
    except (ValueError, OSError):
        return str(path)


def write_atomic(
    path: Path, data: bytes, mode: int = 0o644, checkpoint: Checkpoint = pass_by, name: str = "file"
) -> Diagnostic | None:
    """Replace ``path`` by ``data`` as a whole, synced to disk; None when that is done.

    On any refusal by the operating system the temporary file is removed and the old file is untouched, unless the
    refusal came after the rename (then the new one is in place and complete). Checkpoints: ``<name>.start``,
    ``<name>.written``, ``<name>.renamed``, ``<name>.synced``.
    """
    try:
        checkpoint(f"{name}.start")
        replace(path, data, mode, lambda step: checkpoint(f"{name}.{step}"))
    except OSError as problem:
        return refused(problem, path)
    return None


def read_regular(path: Path, limit: int = SIZE_LIMIT) -> tuple[bytes | None, Diagnostic | None]:
    """The bytes of a regular file of at most ``limit`` bytes; (None, None) when there is no such file.

    A link, a folder, a device or a pipe is refused (STATE-LINK) without being followed or waited for.
    """
    try:
        kind = os.lstat(path).st_mode
        if not stat.S_ISREG(kind):
            return None, _not_regular(path, "a symbolic link" if stat.S_ISLNK(kind) else "a folder or special file")
        return read(path, limit, follow=False), None
    except FileNotFoundError:
        return None, None
    except OSError as problem:
        if problem.errno == errno.EFBIG:
            summary = f"the file has more than {limit} bytes"
            return None, error("STATE-TOO-LARGE", summary, path=display(path), hint="look at what wrote it")
        return None, unreadable(problem, path)


def _not_regular(path: Path, what: str) -> Diagnostic:
    return error(
        "STATE-LINK",
        f"this is {what}, not a file of the state",
        path=display(path),
        hint="remove it; octoform never reads or writes state through a link",
    )


def unreadable(problem: OSError, path: Path) -> Diagnostic:
    """STATE-UNREADABLE with the operating system's words."""
    hint = MOVE_AWAY if problem.errno in IN_THE_WAY else "check its owner and mode"
    return error("STATE-UNREADABLE", f"cannot be read: {reason_of(problem)}", path=display(path), hint=hint)


def reason_of(problem: OSError) -> str:
    """The operating system's words, but for those that do not say what to look for."""
    number, found = problem.errno or 0, problem.strerror or str(problem)
    return IN_THE_WAY.get(number, found) if found == os.strerror(number) else found


def refused(problem: OSError, path: Path) -> Diagnostic:
    """The diagnostic for a failed write: STATE-DISK-FULL, STATE-READ-ONLY or STATE-WRITE-FAILED."""
    where = display(path)
    if problem.errno in _FULL:
        return _disk_full(problem, path)
    reason = reason_of(problem)
    if problem.errno in _REFUSED:
        hint = f"make {display(path.parent)} writable for this user, or run from a copy that is"
        return error("STATE-READ-ONLY", f"cannot be written: {reason}", path=where, hint=hint)
    do = MOVE_AWAY if problem.errno in IN_THE_WAY else None
    summary, detail = f"cannot be written: {reason}", "the former file is intact"
    return error("STATE-WRITE-FAILED", summary, path=where, detail=detail, hint=do)


def _disk_full(problem: OSError, path: Path) -> Diagnostic:
    mount = mount_point(path.parent)
    if problem.errno == errno.EFBIG:
        summary = "the file would be larger than this process may write (ulimit -f)"
    elif problem.errno == errno.EDQUOT:
        summary = f"the disk quota on {mount} is spent"
    else:
        summary = f"no space left on {mount}"
    hint = f"free some space on {mount} and run the same command again"
    detail = "nothing was lost: the former file is intact"
    try:
        facts = os.statvfs(mount)
        free, total = facts.f_bavail * facts.f_frsize, facts.f_blocks * facts.f_frsize
        detail = f"{mount}: {free // 1024} KiB free of {total // 1024} KiB; {detail}"
        if problem.errno == errno.ENOSPC and facts.f_files and not facts.f_favail:  # (some file systems count none)
            summary = f"no inodes left on {mount}: it holds {facts.f_files} files, and takes no more"
            hint = f"remove some files on {mount}, of any size, and run the same command again"
    except OSError as unknown:
        detail = f"{mount}: {unknown.strerror}; {detail}"
    return error("STATE-DISK-FULL", summary, path=display(path), detail=detail, hint=hint)


def mount_point(path: Path) -> Path:
    """The root of the file system that holds ``path`` (which need not exist)."""
    current = Path(os.path.realpath(path))  # of a link to itself, too
    while not current.is_mount() and current != current.parent:
        current = current.parent
    return current


def make_folders(layout: Layout) -> Diagnostic | None:
    """Make ``state/<host>`` and the private ``.octoform/<host>``, which git ignores whatever the user's rules say."""
    target = layout.committed
    try:
        target.mkdir(parents=True, exist_ok=True)
        target = layout.local
        target.parent.mkdir(exist_ok=True, mode=0o700)
        target.mkdir(exist_ok=True, mode=0o700)
        for folder in (layout.committed, layout.local):
            if folder.is_symlink():
                return _not_regular(folder, "a symbolic link")
        if stat.S_IMODE(target.stat().st_mode) & 0o077:
            target.chmod(0o700)
    except OSError as problem:
        return refused(problem, target)
    return hide_from_git(layout.project)


def hide_from_git(project: Path) -> Diagnostic | None:
    """Write `.octoform/.gitignore` again unless it is as octoform wrote it; None when git ignores the whole folder.

    Below lie serial numbers, keys, tokens and sockets, which one lost line would let `git add -A` take. Nothing is done
    where ``project`` has no private folder. A link is replaced and not followed, a folder is moved away, a pipe is
    never opened.
    """
    folder = project / ".octoform"
    path = folder / ".gitignore"
    if not folder.is_dir() or closed(folder) is not None or read_regular(path, len(IGNORES_ALL))[0] == IGNORES_ALL:
        return None  # that of another user is reported by the command itself
    try:
        if path.is_dir() and not path.is_symlink():
            path.rename(folder / f"{path.name}.{os.urandom(6).hex()}")  # a folder, to a free name
    except OSError as problem:
        return refused(problem, path)
    return write_atomic(path, IGNORES_ALL)


def check_writable(layout: Layout) -> list[Diagnostic]:
    """Whether an apply could write its results; asked before any agent is started.

    Makes the folders, removes what a killed run left half written, and writes, syncs and removes a small file in each
    folder that will be written. Only for the holder of the lock.
    """
    problem = make_folders(layout)
    if problem is not None:
        return [problem]
    folders = [layout.committed, layout.local, *(layout.folder(stage) for stage in STAGES), layout.steps]
    sweep(layout)
    found = []
    for folder in folders:
        trouble = _probe(folder) if folder.is_dir() and not folder.is_symlink() else None
        if trouble is not None:
            found.append(trouble)
    return _one_per_cause(found)


def sweep(layout: Layout) -> None:
    """Remove temporary files that a killed run left among the committed ones. Only for the holder of the lock."""
    for leftover in list(layout.committed.rglob(f".*{TEMPORARY}")):
        if leftover.is_dir() and not leftover.is_symlink():
            import shutil  # which loads five compressions

            shutil.rmtree(leftover, ignore_errors=True)
        else:
            with contextlib.suppress(OSError):
                leftover.unlink()


def full_disk(layout: Layout) -> Diagnostic | None:
    """STATE-DISK-FULL when the disk that holds the attempts or the state takes no more, else None.

    distinguishes an agent that failed for want of room from one that did its work badly.
    """
    for folder in (layout.local, layout.committed):
        problem = _probe(folder) if folder.is_dir() else None
        if problem is not None and problem.code == "STATE-DISK-FULL":
            return problem
    return None


def _probe(folder: Path) -> Diagnostic | None:
    trial = folder / f".writable.{os.getpid()}"
    problem = write_atomic(trial, bytes(WRITE_PROBE_BYTES), 0o600)
    if problem is None:
        try:
            trial.unlink()
        except OSError as refusal:
            return refused(refusal, trial)
        return None
    return Diagnostic(problem.severity, problem.code, problem.summary, display(folder), hint=problem.hint)


def _one_per_cause(found: list[Diagnostic]) -> list[Diagnostic]:
    """A full or read-only file system is stated once, not once for each folder on it."""
    seen: dict[tuple[str, str], Diagnostic] = {}
    for item in found:
        seen.setdefault((item.code, item.summary), item)
    return list(seen.values())


# Detects state folders owned by another user: unreadable must not be mistaken for empty.
#
# A command that took unreadable for missing would report to a second user that nothing runs, or advise
# him to apply or to remove files. Light: the pipe of every client asks this.


def foreign(layout: Layout) -> Diagnostic | None:
    """PROJECT-FOREIGN when what octoform keeps of this host is another user's and closed to this one."""
    return closed(layout.local.parent) or closed(layout.local)


def foreign_among(project: Path, host: str | None = None) -> Diagnostic | None:
    """The same for one host of a folder, or for the first of all that it is true of."""
    kept = project / ".octoform"
    folders = [kept, *([kept / host] if host is not None else sorted(kept.glob("*/")))]
    return next(filter(None, map(closed, folders)), None)


def closed(folder: Path) -> Diagnostic | None:
    """The same for one folder; None for one that is open, and for one that is not there."""
    try:
        owner = folder.stat().st_uid
    except OSError:
        return None  # not there, or behind a closed folder; who needs it finds out
    if owner == os.geteuid() or os.access(folder, os.R_OK | os.X_OK):
        return None
    summary = f"{folder} belongs to user {name_of(owner)}, and is closed to others"
    return error("PROJECT-FOREIGN", summary, path=str(folder), hint="run the same command as that user")


def name_of(user: int) -> str:
    """The name of a user id, or the id where it has none."""
    import pwd  # only a refusal pays for it

    try:
        return pwd.getpwuid(user).pw_name
    except KeyError:
        return str(user)


# Room kept on the disk, so that the end of a step that has begun can always be recorded.
#
# An agent may work for minutes and fill the disk while it does. What it made is worth more than 512 KiB, so these are
# taken before it starts and given back when a write of the state finds no room. Light.

RESERVE_BYTES = 512 * 1024


def reserve_path(layout: Layout) -> Path:
    """The file that takes the room."""
    return layout.local / "reserve"


def hold(layout: Layout) -> Diagnostic | None:
    """Take the room, if it is not held already; STATE-DISK-FULL when there is none."""
    path = reserve_path(layout)
    if path.exists():
        return None
    try:
        create(path, os.urandom(RESERVE_BYTES))  # not zeros: a file system may store those as nothing
    except OSError as problem:
        return refused(problem, path)
    return None


def give_back(layout: Layout) -> Diagnostic | None:
    """Free the room."""
    path = reserve_path(layout)
    try:
        path.unlink(missing_ok=True)
    except OSError as problem:
        return refused(problem, path)
    return None


def spending(layout: Layout, write: Callable[[], Diagnostic | None]) -> Diagnostic | None:
    """Do a write that leaves the former file intact when it fails; on a full disk free the room and try once more."""
    problem = write()
    if problem is None or problem.code != "STATE-DISK-FULL" or not reserve_path(layout).exists():
        return problem
    return give_back(layout) or write()


def unforeseen_refusal(problem: OSError) -> Diagnostic:
    """SYSTEM-REFUSED: the operating system's error, about which file, and where octoform met it.

    A refused process or thread is SYSTEM-NO-PROCESSES.
    """
    from octoform.base import shortage  # only a refusal pays for it

    if shortage.is_shortage(problem):
        detail = "; ".join(filter(None, (shortage.limits(), _place(problem)))) or None
        hint = "end some of your processes, or raise the limit, and run the same command again"
        return error("SYSTEM-NO-PROCESSES", shortage.TEXT, detail=detail, hint=hint)
    path = Path(os.fsdecode(problem.filename)) if isinstance(problem.filename, str | bytes) else None
    reason = reason_of(problem) or type(problem).__name__
    return error(
        "SYSTEM-REFUSED",
        f"the operating system refused: {reason}",
        path=display(path) if path is not None else None,
        detail=_place(problem),
        hint=_hint(problem, path),
    )


def _hint(problem: OSError, path: Path | None) -> str:
    if path is None or not path.is_absolute():
        return "octoform explain SYSTEM-REFUSED explains what can be done"
    if problem.errno in _CLOSED:
        owner = _owner(path)
        if owner is not None and owner != os.geteuid():
            return f"it belongs to user {name_of(owner)}; run it as that user"
        return "look at its owner and mode"
    if problem.errno in _NO_SPACE:
        return f"free some space on {mount_point(path.parent)} and run the same command again"
    if problem.errno in IN_THE_WAY:
        return MOVE_AWAY
    if problem.errno == errno.EROFS:
        return "its file system is mounted read-only; mount it for writing, or use a copy that is writable"
    return "octoform explain SYSTEM-REFUSED explains what can be done"


def _owner(path: Path) -> int | None:
    """The owner of the file, or of the nearest folder above it that is readable."""
    for place in (path, *path.parents):
        try:
            return place.stat().st_uid
        except OSError:
            continue
    return None


def _place(problem: OSError) -> str | None:
    """The innermost line of octoform's own that met it: without it a bug looks like a bad disk."""
    import traceback  # only a refusal pays for it

    frames = [frame for frame in traceback.extract_tb(problem.__traceback__) if _ours(frame.filename)]
    if not frames:
        return None
    last = frames[-1]
    return f"met in {last.name} ({Path(last.filename).relative_to(_PACKAGE.parent)}, line {last.lineno})"


def _ours(name: str) -> bool:
    return Path(name).is_relative_to(_PACKAGE)
