"""Which files an agent may not touch while it runs, whatever it is asked: sources, what was accepted, what is served.

Guarded is what no one else has a reason to write meanwhile, since the state's lock is held: a difference is the
agent's, and so is a new file where one is read as instruction (`instructions`). What the endpoint, a daemon and a
person write at any time (logs, counters, latches, what a person asks for) is not guarded here. The daemon's memory is,
as long as none has been there; one that lives knows itself what it wrote.
"""

import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import lru_cache, partial
from itertools import takewhile
from pathlib import Path

import octoform
from octoform.apply import file_integrity
from octoform.apply.context import CANDIDATE, HEALED, Context
from octoform.apply.project_files import Gaps, led_to, names_in
from octoform.base.files import opened, walk
from octoform.base.locks import acquire
from octoform.diagnostics import Diagnostic, warning
from octoform.endpoint.access.tokens import RECORD as TOKENS
from octoform.endpoint.environment.model import MARKER, packages_of
from octoform.endpoint.process.systemd import unit_path, watch_path
from octoform.endpoint.published_files import (
    CLIENTS,
    CONNECTION,
    LAUNCHER,
    MANIFEST,
    POLICY,
    PROGRAM,
    SERVE_SCRIPT,
    read_manifest,
)
from octoform.harness.port import Task
from octoform.manifest.model import FILE_NAME
from octoform.records import dataclass, replace
from octoform.state import attempts
from octoform.state.git_access import head_revision, on_branch, repository, shared_folder
from octoform.state.git_repository import configuration_files
from octoform.state.layout import Layout
from octoform.state.store.lock import is_locked

# The places whose files octoform, git or the package tool will read as instructions, present or not.
#
# An agent that may leave a new file in one of them decides what a later run does: a spec in `protocol/`, the state of
# another host, a hook or a file monitor in `.git`, an index of packages. So these are guarded as a whole, and what was
# not there before has to be gone again.

