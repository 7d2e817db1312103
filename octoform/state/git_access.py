"""How octoform reads a repository: from git's own files where these are enough, else by git. Light until git is called.

A plan names the revision that it reads; starting git or importing a library for that would cost more than the rest of a
plan with nothing to do. What these files do not have (an unborn branch, a ref store of another kind) is None.

Where git is called, no program that the repository names is ever run. A repository's configuration may name programs
for almost anything (hooks, a file monitor, filters, signing, a pager), and anyone who can write below `.git` chooses
them: an agent, or anyone who gave the folder away. So each is switched off, or set to what the person's own
configuration states. Nothing is fetched either. GitPython runs it, and is imported only when git is called: neither a
command outside a repository nor a plan without a commit since the last apply pays for it.
"""

import os
import re
import stat
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from octoform.base.files import head, read
from octoform.patterns import regex
from octoform.records import dataclass

if TYPE_CHECKING:
    from subprocess import CompletedProcess

_REVISION = regex(r"^(?:[0-9a-f]{40}|[0-9a-f]{64})$")
_DEPTH = 5
SECONDS, LISTING_SECONDS = 300, 20
"""How long a call of git may take, and how long the list of its settings, which reads some small files."""
_OFF = (
    *("core.fsmonitor=false", f"core.hooksPath={os.devnull}", "core.pager=cat", "core.editor=:", "core.askPass="),
    *("core.sshCommand=false", "core.gitProxy=", "core.alternateRefsCommand=false", "credential.helper="),
    *("diff.external=", "diff.ignoreSubmodules=all", "sequence.editor=:", "protocol.allow=never"),
    *("submodule.recurse=false", "log.showSignature=false", "gc.auto=0", "maintenance.auto=false"),
)
_FIXED = {
    "GIT_TERMINAL_PROMPT": "0",
    "GIT_ALLOW_PROTOCOL": "none",
    "GIT_NO_LAZY_FETCH": "1",
    "GIT_NO_REPLACE_OBJECTS": "1",
    "GIT_EDITOR": ":",
    "LANGUAGE": "C",
    "LC_ALL": "C",
}
_INHERITED = (
    *("GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE", "GIT_COMMON_DIR", "GIT_OBJECT_DIRECTORY", "GIT_SHALLOW_FILE"),
    *("GIT_ALTERNATE_OBJECT_DIRECTORIES", "GIT_QUARANTINE_PATH", "GIT_INTERNAL_SUPER_PREFIX", "GIT_NAMESPACE"),
    *("GIT_ICASE_PATHSPECS", "GIT_GLOB_PATHSPECS", "GIT_NOGLOB_PATHSPECS", "GIT_CONFIG"),
)
"""The variables with which a calling git, as in a hook, names its own repository, and those that say how names of files
are read: none of them is about the repository that is asked for. With GIT_DIR git would also not check its owner, and
with GIT_CONFIG it lists other settings than those that it obeys."""
_PROGRAM = (
    r"(?s)(filter\..*\.(clean|smudge|process|required)|diff\..*\.(command|textconv)|merge\..*\.driver|gpg\.(.*\.)?program"
    r"|gpg\.ssh\.defaultkeycommand|trailer\..*\.(cmd|command)|credential\..*\.helper)"
)
"""Keys with a name in their middle, or whose value is the person's where it is not the repository's (git-config)."""
_OWN = ("system", "global")
"""The scopes that are the person's and the machine's."""
_MISUSED = 129
"""Git's exit status for an option that it does not know."""
_PLAIN = {
    "gpg.program": "gpg",
    "gpg.openpgp.program": "gpg",
    "gpg.x509.program": "gpgsm",
    "gpg.ssh.program": "ssh-keygen",
}


