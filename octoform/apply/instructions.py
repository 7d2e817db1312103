"""The places whose files octoform, git or the package tool will read as instructions, present or not.

An agent that may leave a new file in one of them decides what a later run does: a spec in `protocol/`, the state of
another host, a hook or a file monitor in `.git`, an index of packages. So these are guarded as a whole, and what was
not there before has to be gone again.
"""

import os
import sys
import sysconfig
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from octoform.apply.context import Context
from octoform.apply.endpoint_node import CANDIDATE
from octoform.apply.healing_record import FOLDER as HEALED
from octoform.base.files import read
from octoform.endpoint.environment.model import MARKER, packages_of
from octoform.endpoint.files import (
    CLIENTS,
    CONNECTION,
    LAUNCHER,
    MANIFEST,
    POLICY,
    PROGRAM,
    SERVE_SCRIPT,
    read_manifest,
)
from octoform.endpoint.process.systemd import unit_path
from octoform.endpoint.process.systemd_watch import watch_path
from octoform.state.git.head import on_branch, repository
from octoform.state.git.repository import configuration_files
from octoform.state.layout import Layout

SERVED = (LAUNCHER, CONNECTION, SERVE_SCRIPT, MANIFEST, POLICY)
_GIT = (".gitattributes", ".gitignore", ".gitmodules", ".mailmap")
_PACKAGES = ("uv.toml", "pyproject.toml", ".python-version", ".npmrc")
_OF_A_TREE = ("config.worktree", "commondir", "gitdir")
_OF_A_REPOSITORY = (*_OF_A_TREE, "config", "objects/info/alternates", "shallow")
_FOLDERS_OF_A_REPOSITORY = ("hooks", "info", "refs/replace")
_OF_A_PERSON = ("git/config", "git/attributes", "git/ignore", "uv/uv.toml", "pip/pip.conf")
_OF_THE_MACHINE = ("gitconfig", "gitattributes", "uv/uv.toml", "pip.conf")
_OF_A_LOGIN = (
    *(".profile", ".bash_profile", ".bash_login", ".bashrc", ".bash_logout", ".kshrc", ".pam_environment"),
    *(".zshenv", ".zprofile", ".zshrc", ".zlogin", ".xprofile", ".xsession", ".config/fish/config.fish"),
    *(".bash_aliases", ".inputrc", ".xinitrc", ".xsessionrc", ".config/direnv/direnvrc", ".tmux.conf", ".screenrc"),
    *(".ssh/authorized_keys", ".ssh/authorized_keys2", ".ssh/config", ".ssh/rc", ".shosts", ".rhosts", ".k5login"),
    *(".vimrc", ".exrc", ".gdbinit", ".config/nvim/init.lua", ".config/nvim/init.vim", ".npmrc"),
    *(".claude/CLAUDE.md", ".codex/AGENTS.md", ".config/opencode/AGENTS.md"),
)
"""What runs, lets somebody in, or gives an agent orders, when a person logs in and works. Not what programs rewrite."""
_FOLDERS_OF_A_LOGIN = (
    *(".config/autostart", ".config/fish/conf.d", ".config/fish/functions", ".config/systemd/user"),
    *(f".claude/{name}" for name in ("agents", "commands", "hooks", "skills")),
)
_PROGRAMS = ("uv", "bwrap", "git", "node", "npm", "npx", "systemctl", "loginctl", "ssh", "sh", "true", "python3")
"""What octoform calls by name."""
_MINORS = range(8, 20)
"""Of the Pythons that a person may have."""
_AGENTS = (
    *("AGENTS.md", "AGENTS.override.md", "CLAUDE.md", "CLAUDE.local.md", "GEMINI.md", "QWEN.md", ".mcp.json", ".env"),
    *("opencode.json", "opencode.jsonc", ".envrc", ".cursorrules", ".windsurfrules", ".goosehints", ".aider.conf.yml"),
    *(".github/copilot-instructions.md", ".cursor/mcp.json", ".vscode/mcp.json", ".vscode/tasks.json", ".roo/mcp.json"),
    *(f".claude/{name}" for name in ("CLAUDE.md", "settings.json", "settings.local.json")),
    *(f".{name}/settings.json" for name in ("gemini", "qwen", "pi")),
    *(".codex/config.toml", ".opencode/opencode.json", ".opencode/opencode.jsonc"),
)
"""What coding agents look for where they are started and above: their instructions, their settings, their programs."""
_FOLDERS_OF_AGENTS = (
    *(f".claude/{name}" for name in ("agents", "commands", "hooks", "rules", "skills")),
    *(
        f".opencode/{name}"
        for name in ("agent", "agents", "command", "commands", "plugin", "plugins", "skills", "tools")
    ),
    *(".cursor/rules", ".clinerules", ".github/instructions"),
    *(".agents", ".gemini/commands", ".gemini/extensions", ".qwen/commands", ".pi/extensions", ".pi/skills"),
)
_STARTS = ("pyvenv.cfg", "pip.conf")


@dataclass(frozen=True, slots=True)
class Places:
    """Single files and whole folders, each absolute, none of which need exist; no entry may come to ``rooms``."""

    files: tuple[Path, ...]
    folders: tuple[Path, ...]
    rooms: tuple[Path, ...]


