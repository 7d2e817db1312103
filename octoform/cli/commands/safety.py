"""Commands on who may do what: emergency stop, limits, audit log, claims, tokens, the tunnel.

What most of these commands need is imported at once, what one of them needs alone when it is chosen.
"""

from __future__ import annotations

from functools import partial

from octoform.cli.table import Json, duration, flag, number_of, operand, option, optional, setting, words
from octoform.diagnostics import Diagnostic, error
from octoform.engine import safety
from octoform.views.endpoint import safety as view

TYPE_CHECKING = False
if TYPE_CHECKING:
    from datetime import datetime

    from octoform.apply.rewrite.pending_rewrite import Rewrite
    from octoform.claims.ledger import Ledger
    from octoform.claims.model import Claim
    from octoform.cli.dispatch import Run


class EstopArguments(Json):
    """Of ``estop``."""

    clear: bool = flag("end the emergency stop")
    reason: str = setting(str, "TEXT", "the reason, for the audit log", default="")


def run_estop(arguments: EstopArguments, run: Run) -> int:
    """Exit code 1 where an endpoint is not stopped, or with ``-clear``, where the stop stays engaged."""
    done, found = safety.clear(run.project) if arguments.clear else safety.stop(run.project, arguments.reason)
    shown = view.cleared if arguments.clear else view.stopped
    return shown(run.screen, done, found, as_json=run.as_json) if done else run.show(*found)


class LimitsArguments(Json):
    """Of ``limits``."""

    reset: str | None = option(str, "TOOL", "reset the counters of a tool")


def run_limits(arguments: LimitsArguments, run: Run) -> int:
    """Exit code 1 when a limit's counters are damaged, or a device is outside of a range."""
    if arguments.reset is None:
        return run.answer(safety.limits(*run.here), view.limits)
    found = safety.reset_limits(*run.here, arguments.reset)
    return run.show(*found) if found else view.reset(run.screen, arguments.reset, as_json=run.as_json)


def _moment(text: str) -> datetime:
    """A moment in UTC."""
    from datetime import UTC, datetime, timedelta

    from octoform.base import durations
    from octoform.base.clock import parse_stamp

    back = durations.seconds(text)
    if back is not None:
        return datetime.now(UTC) - timedelta(seconds=back)
    moment = parse_stamp(text)
    if moment is None:
        hint = "give a duration back from now, like 1h30m, or a time, like 2026-05-04T12:00:00Z"
        raise ValueError(f"{text!r} is neither a duration nor a time; {hint}")
    return moment


class AuditArguments(Json):
    """Of ``audit``."""

    verify: bool = flag("check that no record was changed, removed or added")
    n: int = setting(number_of("lines"), "LINES", "show the latest LINES records", default="50")
    tool: str | None = option(str, "TOOL", "only records of this tool")
    refused: bool = flag("only calls that were refused")
    since: datetime | None = option(
        _moment,
        "WHEN",
        "only records after WHEN: a duration back from now (1h30m) or a time (2026-05-04T12:00:00Z)",
    )
    client: str | None = option(
        str, "TEXT", "only calls whose client, token or process number contains TEXT, and their results"
    )


def run_audit(arguments: AuditArguments, run: Run) -> int:
    """Exit code 1 when something was done to the log."""
    from octoform.endpoint.access.audit_log import Wanted
    from octoform.views.endpoint import logs

    if arguments.verify:
        checked, found = safety.check_records(*run.here)
        return run.answer((checked, found), partial(view.checked, faults=found))
    wanted = Wanted(arguments.tool, arguments.client, arguments.since, arguments.refused)
    show = partial(logs.records, count=arguments.n, filtered=wanted != Wanted())
    return run.answer(safety.records(*run.here, arguments.n, wanted), show)


class ClaimsArguments(Json):
    """Of ``claims``."""

    all: bool = flag("also expired and refuted claims, with the reason")
    retire: str | None = option(str, "ID", "withdraw a claim that is in force")


def run_claims(arguments: ClaimsArguments, run: Run) -> int:
    """Exit code 0; 1 for a claim that cannot be taken back."""
    from octoform.daemon.requests import everything, open_ledger, person, undecidable
    from octoform.views.daemon import requests

    ledger, found = open_ledger(*run.here)
    if ledger is None:
        return run.show(*found)
    problem = undecidable(*run.here)
    if arguments.retire is not None:
        return _show_outcome(run, problem or ledger.retire(arguments.retire, person()))
    if problem is None:
        ledger.expire()
    listed = everything(ledger, over=arguments.all)
    run.note(*ledger.new_diagnostics())
    return requests.listed(run.screen, listed, everything=arguments.all, as_json=run.as_json)


class ConfirmArguments(Json):
    """Of ``confirm``."""

    claim: str | None = optional(
        "ID", "a claim as `octoform claims` shows it, or a rewrite as its notice names it (default: list what waits)"
    )
    reject: bool = flag("reject it")
    auto_approve: bool = flag("do not ask")


