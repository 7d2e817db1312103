"""Commands on the project: its files, what they mean, and what its agents need.

A command imports what it needs when it is chosen: all others cost nothing.
"""

from __future__ import annotations

import os
import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path

from octoform.diagnostics import Diagnostic, as_warning, has_errors
from octoform.views.format import output, problems
from octoform.views.format.console import Console


def run_init(arguments: Namespace, project: Path, screen: Console) -> int:
    """Refuses to overwrite a manifest that is there."""
    from octoform.manifest.starter import start_project

    started, found = start_project(project, arguments.host)
    if started is None:
        return problems.show(screen, found, as_json=arguments.json)
    return output.started(screen, started, as_json=arguments.json)


def run_validate(arguments: Namespace, project: Path, screen: Console) -> int:
    """All problems at once; exit code 1 when one is an error."""
    from octoform.apply.stage.assignment import unpriced
    from octoform.engine.plan.configuration import compile_project
    from octoform.harness import logins

    compiled, found = compile_project(project, os.environ)
    if compiled is not None:
        found += unpriced(compiled.manifest, os.environ)
        found += [as_warning(each) for each in logins.problems(compiled.manifest, os.environ)]
    return output.validation(screen, found, as_json=arguments.json)


def run_schema(_: Namespace, __: Path, screen: Console) -> int:
    """The schema that editors use."""
    from octoform.manifest.schema.document import json_schema

    return output.document(screen, json_schema())


def run_explain(arguments: Namespace, _: Path, screen: Console) -> int:
    """The page of a code, or the list of all codes."""
    from octoform.diagnostics import codes, page_of, unknown_code

    if arguments.code is None:
        return output.codes(screen, codes(), as_json=arguments.json)
    code = arguments.code.upper()
    text = page_of(code)
    if text is None:
        return problems.show(screen, [unknown_code(code)], as_json=arguments.json)
    return output.page(screen, code, text, as_json=arguments.json)


def run_graph(arguments: Namespace, project: Path, screen: Console) -> int:
    """DOT or mermaid on standard output."""
    from octoform.engine.plan.configuration import compile_project
    from octoform.graph.model import to_dot, to_mermaid

    compiled, found = compile_project(project, os.environ)
    if compiled is None:
        return problems.show(screen, found)
    return output.plain(screen, (to_dot if arguments.type == "dot" else to_mermaid)(compiled.graph))


def run_doctor(arguments: Namespace, project: Path, screen: Console) -> int:
    """Exit code 1 when something that is needed failed, or the manifest cannot be read."""
    from octoform.engine.doctor import diagnose
    from octoform.views import doctor

    found = diagnose(project, os.environ)
    if has_errors(found.diagnostics):
        return problems.show(screen, found.diagnostics, as_json=arguments.json)
    return doctor.show(screen, found, as_json=arguments.json)


def run_install(arguments: Namespace, _: Path, screen: Console) -> int:
    """Exit code 1 when one of them could not be installed."""
    from octoform.engine.doctor import install
    from octoform.views import doctor

    result = install(arguments.harness, os.environ, doctor.steps(screen))
    return doctor.show_installation(screen, result, as_json=arguments.json)


def run_profile(arguments: Namespace, project: Path, screen: Console) -> int:
    """One of the two verbs; exit code 1 when a profile is not sound or cannot be drafted."""
    from octoform.engine import profiles as check
    from octoform.engine import profiles as profile_draft
    from octoform.views import profiles

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


def run_spec(arguments: Namespace, project: Path, screen: Console) -> int:
    """One of the three verbs."""
    from octoform.engine import spec_edits
    from octoform.views import state

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


def run_simulate(arguments: Namespace, project: Path, _screen: Console) -> int:
    """Does not return; the program leaves with 0 when it was ended, with 1 when it could not begin."""
    command = [sys.executable, "-P", "-m", "octoform.simulation", _rig(arguments.rig, project)]
    if arguments.folder is not None:
        command += ["-folder", str(project / arguments.folder)]
    for text in arguments.set:
        command += ["-set", text]
    if arguments.json:
        command.append("-json")
    sys.stdout.flush()
    os.execv(sys.executable, command)


def _rig(rig: str, project: Path) -> str:
    """A project's own ``profiles/rigs/NAME.yaml`` takes the place of a shipped one of that name."""
    own = project / "profiles" / "rigs" / f"{rig}.yaml"
    if own.is_file():
        return str(own)
    return str(project / rig) if rig.endswith(".yaml") else rig
