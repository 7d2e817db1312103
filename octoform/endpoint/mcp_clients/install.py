"""Put this host's endpoint into a client's own file, look for it there, and take it out again.

Nothing else of the file is touched. What is there under our name counts as ours only when it starts our command
or refers to a token of octoform's; anything else was put there by a person and is refused.
"""

import json
import os
import re
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from octoform.base import files
from octoform.base.files import private_folder
from octoform.diagnostics import Diagnostic, Span, error
from octoform.endpoint.access.tokens import PREFIX
from octoform.endpoint.mcp_clients import known_clients, merge
from octoform.endpoint.mcp_clients.known_clients import Client, Surroundings
from octoform.endpoint.mcp_clients.merge import Edited, Hunk, Taken, Wish
from octoform.endpoint.mcp_clients.text_edit import Path as Way
from octoform.endpoint.mcp_clients.text_edit import Unreadable, at, place
from octoform.records import dataclass, replace

# A client's own configuration file on disk: read with care, backed up before a change, replaced as a whole.
#
# The file is a person's, and its client may write it at any moment. It is written through a link, keeps its mode, and
# is only replaced when it still is what was read.

BACKUPS = 3
LARGEST = 64 * 1024 * 1024
_BOM = b"\xef\xbb\xbf"
_SHOWN = 200


@dataclass(frozen=True, slots=True)
class ConfigFile:
    """The file of a client: ``path`` as a person names it, ``target`` behind links, ``data`` None for no file yet."""

    path: Path
    target: Path
    data: bytes | None
    mode: int

    @property
    def text(self) -> str:
        """The content without its byte order mark."""
        return (self.data or b"").removeprefix(_BOM).decode()

    def encoded(self, text: str) -> bytes:
        """The bytes of a new content, with the byte order mark that was there."""
        return (_BOM if (self.data or b"").startswith(_BOM) else b"") + text.encode()


def find(path: Path) -> ConfigFile | Diagnostic:
    """The file as it is now; CLIENT-UNWRITABLE when it is not ours to write, CLIENT-FILE-SYNTAX when it is no text."""
    try:
        target = path.resolve()
        facts = target.stat()
    except FileNotFoundError:
        return ConfigFile(path, target, None, 0o600)
    except (OSError, RuntimeError) as problem:
        return unwritable(path, getattr(problem, "strerror", None) or str(problem))
    if reason := _not_ours(facts):
        return unwritable(path, reason)
    try:
        data = files.read(target)
    except OSError as problem:
        return unwritable(path, problem.strerror or str(problem))
    found = ConfigFile(path, target, data, stat.S_IMODE(facts.st_mode))
    try:
        found.text.encode()
    except UnicodeDecodeError as problem:
        text = data[: problem.start].decode()
        return unreadable(path, text, Unreadable("this is no UTF-8", len(text)))
    return found


def _not_ours(facts: os.stat_result) -> str | None:
    if not stat.S_ISREG(facts.st_mode):
        return "it is no regular file"
    if facts.st_uid != os.geteuid():
        return "it belongs to another user"
    if not facts.st_mode & stat.S_IWUSR:
        return "its owner made it read-only"
    if facts.st_nlink > 1:
        return "it has several names (hard links), of which only one would see the change"
    return f"it has more than {LARGEST} bytes" if facts.st_size > LARGEST else None


def backups(path: Path) -> list[Path]:
    """The backups of a file, the latest first."""
    pattern = re.compile(re.escape(path.name) + r"\.octoform-backup-(\d+)")
    found = [(int(match[1]), item) for item in _beside(path) if (match := pattern.fullmatch(item.name))]
    return [item for _, item in sorted(found, reverse=True)]


def _beside(path: Path) -> list[Path]:
    try:
        return list(path.parent.iterdir())
    except OSError:
        return []


def former_texts(path: Path) -> dict[Path, str]:
    """The texts of what was kept, the latest first; one that cannot be read is omitted."""
    texts = {}
    for item in backups(path):
        found = find(item)
        if isinstance(found, ConfigFile):
            texts[item] = found.text
    return texts


