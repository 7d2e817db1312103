"""``confirm``: a person's yes or no to a claim that nobody else may make true."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.claims.model import Claim
from octoform.daemon.deciding import open_ledger, person, undecidable
from octoform.diagnostics import Diagnostic, error
from octoform.views import claims as view
from octoform.views import problems
from octoform.views.console import Console
from octoform.views.service import approves


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 1 when nothing was decided."""
    ledger, found = open_ledger(project, os.environ)
    if ledger is None:
        return problems.show(screen, found, as_json=arguments.json)
    if problem := undecidable(project, os.environ):
        return problems.show(screen, [problem], as_json=arguments.json)
    if arguments.reject:
        return _told(screen, ledger.reject(arguments.claim, person()), as_json=arguments.json)
    claim = next((each for each in ledger.pending() if each.id == arguments.claim), None)
    if claim is not None and not arguments.auto_approve:
        if arguments.json or not screen.interactive:
            return problems.show(screen, [_not_approved()], as_json=arguments.json)
        for line in view.lines(screen, claim):
            screen.line(line)
        if not approves(screen, "Make this claim true?"):
            return problems.show(screen, [_not_approved()])
        if problem := undecidable(project, os.environ):  # a person takes their time
            return problems.show(screen, [problem])
    return _told(screen, ledger.confirm(arguments.claim, person()), as_json=arguments.json)


def _not_approved() -> Diagnostic:
    hint = "answer yes on a terminal, or give -auto-approve where nobody can be asked"
    return error("CLAIM-NOT-APPROVED", "nothing was decided: it was not approved", hint=hint)


def _told(screen: Console, done: Claim | Diagnostic, *, as_json: bool) -> int:
    if isinstance(done, Diagnostic):
        return problems.show(screen, [done], as_json=as_json)
    return view.decided(screen, done, as_json=as_json)
