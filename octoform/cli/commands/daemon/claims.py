"""``claims``: what is claimed of the hardware, and what each claim rests on."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.daemon.requests import everything, open_ledger, person, undecidable
from octoform.diagnostics import Diagnostic
from octoform.views.daemon import control as view
from octoform.views.format import problems
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 0; 1 for a claim that cannot be taken back."""
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
    problems.show(screen, ledger.told())
    return view.listed(screen, listed, everything=arguments.all, as_json=arguments.json)