SERVED = (LAUNCHER, CONNECTION, SERVE_SCRIPT, MANIFEST, POLICY)
_GIT = (".gitattributes", ".gitignore", ".gitmodules", ".mailmap", ".lfsconfig", ".pre-commit-config.yaml")
_PACKAGES = ("uv.toml", "pyproject.toml", ".python-version", ".npmrc")
_OF_A_TREE = ("config.worktree", "commondir", "gitdir")
_NOTED_OF_A_TREE = ("rebase-merge/git-rebase-todo", "rebase-apply/patch", "sequencer/todo")
"""The commands that `git rebase --continue` would run: a person may be in one, so a change is reported and left."""
_ALTERNATES = ("objects/info/alternates", "objects/info/http-alternates")
_OF_A_REPOSITORY = (*_OF_A_TREE, *_ALTERNATES, "config", "shallow")
_FOLDERS_OF_A_REPOSITORY = ("hooks", "info", "refs/replace", "branches", "remotes")
_OF_A_PERSON = ("git/config", "git/attributes", "git/ignore", "uv/uv.toml", "pip/pip.conf")
_OF_THE_MACHINE = ("gitconfig", "gitattributes", "uv/uv.toml", "pip.conf")
_OF_A_LOGIN = (
    *(".profile", ".bash_profile", ".bash_login", ".bashrc", ".bash_logout", ".kshrc", ".pam_environment"),
    *(".zshenv", ".zprofile", ".zshrc", ".zlogin", ".xprofile", ".xsession", ".config/fish/config.fish"),
    *(".bash_aliases", ".inputrc", ".xinitrc", ".xsessionrc", ".config/direnv/direnvrc", ".tmux.conf", ".screenrc"),
    *(".ssh/authorized_keys", ".ssh/authorized_keys2", ".ssh/config", ".ssh/rc", ".shosts", ".rhosts", ".k5login"),
    *(".vimrc", ".exrc", ".gdbinit", ".config/nvim/init.lua", ".config/nvim/init.vim", ".npmrc"),
    *(".vim/vimrc", ".emacs", ".emacs.d/init.el", ".emacs.d/early-init.el", ".config/emacs/init.el", ".zlogout"),
    *(".bash_completion", ".lessfilter", ".pdbrc", ".lldbinit", ".config/gdb/gdbinit", ".curlrc", ".wgetrc"),
    *(".cargo/config.toml", ".config/mise/config.toml"),
    *(".config/tmux/tmux.conf", ".ssh/environment", ".gnupg/gpg.conf", ".gnupg/gpg-agent.conf"),
    *(".claude/CLAUDE.md", ".codex/AGENTS.md", ".codex/AGENTS.override.md", ".config/opencode/AGENTS.md"),
    *(".gemini/GEMINI.md", ".qwen/QWEN.md", ".pi/agent/AGENTS.md"),
)
"""What runs, lets somebody in, or gives an agent orders, when a person logs in and works. Not what programs rewrite."""
_OF_ZSH = (".zshenv", ".zprofile", ".zshrc", ".zlogin", ".zlogout")
_FOLDERS_OF_A_LOGIN = (
    *(".config/autostart", ".config/fish/conf.d", ".config/fish/functions", ".config/systemd/user"),
    *(".local/share/systemd/user", ".local/share/dbus-1/services", ".config/plasma-workspace/env"),
    *(".ipython/profile_default/startup", ".oh-my-zsh/custom"),
    *(".ssh/config.d", ".bashrc.d", ".profile.d", ".zshrc.d", ".config/fish/completions"),
    *(".vim/plugin", ".vim/after", ".vim/autoload", ".config/nvim/plugin", ".config/nvim/after", ".config/nvim/lua"),
    ".local/share/bash-completion/completions",
    *(f".claude/{name}" for name in ("agents", "commands", "hooks", "rules", "skills")),
    *(".codex/prompts", ".codex/skills", ".gemini/commands", ".qwen/commands", ".pi/agent/extensions"),
    *(f".config/opencode/{name}" for name in ("agent", "agents", "command", "commands", "plugin", "plugins", "tools")),
)
_NOTED_OF_A_LOGIN = (
    *(f".{name}/settings.json" for name in ("claude", "gemini", "qwen", "pi/agent")),
    *(".codex/config.toml", ".cursor/mcp.json", ".config/opencode/opencode.json", ".config/opencode/opencode.jsonc"),
    *(f".config/Code/User/{name}.json" for name in ("settings", "mcp", "tasks")),
)
"""Settings that name programs, and that the programs of a person write themselves: reported, and left."""
_NOTED_OF_THE_MACHINE = (
    *("/etc/crontab", "/etc/cron.d", "/etc/cron.hourly", "/etc/cron.daily", "/etc/cron.weekly", "/var/spool/cron"),
    *("/etc/profile", "/etc/profile.d", "/etc/bash.bashrc", "/etc/environment"),
    *("/etc/ld.so.preload", "/etc/ld.so.conf.d"),
    *("/etc/systemd/system", "/etc/systemd/user", "/etc/udev/rules.d", "/etc/sudoers", "/etc/sudoers.d"),
)
"""What root's agent could leave to be run; packages that are being installed change it as well: reported, and left."""
_BINARIES = (".local/bin", "bin")
"""Where a login looks for programs before all others (the usual ~/.profile)."""
SCHEDULERS = {
    "crontab": ("crontab", "-l"),
    "list of `at` jobs": ("atq",),
    "list of transient units": ("systemctl", "--user", "list-units", "--all", "--plain", "--no-legend", "run-*"),
}
"""The lists of what services of the system run for a person, outside of any attempt, and what shows each."""
_CALLED = ("uv", "bwrap", "git", "node", "npm", "npx", "loginctl", "ssh", "sh", "true", "python3")
_PROGRAMS = _CALLED + tuple(command for command, *_ in SCHEDULERS.values())
"""The programs that octoform calls by name."""
_PACKAGES_OF_A_PERSON = tuple(f".local/lib/python3.{minor}/site-packages" for minor in range(8, 20))
"""Of each Python that a person may have."""
_AGENTS = (
    *("AGENTS.md", "AGENTS.override.md", "CLAUDE.md", "CLAUDE.local.md", "GEMINI.md", "QWEN.md", ".mcp.json", ".env"),
    *("opencode.json", "opencode.jsonc", ".envrc", ".cursorrules", ".windsurfrules", ".goosehints", ".aider.conf.yml"),
    *(
        ".github/copilot-instructions.md",
        ".cursor/hooks.json",
        ".cursor/mcp.json",
        ".vscode/mcp.json",
        ".vscode/tasks.json",
        ".roo/mcp.json",
    ),
    *(".vscode/launch.json", ".devcontainer.json", ".devcontainer/devcontainer.json", ".zed/tasks.json"),
    *(f".claude/{name}" for name in ("CLAUDE.md", "settings.json", "settings.local.json")),
    *(f".{name}/settings.json" for name in ("gemini", "qwen", "pi")),
    *(".codex/config.toml", ".opencode/opencode.json", ".opencode/opencode.jsonc"),
)
"""The files that coding agents look for from their folder upwards: instructions, settings, programs."""
_ABOVE = (FILE_NAME, *(name for name in _AGENTS if "/" not in name))
_FOLDERS_OF_AGENTS = (
    *(f".claude/{name}" for name in ("agents", "commands", "hooks", "rules", "skills")),
    *(
        f".opencode/{name}"
        for name in ("agent", "agents", "command", "commands", "plugin", "plugins", "skills", "tools")
    ),
    *(".cursor/rules", ".clinerules", ".github/instructions", ".windsurf/rules", ".amazonq/rules", ".kiro/steering"),
    *(".continue/rules", ".junie", ".cursor/commands", ".github/workflows", ".github/prompts", ".github/agents"),
    *(".roo/rules", ".roo/commands", ".kiro/hooks", ".kiro/settings", ".claude/output-styles", ".claude/plugins"),
    *(".agents", ".gemini/commands", ".gemini/extensions", ".qwen/commands", ".pi/extensions", ".pi/skills"),
)
_STARTS = ("pyvenv.cfg", "pip.conf")
_VARIABLES = (
    *("PIP_CONFIG_FILE", "PIP_CONSTRAINT", "PIP_CERT", "UV_CONFIG_FILE", "UV_CONSTRAINT", "UV_OVERRIDE", "UV_ENV_FILE"),
    *("NPM_CONFIG_USERCONFIG", "npm_config_userconfig", "NPM_CONFIG_GLOBALCONFIG", "npm_config_globalconfig"),
    *("SSL_CERT_FILE", "REQUESTS_CA_BUNDLE", "CURL_CA_BUNDLE", "NODE_EXTRA_CA_CERTS", "GIT_SSL_CAINFO"),
    *("BASH_ENV", "ENV", "INPUTRC", "PYTHONSTARTUP"),
)
"""Each names a file that the package tools go by, or that a shell or an interpreter of the person starts with."""


