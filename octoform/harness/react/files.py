"""The file tools: bounded reading of plain files, and writing that cannot leave the attempt's folder.

Reading may go anywhere, as the shell can, but opens no device: opening alone already acts on some of them. Writing
walks down from the folder without following a link, and puts a whole file in place or none.
"""

import os
import secrets
import stat
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path, PurePosixPath

from octoform.escaping import escaped
from octoform.harness.react.bounded import KEPT
from octoform.harness.react.shell import Said

READ_BYTES = 24 << 10
SEARCHED_BYTES = 32 << 20
PATCHED_BYTES = 4 << 20
FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC
PLAIN = os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC


class Refused(ValueError):
    """What was asked of a file tool is not done; the text is for the model."""


def read_file(workdir: Path, path: str, offset: int = 1, limit: int | None = None) -> Said:
    """Lines of a plain file from line ``offset`` on, at most `READ_BYTES` of them."""
    target = workdir / path
    try:
        if not stat.S_ISREG(target.stat().st_mode):
            return Said(f"{path} is no plain file", failed=True)
        with os.fdopen(os.open(target, PLAIN), "rb") as stream:
            if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
                return Said(f"{path} is no plain file", failed=True)
            lines = _lines(stream.read(SEARCHED_BYTES) or b"")
    except (OSError, ValueError) as problem:
        return Said(f"{path} cannot be read: {_why(problem)}", failed=True)
    first = max(1, offset)
    wanted = lines[first - 1 :] if limit is None else lines[first - 1 : first - 1 + max(0, limit)]
    return Said(_part(wanted, first, len(lines)))


def _lines(data: bytes) -> list[bytes]:
    return data.splitlines(keepends=True)


def _part(wanted: Sequence[bytes], first: int, count: int) -> str:
    shown: list[bytes] = []
    room, taken = READ_BYTES, 0
    for line in wanted:
        if len(line) > room and shown:
            break
        shown.append(line[:room])
        room -= len(shown[-1])
        taken += 1
        if len(shown[-1]) < len(line):
            break
    text = escaped(b"".join(shown).decode("utf-8", "replace"), KEPT)
    last = first + taken - 1
    if not count:
        return "[the file is empty]"
    if not taken:
        return f"[nothing there: the file has {count} lines]"
    cut = len(shown[-1]) < len(wanted[taken - 1])
    if first == 1 and last == count and not cut:
        return text
    return f"{text.rstrip()}\n[lines {first} to {last} of {count}{', the last one cut' if cut else ''}]"


def write_file(workdir: Path, path: str, content: str) -> Said:
    """Put a text file below the folder in place."""
    data = content.encode("utf-8", "replace")
    try:
        with _parent(workdir, path, make=True) as (folder, name):
            _replace(folder, name, data, _mode(folder, name))
    except Refused as problem:
        return Said(str(problem), failed=True)
    except (OSError, ValueError) as problem:
        return Said(f"{path} cannot be written: {_why(problem)}", failed=True)
    return Said(f"{len(data)} bytes written to {path}")


def patch(workdir: Path, path: str, edits: Sequence[Mapping[str, str]]) -> Said:
    """Replace each ``old``, which must stand there exactly once, by its ``new``; all or none."""
    if not edits:
        return Said("edits is empty: nothing was changed", failed=True)
    try:
        with _parent(workdir, path, make=False) as (folder, name):
            text = _text(folder, name, path)
            for number, edit in enumerate(edits, 1):
                text = _edited(text, edit["old"], edit["new"], f"edit {number} of {len(edits)}")
            _replace(folder, name, text.encode("utf-8"), _mode(folder, name))
    except Refused as problem:
        return Said(f"{problem}; nothing was changed", failed=True)
    except (OSError, ValueError) as problem:
        return Said(f"{path} cannot be changed: {_why(problem)}", failed=True)
    return Said(f"{len(edits)} replacement(s) made in {path}")


def _edited(text: str, old: str, new: str, which: str) -> str:
    if not old:
        raise Refused(f"{which}: old is empty")
    found = text.count(old)
    if found != 1:
        what = "does not stand in the file" if not found else f"stands in the file {found} times"
        more = "read the file and copy the text exactly" if not found else "add what stands around the one you mean"
        raise Refused(f"{which}: old {what}; {more}")
    return text.replace(old, new)


def _text(folder: int, name: str, path: str) -> str:
    descriptor = os.open(name, PLAIN | os.O_NOFOLLOW, dir_fd=folder)
    with os.fdopen(descriptor, "rb") as stream:
        if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
            raise Refused(f"{path} is no plain file")
        data = stream.read(PATCHED_BYTES + 1)
    if len(data) > PATCHED_BYTES:
        raise Refused(f"{path} has more than {PATCHED_BYTES} bytes")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as problem:
        raise Refused(f"{path} is no text in UTF-8") from problem


def _mode(folder: int, name: str) -> int:
    """The permissions that the file has or gets; Refused when something else than a plain file is in its place."""
    try:
        facts = os.stat(name, dir_fd=folder, follow_symlinks=False)
    except FileNotFoundError:
        return 0o644
    if not stat.S_ISREG(facts.st_mode):
        raise Refused(f"{name} is there and is no plain file")
    return stat.S_IMODE(facts.st_mode)


def _replace(folder: int, name: str, data: bytes, mode: int) -> None:
    temporary = f".{secrets.token_hex(8)}.part"
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
    descriptor = os.open(temporary, flags, 0o600, dir_fd=folder)
    try:
        with os.fdopen(descriptor, "wb") as stream:
            stream.write(data)
            os.fchmod(stream.fileno(), mode)
        os.rename(temporary, name, src_dir_fd=folder, dst_dir_fd=folder)
    except BaseException:
        os.unlink(temporary, dir_fd=folder)
        raise


@contextmanager
def _parent(workdir: Path, path: str, *, make: bool) -> Iterator[tuple[int, str]]:
    """The open folder of a file below ``workdir`` and the file's name; no link on the way is followed."""
    *above, name = _steps(workdir, path)
    opened = [os.open(workdir, FOLDER)]
    try:
        for step in above:
            if make:
                # Whether what is already there is a folder, the opening says.
                with suppress(FileExistsError):
                    os.mkdir(step, 0o755, dir_fd=opened[-1])
            opened.append(os.open(step, FOLDER, dir_fd=opened[-1]))
        yield opened[-1], name
    finally:
        for descriptor in opened:
            os.close(descriptor)


def _steps(workdir: Path, path: str) -> list[str]:
    """The names from ``workdir`` down to the file; Refused for what lies elsewhere."""
    pure = PurePosixPath(os.path.normpath(workdir / path))
    try:
        steps = list(pure.relative_to(os.path.normpath(workdir)).parts)
    except ValueError:
        steps = []
    if not steps:
        raise Refused(f"{path} is not below your folder {workdir}")
    return steps


def _why(problem: Exception) -> str:
    return problem.strerror or str(problem) if isinstance(problem, OSError) else str(problem)
