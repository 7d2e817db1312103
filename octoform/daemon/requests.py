"""What a person may ask of a daemon: to try again what was given up. Light."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from octoform.daemon.notify.remediation import advice
from octoform.daemon.observe.clock import SystemClock
from octoform.daemon.store import incidents, instance_lock
from octoform.daemon.store.backoff import Breaker, Breakers
from octoform.daemon.store.instance_lock import Record
from octoform.daemon.store.json_store import Shelf
from octoform.diagnostics import Diagnostic, did_you_mean, error
from octoform.state.layout import Layout
from octoform.state.lock_holder import myself

ALL = "all"


@dataclass(frozen=True, slots=True)
class GivenUp:
    """What waits for a person: troubles that last and were given up, and the targets of all that last."""

    frozen: tuple[Breaker, ...] = ()
    targets: tuple[str, ...] = ()
    advice: Mapping[str, str] = field(default_factory=dict)
    """What to do about each, by its target."""
    said: tuple[Diagnostic, ...] = ()


def given_up(layout: Layout) -> GivenUp:
    """What the daemon, or the last one, gave up."""
    if not layout.daemon.is_dir():
        return GivenUp()
    shelf = Shelf(layout)
    breakers = Breakers(shelf, myself().boot_id)
    breakers.load(SystemClock().uptime())
    lasting = [each for each in incidents.read(shelf) if not each.over]
    told = {each.target: advice(each.kind, each.target) for each in lasting}
    return GivenUp(breakers.given_up(lasting), tuple(told), told, tuple(shelf.said))


def retry(layout: Layout, known: GivenUp, target: str | None) -> tuple[tuple[str, ...], Diagnostic | None]:
    """Ask for one look, and for another try of ``target`` (`ALL`: of everything); the targets that it is about.

    DAEMON-NO-SUCH-TROUBLE for a target that has none. A daemon that lives takes it up at once, else the next one does.
    """
    if target is None:
        return (), instance_lock.ask(layout, ())
    if target == ALL:
        return known.targets, instance_lock.ask(layout, ("*",))
    if target not in known.targets:
        near = did_you_mean(target, known.targets)
        listed = ", ".join(known.targets[:8]) or "none; nothing is wrong that is known of"
        hint = f"did you mean {near}?" if near else f"there are: {listed}"
        return (), error("DAEMON-NO-SUCH-TROUBLE", f"{target[:100]} has no trouble that lasts", hint=hint)
    return (target,), instance_lock.ask(layout, (target,))


def daemon_of(layout: Layout) -> Record | None:
    """The daemon that lives."""
    return instance_lock.alive(layout)
