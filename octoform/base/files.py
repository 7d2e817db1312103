"""One way to replace a file and one way to read one that may be a trap.

A process that is killed, a disk that is full or a power cut must never leave half a file, and whatever is in the
place of a file (a pipe, a device, a link, gigabytes, JSON without end) must never hold up or end its reader. So
a file is replaced by a complete and synced one, read only where it is a regular file of a sane size, and every
refusal is an OSError or a ValueError with a reason for a person. Standard library only.
"""

import contextlib
import errno
import json
import math
import os
import re
import stat
from collections.abc import Callable, Iterator
from io import BufferedReader, BufferedWriter
from itertools import takewhile
from pathlib import Path
from typing import Any

MAX_BYTES = 64 * 1024 * 1024
"""More than any file that octoform writes for itself to read again."""
MAX_DEPTH = 128
"""Levels of nested arrays and objects; nothing that octoform writes comes near, and Python's own stack holds more."""
MAX_FOLDER_DEPTH = 64
"""Levels of folders that `walk` looks into; nothing that octoform or a person writes comes near."""
_MAX_PATH_BYTES = 3800
"""Bytes of a path below which another name fits (PATH_MAX, limits.h)."""
TEMPORARY = ".octoform-tmp"
"""Ends the name of a file that is being written."""
_FLAGS = os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC
_FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC
_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
_BLOCK = 1 << 20
_LONG = rb"[0-9]{309}"
"""A number that no float holds has at least so many digits, unless it has an exponent."""
_IRREGULAR = "it is no regular file"
_UNFIT = rb"\\u(?:0000|[dD][89a-fA-F])"
"""Escapes of characters that no file name and no output can hold; a pair of surrogates is one character, and fits."""


def _unwatched(step: str) -> None:
    """The watcher of a production run: nothing happens at any step."""


def replace(
    path: Path,
    data: bytes,
    mode: int = 0o600,
    watch: Callable[[str], None] = _unwatched,
    *,
    synced: bool = True,
    exact: bool = False,
) -> None:
    """Replace ``path`` by ``data`` as a whole; OSError when the system refuses, and the former file is intact.

    A link at ``path`` is replaced, never followed. ``watch`` is called with "written", "renamed" and "synced" as each
    is done; a refusal after "renamed" leaves the new file in place, complete. Not ``synced``: whole for every reader,
    but a power cut may lose it. ``exact``: ``mode`` whatever the umask, as a person gave it.
    """
    _refuse_device(path)
    draft = path.with_name(f".{path.name}.{os.urandom(6).hex()}{TEMPORARY}")
    try:
        create(draft, data, mode, synced=synced)
        if exact:
            draft.chmod(mode)
        watch("written")
        draft.replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            draft.unlink()
        raise
    watch("renamed")
    if synced:
        sync_folder(path.parent)
    watch("synced")


def _refuse_device(path: Path) -> None:
    """A device node, such as /dev/null, is of the whole machine: root could put a file in its place."""
    with contextlib.suppress(FileNotFoundError):
        kind = path.lstat().st_mode
        if stat.S_ISCHR(kind) or stat.S_ISBLK(kind):
            raise FileExistsError(errno.EEXIST, "a device is in its place", str(path))


def replace_in(folder: int, name: str, data: bytes, mode: int) -> None:
    """Replace a file of an open folder as a whole, with exactly that mode, whatever the umask; OSError when refused.

    The file is whole for every reader, but not synced. A link of that name is replaced, never followed.
    """
    draft = Path(f".{name}.{os.urandom(6).hex()}{TEMPORARY}")
    try:
        create(draft, data, mode, synced=False, dir_fd=folder)
        os.chmod(draft, mode, dir_fd=folder)
        os.replace(draft, name, src_dir_fd=folder, dst_dir_fd=folder)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(draft, dir_fd=folder)
        raise


def publish(draft: Path, path: Path) -> None:
    """Replace ``path`` by ``draft``, a complete and synced file in the same file system; OSError when refused.

    A link at ``path`` is replaced, never followed. The caller syncs the folder, once for all files of a set.
    """
    draft.replace(path)


