"""Commands on the daemon: watch, status, health, repairs, claims, incidents.

A command imports what it needs when it is chosen: all others cost nothing.
"""

from __future__ import annotations

import os
from argparse import Namespace
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from octoform.cli.parser import UsageError
from octoform.diagnostics import Diagnostic, error
from octoform.views.format import problems
from octoform.views.format.console import Console

if TYPE_CHECKING:
    from octoform.apply.rewrite.pending_rewrite import Rewrite
    from octoform.claims.ledger import Ledger
    from octoform.claims.model import Claim
    from octoform.daemon.model import Status
    from octoform.daemon.reconcile.supervisor import Cycle


class CycleView(Protocol):
    """A view of the check cycles."""

    def __call__(self, made: Cycle, /) -> None:
        """Show one."""

    def end(self) -> None:
        """Leave the terminal as it was."""


def watched(
    project: Path,
    screen: Console,
    view: CycleView,
    *,
    once: bool,
    as_json: bool,
    beside: Callable[[], int | None] = lambda: None,
) -> tuple[int, Status | None]:
    """The exit code, and the health that the last check cycle left.

    None where it came to no end of its own: it was refused, which is shown (1), or ended by a signal (128 + number).
    ``beside`` gives the exit code where another process has become the daemon meanwhile; None: that is a refusal, too.
    """
    from octoform.daemon.main import watch
    from octoform.daemon.model import Status
    from octoform.daemon.store.instance_lock import TAKEN
    from octoform.views.daemon.event_log import EXIT

    try:
        done, found = watch(project, os.environ, view, once)
    finally:
        view.end()
    if done is None and any(each.code == TAKEN for each in found) and (code := beside()) is not None:
        return code, None
    if done is None:
        return problems.show(screen, found, as_json=as_json), None
    if done.signal is not None:
        return 128 + done.signal, None
    health = done.last.health if done.last is not None else None
    return (1, Status.UNKNOWN) if health is None else (EXIT[health.status], health.status)


def run_watch(arguments: Namespace, project: Path, screen: Console) -> int:
    """The exit code for the signal that ended it; with ``-once`` the exit codes of ``health``."""
    from octoform.views.daemon.event_log import Lines, Objects

    view = Objects(screen) if arguments.json or not screen.out.isatty() else Lines(screen)
    return watched(project, screen, view, once=arguments.once, as_json=arguments.json)[0]


def run_status(arguments: Namespace, project: Path, screen: Console) -> int:
    """0 only in sync and healthy; 3 to 6 as ``health`` leaves; 1 out of sync, or where it cannot be determined."""
    from octoform.daemon.status import survey
    from octoform.engine.project_status import status
    from octoform.views.daemon import status as status_view

    found = status(project, os.environ)
    surveyed, trouble = survey(project, os.environ)
    if surveyed is None:
        return problems.show(screen, found.diagnostics if found.sync is None else trouble, as_json=arguments.json)
    view = status_view.uncompared if found.sync is None else status_view.status
    return view(screen, found, surveyed, as_json=arguments.json)


def run_health(arguments: Namespace, project: Path, screen: Console) -> int:
    """0 healthy, 3 degraded, 4 error, 5 down, 6 unknown; 1 where it cannot be determined at all."""
    from octoform.daemon.status import survey
    from octoform.views.daemon.health import health

    found, trouble = survey(project, os.environ)
    if found is None:
        return problems.show(screen, trouble, as_json=arguments.json)
    return health(screen, found, as_json=arguments.json)


def run_heal(arguments: Namespace, project: Path, screen: Console) -> int:
    """0 when a daemon was asked; of a check cycle that was made here the exit codes of ``health``."""
    from octoform.daemon.requests import daemon_of, given_up, retry
    from octoform.engine.tools import layout_of
    from octoform.views.daemon import requests
    from octoform.views.daemon.event_log import Lines, Silence

    layout, found = layout_of(project, os.environ)
    if layout is None:
        return problems.show(screen, found, as_json=arguments.json)
    known = given_up(layout)
    retried, problem = retry(layout, known, arguments.retry)
    if problem is not None:
        return problems.show(screen, [problem], as_json=arguments.json)

    def asked() -> int | None:
        """The exit code when a daemon lives: the request is written by now, and it takes that up."""
        daemon = daemon_of(layout)
        return None if daemon is None else requests.asked(screen, daemon, known, retried, as_json=arguments.json)

    if (code := asked()) is not None:
        return code
    view = Silence() if arguments.json else Lines(screen)
    # A daemon may have started since.
    code, status = watched(project, screen, view, once=True, as_json=arguments.json, beside=asked)
    if status is not None:
        requests.healed(screen, given_up(layout), retried, str(status), as_json=arguments.json)
    return code


