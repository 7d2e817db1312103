"""SERVE and DEPLOY proved by running: import where it will be served, start, list, call.

The proof of SERVE uses an environment of the packages that the server's own header declares, so that a server is
never accepted on its looks; the proof of DEPLOY uses exactly the locked set and the launcher that clients will use.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from datetime import timedelta
from typing import Any

from octoform import events
from octoform.apply.context import Context, accepted
from octoform.apply.stage.acceptance import fresh
from octoform.apply.stage.artifact_writer import counted, runtime_files
from octoform.base import files
from octoform.base.clock import parse_stamp
from octoform.base.escaping import display as shown_text
from octoform.base.escaping import listed
from octoform.base.files import replace
from octoform.contracts.model import Artifacts, ProfileFacts
from octoform.contracts.rules.deploy_rules import deploy_installed
from octoform.contracts.rules.lock_rules import deploy_lock
from octoform.contracts.rules.raw_line_rules import lines_beside, unknown_lines
from octoform.contracts.rules.serve.line_rules import listening, on_a_line
from octoform.contracts.rules.serve.tool_rules import tools_importing
from octoform.contracts.schema_equivalence import serve_dynamic
from octoform.contracts.server_code.script_header import declared_requirements, normalised
from octoform.contracts.server_code.server_source import imported_modules, needed_source
from octoform.diagnostics import UNTRUSTED_CERTIFICATE, Diagnostic, has_errors, warning
from octoform.endpoint.access.tokens import ensure_default
from octoform.endpoint.bounded_program import ForkServer
from octoform.endpoint.client.check import CheckReport, check, judge_check
from octoform.endpoint.client.check_verdict import tally
from octoform.endpoint.environment.build import await_bytecode, build
from octoform.endpoint.environment.import_check import ImportReport, check_import, judge_import
from octoform.endpoint.environment.lockfile import OFFLINE, resolve
from octoform.endpoint.environment.model import Environment, packages_of, providers, requirements
from octoform.endpoint.environment.system_programs import lacks, missing_programs
from octoform.endpoint.expected_tools import display
from octoform.endpoint.policy_check import doubts
from octoform.endpoint.process.record import refusal
from octoform.endpoint.process.start_stop import PUBLISHED_BYTES, obstacle, stop
from octoform.endpoint.publication import Service, write_endpoint
from octoform.harness.port import Task
from octoform.policy.resolve import Holding
from octoform.policy.resolve import resolve as resolve_policy
from octoform.profiles.selection import devices_of

_AGAIN = "octoform apply makes and starts it when it may run again"

# What the accepted artifacts, the manifest and the profiles make of the endpoint: tools, scope, policy.


def service_of(context: Context, deploy: Mapping[str, Any] | None = None) -> Service:
    """The endpoint as it is to be published; ``deploy`` is a DEPLOY artifact that is being proved."""
    manifest = context.manifest
    tools = accepted(context, "interface")["tools"]
    policy = resolve_policy(manifest.policy, tools, _holding(context), writing(context))
    for name, package in without_library(context, deploy or _deployed(context)).items():
        policy["tools"][name] |= {"decision": "deny", "source": f"{package}, which could not be installed here"}
    for program, needing in missing_programs(context.layout, context.environ).items():
        for name in needing:
            if name in policy["tools"]:
                policy["tools"][name] |= {
                    "decision": "deny",
                    "source": f"{program}, a program that is not on this host",
                }
    return Service(
        tools=tools,
        policy=policy,
        devices=[_device(item) for item in accepted(context, "identify")["devices"]],
        scope=manifest.scope,
        network=asdict(manifest.network) if manifest.network is not None else None,
        tunnel={"command": list(manifest.tunnel.command)} if manifest.tunnel is not None else None,
    )


def writing(context: Context) -> frozenset[str]:
    """The tools of any effect whose code can write to a line that neither a profile nor an answer speaks of."""
    held = {profile.name: ProfileFacts(profile.name, frozenset(ids)) for profile, ids in _holding(context)}
    known = Artifacts(probe=accepted(context, "probe"), profiles=held, answers=context.manifest.answers)
    tools = accepted(context, "interface")["tools"]
    lines, beside = unknown_lines(known), lines_beside(known)
    alone = {tool["name"] for tool in tools if lines.intersection(tool["devices"])}
    mixed = {tool["name"] for tool in tools if beside.intersection(tool["devices"])} - alone
    if not alone and not mixed:
        return frozenset()
    source = accepted(context, "serve")
    return frozenset((alone | mixed & on_a_line(source)) - listening(source))


def without_library(context: Context, deploy: Mapping[str, Any]) -> dict[str, str]:
    """The tools that need a package which failed to install, each with its name; they are omitted from the endpoint."""
    failed = {item["name"] for item in deploy.get("deps_failed", ())}
    modules = {
        item["module"].partition(".")[0]: item["provided_by"]
        for item in deploy.get("imports", ())
        if item["provided_by"] in failed
    }
    if not modules:
        return {}
    served = {tool["name"] for tool in accepted(context, "interface")["tools"]}
    needing = tools_importing(accepted(context, "serve"), modules)
    return {tool: modules[module] for tool, module in needing.items() if tool in served}


def _programs_missing(context: Context, deploy: Mapping[str, Any]) -> list[Diagnostic]:
    """A line for each program of the system that is not here, with the tools that are omitted."""
    packages = {item["name"]: item.get("package") for item in deploy.get("programs", ())}
    out = []
    for program, tools in missing_programs(context.layout, context.environ).items():
        summary = f"{shown_text(program)} is not on this host, so the endpoint has no {listed(sorted(tools))}"
        known = packages.get(program)
        install = f"install it (by DEPLOY: the package {shown_text(known)})" if known else "install it"
        hint = f"{install}, then octoform apply -replace deploy; or deny the tools and leave it"
        out.append(warning("DEPLOY-PROGRAM-MISSING", summary, hint=hint))
    return out


def _deployed(context: Context) -> Mapping[str, Any]:
    found: Mapping[str, Any] = accepted(context, "deploy") if context.layout.output("deploy").is_file() else {}
    return found


def doubts_of(context: Context) -> list[Diagnostic]:
    """Warnings about rules of the policy or a profile for tools that are not there."""
    return doubts(context.manifest.policy, accepted(context, "interface")["tools"], _holding(context))


def _holding(context: Context) -> Holding:
    probe = accepted(context, "probe")
    held = [(profile, devices_of(profile, probe, context.manifest.answers)) for profile in context.profiles]
    return [(profile, ids) for profile, ids in held if ids]


def _device(item: dict[str, Any]) -> dict[str, Any]:
    return {"id": item["id"], "name": item["identified_as"], "category": item["category"]}


IMPORT_SECONDS = 30.0
"""For an import on a small board; an attempt that may take less time in all may not take more for this."""
IMPORT_SHARE = 0.15
"""The share of the attempt's time that the import may take: a longer attempt time means a slower host."""

