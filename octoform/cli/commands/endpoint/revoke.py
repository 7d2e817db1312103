"""``revoke``: end the tunnel of scope internet, and prove that it is gone."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.engine.safety import revoke_tunnel
from octoform.views.endpoint import safety
from octoform.views.format import problems
from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 0 only when it is proved."""
    done, found = revoke_tunnel(project, os.environ)
    if done is None:
        return problems.show(screen, found, as_json=arguments.json)
    return safety.revoked(screen, done, as_json=arguments.json)
