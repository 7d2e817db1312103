"""What the accepted artifacts, the manifest and the profiles make of the endpoint: tools, scope, policy."""

from dataclasses import asdict
from typing import Any

from octoform.apply.context import Context
from octoform.apply.reading import accepted
from octoform.diagnostics import Diagnostic
from octoform.endpoint.policy import Holding, resolve
from octoform.endpoint.policy_check import doubts
from octoform.endpoint.service import Service
from octoform.profiles.applying import holds


def service_of(context: Context) -> Service:
    """The endpoint as it is to be published."""
    manifest = context.manifest
    tools = accepted(context, "interface")["tools"]
    return Service(
        tools=tools,
        policy=resolve(manifest.policy, tools, _holding(context)),
        devices=[_device(item) for item in accepted(context, "identify")["devices"]],
        scope=manifest.scope,
        network=asdict(manifest.network) if manifest.network is not None else None,
        tunnel={"command": list(manifest.tunnel.command)} if manifest.tunnel is not None else None,
    )


def doubts_of(context: Context) -> list[Diagnostic]:
    """Warnings about what the policy or a profile says of tools that are not there."""
    return doubts(context.manifest.policy, accepted(context, "interface")["tools"], _holding(context))


def _holding(context: Context) -> Holding:
    probe = accepted(context, "probe")
    held = [(profile, holds(profile, probe, context.manifest.answers)) for profile in context.profiles]
    return [(profile, ids) for profile, ids in held if ids]


def _device(item: dict[str, Any]) -> dict[str, Any]:
    return {"id": item["id"], "name": item["identified_as"], "category": item["category"]}
