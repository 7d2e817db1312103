"""The endpoint node: octoform's own work, no agent. Publishes what DEPLOY proved, or puts it back after drift."""

import shutil
from collections.abc import Mapping

from octoform import events
from octoform.apply.context import CANDIDATE, Context
from octoform.apply.stage.acceptance import Finished, Verdict
from octoform.apply.stage.artifact_writer import counted
from octoform.apply.stage.serve_proof import STARTING, calls_text, publish, service_of
from octoform.base import digest, files
from octoform.diagnostics import Diagnostic, error, has_errors
from octoform.endpoint.drift import observe
from octoform.endpoint.environment.build import build
from octoform.endpoint.publication import is_published
from octoform.harness.port import Usage


def run_endpoint(context: Context, *, again: bool = False) -> Finished:
    """Make the endpoint what the accepted artifacts say; nothing is started when it already is.

    ``again`` makes all of it again, also where it looks as it was left.
    """
    started = context.clock.monotonic()
    verdict = _publish(context, again)
    return Finished(verdict, 0, Usage(), context.clock.monotonic() - started)


def _publish(context: Context, again: bool) -> Verdict:
    lock_path = context.layout.requirements_lock
    if not lock_path.is_file():
        hint = "octoform apply -replace deploy"
        return Verdict((error("ENDPOINT-NO-LOCK", "the lock of the endpoint is gone", path=str(lock_path), hint=hint),))
    lock = files.read(lock_path).decode("utf-8", "replace")
    facts = observe(context.layout)
    if not facts.reasons and not again and is_published(context.layout, service_of(context), context.environ):
        return _verdict(context, [], lock, f"{counted(len(facts.tools), 'tool')}, as DEPLOY left it")
    # A server that fell silent although every file is in place is broken inside its packages.
    environment, problems = build(context.layout, lock, again=again or facts.answered is False)
    found: list[Diagnostic] = list(problems)
    if environment is None:
        return Verdict(tuple(found))
    context.emit(events.Checking("endpoint", STARTING))
    report = publish(context, environment, found)
    if report is None or has_errors(found):
        return Verdict(tuple(found))
    # Nothing is published from there any more; a run that was killed during a proof has left it.
    shutil.rmtree(context.layout.local / CANDIDATE, ignore_errors=True)
    return _verdict(context, found, lock, f"{counted(len(report.tools), 'tool')}, {calls_text(report)}")


def _verdict(context: Context, found: list[Diagnostic], lock: str, message: str) -> Verdict:
    consumed = context.graph.node("endpoint").consumes
    outputs = {name: context.store.snapshot.nodes[name].output_digest for name in consumed}
    return Verdict(tuple(found), digest=made_of(outputs, lock), found=message)


def made_of(outputs: Mapping[str, str], lock: str) -> str:
    """The digest of an endpoint: of the outputs that it consumes, by stage, and of its packages."""
    return digest.of_value({**outputs, "lock": lock})
