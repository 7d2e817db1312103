"""`check`: one artifact against its whole contract, the schema first and then the cross-stage rules.

Heavy: imports jsonschema. Rules may rely on the shape, so they run only on a value that the schema accepts.
"""

from pathlib import Path

from octoform.contracts.canonical import load_schema
from octoform.contracts.model import Artifacts, Rule, joined
from octoform.contracts.rules import (
    deploy_rules,
    heal_rules,
    probe_host_rules,
    probe_rules,
    step_rules,
    topology_rules,
    watch_rules,
)
from octoform.contracts.rules.identify import identify_rules
from octoform.contracts.rules.interface import interface_rules, protocol_definition_rules, result_rules, unit_rules
from octoform.contracts.rules.serve import serve_rules
from octoform.contracts.schema_validation import shape_diagnostics
from octoform.diagnostics import Diagnostic
from octoform.records import replace

MAX_PER_RULE = 10

RULES: dict[str, tuple[Rule, ...]] = {
    "probe": (*probe_rules.RULES, *probe_host_rules.RULES, *probe_rules.TEXT_RULES),
    "identify": (*identify_rules.RULES, *topology_rules.RULES),
    "interface": (
        *interface_rules.RULES,
        *result_rules.RULES,
        *unit_rules.RULES,
        *protocol_definition_rules.RULES,
    ),
    "serve": joined(serve_rules.RULES),
    "deploy": deploy_rules.RULES,
    "step": step_rules.RULES,
    "watch": watch_rules.RULES,
    "heal": heal_rules.RULES,
}
_NEEDS = {
    "identify": "probe",
    "interface": "identify",
    "serve": "interface",
    "deploy": "serve",
    "step": "interface",
    "watch": "interface",
    "heal": "interface",
}


def check(stage: str, value: object, artifacts: Artifacts, schemas: Path, path: str | None = None) -> list[Diagnostic]:
    """Everything that is wrong with ``value`` as the output of ``stage``; empty when the contract accepts it.

    The output of a privileged step (``step.arm``) has a contract too; ``artifacts.step`` names the step. So do
    the reports of the background tasks (``watch``, ``heal``), with ``artifacts.duty`` for what their agent was given.

    ``artifacts`` holds the accepted artifacts of the stages before; ValueError when the preceding one is missing,
    which no user can cause. ``path`` is written into the diagnostics. Warnings may be among them.
    """
    stage = "step" if stage.startswith("step.") else stage
    needed = _NEEDS.get(stage)
    if needed is not None and getattr(artifacts, needed) is None:
        raise ValueError(f"{stage} cannot be checked without the {needed} artifact")
    found = [] if stage == "serve" else shape_diagnostics(stage, value, load_schema(stage, schemas))
    if not found:
        found = _ruled(RULES[stage], value, artifacts)
    return [item if item.path or path is None else replace(item, path=path) for item in found]


def has_shape(stage: str, value: object, schemas: Path) -> bool:
    """Whether the schema of the stage accepts the value; source text has no schema."""
    stage = "step" if stage.startswith("step.") else stage
    return stage == "serve" or not shape_diagnostics(stage, value, load_schema(stage, schemas))


def _ruled(rules: tuple[Rule, ...], value: object, artifacts: Artifacts) -> list[Diagnostic]:
    found: list[Diagnostic] = []
    for rule in rules:
        found += bounded(rule.check(value, artifacts))
        if found and rule.code == "SERVE-SYNTAX":
            break
    return found


def bounded(found: list[Diagnostic]) -> list[Diagnostic]:
    """At most `MAX_PER_RULE` of one rule's diagnostics; the last one states how many more there were."""
    if len(found) <= MAX_PER_RULE:
        return found
    kept = found[:MAX_PER_RULE]
    more = f"and {len(found) - MAX_PER_RULE} more like this"
    kept[-1] = replace(kept[-1], detail=f"{kept[-1].detail}\n{more}" if kept[-1].detail else more)
    return kept
