"""``init``: a first manifest for this host. (Heavy.)"""

import platform
from pathlib import Path

from octoform.diagnostics import Diagnostic
from octoform.engine.plan.configuration import MANIFEST
from octoform.manifest.edit.starter import write_starter


def start_project(project: Path, host: str | None) -> tuple[Path | None, list[Diagnostic]]:
    """Write octopus.yaml unless there is one; the host is named after this machine when no name is given."""
    path = project / MANIFEST
    named, found = write_starter(path, host, platform.node())
    return (None if named is None else path), found