RESOLVE_SECONDS, BUILD_SECONDS = 120.0, 600.0

SEEN_SECONDS = 900.0
"""For so long a device that PROBE saw is taken to be there; SERVE and DEPLOY of a coding agent take minutes."""

STARTING = "starting the endpoint and calling its read tools"

Judge = Callable[[CheckReport, Mapping[str, Any]], list[Diagnostic]]
"""(report, interface) -> what is wrong with an endpoint that was checked."""
Proof = tuple[list[Diagnostic], dict[str, bytes], dict[str, object]]


def prove_serve(context: Context, task: Task, source: str) -> Proof:
    """Import the server in an environment of its declared packages; compare its tools with INTERFACE."""
    context.emit(events.Checking("serve", "building the environment that the server declares"))
    environment, found = _declared(context, source)
    if environment is None:
        return found, {}, {}
    more, tools = prove_import(context, environment, task, source)
    return [*found, *more], {}, {"said": f"imports with {counted(tools, 'tool')}"}


def _declared(context: Context, source: str) -> tuple[Environment | None, list[Diagnostic]]:
    """An environment of what the server declares; without what cannot be had, where only functions import it.

    Such a package is reported, DEPLOY reports it as failed, and the tools that need it are omitted from the endpoint.
    """
    wanted = declared_requirements(source)
    environment, found = _made(context, wanted)
    spare = [item for item in wanted if not _is_at_top(item, source)]
    if environment is not None or not spare or any(item.hint in (OFFLINE, UNTRUSTED_CERTIFICATE) for item in found):
        return environment, found
    kept = [item for item in wanted if item not in spare]
    environment, _ = _made(context, kept)
    lines = []
    for item in spare if environment is not None else ():
        tried, problems = _made(context, [*kept, item])
        if tried is not None:
            environment, kept = tried, [*kept, item]
            continue
        text = "\n".join(problem.detail or problem.summary for problem in problems)
        hint = "DEPLOY reports it as failed, and the tools that need it are skipped"
        lines.append(
            warning("SERVE-DEPENDENCY-FAILED", f"{shown_text(item)} cannot be had here", detail=text, hint=hint)
        )
    return (environment, lines) if environment is not None else (None, found)


