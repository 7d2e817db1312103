"""``validate``: check manifest, specs and profiles; start nothing."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.diagnostics import as_warning
from octoform.engine.plan.configuration import compile_project
from octoform.engine.plan.prices import unpriced
from octoform.harness import logins
from octoform.views.format import output
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """All problems at once; exit code 1 when one is an error."""
    compiled, found = compile_project(project, os.environ)
    if compiled is not None:
        found += unpriced(compiled.manifest, os.environ)
        found += [as_warning(each) for each in logins.problems(compiled.manifest, os.environ)]
    return output.validation(screen, found, as_json=arguments.json)
