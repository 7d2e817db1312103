"""The daemon as a service of systemd, beside the endpoint's: one unit that runs ``octoform watch``. Light.

It is a unit of its own, so that the daemon can be stopped and started again without touching what it watches.
"""

import sys
from collections.abc import Mapping
from pathlib import Path

from octoform.base.files import read
from octoform.endpoint.process.systemd import plain, program, quoted, unit_path
from octoform.state.layout import Layout

_UNIT = """\
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
# It ends in order at SIGTERM, and tells so with that status.
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
    return _UNIT.format(
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