def keep(found: ConfigFile) -> Path | Diagnostic:
    """Copy the file beside itself under the next number, same mode; the oldest go beyond three."""
    kept = backups(found.path)
    number = int(kept[0].name.rpartition("-")[2]) + 1 if kept else 1
    path = found.path.with_name(f"{found.path.name}.octoform-backup-{number}")
    try:
        _write(path, found.data or b"", found.mode)
        for item in kept[BACKUPS - 1 :]:
            item.unlink()
    except OSError as problem:
        return unwritable(path, problem.strerror or str(problem))
    return path


def replace_file(found: ConfigFile, data: bytes | None, mode: int) -> Diagnostic | bool:
    """Put the new bytes in the place of the file (None: remove it); False when it is no longer what was read."""
    try:
        private_folder(found.target.parent)
        if _now(found.target) != found.data:
            return False
        if data is None:
            found.target.unlink()
        else:
            _write(found.target, data, mode)
    except OSError as problem:
        return unwritable(found.path, problem.strerror or str(problem))
    return True


def _now(path: Path) -> bytes | None:
    try:
        return files.read(path)
    except FileNotFoundError:
        return None


def _write(path: Path, data: bytes, mode: int) -> None:
    files.replace(path, data, mode, exact=True)


def unwritable(path: Path, reason: str) -> Diagnostic:
    """CLIENT-UNWRITABLE."""
    hint = "nothing was changed; octoform connect -print CLIENT prints what belongs in it"
    return error("CLIENT-UNWRITABLE", f"{path.name} is left alone: {reason}", path=str(path), hint=hint)


def unreadable(path: Path, text: str, found: Unreadable) -> Diagnostic:
    """CLIENT-FILE-SYNTAX at its place."""
    hint = "nothing was changed; correct the file, or add the entry yourself: octoform connect -print CLIENT"
    if found.offset is None:
        summary = f"{path.name} cannot be changed: {found.reason}"
        return error("CLIENT-FILE-SYNTAX", summary, path=str(path), hint=hint)
    summary = f"{path.name} cannot be read: {found.reason}"
    line, column, source = place(text, found.offset)
    # A line of such a file may be long, and may hold a secret further on.
    shown = source if len(source) <= _SHOWN else None
    return error("CLIENT-FILE-SYNTAX", summary, path=str(path), hint=hint, span=Span(line, column), source=shown)


TRIES = 3
"""How often a file is read again that its client changed meanwhile."""
PRIVATE = 0o600


@dataclass(frozen=True, slots=True)
class Server:
    """The server to be reached: its name for clients, the command of stdio, the URL of HTTP, the value of a token.

    ``url`` None means stdio; ``bearer`` is only given for a client that cannot refer to a variable.
    """

    name: str
    command: tuple[str, ...]
    url: str | None = None
    bearer: str | None = None

    def owns(self, entry: Mapping[str, Any]) -> bool:
        """True for an entry that octoform wrote for this host, whatever its interpreter, port or form."""
        found = known_clients.words(entry)
        if found and found[1:] == self.command[1:]:
            return True
        address = known_clients.address(entry)
        marks = (known_clients.VARIABLE, known_clients.INPUT, f"Bearer {PREFIX}")
        return address is not None and (address == self.url or any(mark in json.dumps(entry) for mark in marks))


@dataclass(frozen=True, slots=True)
class Reach:
    """The variants of an entry that still lead to the endpoint: whether it answers over HTTP when it runs, at which
    addresses it does now (none: it does not run), the values of its tokens."""

    http: bool
    urls: tuple[str, ...] = ()
    tokens: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Outcome:
    """The change of a file: ``state`` is added, updated, present, removed or absent."""

    client: Client
    file: Path
    state: str
    transport: str | None = None
    backup: Path | None = None
    hunks: tuple[Hunk, ...] = ()


@dataclass(frozen=True, slots=True)
class ClientState:
    """The state of a client: ``state`` is installed, absent, foreign or unreadable; ``there`` describes the file.

    ``current``: what is installed is what would be written now, so it leads to the endpoint.
    """

    client: Client
    file: Path
    there: bool
    state: str
    transport: str | None = None
    problem: Diagnostic | None = None
    current: bool = True