@dataclass(frozen=True, slots=True)
class Places:
    """Single files and whole folders, each absolute, none of which need exist; no entry may come to ``rooms``."""

    files: tuple[Path, ...]
    folders: tuple[Path, ...]
    rooms: tuple[Path, ...]


def sources(context: Context) -> Places:
    """The files that octoform never writes while it judges an output, so that a change is another's."""
    layout, manifest = context.layout, context.manifest
    project = layout.project
    written = [manifest.path, *manifest.profile_files, *(spec.path for spec in context.specs.values())]
    written += [spec.schema for spec in context.specs.values() if spec.schema is not None]
    files = [*written, project / ".octoform" / ".gitignore", *_around(layout), *_personal(layout, context.environ)]
    folders = [project / "protocol", project / "profiles", project / "state", *_units(layout, context.environ)]
    theirs = [*_within(home(context.environ), _FOLDERS_OF_A_LOGIN), *_within(project, _FOLDERS_OF_AGENTS)]
    whole = (project, home(context.environ))
    gaps = Gaps()
    led = [place for path in (*files, *theirs) if not gaps.have(path) for place in led_to(path, whole)]
    files += [place for place in led if not place.is_dir()]
    folders += [*theirs, *(place for place in led if place.is_dir())]
    rooms = [project / ".octoform"]
    if _daemon(layout) is not None:  # it keeps its agents' folders there as well
        rooms.append(layout.attempts)
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
        rooms += of_git.rooms
    return Places(*(tuple(dict.fromkeys(paths)) for paths in (files, folders, rooms)))


