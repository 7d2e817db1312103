"""``attempts``, ``attempts show N``, ``attempts record DIR``: what the agents did, and a recording of it."""

import os
from argparse import Namespace
from pathlib import Path

from octoform.cli.options import UsageError
from octoform.diagnostics import did_you_mean, has_errors
from octoform.engine.inspect import attempts as engine
from octoform.engine.recordings.recording import record
from octoform.protocol.model import DUTIES
from octoform.state.layout import STAGES, STEP
from octoform.views.format import problems
from octoform.views.format.console import Console
from octoform.views.run import attempts


def run(arguments: Namespace, project: Path, screen: Console) -> int:
    """The list, or one of the two verbs."""
    if arguments.verb == "show":
        return _show(arguments, project, screen)
    if arguments.verb == "record":
        return _record(arguments, project, screen)
    stage = arguments.stage
    known = (*STAGES, *DUTIES)
    if stage is not None and stage not in known and not stage.startswith(STEP):
        near = did_you_mean(stage, known)
        raise UsageError(f"-stage: there is no stage {stage!r}" + (f"; did you mean {near}?" if near else ""), "")
    listed, found = engine.listed(project, os.environ, stage)
    if listed is None:
        return problems.show(screen, found, as_json=arguments.json)
    return attempts.listing(screen, listed, everything=arguments.all, as_json=arguments.json)


def _show(arguments: Namespace, project: Path, screen: Console) -> int:
    detail, found = engine.detail(project, os.environ, arguments.number)
    if detail is None:
        return problems.show(screen, found, as_json=arguments.json)
    return attempts.one(screen, detail, as_json=arguments.json)


def _record(arguments: Namespace, project: Path, screen: Console) -> int:
    made, found = record(project, os.environ, Path(arguments.folder).absolute(), arguments.first)
    if made is None or has_errors(found):
        return problems.show(screen, found, as_json=arguments.json)
    problems.show(screen, found)
    return attempts.recorded(screen, made, as_json=arguments.json)