def head_revision(project: Path) -> str | None:
    """The commit that HEAD names in the repository that holds ``project``; None outside one or before the first."""
    found = repository(project)
    if found is None:
        return None
    folder = found.folder
    text = _line(folder / "HEAD")
    for _ in range(_DEPTH):
        if text is None or _REVISION.match(text):
            return text
        if not text.startswith("ref: ") or ".." in text:
            return None
        text = _reference(folder, text.removeprefix("ref: ").strip())
    return None


def on_branch(folder: Path) -> bool:
    """Whether a repository's own folder names a branch as HEAD: a commit then moves that, and leaves the name."""
    return (_line(folder / "HEAD") or "").startswith("ref: ")


@dataclass(frozen=True, slots=True)
class Repository:
    """``root`` is the top of the working tree, ``folder`` where git keeps its files for it."""

    root: Path
    folder: Path


def repository(project: Path) -> Repository | None:
    """The nearest repository with a working tree at or above ``project``; a ``.git`` file is followed."""
    start = project.resolve()
    for place in (start, *start.parents):
        entry = place / ".git"
        if not os.path.lexists(entry):
            continue
        if (entry / "HEAD").is_file():
            return Repository(place, entry)
        target = _line(entry)
        if target is not None and target.startswith("gitdir: "):
            folder = place / target.removeprefix("gitdir: ")
            return Repository(place, folder) if (folder / "HEAD").is_file() else None
    return None


def shared_folder(folder: Path) -> Path:
    """Where a repository keeps what its working trees have in common (gitrepository-layout(5)); ``folder`` is one's."""
    shared = _line(folder / "commondir")
    return folder / shared if shared is not None else folder


def _reference(folder: Path, name: str) -> str | None:
    """A ref's text: of this worktree, else of the repository that it shares, loose before packed."""
    common = shared_folder(folder)
    return _line(folder / name) or _line(common / name) or _packed(common, name)


def _packed(common: Path, name: str) -> str | None:
    try:
        for line in read(common / "packed-refs").decode("utf-8", "replace").splitlines():
            revision, _, ref = line.partition(" ")
            if ref == name and _REVISION.match(revision):
                return revision
    except OSError:
        return None  # no packed refs
    return None


def _line(path: Path) -> str | None:
    """The first line of a small file, or None when it is not there."""
    try:
        return head(path, 4096, follow=True).decode("utf-8", "replace").partition("\n")[0].strip() or None
    except OSError:
        return None


class RepositoryRefused(Exception):
    """Git cannot be called on the repository without running what it names; the text is one line for a person."""


@dataclass(frozen=True, slots=True)
class Setting:
    """One value of a repository's configuration: the scope and the origin are those of git-config(1)."""

    scope: str
    origin: str
    key: str
    value: str


def settings(root: str, environment: Mapping[str, str]) -> list[Setting]:
    """All that git reads for the repository, in its order, with what is included.

    OSError where there is no git, RepositoryRefused where git is too old to name the scopes, would wait, or cannot read
    them: which programs they name is not known then.
    """
    blocking = _blocking(Path(root))
    if blocking is not None:
        raise RepositoryRefused(f"{blocking!r} is a pipe or a device, and git would wait for it")
    words = [*_words(root), "config", "--show-scope", "--show-origin", "--list", "-z"]
    done = run(root, words, environment, LISTING_SECONDS)
    if done.returncode == _MISUSED:
        raise RepositoryRefused(
            "this git is older than 2.26 and does not show the scope of a setting; install a newer one"
        )
    if done.returncode != 0:
        raise RepositoryRefused(done.stderr.decode("utf-8", "replace").strip() or "git cannot read its settings")
    fields = iter(done.stdout.decode(errors="surrogateescape").split("\0"))
    found = (
        (scope, origin, entry.partition("\n")) for scope, origin, entry in zip(fields, fields, fields, strict=False)
    )
    return [Setting(scope, origin, key, value) for scope, origin, (key, _, value) in found]


