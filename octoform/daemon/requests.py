"""A person's requests to the daemon: to retry repairs that gave up. Light."""

import os
import pwd
from collections.abc import Mapping
from pathlib import Path

from octoform.base.escaping import escaped
from octoform.claims.ledger import Ledger
from octoform.claims.model import Claim
from octoform.claims.settings import settings_of
from octoform.daemon.notices import advice
from octoform.daemon.observe.clock_jumps import SystemClock
from octoform.daemon.store import incidents, instance_lock
from octoform.daemon.store.backoff import Backoff, Backoffs
from octoform.daemon.store.instance_lock import Record
from octoform.daemon.store.json_store import Shelf
from octoform.diagnostics import Diagnostic, did_you_mean, error
from octoform.engine.tools import layout_of
from octoform.manifest.loader import load
from octoform.manifest.model import FILE_NAME, Daemon
from octoform.records import dataclass, field
from octoform.state.layout import Layout
from octoform.state.store.lock import Holder, Liveness, liveness, myself, read_holder

ALL = "all"


@dataclass(frozen=True, slots=True)
class GivenUp:
    """Problems that wait for a person: those that last and gave up, and the targets of all that last."""

    frozen: tuple[Backoff, ...] = ()
    targets: tuple[str, ...] = ()
    advice: Mapping[str, str] = field(default_factory=dict)
    """The remedy of each, by its target."""
    said: tuple[Diagnostic, ...] = ()


def given_up(layout: Layout) -> GivenUp:
    """The problems that the daemon, or the last one, gave up."""
    if not layout.daemon.is_dir():
        return GivenUp()
    shelf = Shelf(layout)
    breakers = Backoffs(shelf, myself().boot_id)
    breakers.load(SystemClock().uptime())
    lasting = [each for each in incidents.read(shelf) if not each.over]
    fields = {each.target: advice(each.kind, each.target) for each in lasting}
    return GivenUp(breakers.given_up(lasting), tuple(fields), fields, tuple(shelf.said))


def retry(layout: Layout, known: GivenUp, target: str | None) -> tuple[tuple[str, ...], Diagnostic | None]:
    """Ask for one look, and for another try of ``target`` (`ALL`: of everything); the targets that it is about.

    DAEMON-NO-SUCH-A problem for a target that has none. A daemon that lives takes it up at once, else the next one
    does.
    """
    if target is None:
        return (), instance_lock.ask(layout, ())
    if target == ALL:
        return known.targets, instance_lock.ask(layout, ("*",))
    if target not in known.targets:
        near = did_you_mean(target, known.targets)
        listed = ", ".join(known.targets[:8]) or "none; nothing is wrong that is known of"
        hint = f"did you mean {near}?" if near else f"there are: {listed}"
        return (), error("DAEMON-NO-SUCH-TROUBLE", f"{target[:100]} has no open incident", hint=hint)
    return (target,), instance_lock.ask(layout, (target,))


def daemon_of(layout: Layout) -> Record | None:
    """The daemon that lives."""
    return instance_lock.alive(layout)


# What a person decides about claims. The decider is noted by account name. (Heavy: the manifest.)


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
    hint = "an agent at work must not be able to decide as a person; repeat the command when it has ended"
    return error("CLAIM-AGENT-AT-WORK", summary, hint=hint)


def everything(ledger: Ledger, *, over: bool) -> list[Claim]:
    """Those that wait for a person, those in force, and with ``over`` those that ended, the newest first."""
    return [*ledger.pending(), *ledger.active(), *(reversed(ledger.recent()) if over else ())]


def person() -> str:
    """The user at the terminal: the account's name, or its number."""
    try:
        return pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return str(os.getuid())