def _is_at_top(requirement: str, source: str) -> bool:
    """Whether the server's top imports a module by the name of the package, so that nothing works without it."""
    parsed = needed_source(source)
    top = {normalised(name) for name, _, inside in imported_modules(parsed) if not inside}
    return normalised(re.split(r"[^A-Za-z0-9._-]", requirement.strip(), maxsplit=1)[0]) in top


def _made(context: Context, requirements: Sequence[str]) -> tuple[Environment | None, list[Diagnostic]]:
    lock, found = _lock(context, requirements)
    environment, more = _environment(context, lock)
    return environment, [*found, *more]


def prove_import(context: Context, environment: Environment, task: Task, source: str) -> tuple[list[Diagnostic], int]:
    """The errors of an import of the server in this environment, and the number of its tools."""
    context.emit(events.Checking(task.stage, "importing the server where it will be served"))
    report = _import(context, environment, task, source)
    found = judge_import(report)
    if not has_errors(found):
        found += serve_dynamic(asdict(report), accepted(context, "interface"))
    return found, len(report.tools)


def prove_deploy(context: Context, _: Task, deploy: Mapping[str, Any]) -> Proof:
    """Lock the decided packages with hashes, build that environment, start the server and call its read tools."""
    context.emit(events.Checking("deploy", "locking and building the exact environment"))
    pinned = [f"{item['name']}=={item['version']}" for item in deploy["requirements"]]
    lock, found = _lock(context, pinned)
    if lock is not None:
        found += deploy_lock(lock, dict(deploy))
    environment, more = _environment(context, lock if not has_errors(found) else None)
    found += more
    if environment is None or lock is None:
        return found, {}, {}
    site = packages_of(environment.path)
    found += deploy_installed(dict(deploy), accepted(context, "serve"), providers(site), requirements(site))
    if has_errors(found):
        return found, {}, {}
    left = without_library(context, deploy)
    for package in sorted(set(left.values())):
        tools = listed(sorted(name for name, one in left.items() if one == package))
        reason = next(item["reason"] for item in deploy["deps_failed"] if item["name"] == package)
        summary = f"{shown_text(package)} could not be installed, so the endpoint has no {tools}"
        hint = "octoform apply -replace serve makes the server again, once the package can be had"
        found.append(warning("DEPLOY-DEPENDENCY-FAILED", summary, detail=reason, hint=hint))
    found += _programs_missing(context, deploy)
    context.emit(events.Checking("deploy", STARTING))
    report = publish(context, environment, found, deploy=deploy)
    detail: dict[str, object] = {"packages": lock.count("==")}
    if report is not None:
        detail["said"] = f"{detail['packages']} packages locked, {calls_text(report)}"
    return found, {"requirements.txt": lock.encode()}, detail


