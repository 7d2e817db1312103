"""End the tunnel of scope internet from outside of the process that serves, with proof.

The process is asked first, so that it starts no other. The proof does not rest on its word: a program of its own looks
for what is left, ends it, and asks the public address. That also works when nothing serves any more. Light.
"""

import subprocess
import sys
import time
from collections.abc import Mapping
from typing import Any
from urllib.parse import urlsplit

from octoform.base import files
from octoform.base.files import parse, private_folder
from octoform.diagnostics import Diagnostic, error, warning
from octoform.endpoint.process import offline_commands, record
from octoform.endpoint.process.record import ask
from octoform.endpoint.published_files import CONNECTION
from octoform.records import dataclass
from octoform.state.layout import Layout

REVOKED = "tunnel-revoked.json"
ASK_SECONDS = 30.0
PROOF_SECONDS = 60.0


@dataclass(frozen=True, slots=True)
class Revocation:
    """The proof of a revocation. ``answered_before``: it answered just before (None: there was no address);
    ``asked`` whether a process that serves took part."""

    pid: int | None
    url: str | None
    was_running: bool
    answered_before: bool | None
    asked: bool
    seconds: float


def allow(layout: Layout) -> None:
    """Let the tunnel open again: a person's order with `octoform start`."""
    (layout.run / REVOKED).unlink(missing_ok=True)


def revoke(layout: Layout, by: str) -> tuple[Revocation | None, list[Diagnostic]]:
    """End the tunnel for good, as ``by`` wants; a Revocation only when it is proved to be gone."""
    private_folder(layout.run)
    result = ask(layout, {"op": "revoke_tunnel", "by": by}, ASK_SECONDS)
    # In isolated mode, by the module's name: the launcher is no part of the core, and its word is read as text.
    command = [sys.executable, "-I", "-m", "octoform.server.tunnel_termination", str(layout.run)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=PROOF_SECONDS, check=False)
        found = parse(done.stdout)
        proved = done.returncode == 0 and found["proved"] is True
    except (OSError, subprocess.TimeoutExpired, ValueError, LookupError, TypeError) as problem:
        return None, [_not_proved(f"the check could not be made: {problem}")]
    if (result is None or "proved" not in result) and found["pid"] is not None:
        # No process has written it. The tunnel is gone either way, so a log that cannot be written changes nothing.
        offline_commands.ask(layout, "note", {"event": "tunnel_revoked", "by": by, **found})
    if not proved:
        return None, [_not_proved(_left(found))]
    first = result if result is not None and "proved" in result else found
    return Revocation(
        pid=found["pid"],
        url=found["url"],
        was_running=bool(first["was_running"] or found["was_running"]),
        answered_before=first["answered_before"],
        asked=result is not None,
        seconds=found["seconds"],
    ), []


def _left(found: dict[str, object]) -> str:
    if not found["process_gone"]:
        return f"a process of it (pid {found['pid']}, or one that it started) could not be ended"
    if found["answers"]:
        return f"{found['url']} still answers as this endpoint"
    return f"no process of it lives, but {found['url']} never answered from here before, so silence proves nothing"


def _not_proved(detail: str) -> Diagnostic:
    hint = "end the tunnel at its provider; octoform token revoke and octoform stop close the endpoint itself"
    return error("TUNNEL-NOT-REVOKED", "the tunnel is not verified to be gone", detail=detail, hint=hint)


# Where the endpoint is reached from outside of this machine: what was published, and what its tunnel reports now.
# Light.
#
# A tunnel opens some seconds after the process that serves, or never: a command that reports success to a person asks
# here.

OPENING, RUNNING = "starting", "running"
OPEN_SECONDS = 15.0
"""Seconds that a tunnel may take for its address before a person is notified that it has none."""
_STEP = 0.1
_WORDS = {"revoked": "the tunnel is revoked", OPENING: "the tunnel has no address yet"}


@dataclass(frozen=True, slots=True)
class TunnelState:
    """A tunnel as its process reports it: ``state`` is starting, running, not running, revoked or unknown.

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


def tunnel_now(layout: Layout) -> TunnelState | None:
    """The tunnel as it is; None where the published endpoint has none."""
    if _published(layout).get("tunnel") is None:
        return None
    found = (record.ask(layout, {"op": "status"}) or {}).get("tunnel")
    if not isinstance(found, Mapping):
        return TunnelState("unknown", reason="the endpoint's process does not report it")
    url, reason = found.get("url"), found.get("reason")
    return TunnelState(str(found.get("state")), str(url) if url else None, str(reason) if reason else None)


def tunnel_opened(layout: Layout, seconds: float = OPEN_SECONDS) -> TunnelState | None:
    """The tunnel once it runs or is known not to; as it is after ``seconds`` when it is still starting."""
    end = time.monotonic() + seconds
    found = tunnel_now(layout)
    while found is not None and found.state == OPENING and time.monotonic() < end:
        time.sleep(_STEP)
        found = tunnel_now(layout)
    return found


def through(tunnel: TunnelState, url: str) -> str:
    """The endpoint's own URL as it is called through its tunnel."""
    return f"{tunnel.url}{urlsplit(url).path}"


def no_tunnel(found: TunnelState | None) -> Diagnostic | None:
    """TUNNEL-NOT-RUNNING, a warning, for a tunnel that ought to run and does not; None for every other."""
    if found is None or found.running:
        return None
    summary = _WORDS.get(found.state, "the tunnel does not run")
    hint = "octoform start opens a new one" if found.state == "revoked" else "octoform doctor looks for its program"
    return warning(
        "TUNNEL-NOT-RUNNING",
        f"{summary}: the endpoint cannot be reached from the internet",
        detail=found.reason,
        hint=f"{hint}; octoform status shows the progress",
    )


def _published(layout: Layout) -> dict[str, Any]:
    try:
        found = files.read_json(layout.endpoint / CONNECTION)
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}
