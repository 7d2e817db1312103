"""``install``: the programs of harnesses, in tried versions."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.engine.doctor import install
from octoform.views.format.console import Console
from octoform.views.inspect import doctor


def run(arguments: Namespace, _: Path, screen: Console) -> int:
    """Exit code 1 when one of them could not be installed."""
    result = install(arguments.harness, os.environ, doctor.steps(screen))
    return doctor.show_installation(screen, result, as_json=arguments.json)
