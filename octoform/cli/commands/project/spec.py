"""``spec diff|promote|reset``: what agents made of their own instructions."""

import os
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path

from octoform.diagnostics import Diagnostic, has_errors
from octoform.engine import spec_edits
from octoform.views.format import problems
from octoform.views.format.console import Console
from octoform.views.inspect import state


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """One of the three verbs."""
    stage, as_json = arguments.stage, arguments.json
    if arguments.verb == "promote":
        found = spec_edits.promote(project, os.environ, stage)
        return _refused(screen, found, as_json=as_json) or state.promoted(screen, stage, as_json=as_json)
    if arguments.verb == "reset":
        dropped, found = spec_edits.reset(project, os.environ, stage)
        return _refused(screen, found, as_json=as_json) or state.dropped(screen, dropped, as_json=as_json)
    edits, found = spec_edits.waiting(project, os.environ, stage)
    if edits is None or has_errors(found):
        return problems.show(screen, found, as_json=as_json)
    problems.show(screen, found)
    return state.diff(screen, edits, as_json=as_json)


def _refused(screen: Console, found: Sequence[Diagnostic], *, as_json: bool) -> int:
    """Show what was found; in JSON only what refused, since the result is the one document otherwise."""
    return problems.show(screen, found, as_json=as_json) if has_errors(found) or not as_json else 0