def sources(context: Context) -> Places:
    """What octoform itself never writes while it judges an output, so that a difference is another's."""
    layout, manifest = context.layout, context.manifest
    project = layout.project
    written = [manifest.path, *manifest.profile_files, *(spec.path for spec in context.specs.values())]
    written += [spec.schema for spec in context.specs.values() if spec.schema is not None]
    files = [*written, project / ".octoform" / ".gitignore", *_around(layout), *_personal(layout, context.environ)]
    folders = [project / "protocol", project / "profiles", project / "state", *_units(layout, context.environ)]
    folders += [home(context.environ) / name for name in _FOLDERS_OF_A_LOGIN]
    folders += [project / name for name in _FOLDERS_OF_AGENTS]
    rooms = [project / ".octoform"]
    for each in (layout, *_others(layout)):
        started, packages = _environments(each)
        files += started
        rooms += packages
    for other in _others(layout):
        files += [*other.records(), *(other.endpoint / name for name in SERVED)]
        folders += records(other)
    found = repository(project)
    if found is not None:
        of_git = _git(found.folder)
        files += of_git.files
        folders += of_git.folders
    return Places(*(tuple(dict.fromkeys(paths)) for paths in (files, folders, rooms)))


def home(environ: Mapping[str, str]) -> Path:
    """The home folder of the person whose shell runs octoform."""
    return Path(environ.get("HOME") or "~").expanduser()


def records(layout: Layout) -> list[Path]:
    """The folders of a host that octoform alone writes, and not while an agent runs."""
    kept = [layout.spec_edits, layout.kept, layout.local / HEALED, layout.local / CANDIDATE]
    return [*kept, *(layout.endpoint / name for name in (CLIENTS, PROGRAM))]


def _others(layout: Layout) -> Iterator[Layout]:
    """The other hosts that this folder keeps something of."""
    for entry in sorted((layout.project / ".octoform").glob("*/")):
        if entry.name != layout.host and not entry.is_symlink():
            yield Layout(layout.project, entry.name)


def _git(folder: Path) -> Places:
    """What git goes by in a working tree's own folder, in the one it shares, and in those of the others and submodules.

    Not what a commit or a fetch of the person's moves: references, the index.
    """
    shared = _shared(folder)
    modules = [config.parent for depth in ("*", "*/*") for config in shared.glob(f"modules/{depth}/config")]
    files, folders = [], []
    for place in {folder, shared, *modules}:
        files += [place / name for name in _OF_A_REPOSITORY]
        folders += [place / name for name in _FOLDERS_OF_A_REPOSITORY]
    files += [place / name for place in shared.glob("worktrees/*") for name in _OF_A_TREE]
    if on_branch(folder):  # otherwise a commit of the person's changes it
        files.append(folder / "HEAD")
    return Places(tuple(files), tuple(folders), ())


def _environments(layout: Layout) -> tuple[list[Path], list[Path]]:
    """What an interpreter that serves reads at its start, and the folders from which it imports by name."""
    manifest = read_manifest(layout) or {}
    named = (manifest.get("environment"), manifest.get("previous_environment"))
    started, packages = [], []
    for place in (Path(name) for name in named if name):
        started += [*_read_at_start(place, packages_of(place)), place / MARKER]
        packages.append(packages_of(place))
    return started, packages


def _read_at_start(prefix: Path, packages: Path) -> list[Path]:
    """What an interpreter below ``prefix`` goes by before it runs anything."""
    links = (path for path in sorted((prefix / "bin").glob("python*")) if path.is_symlink())
    named = (path for path in sorted(packages.glob("*")) if path.suffix in (".pth", ".py"))
    return [*(prefix / name for name in _STARTS), *links, *named]


def of_octoform() -> Places:
    """The same of octoform's own installation, which is not this project's alone."""
    packages = Path(sysconfig.get_path("purelib"))
    return Places(tuple(_read_at_start(Path(sys.prefix), packages)), (), (packages,))


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
    looked = (project, layout.local.parent, layout.local, layout.attempts)
    yield from (place / name for place in looked for name in _AGENTS)
    yield from (place / name for place in project.parents for name in _AGENTS if "/" not in name)


def _personal(layout: Layout, environ: Mapping[str, str]) -> Iterator[Path]:
    """A person's own files; of git also those that their configuration includes."""
    own = home(environ)
    given = environ.get("XDG_CONFIG_HOME")
    config = Path(given) if given and Path(given).is_absolute() else own / ".config"
    yield from (own / ".gitconfig", own / ".pip" / "pip.conf")
    yield from (own / name for name in _OF_A_LOGIN)
    yield from _shadows(environ)
    yield from (Path("/etc") / name for name in _OF_THE_MACHINE)
    yield from (config / name for name in _OF_A_PERSON)
    yield from (unit_path(layout, environ), watch_path(layout, environ))
    yield from configuration_files(layout.project)


def _shadows(environ: Mapping[str, str]) -> Iterator[Path]:
    """Where a program would stand before the one that octoform calls by that name; none of them is there."""
    folders = [Path(name) for name in environ.get("PATH", "").split(os.pathsep) if name.startswith("/")]
    for name in _PROGRAMS:
        for folder in folders:
            if (folder / name).exists():
                break
            yield folder / name


def starts(environ: Mapping[str, str]) -> list[Path]:
    """Where the person's own packages lie, which any Python of theirs goes by at its start."""
    return [home(environ) / ".local" / "lib" / f"python3.{minor}" / "site-packages" for minor in _MINORS]


def _units(layout: Layout, environ: Mapping[str, str]) -> Iterator[Path]:
    """What systemd reads beside the host's units: what is added to them, and what variables they start with."""
    for path in (unit_path(layout, environ), watch_path(layout, environ)):
        yield path.with_name(f"{path.name}.d")
        yield path.with_name("service.d")
        yield path.parents[2] / "environment.d"


def _shared(folder: Path) -> Path:
    """Where a working tree's repository keeps what its trees have in common (gitrepository-layout(5))."""
    try:
        return (folder / read(folder / "commondir", 4096).decode().strip()).resolve()
    except (OSError, ValueError):
        return folder