def run_claims(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 0; 1 for a claim that cannot be taken back."""
    from octoform.daemon.requests import everything, open_ledger, person, undecidable
    from octoform.views.daemon import requests as view

    ledger, found = open_ledger(project, os.environ)
    if ledger is None:
        return problems.show(screen, found, as_json=arguments.json)
    problem = undecidable(project, os.environ)
    if arguments.retire is not None:
        if problem is not None:
            return problems.show(screen, [problem], as_json=arguments.json)
        done = ledger.retire(arguments.retire, person())
        if isinstance(done, Diagnostic):
            return problems.show(screen, [done], as_json=arguments.json)
        return view.decided(screen, done, as_json=arguments.json)
    if problem is None:
        ledger.expire()
    listed = everything(ledger, over=arguments.all)
    problems.show(screen, ledger.new_diagnostics())
    return view.listed(screen, listed, everything=arguments.all, as_json=arguments.json)


def run_confirm(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 1 when nothing was decided."""
    from octoform.daemon.requests import open_ledger, person, undecidable
    from octoform.engine.unattended.heal import waiting_rewrite

    ledger, found = open_ledger(project, os.environ)
    if ledger is None:
        return problems.show(screen, found, as_json=arguments.json)
    if arguments.claim is None:
        return _listed(arguments, project, screen, ledger.pending())
    if problem := undecidable(project, os.environ):
        return problems.show(screen, [problem], as_json=arguments.json)
    rewrite = waiting_rewrite(project, os.environ, arguments.claim)
    if rewrite is not None:
        return _rewrite(arguments, project, screen, rewrite)
    if arguments.reject:
        return _print_outcome(screen, ledger.reject(arguments.claim, person()), as_json=arguments.json)
    return _claim(arguments, project, screen, ledger)


def _claim(arguments: Namespace, project: Path, screen: Console, ledger: Ledger) -> int:
    """Show a claim that waits, and make it true after a yes."""
    from octoform.daemon.requests import person, undecidable
    from octoform.views.daemon import requests as view
    from octoform.views.endpoint.process import approves

    claim = next((each for each in ledger.pending() if each.id == arguments.claim), None)
    if claim is not None and not arguments.auto_approve:
        if arguments.json or not screen.interactive:
            return problems.show(screen, [_not_approved()], as_json=arguments.json)
        for line in view.lines(screen, claim):
            screen.line(line)
        if not approves(screen, view.question(claim)):
            return problems.show(screen, [_not_approved()])
        if problem := undecidable(project, os.environ):  # a person takes their time
            return problems.show(screen, [problem])
    return _print_outcome(screen, ledger.confirm(arguments.claim, person()), as_json=arguments.json)


def _listed(arguments: Namespace, project: Path, screen: Console, claims: Sequence[Claim]) -> int:
    """All that waits for a person."""
    from octoform.engine.unattended.heal import waiting_rewrites
    from octoform.views.daemon import requests as view

    if arguments.reject or arguments.auto_approve:
        return problems.show(screen, [_of_nothing()], as_json=arguments.json)
    rewrites = [
        {"id": each.id, "moves": each.moves, "at": each.at, "difference": each.difference()}
        for each in waiting_rewrites(project, os.environ)
    ]
    return view.waiting(screen, claims, rewrites, as_json=arguments.json)


def _rewrite(arguments: Namespace, project: Path, screen: Console, rewrite: Rewrite) -> int:
    """Show what a rewrite changes, and put it in service or drop it."""
    from octoform.daemon.requests import undecidable
    from octoform.engine.unattended.heal import decide_rewrite
    from octoform.views.daemon import requests as view
    from octoform.views.endpoint.process import approves

    if not arguments.reject and not arguments.auto_approve:
        if arguments.json or not screen.interactive:
            return problems.show(screen, [_not_approved()], as_json=arguments.json)
        for line in view.rewrite_lines(rewrite.id, rewrite.moves, rewrite.difference()):
            screen.line(line)
        if not approves(screen, "Put this rewrite in service?"):
            return problems.show(screen, [_not_approved()])
        if problem := undecidable(project, os.environ):
            return problems.show(screen, [problem])
    problem = decide_rewrite(project, os.environ, rewrite, yes=not arguments.reject)
    if problem is not None:
        return problems.show(screen, [problem], as_json=arguments.json)
    return view.rewrite_decided(screen, rewrite.id, served=not arguments.reject, as_json=arguments.json)


def _of_nothing() -> Diagnostic:
    hint = "octoform confirm lists what waits for a person"
    return error("CLAIM-NOT-APPROVED", "nothing was decided: no claim and no rewrite is named", hint=hint)


def _not_approved() -> Diagnostic:
    hint = "answer yes on a terminal, or give -auto-approve where no one can be asked"
    return error("CLAIM-NOT-APPROVED", "nothing was decided: it was not approved", hint=hint)


def _print_outcome(screen: Console, done: Claim | Diagnostic, *, as_json: bool) -> int:
    from octoform.views.daemon import requests as view

    if isinstance(done, Diagnostic):
        return problems.show(screen, [done], as_json=as_json)
    return view.decided(screen, done, as_json=as_json)


def run_pause(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 0 when repairs are paused, also where no daemon runs yet."""
    from octoform.daemon.observe.clock_jumps import SystemClock
    from octoform.daemon.store import instance_lock
    from octoform.engine.tools import layout_of
    from octoform.views.daemon import requests

    layout, found = layout_of(project, os.environ)
    if layout is None:
        return problems.show(screen, found, as_json=arguments.json)
    if problem := instance_lock.pause(layout, SystemClock().stamp()):
        return problems.show(screen, [problem], as_json=arguments.json)
    return requests.paused(screen, layout.host, instance_lock.alive(layout), as_json=arguments.json)


def run_resume(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 0 when repairs are not paused any more."""
    from octoform.daemon.store import instance_lock
    from octoform.engine.tools import layout_of
    from octoform.views.daemon import requests

    layout, found = layout_of(project, os.environ)
    if layout is None:
        return problems.show(screen, found, as_json=arguments.json)
    was, problem = instance_lock.resume(layout)
    if problem is not None:
        return problems.show(screen, [problem], as_json=arguments.json)
    return requests.resumed(screen, layout.host, instance_lock.alive(layout), was=was, as_json=arguments.json)


def run_incidents(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 0, whatever went wrong; 1 where the one to be shown is not kept."""
    from octoform.daemon.store.incidents import read
    from octoform.daemon.store.json_store import Shelf
    from octoform.engine.tools import layout_of
    from octoform.views.daemon import event_log as view

    if arguments.show:
        return _one_incident(arguments, project, screen)
    text = arguments.n
    if not text.isascii() or not text.isdigit():
        raise UsageError(f"-n: {text!r} is not a number of incidents", "usage: octoform incidents [-n COUNT] [-json]")
    layout, found = layout_of(project, os.environ)
    if layout is None:
        return problems.show(screen, found, as_json=arguments.json)
    shelf = Shelf(layout)
    episodes = read(shelf) if layout.daemon.is_dir() else []
    return view.listed(screen, episodes, shelf.said, int(text), as_json=arguments.json)


def _one_incident(arguments: Namespace, project: Path, screen: Console) -> int:
    from octoform.daemon.status import incident
    from octoform.views.daemon import health as view

    match arguments.show:
        case ["show", name]:
            found, trouble = incident(project, os.environ, name)
        case words:
            usage = "usage: octoform incidents show N [-json]"
            raise UsageError(f"{' '.join(words)!r} is not `show` with the id or the number of an incident", usage)
    if found is None:
        return problems.show(screen, trouble, as_json=arguments.json)
    return view.incident(screen, found, trouble, as_json=arguments.json)
