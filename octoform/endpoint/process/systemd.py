"""The endpoint as a service of systemd, of one person's own manager: the unit's text, and the few words to systemctl.

While a unit of ours is installed, systemd owns the process: anyone who starts or stops the endpoint asks systemd, so
that there is one supervisor and not two. Light until systemctl is really asked.
"""

import os
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from octoform.base.digest import of_bytes
from octoform.base.files import read
from octoform.endpoint.process.record import MARK, unmark
from octoform.endpoint.published_files import LAUNCHER
from octoform.patterns import regex
from octoform.records import dataclass
from octoform.state.layout import Layout

PROGRAM = "systemctl"
SECONDS = 40.0
"""For one command: more than the unit's own time to stop."""
LOOK_SECONDS = 0.5
_ENDED = ("failed", "inactive")

_UNIT = """\
# Written by octoform service install; octoform service uninstall takes it away.
[Unit]
Description=octoform endpoint of {host}
# What octoform stop ended stays so, also after a boot.
ConditionPathExists=!{stop}
StartLimitIntervalSec=300
StartLimitBurst=10

[Service]
Type=exec
{user}ExecStart={launcher}
WorkingDirectory=-{folder}
Environment={path} {mark}
UMask=0077
StandardOutput=append:{log}
StandardError=inherit
Restart=on-failure
RestartSec=3
# 75: another process serves this endpoint; 78: what is there may not be served. Neither gets better by trying again.
RestartPreventExitStatus=75 78
# The process ends its calls and its tunnel by itself; what it leaves behind is killed.
KillMode=mixed
TimeoutStopSec=15
# No sandbox of files, users or devices: it would hide the groups and nodes that the hardware is reached through.
NoNewPrivileges=yes
LockPersonality=yes
RestrictSUIDSGID=yes

[Install]
WantedBy={target}
"""


@dataclass(frozen=True, slots=True)
class SystemctlOutput:
    """The output of systemctl; ``status`` is None when there is no such program, or when it did not come to an end."""

    status: int | None
    said: str


def unit_name(layout: Layout) -> str:
    """The unit of a host."""
    return f"octoform-{layout.host}.service"


def unit_path(layout: Layout, environ: Mapping[str, str] | None = None) -> Path:
    """Where a person's own units lie."""
    given = (os.environ if environ is None else environ).get("XDG_CONFIG_HOME")
    folder = Path(given) if given and Path(given).is_absolute() else Path.home() / ".config"
    return folder / "systemd" / "user" / unit_name(layout)


def unit_text(layout: Layout, path: str, account: str | None = None) -> str:
    """The unit, with the search path ``path`` for a tunnel's program; for the whole machine with ``account``."""
    return _UNIT.format(
        host=plain(layout.host),
        user="" if account is None else f"User={plain(account)}\n",
        launcher=program(layout.endpoint / LAUNCHER),
        stop=plain(str(layout.stop_mark)),
        folder=plain(str(layout.run)),
        path=quoted(f"PATH={path}"),
        mark=f"{MARK}={of_bytes(os.fsencode(layout.endpoint))[-16:]}",
        log=plain(str(layout.server_log)),
        target="default.target" if account is None else "multi-user.target",
    )


def quoted(word: str) -> str:
    """A word as systemd.syntax(7) has it: in quotes, with its own escapes, and no specifier in it."""
    text = word.replace("\\", "\\\\").replace('"', '\\"').replace("%", "%%")
    return f'"{text}"'


def program(path: Path) -> str:
    """The program to start. Systemd takes none with a quote or a backslash in its name, so there a shell starts it.

    A dollar sign would be taken for a variable without the colon.
    """
    text = str(path)
    shell = "/bin/sh " if any(character in text for character in "\"'\\") else ""
    return (":" if "$" in text else "") + shell + quoted(text)


def plain(text: str) -> str:
    """A setting that goes to the end of its line: blanks stay, specifiers do not work."""
    return text.replace("%", "%%")


def fits(layout: Layout) -> bool:
    """True when the paths can be in a unit: a line break in one cannot."""
    return not any(character in str(layout.project) for character in "\r\n\0")


def is_ours(layout: Layout, path: Path) -> bool:
    """True when the unit at ``path`` starts this very endpoint; another project may have a host of the same name."""
    try:
        return f"ExecStart={program(layout.endpoint / LAUNCHER)}" in read(path).decode().splitlines()
    except (OSError, ValueError):
        return False