@lru_cache(256)
def _within(folder: Path, names: tuple[str, ...]) -> tuple[Path, ...]:
    """The paths of these names in a folder. They are the same at each attempt, and to make them takes long."""
    return tuple(folder / name for name in names)


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
    """The files that git obeys in a working tree's own folder, in its shared one, and in others' and submodules'.

    Not what a commit or a fetch of the person's moves: references, the index.
    """
    common = shared_folder(folder)
    shared = folder if common == folder else common.resolve()
    modules = _modules(shared / "modules")
    files: list[Path] = []
    folders: list[Path] = []
    for place in {folder, shared, *modules}:
        files += _within(place, _OF_A_REPOSITORY)
        folders += _within(place, _FOLDERS_OF_A_REPOSITORY)
    files += [place / name for place in shared.glob("worktrees/*") for name in _OF_A_TREE]
    if on_branch(folder):  # otherwise a commit of the person's changes it
        files.append(folder / "HEAD")
    return Places(tuple(files), tuple(folders), (shared / "modules",))


def _modules(folder: Path) -> list[Path]:
    """The repositories of submodules, whose names may have slashes."""
    found = []
    for root, folders, names in walk(folder):
        if "config" in names or "HEAD" in names:
            found.append(root)
            folders[:] = [name for name in folders if name == "modules"]
    return found


def _environments(layout: Layout) -> tuple[list[Path], list[Path]]:
    """The files that a serving interpreter reads at its start, and the folders of its imports."""
    manifest = read_manifest(layout) or {}
    named = (manifest.get("environment"), manifest.get("previous_environment"))
    started, packages = [], []
    for place in (Path(name) for name in named if name):
        started += [*_read_at_start(place, packages_of(place)), place / MARKER]
        packages.append(packages_of(place))
    return started, packages


def _read_at_start(prefix: Path, packages: Path) -> list[Path]:
    """The files that an interpreter below ``prefix`` reads before it runs anything."""
    links = (path for path in sorted((prefix / "bin").glob("python*")) if path.is_symlink())
    named = (packages / name for name in sorted(names_in(packages)) if name.endswith((".pth", ".py")))
    return [*_within(prefix, _STARTS), *links, *named]


def of_octoform() -> Places:
    """The same of octoform's own installation, which is not this project's alone."""
    packages = Path(sysconfig.get_path("purelib"))
    return Places(tuple(_read_at_start(Path(sys.prefix), packages)), (), (packages,))


def _around(layout: Layout) -> Iterator[Path]:
    """The files that git and the package tool look for in a folder and in those above it, up to the root."""
    project = layout.project
    found = repository(project)
    for place in (project, *project.parents):
        yield place / ".git"
        if found is not None and place.is_relative_to(found.root):
            yield from _within(place, _GIT)
    below = (project, layout.local.parent, layout.local, layout.environments)
    yield from (path for place in below for path in _within(place, _PACKAGES))
    looked = (project, layout.local.parent, layout.local, layout.attempts)
    yield from (path for place in looked for path in _within(place, _AGENTS))
    yield from (path for place in project.parents for path in _within(place, _ABOVE))


def _personal(layout: Layout, environ: Mapping[str, str]) -> Iterator[Path]:
    """A person's own files; of git also those that their configuration includes."""
    own = home(environ)
    given = environ.get("XDG_CONFIG_HOME")
    config = Path(given) if given and Path(given).is_absolute() else own / ".config"
    yield from (own / ".gitconfig", own / ".pip" / "pip.conf")
    yield from _within(own, _OF_A_LOGIN)
    yield from _shadows(environ)
    yield from _within(Path("/etc"), _OF_THE_MACHINE)
    yield from _within(config, _OF_A_PERSON)
    yield from (layout.project / environ[name] for name in _VARIABLES if environ.get(name))
    yield from (Path(environ["ZDOTDIR"]) / name for name in _OF_ZSH if environ.get("ZDOTDIR"))
    yield from (unit_path(layout, environ), watch_path(layout, environ))
    yield from configuration_files(layout.project)