def command(root: str, found: Iterable[Setting]) -> list[str]:
    """The words that every call of git begins with, for the repository that has these settings and that working tree.

    RepositoryRefused where a program cannot be switched off.
    """
    words = _words(root)
    own: dict[str, str] = {}
    named: dict[str, None] = {}
    for setting in found:
        if re.fullmatch(_PROGRAM, setting.key):
            named[setting.key] = None
            if setting.scope in _OWN:
                own[setting.key] = setting.value
    for key in named:
        if "=" in key:
            raise RepositoryRefused(f"its configuration has the key {key!r}, which cannot be switched off")
        neutral = "false" if key.endswith(".required") else _PLAIN.get(key, "")
        words += ["-c", f"{key}={own.get(key, neutral)}"]
    return words


def _words(root: str) -> list[str]:
    words = ["git", "-C", str(Path(root).absolute()), "--no-pager", "--no-optional-locks"]
    for setting in _OFF:
        words += ["-c", setting]
    return words


def _blocking(root: Path) -> str | None:
    """A pipe or a device among the files in which git keeps what it reads at every call.

    Of the objects only what leads to them is looked at: there may be a million.
    """
    found = repository(root)
    if found is None:
        return None
    for start in dict.fromkeys((found.folder, shared_folder(found.folder))):
        for place, folders, files in os.walk(start):
            if os.path.basename(place) == "objects":  # noqa: PTH119 - there may be thousands
                folders[:] = [name for name in folders if name in ("info", "pack")]
            folders[:] = [name for name in folders if name not in ("modules", "worktrees")]
            for name in files:
                path = os.path.join(place, name)  # noqa: PTH118 - there may be thousands
                if blocks(path):
                    return path
    return None


def blocks(path: str | Path) -> bool:
    """Whether opening ``path`` as a file may wait for somebody else; a link is judged by what it names.

    What names the empty device means no file: people switch off their list of ignored files by it.
    """
    try:
        facts = os.stat(path)  # noqa: PTH116 - see `_blocking`
    except (OSError, ValueError):
        return False  # git reports what is not there, or is closed to this user
    special = stat.S_ISFIFO(facts.st_mode) or stat.S_ISCHR(facts.st_mode) or stat.S_ISBLK(facts.st_mode)
    return special and not os.path.samestat(facts, os.stat(os.devnull))  # noqa: PTH116


def call(root: str, arguments: list[str], environment: Mapping[str, str] | None = None) -> "CompletedProcess[bytes]":
    """Run ``git ARGUMENTS`` in ``root`` to its end; OSError or RepositoryRefused.

    One that did not end in time is killed, and its complaint states that."""
    variables = environment or {}
    return run(root, [*command(root, settings(root, variables)), *arguments], variables)


def run(
    root: str, words: list[str], environment: Mapping[str, str], seconds: int | None = None
) -> "CompletedProcess[bytes]":
    """Run these words, of which `command` gives the first, in our variables, those that keep git from asking, fetching
    and editing, and those of the call."""
    from subprocess import CompletedProcess

    try:
        from git import Git, GitCommandNotFound  # looks for the program when it is imported, which takes its time
    except ModuleNotFoundError:
        raise  # octoform is not installed as it should be, which is another thing than no git
    except ImportError as problem:
        raise FileNotFoundError("there is no git program") from problem
    try:
        status, output, complaints = Git(root).execute(
            [*_without_inherited(environment), *words],
            env={**_FIXED, **environment},
            shell=False,
            with_extended_output=True,
            with_exceptions=False,
            stdout_as_string=False,
            strip_newline_in_stdout=False,
            kill_after_timeout=seconds or SECONDS,
        )
    except GitCommandNotFound as problem:
        raise FileNotFoundError("there is no git program") from problem
    return CompletedProcess(words, status, output, complaints.encode(errors="surrogateescape"))


def _without_inherited(environment: Mapping[str, str]) -> list[str]:
    """What stands before a command to take the variables of a calling git away: the library can only add some."""
    inherited = [name for name in _INHERITED if name in os.environ and name not in environment]
    return ["env", *(word for name in inherited for word in ("-u", name))] if inherited else []
