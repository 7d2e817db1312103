"""What a person decides about claims. Whoever decides is noted by the name of their account. (Heavy: the manifest.)"""

import os
import pwd
from collections.abc import Mapping
from pathlib import Path

from octoform.claims.ledger import Ledger
from octoform.claims.model import Claim
from octoform.claims.settings import settings_of
from octoform.daemon.observe.clock import SystemClock
from octoform.diagnostics import Diagnostic, error
from octoform.engine.tools import layout_of
from octoform.escaping import escaped
from octoform.manifest.loader import load
from octoform.manifest.model import FILE_NAME, Daemon
from octoform.state.lock_holder import Liveness, liveness, myself
from octoform.state.store.lock import Holder, read_holder


def open_ledger(project: Path, environ: Mapping[str, str]) -> tuple[Ledger | None, list[Diagnostic]]:
    """The ledger of the manifest's host, with the manifest's own longest time of a claim."""
    layout, found = layout_of(project, environ)
    if layout is None:
        return None, found
    manifest, _ = load(project / FILE_NAME, environ)
    settings = manifest.daemon if manifest is not None else Daemon()
    return Ledger.open(layout, SystemClock(), settings_of(layout, float(settings.claim_seconds))), found


def undecidable(project: Path, environ: Mapping[str, str]) -> Diagnostic | None:
    """Why nothing can be decided now: somebody works on the host, and an agent's word would look like a person's."""
    layout, _ = layout_of(project, environ)
    holder = read_holder(layout) if layout is not None else None
    if not isinstance(holder, Holder) or liveness(holder.process, myself()) is Liveness.DEAD:
        return None
    summary = f"nothing is decided while {escaped(holder.operation)[:60]} is under way (process {holder.process.pid})"
    hint = "an agent may be at work, and what it decides would look like a person's word; say it when that has ended"
    return error("CLAIM-AGENT-AT-WORK", summary, hint=hint)


def everything(ledger: Ledger, *, over: bool) -> list[Claim]:
    """Those that wait for a person, those in force, and with ``over`` those that ended, the newest first."""
    return [*ledger.pending(), *ledger.active(), *(reversed(ledger.recent()) if over else ())]


def person() -> str:
    """Who sits there: the account's name, or its number."""
    try:
        return pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return str(os.getuid())
