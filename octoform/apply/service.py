"""What the accepted artifacts, the manifest and the profiles make of the endpoint: tools, scope, policy."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from octoform.apply.context import Context
from octoform.apply.reading import accepted
from octoform.contracts.model import Artifacts, ProfileFacts
from octoform.contracts.raw_line_rules import lines_beside, unknown_lines
from octoform.contracts.serve_line_rules import listening, on_a_line
from octoform.contracts.serve_tool_rules import tools_importing
from octoform.diagnostics import Diagnostic
from octoform.endpoint.publish.policy import Holding, resolve
from octoform.endpoint.publish.policy_check import doubts
from octoform.endpoint.publish.spec import Service
from octoform.profiles.selection import holds


def service_of(context: Context, deploy: Mapping[str, Any] | None = None) -> Service:
    """The endpoint as it is to be published; ``deploy`` is a DEPLOY artifact that is being proved."""
    manifest = context.manifest
    tools = accepted(context, "interface")["tools"]
    policy = resolve(manifest.policy, tools, _holding(context), writing(context))
    for name, package in without_library(context, deploy or _deployed(context)).items():
        policy["tools"][name] |= {"decision": "deny", "source": f"{package}, which could not be installed here"}
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
    """The tools that need a package which failed to install, each with its name; they are left out of the endpoint."""
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


def _deployed(context: Context) -> Mapping[str, Any]:
    found: Mapping[str, Any] = accepted(context, "deploy") if context.layout.output("deploy").is_file() else {}
    return found


def doubts_of(context: Context) -> list[Diagnostic]:
    """Warnings about what the policy or a profile says of tools that are not there."""
    return doubts(context.manifest.policy, accepted(context, "interface")["tools"], _holding(context))


def _holding(context: Context) -> Holding:
    probe = accepted(context, "probe")
    held = [(profile, holds(profile, probe, context.manifest.answers)) for profile in context.profiles]
    return [(profile, ids) for profile, ids in held if ids]


def _device(item: dict[str, Any]) -> dict[str, Any]:
    return {"id": item["id"], "name": item["identified_as"], "category": item["category"]}
