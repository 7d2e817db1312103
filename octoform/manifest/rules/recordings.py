"""Recordings as a manifest names them: folders of the project, by a path relative to the manifest.

As with profiles, only what lies inside the project counts, also after links are followed: what a recording makes must
be the same on every machine.
"""

import os
from pathlib import Path

from octoform.manifest import agent_locations
from octoform.manifest.source import tree
from octoform.manifest.source.report import Report
from octoform.manifest.source.tree import Scalar, Table

_COPY = "copy it beside octopus.yaml and give its relative path, such as recordings/bench"


def check(root: Table, project: Path, report: Report) -> None:
    """Report what is wrong with the recordings that harnesses name."""
    for loc in agent_locations.HARNESSES:
        item = tree.at(root, (*loc, "recording"))
        if isinstance(item, Scalar) and isinstance(item.value, str) and not report.is_settled((*loc, "recording")):
            _one(item, project, report)


def _one(item: Scalar, project: Path, report: Report) -> None:
    if not item.text or "\0" in item.text:
        return
    path = Path(os.path.normpath(project / item.text))
    shown = f"the recording `{report.shown(item.text)}`"
    if Path(item.text).is_absolute() or path == project or not path.is_relative_to(project):
        _refuse(item, f"{shown} is not below the project's folder", _COPY, report)
        return
    try:
        if not path.exists():
            _refuse(
                item, f"there is no recording `{report.shown(item.text)}`", "paths are relative to octopus.yaml", report
            )
        elif not path.resolve().is_relative_to(project.resolve()):
            _refuse(item, f"{shown} is a link to a place outside the project", "copy the folder", report)
        elif not path.is_dir():
            _refuse(item, f"{shown} is no folder", "a recording is a folder; name that", report)
    except OSError as problem:
        _refuse(item, f"{shown} cannot be read: {problem.strerror or problem}", "a recording is a folder", report)


def _refuse(item: Scalar, what: str, hint: str, report: Report) -> None:
    report.error("MANIFEST-BAD-RECORDING", what, item.span, hint=hint)
