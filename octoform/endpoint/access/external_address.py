"""Where the endpoint is reached from outside of this machine: what was published, and what its tunnel says now. Light.

A tunnel opens some seconds after the process that serves, or never: whoever tells a person that all is done asks here.
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

from octoform.base import files
from octoform.diagnostics import Diagnostic, warning
from octoform.endpoint.files import CONNECTION
from octoform.endpoint.process import control
from octoform.state.layout import Layout

OPENING, RUNNING = "starting", "running"
OPEN_SECONDS = 15.0
"""What a tunnel may take for its address before a person is told that it has none."""
_STEP = 0.1
_WORDS = {"revoked": "the tunnel is revoked", OPENING: "the tunnel has no address yet"}


@dataclass(frozen=True, slots=True)
class TunnelSight:
    """A tunnel as its process tells it: ``state`` is starting, running, not running, revoked or unknown.

    ``url`` is its address while it runs, without a path; ``reason`` why it does not.
    """

    state: str
    url: str | None = None
    reason: str | None = None

    @property
    def running(self) -> bool:
        """True when it can be reached at ``url``."""
        return self.state == RUNNING and self.url is not None


def networked(layout: Layout) -> bool:
    """Whether the published endpoint has an address of HTTP when it runs."""
    return _published(layout).get("network") is not None


def tunnel_now(layout: Layout) -> TunnelSight | None:
    """The tunnel as it is; None where the published endpoint has none."""
    if _published(layout).get("tunnel") is None:
        return None
    told = (control.ask(layout, {"op": "status"}) or {}).get("tunnel")
    if not isinstance(told, Mapping):
        return TunnelSight("unknown", reason="the endpoint's process does not tell")
    url, reason = told.get("url"), told.get("reason")
    return TunnelSight(str(told.get("state")), str(url) if url else None, str(reason) if reason else None)


def tunnel_opened(layout: Layout, seconds: float = OPEN_SECONDS) -> TunnelSight | None:
    """The tunnel once it runs or is known not to; as it is after ``seconds`` when it is still starting."""
    end = time.monotonic() + seconds
    found = tunnel_now(layout)
    while found is not None and found.state == OPENING and time.monotonic() < end:
        time.sleep(_STEP)
        found = tunnel_now(layout)
    return found


def through(tunnel: TunnelSight, url: str) -> str:
    """The endpoint's own URL as it is called through its tunnel."""
    return f"{tunnel.url}{urlsplit(url).path}"


def no_tunnel(found: TunnelSight | None) -> Diagnostic | None:
    """TUNNEL-NOT-RUNNING, a warning, for a tunnel that ought to run and does not; None for every other."""
    if found is None or found.running:
        return None
    summary = _WORDS.get(found.state, "the tunnel does not run")
    hint = "octoform start opens a new one" if found.state == "revoked" else "octoform doctor looks for its program"
    return warning(
        "TUNNEL-NOT-RUNNING",
        f"{summary}: the endpoint cannot be reached from the internet",
        detail=found.reason,
        hint=f"{hint}; octoform status tells how it goes on",
    )


def _published(layout: Layout) -> dict[str, Any]:
    try:
        found = files.read_json(layout.endpoint / CONNECTION)
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}
