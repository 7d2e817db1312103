"""Git: at which revision the inputs are, and one commit of what an apply changed.

Nothing else of the person's repository is touched: the commit is made from an index of its own (HEAD and the given
paths), so what they have staged stays staged, and a refused commit leaves no trace. No hook runs, and no other program
that the repository names (`git_command`): a run of agents has just ended there. Whether to sign is the person's.
"""

import contextlib
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from subprocess import CompletedProcess

from octoform.diagnostics import Diagnostic, error, warning
from octoform.patterns import regex
from octoform.records import dataclass, field, replace
from octoform.state.files import display
from octoform.state.git_access import (
    Repository,
    RepositoryRefused,
    Setting,
    blocks,
    command,
    repository,
    run,
    settings,
)

_BY_HAND = "commit the state by hand, or let the next apply that changes something do it"
_TAIL = 3000
_MAX_NAMES = 200  # in one command line, which the system bounds
_PLAIN = ("100644", "100755")
"""Modes of files in a tree: no links, no repositories within this one."""
_INCLUDE = regex(r"include(if\..*)?\.path", re.DOTALL)
_FILES = ("core.attributesfile", "core.excludesfile", "mailmap.file", "commit.template")
_HOOKS = (
    *("applypatch-msg", "pre-applypatch", "post-applypatch", "pre-commit", "pre-merge-commit", "prepare-commit-msg"),
    *(
        "commit-msg",
        "post-commit",
        "pre-rebase",
        "post-checkout",
        "post-merge",
        "pre-push",
        "pre-auto-gc",
        "post-rewrite",
    ),
    *(
        "pre-receive",
        "update",
        "proc-receive",
        "post-receive",
        "post-update",
        "push-to-checkout",
        "reference-transaction",
    ),
    *("sendemail-validate", "fsmonitor-watchman", "p4-changelist", "p4-prepare-changelist", "p4-post-changelist"),
    *("p4-pre-submit", "post-index-change"),
)
"""All that git runs from a folder of hooks (githooks(5))."""
_FALSE = ("false", "no", "off", "0")
_PLAINLY = {"GIT_LITERAL_PATHSPECS": "1"}
_BEFORE_NAME = {"1": 8, "u": 10, "?": 1, "!": 1}
"""How many fields of an entry of `git status --porcelain=v2` lie before its name, by its kind."""
_UNDER_WAY = {
    "MERGE_HEAD": "a merge",
    "CHERRY_PICK_HEAD": "a cherry-pick",
    "REVERT_HEAD": "a revert",
    "rebase-merge": "a rebase",
    "rebase-apply": "a rebase",
}


@dataclass(frozen=True, slots=True)
class GitFacts:
    """``revision`` is None before the first commit, ``branch`` None when HEAD is detached; ``dirty`` holds, relative to
    the project, the asked paths whose content is not that of the revision (edited, staged, untracked, ignored)."""

    revision: str | None
    dirty: tuple[str, ...]
    branch: str | None


@dataclass(frozen=True, slots=True)
class _Git:
    """Runs git on one repository, in plain English and with names that are no patterns.

    Its settings are read once, and the programs that they name are switched off in each call.
    """

    where: Repository
    settings: Sequence[Setting]
    words: Sequence[str]
    extra: Mapping[str, str] = field(default_factory=dict)

    def given(self, **extra: str) -> "_Git":
        """The same with more variables."""
        return replace(self, extra={**self.extra, **extra})

    def run(self, *arguments: str) -> tuple[int, str, str]:
        """(status, output without its last line's end, complaints) of one git command."""
        done = self._call(*arguments)
        output, complaints = (data.decode(errors="surrogateescape") for data in (done.stdout, done.stderr))
        return done.returncode, output.removesuffix("\n"), complaints

    def blob(self, name: str) -> bytes | None:
        """The bytes of an object; None when it is not there."""
        done = self._call("cat-file", "blob", name)
        return done.stdout if done.returncode == 0 else None

    def _call(self, *arguments: str) -> "CompletedProcess[bytes]":
        return run(str(self.where.root), [*self.words, *arguments], {**_PLAINLY, **self.extra})