def file_of(client: Client, around: Surroundings, server: Server | None = None) -> Path:
    """The file that the client would read: the one with the server, else the first there is, else the preferred one."""
    places = client.places(around)
    there = [path for path in places if path.exists()]
    if server is not None and len(there) > 1:
        there.sort(key=lambda path: not _holds(client, path, server))
    return there[0] if there else places[0]


def _holds(client: Client, path: Path, server: Server) -> bool:
    found = find(path)
    if isinstance(found, Diagnostic):
        return False
    content = merge.NOTATIONS[client.notation].read(found.text)
    return not isinstance(content, Unreadable) and _standing(client, content, server) is not None


def look(client: Client, around: Surroundings, server: Server, reach: Reach) -> ClientState:
    """Whether the endpoint is in the client's file; nothing is written."""
    path = file_of(client, around, server)
    found = find(path)
    if isinstance(found, Diagnostic):
        return ClientState(client, path, True, "unreadable", problem=found)
    content = merge.NOTATIONS[client.notation].read(found.text)
    if isinstance(content, Unreadable):
        return ClientState(client, path, True, "unreadable", problem=unreadable(path, found.text, content))
    there = found.data is not None
    way = _standing(client, content, server)
    if way is None:
        return ClientState(client, path, there, "absent")
    entry = at(content, way)
    if not isinstance(entry, dict) or not server.owns(entry):
        return ClientState(client, path, there, "foreign")
    current = _current(client, found.text, entry, server, reach)
    return ClientState(client, path, there, "installed", _transport(entry), current=current)


def _current(client: Client, text: str, entry: Mapping[str, Any], server: Server, reach: Reach) -> bool:
    """Whether bringing in an entry of the same transport would change nothing."""
    address = known_clients.address(entry)
    if address is None:
        wanted = replace(server, url=None, bearer=None)
    elif not reach.http or (reach.urls and address not in reach.urls):
        return False
    else:
        held = next((value for value in reach.tokens if value in json.dumps(entry)), None)
        wanted = replace(server, url=address, bearer=held if client.reference is None else None)
    done = merge.merge(client, text, _wish(client, text, wanted), server.owns)
    return isinstance(done, Edited) and done.state == "present"


def install(client: Client, around: Surroundings, server: Server) -> Outcome | Diagnostic:
    """Bring the endpoint in; the file is as it was when that cannot be done."""
    path = file_of(client, around, server)
    for _ in range(TRIES):
        found = find(path)
        if isinstance(found, Diagnostic):
            return found
        wish = _wish(client, found.text, server)
        done = merge.merge(client, found.text, wish, server.owns)
        if not isinstance(done, Edited):
            return _refused(found, done, wish.entry)
        outcome = Outcome(client, path, done.state, _transport(wish.entry), hunks=_masked(done.hunks, server.bearer))
        if done.state == "present":
            return outcome
        mode = PRIVATE if server.bearer and server.url else found.mode
        result = _put(found, done.text, mode, (*wish.table, wish.name), outcome)
        if result is not None:
            return result
    return _moving(path)


def remove(client: Client, around: Surroundings, server: Server) -> Outcome | Diagnostic:
    """Take the endpoint out; what was there before is there again, byte for byte when nothing else changed."""
    path = file_of(client, around, server)
    for _ in range(TRIES):
        found = find(path)
        if isinstance(found, Diagnostic):
            return found
        content = merge.NOTATIONS[client.notation].read(found.text)
        if isinstance(content, Unreadable):
            return unreadable(path, found.text, content)
        way = _standing(client, content, server)
        if way is None:
            return Outcome(client, path, "absent")
        former = former_texts(path)
        done = merge.take_out(client, found.text, way, server.owns, list(former.values()))
        if not isinstance(done, Edited):
            assert done is not None
            return _refused(found, done, None)
        outcome = Outcome(client, path, "removed", _transport(at(content, way)), hunks=done.hunks)
        spent = next((item for item, text in former.items() if text == done.text), None)
        result = _put(found, done.text, found.mode, way, outcome)
        if result is not None:
            if isinstance(result, Outcome) and spent is not None and result.backup is None:
                # It would hold what the file holds again.
                spent.unlink(missing_ok=True)
            return result
    return _moving(path)


