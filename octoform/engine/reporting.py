"""What the end of a run tells: the funnel and the endpoint, read from the accepted artifacts."""

import json
from collections.abc import Mapping
from typing import Any

from octoform.endpoint.observing import observe
from octoform.engine.results import EndpointSummary, Funnel
from octoform.state.layout import Layout


def funnel(artifacts: Mapping[str, Any]) -> Funnel | None:
    """Counts from what is seen to what can be called; None before IDENTIFY was accepted."""
    probe, identify, interface = (artifacts.get(stage) for stage in ("probe", "identify", "interface"))
    if probe is None or identify is None:
        return None
    served = {device for tool in interface["tools"] for device in tool["devices"]} if interface else set()
    return Funnel(
        seen=len(probe["devices"]),
        annotated=len(identify["devices"]),
        unknown=sum(1 for device in identify["devices"] if device["category"] == "unknown"),
        left_out=len(probe["devices"]) - len(served),
        tools=len(interface["tools"]) if interface else 0,
    )


def endpoint(layout: Layout, artifacts: Mapping[str, Any]) -> EndpointSummary | None:
    """The endpoint as it was last checked; None when there is none."""
    interface = artifacts.get("interface")
    facts = observe(layout)
    if interface is None or facts.reasons or not (layout.endpoint / "launch").exists():
        return None
    readers = [tool for tool in interface["tools"] if tool["effect"] == "read"]
    easy = [tool["name"] for tool in readers if not tool["input_schema"].get("required")]
    return EndpointSummary(
        command=str(layout.endpoint / "launch"),
        scope="local",
        transport="stdio",
        tools=tuple(tool["name"] for tool in interface["tools"]),
        answered=_answered(layout),
        example=easy[0] if easy else None,
    )


def _answered(layout: Layout) -> str | None:
    """A read tool that answered in the last check, for the closing lines."""
    path = layout.endpoint / "check.json"
    if not path.is_file():
        return None
    calls = json.loads(path.read_bytes()).get("calls", [])
    good = [call for call in calls if call.get("ok")]
    if not good:
        return None
    took = f" in {good[0]['ms']:.0f} ms" if good[0].get("ms") is not None else ""
    return f"{good[0]['tool']} answered{took}; {len(good)} of {len(calls)} read tools did"
