"""``install``: the programs of harnesses, in tried versions."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.engine.installing import install
from octoform.views import installing
from octoform.views.console import Console


def run(arguments: Namespace, _: Path, screen: Console) -> int:
    """Exit code 1 when one of them could not be installed."""
    result = install(arguments.harness, os.environ, installing.steps(screen))
    return installing.show(screen, result, as_json=arguments.json)
