"""What the end of a run tells: the funnel and the endpoint, read from the accepted artifacts."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from octoform.base import files
from octoform.base.shape import fits
from octoform.endpoint.access.external_address import no_tunnel, through, tunnel_opened
from octoform.endpoint.access.tokens import listed
from octoform.endpoint.client.check_verdict import NOTHING_ANSWERS
from octoform.endpoint.observe.drift import observe
from octoform.endpoint.publish.expected_tools import shown
from octoform.engine.inspect.rights import diagnostics, lacking
from octoform.engine.results import EndpointSummary, Funnel, RunResult
from octoform.state.layout import Layout


def funnel(artifacts: Mapping[str, Any]) -> Funnel | None:
    """Counts from what is seen to what can be called; None before IDENTIFY was accepted."""
    probe, identify, interface = (artifacts.get(stage) for stage in ("probe", "identify", "interface"))
    if probe is None or identify is None:
        return None
    return Funnel(
        seen=len(probe["devices"]),
        annotated=len(identify["devices"]),
        unknown=sum(1 for device in identify["devices"] if device["category"] == "unknown"),
        left_out=len(probe["devices"]) - len(identify["devices"]),
        tools=len(interface["tools"]) if interface else 0,
    )


def endpoint(layout: Layout, artifacts: Mapping[str, Any]) -> EndpointSummary | None:
    """The endpoint as it was last checked; None when there is none."""
    interface = artifacts.get("interface")
    facts = observe(layout)
    if interface is None or facts.reasons or facts.process is None:
        return None
    tools = shown(layout, interface)["tools"]
    readers = [tool for tool in tools if tool["effect"] == "read"]
    calls = _trial_calls(layout)
    failed = {call["tool"] for call in calls if not call.get("ok")}
    good = {call["tool"]: call for call in calls if call["tool"] not in failed}
    easy = [tool["name"] for tool in readers if not tool["input_schema"].get("required")]
    return EndpointSummary(
        command=f"octoform connect {layout.host}",
        scope=facts.process.scope,
        url=facts.process.url,
        tools=tuple(tool["name"] for tool in tools),
        answered=_said(calls, good),
        token=next((token.name for token in listed(layout)[0] if not token.ended), None),
        denied=len(interface["tools"]) - len(tools),
        example=next((name for name in easy if name in good), easy[0] if easy else None),
    )


def rights(layout: Layout, result: RunResult, environ: Mapping[str, str]) -> RunResult:
    """The result with each served device that this user may not use; its tools answer with an error until then.

    And with word of an endpoint none of whose read tools answered when they were tried.
    """
    result = replace(result, silent=any(item.code == NOTHING_ANSWERS for item in result.diagnostics))
    shut = lacking(layout, environ)
    told = (*result.diagnostics, *diagnostics(shut))
    return replace(result, diagnostics=told, incomplete=tuple(sorted(shut))) if shut else result


def outside(layout: Layout, result: RunResult) -> RunResult:
    """The result with the address of the tunnel, or a warning that nobody gets in there; waits until one is known."""
    told = result.endpoint
    tunnel = tunnel_opened(layout) if told is not None else None
    if told is None or tunnel is None:
        return result
    problem = no_tunnel(tunnel)
    if problem is not None:
        return replace(result, diagnostics=(*result.diagnostics, problem))
    return replace(result, endpoint=replace(told, public=through(tunnel, told.url or "")))


def _trial_calls(layout: Layout) -> list[dict[str, Any]]:
    """The calls of the last check; empty when there was none."""
    path = layout.endpoint / "check.json"
    try:
        document = files.read_json(path)
    except (OSError, ValueError):
        return []  # the check's own verdict was told already; only its calls are not to be had
    calls: list[dict[str, Any]] = document["calls"] if fits(document, {"calls": [dict]}) else []
    return calls


def _said(calls: list[dict[str, Any]], good: Mapping[str, dict[str, Any]]) -> str | None:
    """A read tool that answered in the last check, for the closing lines."""
    if not good:
        return None
    name, call = next(iter(good.items()))
    took = f" in {call['ms']:.0f} ms" if call.get("ms") is not None else ""
    return f"{name} answered{took}; {len(good)} of {len({call['tool'] for call in calls})} read tools did"