def _shadows(environ: Mapping[str, str]) -> Iterator[Path]:
    """Where a program would be before the one that octoform calls by that name; none of them is there."""
    own = [home(environ) / name for name in _BINARIES]
    yield from (path for folder in own for path in _within(folder, _PROGRAMS) if not path.exists())
    named = [Path(name) for name in environ.get("PATH", "").split(os.pathsep) if name.startswith("/")]
    # Nothing in a folder that is closed to this user is started, nor put there by an agent that has the same rights.
    folders = [folder for folder in named if not _closed(folder)]
    for paths in zip(*(_within(folder, _PROGRAMS) for folder in folders), strict=True):
        yield from takewhile(lambda path: not path.exists(), paths)


def _closed(folder: Path) -> bool:
    try:
        folder.stat()
    except PermissionError:
        return True
    except OSError:  # none is there yet
        return False
    return not os.access(folder, os.X_OK)


def starts(environ: Mapping[str, str]) -> list[Path]:
    """Where the person's own packages lie, which any Python of theirs goes by at its start."""
    return list(_within(home(environ), _PACKAGES_OF_A_PERSON))


def _units(layout: Layout, environ: Mapping[str, str]) -> Iterator[Path]:
    """The files that systemd reads beside the host's units: drop-ins and environment files."""
    for path in (unit_path(layout, environ), watch_path(layout, environ)):
        yield path.with_name(f"{path.name}.d")
        yield path.with_name("service.d")
        yield path.parents[2] / "environment.d"


UNDONE = "undone"
"""Folder of an attempt with what files had become that were not the agent's to change."""


@dataclass(frozen=True, slots=True)
class Guard:
    """The protected paths when the agent began. ``daemon`` shows which daemon was there last; None while one lives.

    ``specs`` are those that come with octoform, ``installation`` identifies one installation of it.
    ``scheduled`` lists what the services of the system run for the person, ``schedules`` is what that was.
    """

    watch: file_integrity.Watch
    layout: Layout
    daemon: bytes | None
    revision: str | None
    specs: frozenset[Path]
    installation: object
    scheduled: Callable[[], Mapping[str, bytes]]
    schedules: Mapping[str, bytes]

    def end(self, undone: Path) -> list[Diagnostic]:
        """Put back what was changed and say so; an empty list when the attempt kept to its folder.

        ``undone`` is a folder, made when it is needed, for what the changed files had become.
        """
        watch = self.watch
        if self.daemon is None or _daemon(self.layout) != self.daemon:
            # A daemon that came meanwhile wrote its own files, and goes on from what it finds.
            memory = self.layout.memory()
            guarded = {path: it for path, it in watch.guarded.items() if path not in memory}
            rooms = {room: names for room, names in watch.rooms.items() if room != self.layout.attempts}
            watch = replace(watch, guarded=guarded, rooms=rooms)
        if _installation() == self.installation:
            # It was not brought up to date meanwhile, so a difference is the agent's.
            watch = replace(watch, installed=watch.installed - self.specs)
        return [*file_integrity.end(watch, undone), *self._moved(), *self._rescheduled()]

    def _rescheduled(self) -> list[Diagnostic]:
        """A job may be a person's, so it is reported and stays."""
        changed = [name for name, jobs in self.scheduled().items() if jobs != self.schedules[name]]
        texts = [f"your {name} changed while the agent ran; octoform left it as it is" for name in changed]
        hints = [f"`{' '.join(SCHEDULERS[name])}` shows it; check if that is yours" for name in changed]
        return [warning("APPLY-OUTSIDE-WRITE", text, hint=hint) for text, hint in zip(texts, hints, strict=True)]

    def _moved(self) -> list[Diagnostic]:
        """A commit may be a person's, who would lose it: it is reported and stays."""
        now = head_revision(self.layout.project)
        if now == self.revision:
            return []
        return [
            warning(
                "APPLY-OUTSIDE-WRITE",
                "the repository's HEAD was moved while the agent ran; it was left as it is",
                detail=f"from {self.revision or 'no commit'} to {now or 'no commit'}",
                hint="`git log` shows what was committed; if that was not you, `git reset --soft` to the former",
            )
        ]