def _open(project: Path, paths: Iterable[Path] = ()) -> tuple[_Git | None, list[Diagnostic]]:
    """Git on the repository that holds ``project``; (None, []) outside one, a warning when git is not to be used.

    ``paths`` are those that it will be asked about. Whether git reads the repository shows in its first answer.
    """
    where = repository(project)
    if where is None:
        return None, []
    root = str(where.root)
    try:
        found = settings(root, _PLAINLY)
        named = (path for each in found if each.key in _FILES for path in _named(where.root, each))
        read = (*_read_by_git(where, project, paths), *named)
        waits = next((path for path in read if blocks(path)), None)
        if waits is not None:
            return None, [_unusable(where, f"{display(waits)} is a pipe or a device, and git would wait for it")]
        return _Git(where, found, command(root, found)), []
    except RepositoryRefused as problem:
        return None, [_unusable(where, str(problem))]
    except OSError:
        hint = "install git, or ignore this: only revisions and commits need it"
        return None, [warning("GIT-UNUSABLE", "this is a repository, but there is no git program", hint=hint)]


def _read_by_git(where: Repository, project: Path, paths: Iterable[Path]) -> Iterator[Path]:
    """Files of the working tree that git reads for itself when it is asked about ``paths`` of the project."""
    folders = [project.resolve(), *(Path(found) for path in paths for found, _, _ in os.walk(path))]
    folders += [place for place in folders[0].parents if place.is_relative_to(where.root)]
    yield from (folder / name for folder in folders for name in (".gitignore", ".gitattributes", ".mailmap"))


def _unusable(where: Repository, complaints: str) -> Diagnostic:
    return warning(
        "GIT-UNUSABLE",
        "git refuses to read this repository; the plan goes on without revisions",
        path=display(where.root),
        detail=_words(complaints),
        hint="follow git's message, or ignore this: only revisions and commits need it",
    )


def repository_facts(project: Path, paths: Iterable[Path]) -> tuple[GitFacts | None, list[Diagnostic]]:
    """Revision, branch and which of ``paths`` (manifest, specs, profiles) are dirty; (None, []) outside a repository.

    Reads only: not even git's own cache of file times is refreshed.
    """
    paths = list(paths)
    git, found = _open(project, paths)
    if git is None:
        return None, found
    inside = _inside(git.where, paths)
    shown = ("--untracked-files=all", "--ignored=matching") if inside else ("--untracked-files=no",)
    options = (
        "--porcelain=v2",
        "--branch",
        "--no-ahead-behind",
        "-z",
        "--no-renames",
        "--ignore-submodules=all",
        *shown,
    )
    failed, listing, complaints = git.run("status", *options, "--", *inside)
    if failed:
        return None, [_unusable(git.where, complaints)]
    entries = [entry for entry in listing.split("\0") if entry]
    head = dict(entry[2:].split(" ", 1) for entry in entries if entry.startswith("# branch."))
    revision, branch = head["branch.oid"], head["branch.head"]
    names = [entry.split(" ", _BEFORE_NAME[entry[0]])[-1] for entry in entries if inside and entry[0] in _BEFORE_NAME]
    dirty = tuple(sorted(_for_person(git.where, project, name) for name in names))
    return GitFacts(
        None if revision == "(initial)" else revision, dirty, None if branch == "(detached)" else branch
    ), []


def kept(project: Path, folders: Sequence[Path]) -> frozenset[Path]:
    """The files below ``folders`` that are this repository's own: tracked, or new and not ignored; absolute, resolved.

    Empty outside a repository and where git is not usable. Reads only.
    """
    where = repository(project)
    names = _inside(where, folders) if where is not None else []
    git = _open(project, folders)[0] if names else None
    if git is None:
        return frozenset()
    found: set[Path] = set()
    for start in range(0, len(names), _MAX_NAMES):
        options = ("-z", "--cached", "--others", "--exclude-standard")
        failed, listing, _ = git.run("ls-files", *options, "--", *names[start : start + _MAX_NAMES])
        found.update(git.where.root / name for name in listing.split("\0") if name and not failed)
    return frozenset(found)