def publish_new(draft: Path, path: Path) -> None:
    """Give a complete file the name ``path`` as well; FileExistsError when that is taken, OSError without links."""
    os.link(draft, path, follow_symlinks=False)


def move(path: Path, target: Path) -> None:
    """Rename a file within its file system, in place of a former one at ``target``; OSError when refused.

    For a file that leaves its place (an archive, a damaged file); what comes into the place is written by `replace`.
    """
    path.replace(target)


def create(path: Path, data: bytes, mode: int = 0o600, *, synced: bool = True, dir_fd: int | None = None) -> None:
    """Write a file that is not there yet; OSError when it is, or the disk takes only a part (which then goes)."""
    descriptor = os.open(path, _NEW, mode, dir_fd=dir_fd)
    try:
        write_all(descriptor, data)
        if synced:
            os.fsync(descriptor)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(path, dir_fd=dir_fd)
        raise
    finally:
        os.close(descriptor)


def make_way(path: Path) -> None:
    """Rename what is in the place of a file of ours and is none (a folder, a pipe, a link).

    A folder may hold what somebody misses. Only for places that octoform alone writes; where a person named the place,
    what is there is theirs.
    """
    with contextlib.suppress(FileNotFoundError):
        if not stat.S_ISREG(path.lstat().st_mode):
            path.rename(path.with_name(f"{path.name}.aside-{os.urandom(3).hex()}"))


def private_folder(path: Path) -> Path:
    """Make a folder that is closed to others, and those above it that are missing; one that is there stays as it is.

    OSError when that cannot be, or something else has its name. A folder above is closed as well: anyone who may
    replace it replaces what is in it.
    """
    missing = takewhile(lambda each: not each.is_dir(), (path, *path.parents))
    for each in reversed([*missing]):
        each.mkdir(mode=0o700, exist_ok=True)
    return path


def walk(top: Path, max_depth: int = MAX_FOLDER_DEPTH) -> Iterator[tuple[Path, list[str], list[str]]]:
    """Each folder from ``top`` on, the upper ones first, with the names of its folders and of all else in it.

    As `os.walk`, but without recursion, so that folders nested thousands of levels deep end no one: what lies below
    ``max_depth`` levels, or too deep for a path, is not looked at. What is taken out of the list of folders is not
    entered, and neither is a link to one; a folder that is closed has nothing in it.
    """
    pending = [(top, 0)]
    while pending:
        place, level = pending.pop()
        folders: list[str] = []
        names: list[str] = []
        try:
            with os.scandir(place) as entries:
                for entry in entries:
                    (folders if _leads_to_folder(entry) else names).append(entry.name)
        except (FileNotFoundError, NotADirectoryError):
            continue
        except OSError:
            pass  # it is there, and closed
        yield place, folders, names
        below = (place / name for name in reversed(folders)) if level < max_depth else ()
        pending += [
            (each, level + 1) for each in below if len(os.fsencode(each)) < _MAX_PATH_BYTES and not each.is_symlink()
        ]