def begin(context: Context, task: Task) -> Guard:
    """Remember all that the agent of this attempt may not touch."""
    layout, read = context.layout, sources(context)
    files = [*read.files, *layout.records(), *(layout.endpoint / name for name in SERVED)]
    files += [folder / attempts.FILE_NAME for folder in attempts.folders(layout) if folder != task.workdir]
    folders = [*read.folders, layout.committed, *records(layout)]
    sign = _daemon(layout)
    watch = _begun(context, [*files, *layout.memory()], folders, read.rooms)
    scheduled = partial(_scheduled, context.environ)
    revision = head_revision(layout.project)
    return Guard(watch, layout, sign, revision, _installed(context), _installation(), scheduled, scheduled())


def _scheduled(environ: Mapping[str, str]) -> dict[str, bytes]:
    """The person's jobs by the name of their list; nothing in a list whose program is absent or does not answer.

    Their files are closed to an ordinary user, so only those programs can read them.
    """
    found = dict.fromkeys(SCHEDULERS, b"")
    room = Path(os.environ.get("XDG_RUNTIME_DIR") or f"/run/user/{os.getuid()}")
    managed = room.is_dir() or "DBUS_SESSION_BUS_ADDRESS" in os.environ  # else no systemd answers this user
    for name, (command, *options) in SCHEDULERS.items():
        argv = [shutil.which(command, path=environ.get("PATH")) or "", *options]
        with suppress(OSError, subprocess.TimeoutExpired):
            if argv[0] and (managed or "--user" not in options):
                found[name] = subprocess.run(argv, stdin=subprocess.DEVNULL, capture_output=True, timeout=10).stdout
    return found


def of_sources(context: Context) -> file_integrity.Watch:
    """Remember only what is read as instruction: for the time in which an agent's code is run to judge it."""
    read = sources(context)
    return _begun(context, read.files, read.folders, read.rooms)


def _begun(
    context: Context, files: Iterable[Path], folders: Iterable[Path], rooms: Iterable[Path]
) -> file_integrity.Watch:
    project, own = context.layout.project, context.layout.host
    noted = [*_within(home(context.environ), _NOTED_OF_A_LOGIN)]
    noted += map(Path, _NOTED_OF_THE_MACHINE if os.geteuid() == 0 else ())
    found = repository(project)
    noted += [found.folder / name for name in _NOTED_OF_A_TREE] if found is not None else []
    tokens = (each.run / TOKENS for each in (context.layout, *_others(context.layout)))
    started = of_octoform()
    installed = _installed(context) | {*started.files, *started.rooms}
    wanted = file_integrity.Guarded(
        [*files, *started.files],
        folders,
        [*rooms, *started.rooms],
        home(context.environ),
        installed,
        lambda: _at_work(project, own),
        starts(context.environ),
        (*noted, *tokens),
    )
    return file_integrity.begin(project, wanted)


def _at_work(project: Path, own: str) -> tuple[Path, ...]:
    """The files of other hosts of this folder that a run or a daemon is changing now."""
    others = [Layout(project, path.parent.name) for path in (project / ".octoform").glob("*/lock.guard")]
    busy = [other for other in others if other.host != own and (is_locked(other) or _daemon(other) is None)]
    return tuple(place for other in busy for place in (other.committed, other.local))


def _installed(context: Context) -> frozenset[Path]:
    """The specs and schemas that come with octoform: other projects read them as well."""
    paths = (path for spec in context.specs.values() for path in (spec.path, spec.schema) if path is not None)
    return frozenset(path for path in paths if not path.is_relative_to(context.layout.project))


def _installation() -> object:
    """The identity of an installation of octoform: its package's own files, the record of its install, the commit."""
    own = Path(octoform.__file__)
    files = (own, *sorted(own.parents[1].glob("octoform-*.dist-info/RECORD")))
    try:
        facts = [(path.name, path.stat().st_mtime_ns, path.stat().st_size) for path in files]
    except OSError:
        return object()  # it is being changed right now: like no other
    return facts, head_revision(own.parents[1])


def _daemon(layout: Layout) -> bytes | None:
    """Which daemon was there last (empty: none ever was); None while one lives, or where that cannot be determined."""
    try:
        with opened(layout.daemon_lock, follow=False) as descriptor:
            return os.read(descriptor, 4096) if acquire(descriptor, shared=True) else None
    except FileNotFoundError:
        return b""
    except OSError:
        return None