def configuration_files(project: Path) -> frozenset[Path]:
    """Every file that git reads its configuration of this repository from, or that this names; absolute.

    Those that are not there count as well: an include, a file of attributes, a hook in a folder of hooks. Empty outside
    a repository and where git is not usable.
    """
    where = repository(project)
    if where is None:
        return frozenset()
    try:
        listed = settings(str(where.root), _PLAINLY)
    except (RepositoryRefused, OSError):
        return frozenset()
    found: set[Path] = set()
    for setting in listed:
        if not setting.origin.startswith("file:"):
            continue  # octoform's own words
        found |= {where.root / setting.origin.removeprefix("file:"), *_named(where.root, setting)}
    return frozenset(Path(os.path.normpath(path)) for path in found)


def _named(root: Path, setting: Setting) -> list[Path]:
    """The files that a setting names; an included one lies beside what includes it (git-config(1))."""
    if not setting.value:
        return []
    home = os.path.expanduser(setting.value)  # noqa: PTH111 - a user that is not there stays as it is written
    if _INCLUDE.fullmatch(setting.key):
        return [(root / setting.origin.removeprefix("file:")).parent / home]
    if setting.key == "core.hookspath":
        return [root / home / name for name in _HOOKS]
    return [root / home] if setting.key in _FILES else []


def versions(project: Path, folder: Path, most: int = 20) -> Iterator[dict[str, bytes]]:
    """The files of ``folder`` as the last ``most`` commits that changed it have them, newest first: name to bytes.

    Nothing outside a repository and where git is not usable. Reads only objects: neither index nor work tree.
    """
    git, _ = _open(project)
    names = _inside(git.where, [folder]) if git is not None else []
    if git is None or not names:
        return
    failed, revisions, _ = git.run("log", f"-n{most}", "--format=%H", "HEAD", "--", *names)
    for revision in () if failed else revisions.split():
        _, listing, _ = git.run("ls-tree", "-r", "-z", revision, "--", *names)
        found: dict[str, bytes] = {}
        for kind, blob, name in _blobs(listing):
            data = git.blob(blob) if kind in _PLAIN else None
            if data is None:
                break
            found[str(Path(name).relative_to(names[0]))] = data
        else:
            yield found


def _blobs(listing: str) -> Iterator[tuple[str, str, str]]:
    """Mode, object and name (relative to the repository) of each entry of a tree."""
    for entry in filter(None, listing.split("\0")):
        facts, _, name = entry.partition("\t")
        mode, _, blob = facts.split()
        yield mode, blob, name


def _inside(where: Repository, paths: Iterable[Path]) -> list[str]:
    """The paths that lie in the working tree, relative to its root."""
    places = (Path(os.path.realpath(path.parent)) / path.name for path in paths)
    return [str(place.relative_to(where.root)) for place in places if place.is_relative_to(where.root)]


def _for_person(where: Repository, project: Path, name: str) -> str:
    path = where.root / name
    home = project.resolve()
    return str(path.relative_to(home)) if path.is_relative_to(home) else os.path.relpath(path, home)


def commit(
    project: Path, paths: Sequence[Path], message: str, trailers: Mapping[str, str]
) -> tuple[str | None, list[Diagnostic]]:
    """Commit the present content of ``paths`` (files or folders, gone ones included) and nothing else.

    Returns the new revision; (None, []) outside a repository or when nothing changed. GIT-BUSY while a merge or rebase
    is going on, GIT-IGNORED, GIT-COMMIT-FAILED with git's words: then the repository is as it was.
    """
    git, found = _open(project, paths)
    if git is None:
        return None, found
    unreadable, _, complaints = git.run("rev-parse", "--git-dir")
    if unreadable:
        return None, [_unusable(git.where, complaints)]
    busy = [what for name, what in _UNDER_WAY.items() if (git.where.folder / name).exists()]
    if busy:
        return None, [_busy(git.where, busy[0])]
    with _own_index(git) as own:
        names, found = _stage(own, _inside(git.where, paths))
        if found or not _changed(own):
            return None, found
        words = ("commit", "--quiet", "-m", message, "-m", _trailers(trailers))
        status, _, complaints = own.given(**_identity(own)).run(*words)
        if status != 0:
            return None, [_failed(git.where, complaints)]
    _, revision, _ = git.run("rev-parse", "HEAD")
    status, _, complaints = git.run("reset", "--quiet", "--", *names)
    return revision, [_index_behind(git.where, complaints)] if status != 0 else []