def run_confirm(arguments: ConfirmArguments, run: Run) -> int:
    """Exit code 1 when nothing was decided."""
    from octoform.daemon.requests import open_ledger, person, undecidable
    from octoform.engine.unattended.heal import waiting_rewrite

    ledger, found = open_ledger(*run.here)
    if ledger is None:
        return run.show(*found)
    if arguments.claim is None:
        return _list_waiting(arguments, run, ledger)
    if problem := undecidable(*run.here):
        return run.show(problem)
    rewrite = waiting_rewrite(*run.here, arguments.claim)
    if rewrite is not None:
        return _decide_rewrite(arguments, run, rewrite)
    if arguments.reject:
        return _show_outcome(run, ledger.reject(arguments.claim, person()))
    return _confirm(arguments.claim, run, ledger, approved=arguments.auto_approve)


def _list_waiting(arguments: ConfirmArguments, run: Run, ledger: Ledger) -> int:
    """All that waits for a person."""
    from octoform.engine.unattended.heal import waiting_rewrites
    from octoform.views.daemon import requests

    if arguments.reject or arguments.auto_approve:
        hint = "octoform confirm lists what waits for a person"
        return run.show(error("CLAIM-NOT-APPROVED", "nothing was decided: no claim and no rewrite is named", hint=hint))
    rewrites = [
        {"id": each.id, "moves": each.moves, "at": each.at, "difference": each.difference()}
        for each in waiting_rewrites(*run.here)
    ]
    return requests.waiting(run.screen, ledger.pending(), rewrites, as_json=run.as_json)


def _confirm(name: str, run: Run, ledger: Ledger, *, approved: bool) -> int:
    """Show a claim that waits, and make it true after a yes."""
    from octoform.daemon.requests import person
    from octoform.views.daemon import requests

    claim = next((each for each in ledger.pending() if each.id == name), None)
    if claim is not None and not approved:
        problem = _not_approved(run, [*requests.lines(run.screen, claim)], requests.question(claim))
        if problem is not None:
            return run.show(problem)
    return _show_outcome(run, ledger.confirm(name, person()))


def _not_approved(run: Run, lines: list[str], question: str) -> Diagnostic | None:
    """None after a yes to what ``lines`` show; a person takes their time, so what may be decided is asked again."""
    from octoform.daemon.requests import undecidable
    from octoform.views.endpoint.process import approves

    hint = "answer yes on a terminal, or give -auto-approve where no one can be asked"
    refused = error("CLAIM-NOT-APPROVED", "nothing was decided: it was not approved", hint=hint)
    if run.as_json or not run.screen.interactive:
        return refused
    for line in lines:
        run.screen.line(line)
    return undecidable(*run.here) if approves(run.screen, question) else refused


def _decide_rewrite(arguments: ConfirmArguments, run: Run, rewrite: Rewrite) -> int:
    """Show what a rewrite changes, and put it in service or drop it."""
    from octoform.engine.unattended.heal import decide_rewrite
    from octoform.views.daemon import requests

    problem = None
    if not arguments.reject and not arguments.auto_approve:
        lines = [*requests.rewrite_lines(rewrite.id, rewrite.moves, rewrite.difference())]
        problem = _not_approved(run, lines, "Put this rewrite in service?")
    problem = problem or decide_rewrite(*run.here, rewrite, yes=not arguments.reject)
    if problem is not None:
        return run.show(problem)
    return requests.rewrite_decided(run.screen, rewrite.id, served=not arguments.reject, as_json=run.as_json)


def _show_outcome(run: Run, done: Claim | Diagnostic) -> int:
    from octoform.views.daemon import requests

    return run.show(done) if isinstance(done, Diagnostic) else requests.decided(run.screen, done, as_json=run.as_json)


def run_token_list(_: Json, run: Run) -> int:
    """The tokens without their values."""
    return run.answer(safety.list_tokens(*run.here), view.listed)


class TokenArguments(Json):
    """Of a command on one token."""

    name: str = operand(str, "NAME")


class TokenCreateArguments(TokenArguments):
    """Of ``token create``."""

    effects: list[str] = setting(words, "LIST", "which tools it may call: read, actuate, irreversible", default="read")
    expires: float | None = option(
        duration, "DURATION", "the token expires after DURATION, such as 24h (default: never)"
    )


def run_token_create(arguments: TokenCreateArguments, run: Run) -> int:
    """Its value is shown this once."""
    made = safety.create_token(*run.here, arguments.name, arguments.effects, arguments.expires)
    return run.answer(made, partial(view.made, rotated=False))


def run_token_rotate(arguments: TokenArguments, run: Run) -> int:
    """Its new value is shown this once."""
    return run.answer(safety.rotate_token(*run.here, arguments.name), partial(view.made, rotated=True))


def run_token_show(arguments: TokenArguments, run: Run) -> int:
    """The value of a token."""
    shown, found = safety.show_token(*run.here, arguments.name)
    if shown is None:
        return run.show(*found)
    return view.value(run.screen, arguments.name, shown, as_json=run.as_json)


def run_token_revoke(arguments: TokenArguments, run: Run) -> int:
    """End a token with all that it has open."""
    found = safety.revoke_token(*run.here, arguments.name)
    return run.show(*found) if found else view.ended(run.screen, arguments.name, as_json=run.as_json)


def run_revoke(_: Json, run: Run) -> int:
    """Exit code 0 only when it is proved."""
    return run.answer(safety.revoke_tunnel(*run.here), view.revoked)
