"""The places whose files octoform, git or the package tool will read as instructions, present or not.

An agent that may leave a new file in one of them decides what a later run does: a spec in `protocol/`, the state of
another host, a hook or a file monitor in `.git`, an index of packages. So these are guarded as a whole, and what was
not there before has to be gone again.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from octoform.apply.context import Context
from octoform.apply.endpoint_node import CANDIDATE
from octoform.apply.healing_record import FOLDER as HEALED
from octoform.endpoint.files import CLIENTS, CONNECTION, LAUNCHER, MANIFEST, POLICY, PROGRAM, SERVE_SCRIPT
from octoform.endpoint.systemd import unit_path
from octoform.endpoint.watch_unit import watch_path
from octoform.state.history import configuration_files
from octoform.state.layout import Layout
from octoform.state.revision import repository

SERVED = (LAUNCHER, CONNECTION, SERVE_SCRIPT, MANIFEST, POLICY)
_GIT = (".gitattributes", ".gitignore", ".gitmodules", ".mailmap")
_PACKAGES = ("uv.toml", "pyproject.toml", ".python-version")
_OF_A_REPOSITORY = ("config", "config.worktree", "commondir", "gitdir", "objects/info/alternates")
_OF_A_PERSON = ("git/config", "git/attributes", "git/ignore", "uv/uv.toml", "pip/pip.conf")


@dataclass(frozen=True, slots=True)
class Places:
    """Single files and whole folders, each absolute; none of them need exist."""

    files: tuple[Path, ...]
    folders: tuple[Path, ...]


def sources(context: Context) -> Places:
    """What octoform itself never writes while it judges an output, so that a difference is another's."""
    layout, manifest = context.layout, context.manifest
    project = layout.project
    written = [manifest.path, *manifest.profile_files, *(spec.path for spec in context.specs.values())]
    files = [*written, project / ".octoform" / ".gitignore", *_around(layout), *_personal(layout, context.environ)]
    folders = [project / "protocol", project / "profiles", project / "state"]
    for other in _others(layout):
        files += [*other.records(), *(other.endpoint / name for name in SERVED)]
        folders += records(other)
    found = repository(project)
    for place in {found.folder, _shared(found.folder)} if found else ():
        files += [place / name for name in _OF_A_REPOSITORY]
        folders += [place / "hooks", place / "info"]
    return Places(tuple(dict.fromkeys(files)), tuple(dict.fromkeys(folders)))


def records(layout: Layout) -> list[Path]:
    """The folders of a host that octoform alone writes, and not while an agent runs."""
    kept = [layout.spec_edits, layout.kept, layout.local / HEALED, layout.local / CANDIDATE]
    return [*kept, *(layout.endpoint / name for name in (CLIENTS, PROGRAM))]


def _others(layout: Layout) -> Iterator[Layout]:
    """The other hosts that this folder keeps something of."""
    for entry in sorted((layout.project / ".octoform").glob("*/")):
        if entry.name != layout.host and not entry.is_symlink():
            yield Layout(layout.project, entry.name)


def _around(layout: Layout) -> Iterator[Path]:
    """What git and the package tool look for in a folder and in those above it, up to the root."""
    project = layout.project
    found = repository(project)
    for place in (project, *project.parents):
        yield place / ".git"
        if found is not None and place.is_relative_to(found.root):
            yield from (place / name for name in _GIT)
    below = (project, layout.local.parent, layout.local, layout.environments)
    yield from (place / name for place in below for name in _PACKAGES)


def _personal(layout: Layout, environ: Mapping[str, str]) -> Iterator[Path]:
    """A person's own files; of git also those that their configuration includes."""
    home = Path(environ.get("HOME") or "~").expanduser()
    given = environ.get("XDG_CONFIG_HOME")
    config = Path(given) if given and Path(given).is_absolute() else home / ".config"
    yield home / ".gitconfig"
    yield from (config / name for name in _OF_A_PERSON)
    yield from (unit_path(layout, environ), watch_path(layout, environ))
    yield from configuration_files(layout.project)


def _shared(folder: Path) -> Path:
    """Where a working tree's repository keeps what its trees have in common (gitrepository-layout(5))."""
    try:
        return (folder / (folder / "commondir").read_text().strip()).resolve()
    except (OSError, ValueError):
        return folder
