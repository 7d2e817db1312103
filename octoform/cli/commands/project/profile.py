"""``profile new|check``: begin a profile from what was seen of a device; see where one would hold, and why not."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.diagnostics import has_errors
from octoform.engine import profiles as check
from octoform.engine import profiles as profile_draft
from octoform.views.format import problems
from octoform.views.format.console import Console
from octoform.views.inspect import profiles


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """One of the two verbs; exit code 1 when a profile is not sound or cannot be drafted."""
    as_json = arguments.json
    if arguments.verb == "new":
        draft, found = profile_draft.draft(project, os.environ, arguments.device)
        if draft is None:
            return problems.show(screen, found, as_json=as_json)
        return profiles.drafted(screen, draft, as_json=as_json)
    report, found = check.check(project, os.environ, Path(arguments.file))
    if report is None or has_errors(found):
        return problems.show(screen, found, as_json=as_json)
    if not as_json:
        problems.show(screen, found)
    return profiles.report(screen, arguments.file, report, as_json=as_json)
