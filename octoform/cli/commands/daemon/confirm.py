"""``confirm``: a person's yes or no to what nobody else may make true: a claim, or a rewrite of what moves a device."""

import os
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path

from octoform.apply.rewrite.pending_rewrite import Rewrite
from octoform.claims.ledger import Ledger
from octoform.claims.model import Claim
from octoform.daemon.requests import open_ledger, person, undecidable
from octoform.diagnostics import Diagnostic, error
from octoform.engine.unattended.heal import decide_rewrite, waiting_rewrite, waiting_rewrites
from octoform.views.daemon import control as view
from octoform.views.endpoint.process import approves
from octoform.views.format import problems
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 1 when nothing was decided."""
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
        return _told(screen, ledger.reject(arguments.claim, person()), as_json=arguments.json)
    return _claim(arguments, project, screen, ledger)


def _claim(arguments: Namespace, project: Path, screen: Console, ledger: Ledger) -> int:
    """Show a claim that waits, and make it true after a yes."""
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
    return _told(screen, ledger.confirm(arguments.claim, person()), as_json=arguments.json)


def _listed(arguments: Namespace, project: Path, screen: Console, claims: Sequence[Claim]) -> int:
    """All that waits for a person."""
    if arguments.reject or arguments.auto_approve:
        return problems.show(screen, [_of_nothing()], as_json=arguments.json)
    rewrites = [
        {"id": each.id, "moves": each.moves, "at": each.at, "difference": each.difference()}
        for each in waiting_rewrites(project, os.environ)
    ]
    return view.waiting(screen, claims, rewrites, as_json=arguments.json)


def _rewrite(arguments: Namespace, project: Path, screen: Console, rewrite: Rewrite) -> int:
    """Show what a rewrite changes, and put it in service or drop it."""
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
    hint = "answer yes on a terminal, or give -auto-approve where nobody can be asked"
    return error("CLAIM-NOT-APPROVED", "nothing was decided: it was not approved", hint=hint)


def _told(screen: Console, done: Claim | Diagnostic, *, as_json: bool) -> int:
    if isinstance(done, Diagnostic):
        return problems.show(screen, [done], as_json=as_json)
    return view.decided(screen, done, as_json=as_json)
