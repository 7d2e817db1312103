"""A plan as plain JSON values and back: the form that views stream, plan files keep and the memo remembers."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from octoform.graph.model import Agent
from octoform.plan.model import (
    Action,
    Cause,
    Change,
    Loan,
    NearProfile,
    OpenQuestion,
    Plan,
    PlannedAction,
    ProfileUse,
    Reason,
    StepOutlook,
    ToldDevice,
)

FORMAT = 1
_ABSENT = ("escalate", "loan")
"""Fields of an action that are there only where they say something."""


def to_json(plan: Plan) -> dict[str, Any]:
    """All of a plan as JSON values; absent facts are left out of reasons."""
    out: dict[str, Any] = {"format": FORMAT, **asdict(plan)}
    out["actions"] = [_action(item) for item in plan.actions]
    out["changes"] = [asdict(item) for item in plan.changes]
    for name in ("questions", "devices", "profiles", "near"):
        out[name] = [asdict(item) for item in getattr(plan, name)]
    if plan.steps:
        out["steps"] = [{**asdict(item), "devices": _listed(item.devices)} for item in plan.steps]
    else:
        del out["steps"]
    return out


def _listed(names: tuple[str, ...] | None) -> list[str] | None:
    return None if names is None else list(names)


def _action(item: PlannedAction) -> dict[str, Any]:
    out = asdict(item)
    out["reasons"] = [
        {key: value for key, value in asdict(reason).items() if value is not None} for reason in item.reasons
    ]
    return {key: value for key, value in out.items() if value is not None or key not in _ABSENT}


def from_json(data: Mapping[str, Any]) -> Plan:
    """The plan again; KeyError, TypeError or ValueError when ``data`` is not what `to_json` gives."""
    fields = {key: value for key, value in data.items() if key != "format"}
    fields["actions"] = tuple(_read_action(item) for item in data["actions"])
    fields["changes"] = tuple(Change(**{**item, "action": Action(item["action"])}) for item in data["changes"])
    fields["questions"] = tuple(OpenQuestion(**item) for item in data["questions"])
    fields["devices"] = tuple(ToldDevice(**item) for item in data.get("devices", ()))
    uses = data.get("profiles", ())
    fields["profiles"] = tuple(ProfileUse(**{**item, "action": Action(item["action"])}) for item in uses)
    fields["near"] = tuple(NearProfile(**item) for item in data.get("near", ()))
    fields["steps"] = tuple(_read_step(item) for item in data.get("steps", ()))
    fields["dirty"] = tuple(data["dirty"])
    fields["targets"] = tuple(data["targets"])
    return Plan(**fields)


def _read_step(item: Mapping[str, Any]) -> StepOutlook:
    devices = item["devices"]
    return StepOutlook(**{**item, "devices": None if devices is None else tuple(devices)})


def _read_action(item: Mapping[str, Any]) -> PlannedAction:
    reasons = tuple(Reason(**{**reason, "cause": Cause(reason["cause"])}) for reason in item["reasons"])
    more: dict[str, Any] = {"loan": Loan(**item["loan"])} if "loan" in item else {}
    more |= {"escalate": Agent(**item["escalate"])} if "escalate" in item else {}
    return PlannedAction(**{**item, "action": Action(item["action"]), "reasons": reasons, **more})