def systemctl(*arguments: str) -> SystemctlOutput:
    """One command to the person's own manager; never as another user."""
    import subprocess

    try:
        done = subprocess.run(
            [PROGRAM, "--user", "--no-pager", *arguments],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=SECONDS,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return SystemctlOutput(None, f"{PROGRAM} {' '.join(arguments)} did not come to an end within {SECONDS:.0f} s")
    except OSError as problem:
        return SystemctlOutput(None, f"{PROGRAM} cannot be started: {problem.strerror}")
    return SystemctlOutput(done.returncode, (done.stderr or done.stdout).strip())


class Service:
    """A start that systemd was asked for."""

    def __init__(self, name: str) -> None:
        self._name = name
        self.taken = False  # systemd ends one process wholly before it starts the next
        self._next = time.monotonic() + LOOK_SECONDS

    def ended(self) -> str | None:
        """How it ended before it served; None while it may still come. Systemd is asked twice a second."""
        if time.monotonic() < self._next:
            return None
        self._next = time.monotonic() + LOOK_SECONDS
        found = systemctl("is-active", self._name)
        state = found.said.splitlines()[0] if found.said else ""
        return f"systemd reports that {self._name} is {state}" if state in _ENDED else None

    def give_up(self) -> None:
        """End what does not come."""
        systemctl("stop", self._name)


def started(layout: Layout) -> Service | None:
    """Let systemd start the endpoint; None when no unit of ours is installed, or when systemd does not take it.

    A caller that gets here may end a person's stop, and the unit starts nothing while its mark is there.
    """
    if not is_ours(layout, unit_path(layout)):
        return None
    unmark(layout)
    name = unit_name(layout)
    return Service(name) if systemctl("start", name).status == 0 else None


def stopped(layout: Layout) -> bool:
    """Let systemd stop the endpoint, so that it does not start it again; True when it did."""
    return is_ours(layout, unit_path(layout)) and systemctl("stop", unit_name(layout)).status == 0


# The daemon as a service of systemd, beside the endpoint's: one unit that runs ``octoform watch``. Light.
#
# It is a unit of its own, so that the daemon can be stopped and started again without touching what it watches.

_WATCH_UNIT = """\
# Written by octoform service install; octoform service uninstall takes it away.
[Unit]
Description=octoform watch of {host}
StartLimitIntervalSec=300
StartLimitBurst=10

[Service]
Type=exec
{user}ExecStart={python} -P -m octoform.cli watch
WorkingDirectory={folder}
Environment={path}
UMask=0077
Restart=on-failure
RestartSec=5
# It ends in order at SIGTERM, and reports it by that status.
SuccessExitStatus=143
# It ends its agents and its other children by itself. An endpoint that it started without a unit is none of them.
KillMode=process
TimeoutStopSec=60
# No sandbox of files or users: agents bring their own, and repairs write where apply does.
NoNewPrivileges=yes

[Install]
WantedBy={target}
"""


def watch_name(layout: Layout) -> str:
    """The unit of a host's daemon."""
    return f"octoform-watch-{layout.host}.service"


def watch_path(layout: Layout, environ: Mapping[str, str] | None = None) -> Path:
    """Where it lies among a person's own units."""
    return unit_path(layout, environ).with_name(watch_name(layout))


def watch_text(layout: Layout, path: str, account: str | None = None) -> str:
    """The unit, with the search path ``path`` for agents' programs; for the whole machine with ``account``."""
    return _WATCH_UNIT.format(
        host=plain(layout.host),
        user="" if account is None else f"User={plain(account)}\n",
        python=program(Path(sys.executable)),
        folder=plain(str(layout.project)),
        path=quoted(f"PATH={path}"),
        target="default.target" if account is None else "multi-user.target",
    )


def watches(layout: Layout, path: Path) -> bool:
    """True when the unit at ``path`` watches this very project; another one may have a host of the same name."""
    try:
        lines = read(path).decode().splitlines()
    except (OSError, ValueError):
        return False
    wanted = f"WorkingDirectory={plain(str(layout.project))}"
    return wanted in lines and any(line.endswith("-m octoform.cli watch") for line in lines)


# The command that starts octoform again, for files that outlive this run.
#
# A program that was fetched for one run (`uvx`, `pipx run`) lives in a cache, which is cleaned: a client's file with
# that path works today and not next week. Light.

NAME = "octoform"
_UV_FOLDER = regex(r"(archive|environments|builds)-v\d+")
_PIPX_CACHES = (".cache/pipx", ".local/pipx/.cache", ".local/share/pipx/.cache", "Library/Caches/pipx")


def lasting_command(words: Sequence[str], environ: Mapping[str, str]) -> list[str] | None:
    """The command line that runs octoform with ``words`` later as well.

    This interpreter where it stays; else an octoform of the PATH that does; None where there is none.
    """
    if stays(environ):
        return [sys.executable, "-I", "-m", "octoform.cli", *words]
    for folder in map(Path, environ.get("PATH", "").split(os.pathsep)):
        program = folder / NAME
        if folder.is_absolute() and os.access(program, os.X_OK) and not _of_a_cache(program, environ):
            return [str(program), *words]
    return None


def stays(environ: Mapping[str, str]) -> bool:
    """Whether this octoform is there for later runs too, and does not lie in a cache for one run."""
    return not _of_a_cache(Path(sys.prefix), environ)


def _of_a_cache(path: Path, environ: Mapping[str, str]) -> bool:
    """Whether the path, or what it leads to, lies where uv or pipx keeps what is needed for one run."""
    home = Path(environ.get("HOME") or Path.home())
    caches = [home / name for name in _PIPX_CACHES]
    caches += [Path(environ[name]) for name in ("UV_CACHE_DIR",) if environ.get(name)]
    caches += [Path(environ["PIPX_HOME"]) / ".cache"] if environ.get("PIPX_HOME") else []
    seen = (path.absolute(), path.resolve())
    return any(
        any(_UV_FOLDER.fullmatch(part) for part in each.parts) or any(each.is_relative_to(cache) for cache in caches)
        for each in seen
    )