def _leads_to_folder(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_dir()
    except OSError:  # a link that leads nowhere anybody may look
        return False


def remove_tree(top: Path) -> None:
    """Remove a folder with all that is in it, however deep; what cannot be removed stays.

    The first refusal is raised (OSError) once all else is gone. A folder within is moved to the top before it is
    emptied, so no path grows long and none is followed twice; one that its owner has closed is opened.
    """
    problems: list[OSError] = []
    handle = os.open(top, _FOLDER)
    try:
        pending = [*_unlinked(handle, problems)]
        while pending:
            name = pending.pop()
            with _noted(problems):
                pending += _emptied(handle, name, problems)
    finally:
        os.close(handle)
    with _noted(problems):
        top.rmdir()
    if problems:
        raise problems[0]


def _emptied(top: int, name: str, problems: list[OSError]) -> list[str]:
    """Remove a folder below ``top``; the new names there of the folders that were in it."""
    with contextlib.suppress(OSError):
        os.chmod(name, 0o700, dir_fd=top)
    inner = os.open(name, _FOLDER, dir_fd=top)
    moved: list[str] = []
    try:
        for each in _unlinked(inner, problems):
            with contextlib.suppress(OSError):  # a folder that is closed to its owner cannot be moved
                os.chmod(each, 0o700, dir_fd=inner)
            with _noted(problems):
                fresh = f".{os.urandom(6).hex()}{TEMPORARY}"
                os.rename(each, fresh, src_dir_fd=inner, dst_dir_fd=top)
                moved.append(fresh)
    finally:
        os.close(inner)
    with _noted(problems):
        os.rmdir(name, dir_fd=top)
    return moved


def _unlinked(handle: int, problems: list[OSError]) -> list[str]:
    """Remove all that is no folder; the names of the folders."""
    folders = []
    for name in os.listdir(handle):
        with _noted(problems):
            if stat.S_ISDIR(os.stat(name, dir_fd=handle, follow_symlinks=False).st_mode):
                folders.append(name)
            else:
                os.unlink(name, dir_fd=handle)
    return folders


@contextlib.contextmanager
def _noted(problems: list[OSError]) -> Iterator[None]:
    try:
        yield
    except OSError as problem:
        problems.append(problem)


def write_all(descriptor: int, data: bytes) -> None:
    """Write every byte; OSError when the disk takes only some."""
    view = memoryview(data)
    while view:
        written = os.write(descriptor, view)
        if not written:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        view = view[written:]


def sync_folder(folder: Path) -> None:
    """Make the names in a folder durable."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def require_room(folder: Path, size: int) -> None:
    """OSError when ``folder`` does not take a file of ``size`` bytes; asked before something that works is ended."""
    trial = folder / f".room.{os.urandom(6).hex()}{TEMPORARY}"
    create(trial, bytes(size))
    trial.unlink()


def read(path: Path, limit: int = MAX_BYTES, *, follow: bool = True) -> bytes:
    """The bytes of a regular file of at most ``limit`` bytes; OSError for everything else, which is never waited for.

    Not ``follow``: a link at ``path`` is refused (ELOOP).
    """
    with opened(path, follow=follow) as descriptor:
        if os.fstat(descriptor).st_size > limit:
            raise _too_large(path, limit)
        parts: list[bytes] = []
        length = 0
        while part := os.read(descriptor, min(limit + 1 - length, _BLOCK)):
            parts.append(part)
            length += len(part)
            if length > limit:
                raise _too_large(path, limit)
        return b"".join(parts)


def head(path: Path, limit: int, *, follow: bool = False) -> bytes:
    """The first ``limit`` bytes of a regular file; OSError as `read`."""
    with opened(path, follow=follow) as descriptor:
        parts: list[bytes] = []
        left = limit
        while left and (part := os.read(descriptor, min(left, _BLOCK))):
            parts.append(part)
            left -= len(part)
        return b"".join(parts)


def read_plain(path: Path, limit: int) -> bytes | None:
    """The first ``limit`` bytes of a plain file; None when there is none, or it is a link, a folder or a pipe."""
    try:
        return head(path, limit)
    except OSError:
        return None


@contextlib.contextmanager
def opened(path: Path, *, follow: bool = True) -> Iterator[int]:
    """A descriptor to read a regular file with; OSError for a folder, device or pipe, without waiting for it."""
    try:
        descriptor = os.open(path, _FLAGS if follow else _FLAGS | os.O_NOFOLLOW)
    except ValueError:  # a NUL in the name
        raise OSError(errno.ENOENT, "it has a name that no file can have", repr(str(path))) from None
    except OSError as problem:
        if problem.errno == errno.ELOOP:
            raise OSError(errno.ELOOP, "it is a link to itself" if follow else "it is a symlink", str(path)) from None
        if problem.errno == errno.ENXIO:  # a socket
            raise OSError(errno.EINVAL, _IRREGULAR, str(path)) from None
        raise
    try:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise OSError(errno.EINVAL, _IRREGULAR, str(path))
        yield descriptor
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def stream(path: Path, *, follow: bool = True) -> Iterator[BufferedReader]:
    """A regular file as a buffered stream, for files too large to be held whole; OSError as `opened`."""
    with opened(path, follow=follow) as descriptor, os.fdopen(descriptor, "rb", closefd=False) as found:
        yield found


@contextlib.contextmanager
def stream_to(path: Path) -> Iterator[BufferedWriter]:
    """A new file, private, as a buffered stream; whatever has its name goes first, OSError when that is a folder."""
    path.unlink(missing_ok=True)
    with os.fdopen(os.open(path, _NEW, 0o600), "wb") as made:
        yield made


def read_json(path: Path, limit: int = MAX_BYTES, *, follow: bool = True, any_text: bool = False) -> Any:
    """The JSON document of a file; OSError as `read`, ValueError as `parse`.

    Characters that no file name and no output can hold (NUL, half a surrogate pair) are a ValueError as well, but for
    ``any_text``: a document that keeps what strangers wrote.
    """
    return parse(read(path, limit, follow=follow), any_text=any_text)


def parse(data: bytes | str, *, any_text: bool = True) -> Any:
    """The JSON document in UTF-8; ValueError, and nothing else, for everything that is none or that could harm.

    Refused: more than ``MAX_DEPTH`` levels, and numbers that are not finite as a float; characters as `read_json`.
    """
    raw = data if isinstance(data, bytes) else data.encode("utf-8", "surrogatepass")
    try:
        value = json.loads(
            raw.decode("utf-8", "surrogatepass" if any_text else "strict"),
            parse_constant=_not_finite,
            parse_float=_finite,
            parse_int=_finite_whole if re.search(_LONG, raw) else None,
        )
    except RecursionError:
        raise _too_deep() from None
    except UnicodeDecodeError as problem:
        raise NoUtf8Error(*problem.args) from None
    _bounded(value)
    if not any_text and b"\\u" in raw and re.search(_UNFIT, raw):
        _printable(value)
    return value


class NoUtf8Error(UnicodeDecodeError):
    """Bytes that are no text, in words for a person."""

    def __str__(self) -> str:
        """Where the first of them stands."""
        return f"it is not UTF-8 (byte {self.start})"


class OtherFormatError(ValueError):
    """A record that another version of octoform wrote; ``is_newer`` where a later one did."""

    def __init__(self, found: object, known: int) -> None:
        """``found`` is the record's format, ``known`` that of its reader."""
        super().__init__(f"it has format {str(found)[:20]}, and this octoform reads {known}")
        self.is_newer = isinstance(found, int) and found > known


def record(value: Any, known: int) -> dict[str, Any]:
    """A parsed record in the format that its reader knows; ValueError for what is no object, OtherFormatError."""
    if not isinstance(value, dict):
        raise ValueError("it is no JSON object")
    found = value.get("format")
    if isinstance(found, bool) or found != known:
        raise OtherFormatError(found, known)
    return value


def _bounded(value: Any) -> None:
    """Level by level, never by recursion."""
    level, depth = [value], 0
    while level := [each for each in level if isinstance(each, (dict, list))]:
        depth += 1
        if depth > MAX_DEPTH:
            raise _too_deep()
        level = [below for each in level for below in (each.values() if isinstance(each, dict) else each)]


def _printable(value: Any) -> None:
    left = [value]
    while left:
        each = left.pop()
        if isinstance(each, str):
            if "\0" in each:
                raise ValueError("a string has a NUL in it")
            if any("\ud800" <= letter <= "\udfff" for letter in each):
                raise ValueError("a string has half a surrogate pair in it")
        elif isinstance(each, dict):
            left += [*each, *each.values()]
        elif isinstance(each, list):
            left += each


def _finite(text: str) -> float:
    value = float(text)
    return value if math.isfinite(value) else _not_finite(text)


def _finite_whole(text: str) -> int:
    """An integer that arithmetic with others can take (float, and with it `math.isfinite`, has no larger one)."""
    value = int(text)
    try:
        float(value)
    except OverflowError:
        _not_finite(text)
    return value


def _not_finite(text: str) -> float:
    raise ValueError(f"{text[:40]} is no finite number")


def _too_deep() -> ValueError:
    return ValueError(f"it is nested deeper than {MAX_DEPTH} levels")


def _too_large(path: Path, limit: int) -> OSError:
    return OSError(errno.EFBIG, f"it has more than {limit} bytes", str(path))