@contextlib.contextmanager
def _own_index(git: _Git) -> Iterator[_Git]:
    """Git with an index that holds HEAD and nothing that the person has staged."""
    path = git.where.folder / f"index.octoform.{os.urandom(6).hex()}"
    own = git.given(GIT_INDEX_FILE=str(path.resolve()))
    try:
        born, _, _ = own.run("rev-parse", "--verify", "--quiet", "HEAD")
        own.run("read-tree", *(["HEAD"] if born == 0 else ["--empty"]))
        yield own
    finally:
        for leftover in (path, path.with_name(f"{path.name}.lock")):
            leftover.unlink(missing_ok=True)


def _stage(own: _Git, names: list[str]) -> tuple[list[str], list[Diagnostic]]:
    """Put the paths' present content into the own index; returns those that git knows or that are there."""
    known = []
    for name in names:
        if os.path.lexists(own.where.root / name) or own.run("ls-files", "--", name)[1]:
            known.append(name)
    if not known:
        return [], []
    # A generated server that is started by hand leaves bytecode beside it, which is no one's work.
    literal = own.given(GIT_LITERAL_PATHSPECS="0")
    patterns = [f":(top,literal){name}" for name in known]
    patterns.append(":(top,exclude,glob)**/__pycache__/**")
    sparse = {setting.key: setting.value for setting in own.settings}.get("core.sparsecheckout", "false")
    options = ["--sparse"] if sparse not in _FALSE else []  # which git takes from 2.34 on
    status, _, complaints = literal.run("add", "--all", *options, "--", *patterns)
    if status == 0:
        return known, []
    if _ignored(own, known):
        hint = "take state/ out of .gitignore, or set `git: {commit: false}`"
        summary = "git ignores the files that should be committed"
        return [], [error("GIT-IGNORED", summary, path=display(own.where.root), detail=_words(complaints), hint=hint)]
    return [], [_failed(own.where, complaints)]


def _ignored(own: _Git, names: list[str]) -> bool:
    plain = own.given(GIT_LITERAL_PATHSPECS="0")  # this command takes names only
    return plain.run("check-ignore", "--", *names)[1] != ""


def _changed(own: _Git) -> bool:
    status, before, _ = own.run("rev-parse", "--verify", "--quiet", "HEAD^{tree}")
    if status != 0:
        return own.run("ls-files")[1] != ""
    return own.run("write-tree")[1] != before


def _identity(git: _Git) -> dict[str, str]:
    """Where git knows no author, one of octoform's own, rather than a guess from the machine's name."""
    out, configured = {}, {setting.key: setting.value for setting in git.settings}
    for part, fallback in (("NAME", "octoform"), ("EMAIL", "octoform@localhost")):
        if configured.get(f"user.{part.lower()}"):
            continue
        for role in ("AUTHOR", "COMMITTER"):
            specific = configured.get(f"{role.lower()}.{part.lower()}")
            if not specific and not os.environ.get(f"GIT_{role}_{part}"):
                out[f"GIT_{role}_{part}"] = fallback
    return out


def _trailers(trailers: Mapping[str, str]) -> str:
    return "\n".join(f"{name}: {' '.join(value.split())}" for name, value in trailers.items())


def _busy(where: Repository, what: str) -> Diagnostic:
    hint = f"finish it, then {_BY_HAND}"
    return error(
        "GIT-BUSY", f"{what} is going on in this repository; nothing was committed", path=str(where.root), hint=hint
    )


def _failed(where: Repository, complaints: str) -> Diagnostic:
    return error(
        "GIT-COMMIT-FAILED",
        "git did not make the commit; the state itself is written and stays",
        path=display(where.root),
        detail=_words(complaints),
        hint=f"follow git's message, then {_BY_HAND}",
    )


def _index_behind(where: Repository, complaints: str) -> Diagnostic:
    return warning(
        "GIT-INDEX-BEHIND",
        "the commit is made, but the index could not be brought up to it",
        path=display(where.root),
        detail=_words(complaints),
        hint="run `git reset -- state` when nothing else uses the repository",
    )


def _words(complaints: str) -> str:
    """The end of git's output, fit to be shown."""
    text = complaints.strip()[-_TAIL:]
    return "".join(char if char.isprintable() or char == "\n" else "\N{REPLACEMENT CHARACTER}" for char in text)
