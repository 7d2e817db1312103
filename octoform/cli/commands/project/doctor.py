"""``doctor``: what the chosen harnesses need, checked."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.diagnostics import has_errors
from octoform.engine.doctor import diagnose
from octoform.views.format import problems
from octoform.views.format.console import Console
from octoform.views.inspect import doctor


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 1 when something that is needed failed, or the manifest cannot be read."""
    found = diagnose(project, os.environ)
    if has_errors(found.diagnostics):
        return problems.show(screen, found.diagnostics, as_json=arguments.json)
    return doctor.show(screen, found, as_json=arguments.json)