def _put(found: ConfigFile, text: str | None, mode: int, way: Way, outcome: Outcome) -> Outcome | Diagnostic | None:
    """Keep what is there unless it is known to come of what was kept, then write; None when the file moved."""
    client = outcome.client
    former = list(former_texts(found.path).values())
    made = text is None or merge.origin(client, found.text, way, former) is not None
    backup = None
    if found.data is not None and not made:
        kept = keep(found)
        if isinstance(kept, Diagnostic):
            return kept
        backup = kept
    done = replace_file(found, None if text is None else found.encoded(text), mode)
    if isinstance(done, Diagnostic):
        return done
    if not done:
        if backup is not None:
            backup.unlink(missing_ok=True)
        return None
    return replace(outcome, backup=backup)


def _wish(client: Client, text: str, server: Server) -> Wish:
    """The entry and its place; a URL is only given for a client that knows HTTP."""
    entry = known_clients.form(client, server.name, server.command, server.url, server.bearer)
    assert entry is not None
    content = merge.NOTATIONS[client.notation].read(text)
    content = {} if isinstance(content, Unreadable) else content
    standing = _standing(client, content, server)
    table = standing[:-1] if standing else known_clients.table_of(client, content)
    forms = (known_clients.form(client, "", server.command, url) or {} for url in (None, server.url or "-"))
    fields = frozenset(key for form in forms for key in form)
    return Wish(table, server.name, entry, prompted=server.url is not None, dropped=fields - entry.keys())


def _standing(client: Client, content: Mapping[str, Any], server: Server) -> Way | None:
    """Where an entry of the server's name stands, in whichever notation of the client."""
    for table in (client.table, client.older):
        above = at(content, table) if table else None
        if table and isinstance(above, dict) and server.name in above:
            return (*table, server.name)
    return None


def _transport(entry: Any) -> str:
    return "http" if isinstance(entry, Mapping) and known_clients.address(entry) is not None else "stdio"


def _masked(hunks: tuple[Hunk, ...], secret: str | None) -> tuple[Hunk, ...]:
    """The parts that may be shown: a token's value is in the file alone."""
    if secret is None:
        return hunks
    return tuple(Hunk(h.line, h.removed.replace(secret, "[token]"), h.added.replace(secret, "[token]")) for h in hunks)


def _moving(path: Path) -> Diagnostic:
    return unwritable(path, "its client is writing it over and over")


def _refused(found: ConfigFile, reason: Taken | Unreadable, entry: Mapping[str, Any] | None) -> Diagnostic:
    if isinstance(reason, Unreadable):
        return unreadable(found.path, found.text, reason)
    where: dict[str, object] = {"path": str(found.path)}
    if reason.offset is not None:
        line, column, _ = place(found.text, reason.offset)
        where["span"] = Span(line, column)
    dotted = ".".join(reason.path)
    if not isinstance(reason.entry, dict):
        hint = "nothing was changed; make it a table of servers, or add the entry yourself: octoform connect -print"
        return error("CLIENT-PLACE-TAKEN", f"{dotted} holds something that is no table", hint=hint, **where)
    lines = [f"in the file: {_command_text(reason.entry)}"] + (
        [f"octoform's:  {_command_text(entry)}"] if entry else []
    )
    hint = f"nothing was changed; give that entry another name or remove it from {found.path.name}, then try again"
    summary = f"{dotted} is there already and is not octoform's"
    return error("CLIENT-ENTRY-FOREIGN", summary, detail="\n".join(lines), hint=hint, **where)


def _command_text(entry: Mapping[str, Any]) -> str:
    """The command or URL of an entry; not its variables and headers, which may be secrets."""
    text = known_clients.address(entry) or " ".join(known_clients.words(entry)) or "neither a command nor a URL"
    others = sorted(set(entry) - {"command", "cmd", "args", "url", "uri", "type"})
    return text + (f"  (also: {', '.join(others)})" if others else "")
