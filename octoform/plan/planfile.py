"""A saved plan: per-unit constraints bound to a lineage.

It holds no copy of the manifest or the state, so nothing secret and nothing to go out of date in silence: at apply
each unit's key parts, prior key and artifact are compared with what is there now, and a unit that moved is refused
by name with the part, before and after. An unrelated serial bump moves nothing. (Heavy: imports pydantic.)
"""

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from octoform.base.files import parse
from octoform.diagnostics import Diagnostic, error
from octoform.graph.model import HARDWARE, Graph, Node, input_of, key_of, key_parts, moved_parts
from octoform.plan import model
from octoform.plan.diff import Observed, Prior
from octoform.plan.model import Action, Plan
from octoform.records import dataclass

_HINT = "save one with `octoform plan -out FILE`"


KIND: Literal["octoform plan"] = "octoform plan"


class Unit(BaseModel):
    """The constraints of one node: known key parts, the prior key, the artifact's digest."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)

    parts: dict[str, str]
    prior: str | None
    file: str | None


class PlanFile(BaseModel):
    """The document that ``plan -out`` writes and ``apply FILE`` obeys."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)

    format: Literal[1] = 1
    kind: Literal["octoform plan"] = KIND
    octoform: str
    host: str
    lineage: str | None
    targets: list[str] | None
    replace: list[str]
    reuse: bool = True
    tier1: bool = False
    units: dict[str, Unit]
    plan: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Moved:
    """A constraint of one unit that no longer holds; ``text`` has more of it where there is more."""

    unit: str
    part: str
    before: str | None
    after: str | None
    text: str = ""


def units(graph: Graph, plan: Plan, prior: Mapping[str, Prior], observed: Observed) -> dict[str, Unit]:
    """The constraints of every node that the plan would work on."""
    moving = {item.node for item in plan.work}
    return {item.node: _unit(item.node, graph, moving, prior, observed) for item in plan.work}


def _unit(name: str, graph: Graph, moving: set[str], prior: Mapping[str, Prior], observed: Observed) -> Unit:
    """The constraints of a node; one that the graph no longer has depends on nothing but itself."""
    parts = _known_parts(graph.node(name), moving, prior, observed) if name in graph.names() else {}
    before = prior.get(name)
    return Unit(parts=parts, prior=_run(before) if before is not None else None, file=observed.files.get(name))


def _known_parts(node: Node, moving: set[str], prior: Mapping[str, Prior], observed: Observed) -> dict[str, str]:
    outputs = {name: prior[name].output_digest if name in prior else "" for name in node.consumes}
    parts = key_parts(node, outputs, observed.fingerprint)
    return {part: value for part, value in parts.items() if input_of(part) not in moving}


def _run(before: Prior) -> str:
    """Which run of a node the state holds: a plan that was applied once has moved, whatever came out."""
    return f"{key_of(before.key_parts)}/{before.status}/{before.accepted_at}"


def moved(saved: PlanFile, graph: Graph, prior: Mapping[str, Prior], observed: Observed) -> list[Moved]:
    """Every constraint that no longer holds, unit by unit; empty when the plan may be applied as it is."""
    moving = set(saved.units)
    out = []
    for name, unit in saved.units.items():
        now = _unit(name, graph, moving, prior, observed)
        for part in moved_parts(unit.parts, now.parts):
            text = "; ".join(observed.hardware) if part == HARDWARE else ""
            out.append(Moved(name, part, unit.parts.get(part), now.parts.get(part), text))
        if unit.prior != now.prior:
            out.append(Moved(name, "state", unit.prior, now.prior))
        if unit.file != now.file:
            out.append(Moved(name, "artifact", unit.file, now.file))
    return out


def read(data: bytes, path: str) -> tuple[PlanFile | None, list[Diagnostic]]:
    """The saved plan in ``data``, or why it is none."""
    try:
        saved = PlanFile.model_validate_json(data)
        model.from_json(saved.plan)
    except (ValidationError, KeyError, TypeError, ValueError) as problem:
        place = (
            ".".join(str(part) for part in problem.errors()[0]["loc"]) if isinstance(problem, ValidationError) else ""
        )
        detail = f"it does not fit at {place}" if place else "it is cut off, edited or another file"
        return None, [error("PLAN-NOT-A-PLAN", "this is not a saved plan", path=path, detail=detail, hint=_HINT)]
    return saved, []


def is_one(data: bytes) -> bool:
    """Whether a file is a saved plan, even of another version or with members that do not fit."""
    try:
        document = parse(data)
    except ValueError:
        return False
    return isinstance(document, dict) and document.get("kind") == KIND


def unread(path: str, problem: Diagnostic | None) -> Diagnostic:
    """Why a file that a person named is not a plan; only for files of the state the hint is to remove it."""
    if problem is not None and problem.code != "STATE-LINK":
        return problem
    summary = "this is a link, a folder or a special file, not a saved plan" if problem else "there is no such file"
    return error("PLAN-NOT-A-PLAN", summary, path=path, hint=_HINT)


def describe(item: Moved) -> Diagnostic:
    """PLAN-STALE for one moved constraint."""
    detail = f"{item.part}: {item.before or '(none)'} -> {item.after or '(none)'}"
    return error(
        "PLAN-STALE",
        f"{item.unit}: {item.part} moved since the plan was saved",
        detail=f"{detail} (since PROBE: {item.text})" if item.text else detail,
        hint="make a new plan; the units that did not move are applied",
    )


def applicable(saved: PlanFile, graph: Graph, stale: list[Moved]) -> frozenset[str]:
    """The planned units that may still be applied: not stale and not built on a stale one."""
    refused = graph.downstream({item.unit for item in stale})
    planned = {item.node for item in model.from_json(saved.plan).actions if item.action is not Action.NOOP}
    return frozenset(planned - refused)