def publish(
    context: Context,
    environment: Environment,
    found: list[Diagnostic],
    judge: Judge | None = None,
    *,
    smoke: bool = True,
    deploy: Mapping[str, Any] | None = None,
) -> CheckReport | None:
    """Write descriptor, snippets and launcher, start the endpoint, call every read tool; problems join ``found``.

    ``judge`` states what of the check is wrong (`judge_check` where none is given): an error takes the endpoint out of
    service. ``deploy`` is the DEPLOY artifact that is being proved. Without ``smoke`` no tool is called, and the
    endpoint only has to answer with its tools. A person's stop meanwhile holds: what is written is not started, or it
    ends.
    """
    if problem := obstacle(context.layout, PUBLISHED_BYTES):
        found.append(problem)
        return None
    ForkServer.at(environment.python)  # it loads while the endpoint is written and started
    stop(context.layout)
    service = service_of(context, deploy)
    found += doubts_of(context)
    found += write_endpoint(context.layout, environment, service, context.environ)
    if service.network is not None:
        found += ensure_default(context.layout)
    if problem := refusal(context.layout, _AGAIN):
        found.append(problem)
    if has_errors(found):
        return None
    interface = display(context.layout, accepted(context, "interface"))
    report = check(context.layout, interface, smoke=smoke, seconds=_time(context, math.inf))
    judged = (
        judge(report, interface)
        if judge
        else judge_check(report, interface, _just_seen(context), lambda name: lacks(name, context.environ))
    )
    if problem := refusal(context.layout, _AGAIN):
        judged = [*judged, problem]
    found += judged
    if has_errors(judged):
        # What is broken is not left running; the next apply makes it again.
        stop(context.layout)
    return report


def _just_seen(context: Context) -> frozenset[str]:
    """The devices of a PROBE that was accepted a moment ago; none where it is older."""
    node = context.store.snapshot.nodes.get("probe")
    accepted_at = parse_stamp(node.accepted_at) if node is not None else None
    if accepted_at is None or context.clock.now() - accepted_at > timedelta(seconds=SEEN_SECONDS):
        return frozenset()
    return frozenset(device["id"] for device in accepted(context, "probe")["devices"])


def calls_text(report: CheckReport) -> str:
    """How the test calls went, for a person; a tool answered when it did for each of its devices."""
    tried = {call.tool for call in report.calls if call.skipped is None}
    failed = {call.tool for call in report.calls if call.skipped is None and not call.ok}
    full = {call.tool for call in report.calls if call.content or not call.results}
    return tally(tried - failed, tried, {call.tool for call in report.calls}, tried - failed - full)


def _lock(context: Context, requirements: Sequence[str]) -> tuple[str | None, list[Diagnostic]]:
    """The full set for these direct requirements; what was locked before is preferred."""
    path = context.layout.requirements_lock
    previous = files.read(path).decode("utf-8", "replace") if path.is_file() else None
    project = context.layout.project
    lock, found = resolve(requirements, project, previous, _time(context, RESOLVE_SECONDS))
    if lock is None and previous is not None:  # it may be the former lock that is damaged: it is a preference, no more
        lock, found = resolve(requirements, project, None, _time(context, RESOLVE_SECONDS))
    return lock, list(found)


def _environment(context: Context, lock: str | None) -> tuple[Environment | None, list[Diagnostic]]:
    if lock is None:
        return None, []
    await_bytecode(context.layout)
    environment, found = build(context.layout, lock, _time(context, BUILD_SECONDS))
    return environment, list(found)


def _time(context: Context, most: float) -> float:
    """Seconds that a part of a test may take: what is left of its stage's time, and at most so many."""
    return context.purse.time(context.clock.monotonic(), most)


def _import(context: Context, environment: Environment, task: Task, source: str) -> ImportReport:
    folder = fresh(task.workdir / "import")
    for name, data in {"server.py": source.encode(), **runtime_files()}.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        replace(path, data, 0o644, synced=False)
    seconds = max(min(IMPORT_SECONDS, task.limits.wall_seconds), IMPORT_SHARE * task.limits.wall_seconds)
    return check_import(environment.python, folder, _time(context, seconds))


PROOFS: Mapping[str, Callable[[Context, Task, Any], Proof]] = {"serve": prove_serve, "deploy": prove_deploy}
