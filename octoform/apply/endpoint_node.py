"""The endpoint node: octoform's own work, no agent. Publishes what DEPLOY proved, or puts it back after drift."""

from octoform import digest
from octoform.apply.context import Context
from octoform.apply.gate import Verdict
from octoform.apply.result import Finished
from octoform.apply.service import service_of
from octoform.apply.serving import calls_said, publish
from octoform.apply.settling import counted
from octoform.diagnostics import Diagnostic, error, has_errors
from octoform.endpoint.building import build
from octoform.endpoint.observing import observe
from octoform.endpoint.publishing import is_published
from octoform.harness.port import Usage


def run_endpoint(context: Context, *, anew: bool = False) -> Finished:
    """Make the endpoint what the accepted artifacts say; nothing is started when it already is.

    ``anew`` makes all of it again, also where it looks as it was left.
    """
    started = context.clock.monotonic()
    verdict = _publish(context, anew)
    return Finished(verdict, 0, Usage(), context.clock.monotonic() - started)


def _publish(context: Context, anew: bool) -> Verdict:
    lock_path = context.layout.requirements_lock
    if not lock_path.is_file():
        hint = "octoform apply -replace deploy"
        return Verdict((error("ENDPOINT-NO-LOCK", "the lock of the endpoint is gone", path=str(lock_path), hint=hint),))
    lock = lock_path.read_text(encoding="utf-8")
    facts = observe(context.layout)
    if not facts.reasons and not anew and is_published(context.layout, service_of(context), context.environ):
        return _verdict(context, [], lock, f"{counted(len(facts.tools), 'tool')}, as DEPLOY left it")
    # A server that fell silent although every file is in place is broken inside its packages.
    environment, problems = build(context.layout, lock, anew=anew or facts.answered is False)
    found: list[Diagnostic] = list(problems)
    if environment is None:
        return Verdict(tuple(found))
    report = publish(context, environment, found, "endpoint")
    if report is None or has_errors(found):
        return Verdict(tuple(found))
    return _verdict(context, found, lock, f"{counted(len(report.tools), 'tool')}, {calls_said(report)}")


def _verdict(context: Context, found: list[Diagnostic], lock: str, said: str) -> Verdict:
    consumed = context.graph.node("endpoint").consumes
    outputs = {name: context.store.snapshot.nodes[name].output_digest for name in consumed}
    return Verdict(tuple(found), digest=digest.of_value({**outputs, "lock": lock}), found=said)
