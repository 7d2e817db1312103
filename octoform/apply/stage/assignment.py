"""The assignment of one agent: the stage, the agent and its budget, its inputs, and the judge of its output.

Most stages are one assignment. IDENTIFY with ``escalate`` is two: the second goes to another agent, reads only what
the first left unknown, and its output is judged merged with that of the first.
"""

import dataclasses
import json
from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from octoform.apply.context import Context, accepted, predecessor
from octoform.apply.stage.acceptance import BYTES_QUOTED, Verdict, artifacts, display, judge, read_output, read_value
from octoform.apply.stage.artifact_writer import runtime_files
from octoform.apply.stage.secret_scan import blanked
from octoform.base import files
from octoform.base.escaping import display as quoted
from octoform.base.files import parse, replace
from octoform.contracts.contract_check import check, has_shape
from octoform.contracts.model import HostScan
from octoform.contracts.rules.probe_host_rules import completed
from octoform.diagnostics import Diagnostic, Span, error, has_errors, warning
from octoform.endpoint.environment.system_programs import chosen_programs, named_programs, package_of
from octoform.harness.adapters import resolve as resolve_harness
from octoform.harness.llm.token_prices import OLD_DAYS, OWNERS, age_days, price_of
from octoform.harness.port import AgentEvent, ExitReason, Outcome, Price, Task, TaskLimits, Usage
from octoform.manifest.model import MODEL_FREE, STEP, Budget, HarnessSpec, Manifest
from octoform.manifest.references import resolve
from octoform.plan.model import Plan
from octoform.protocol.prompt import tail
from octoform.records import dataclass, field


def judge_server(context: Context, task: Task, data: bytes) -> tuple[Any, list[Diagnostic]]:
    """SERVE: parse and rules, and whether the programs that it starts by its own choice are on this host."""
    value, found = judge(context, task, data)
    if not isinstance(value, str) or has_errors(found):
        return value, found
    path = display(task.output)
    return value, [*found, *absent_programs(value, accepted(context, "interface"), context.environ, path)]


def absent_programs(text: str, interface: Any, environ: Mapping[str, str], path: str) -> list[Diagnostic]:
    """A finding for each program that a server chose and that the host lacks."""
    return [_absent(program, line, text, path) for program, line in chosen_programs(text, interface, environ).items()]


def judge_interface(context: Context, task: Task, data: bytes) -> tuple[Any, list[Diagnostic]]:
    """INTERFACE: parse, schema and rules, and whether the programs that tools go through are on this host."""
    value, found = judge(context, task, data)
    if not isinstance(value, dict) or has_errors(found):
        return value, found
    return value, [*found, *lacking_programs(value, context.environ, display(task.output))]


def lacking_programs(interface: Mapping[str, Any], environ: Mapping[str, str], path: str) -> list[Diagnostic]:
    """A warning for each program that tools go through and that the host lacks: these tools will not be served."""
    out = []
    for program, tools in named_programs(interface, environ).items():
        package = package_of(program, environ)
        summary = f"{quoted(program)} is not on this host, and these tools go through it: {', '.join(tools)}"
        hint = f"install it{f', from the package {quoted(package)},' if package else ''} or go through what is here; "
        hint += "without it the endpoint will not have these tools"
        out.append(warning("INTERFACE-PROGRAM-MISSING", summary, path=path, hint=hint))
    return out


def _absent(program: str, line: int, text: str, path: str) -> Diagnostic:
    summary = f"the server starts {quoted(program)}, which is not on this host, and INTERFACE does not name it"
    hint = "read the kernel's files instead, or catch FileNotFoundError and raise ToolError with the program's name "
    hint += "and the package that has it"
    span = Span(line, 1)
    source = text.splitlines()[line - 1]
    return error("SERVE-PROGRAM-MISSING", summary, path=path, span=span, source=source, hint=hint)


# The host's own scan beside another agent's PROBE: the embedded agent looks too, and its word is what that is held to.
#
# It costs no model and finds all that the kernel shows. It runs in a folder that the judged agent cannot reach.

STAGE = "scan"
SECONDS = 120.0
EMBEDDED = HarnessSpec("builtin")


def scan_beside(context: Context, probe: Any) -> tuple[HostScan | None, list[Diagnostic]]:
    """What the host shows, and which words of ``probe`` it never has; None, with a warning, if unreadable."""
    try:
        with TemporaryDirectory(prefix="octoform-scan-") as name:
            return _scanned(context, Path(name), probe)
    except OSError as problem:
        return None, [_not_held(f"{problem.strerror or problem}")]


def judge_scan(context: Context, task: Task, data: bytes) -> tuple[Any, list[Diagnostic]]:
    """PROBE of another agent: parse, schema and rules, and its facts against what the host shows."""
    value, found = read_value(task, data)
    if value is None:
        return None, found
    fits = has_shape("probe", value, context.schemas)
    scan, more = scan_beside(context, value) if fits else (None, [])
    known = dataclasses.replace(artifacts(context, "probe", value), scan=scan)
    found += [*check("probe", value, known, context.schemas, display(task.output)), *more]
    return completed(value, scan) if scan is not None else value, found


def _scanned(context: Context, folder: Path, probe: Any) -> tuple[HostScan | None, list[Diagnostic]]:
    task = _task(context, folder)
    given = folder / "input.json"
    replace(given, json.dumps(probe).encode("utf-8", "surrogatepass"), 0o600, synced=False)
    document = {"format": 1, "stage": STAGE, "input": str(given), "output": str(task.output)}
    replace(task.document, json.dumps(document).encode(), 0o600, synced=False)
    harness = resolve_harness(EMBEDDED, context.environ, None)
    assert not isinstance(harness, Diagnostic)
    outcome = harness.run(task, _unheard)
    data, found = read_output(task)
    if outcome.reason is not ExitReason.FINISHED or found:
        return None, [_not_held(_reason(task, outcome))]
    value = parse(data, any_text=True)
    # What is held to it has no secrets of devices any more.
    return HostScan(blanked(value["probe"]), tuple(value["unsaid"]), tuple(value["untrue"])), []


def _task(context: Context, folder: Path) -> Task:
    return Task(
        stage=STAGE,
        attempt=1,
        workdir=folder,
        prompt=folder / "prompt.md",
        output=folder / "output.json",
        log=folder / "agent.log",
        document=folder / "task.json",
        model=None,
        environment=context.environ,
        limits=TaskLimits(SECONDS),
        secrets=context.manifest.variables,
    )


def _unheard(_event: AgentEvent, _elapsed: float, _used: Usage) -> None:
    """It shows nothing that a person waits for."""


def _reason(task: Task, outcome: Outcome) -> str:
    return outcome.detail or tail(task.log, 1, BYTES_QUOTED) or outcome.reason.value


def _not_held(reason: str) -> Diagnostic:
    return warning(
        "PROBE-NOT-HELD",
        f"PROBE's output could not be compared with this host: {reason}",
        hint="`octoform apply -replace probe` tries it again; without stages.probe the embedded agent does PROBE",
    )


UNMEASURED = (*MODEL_FREE, "command")
"""Harnesses whose output shows nothing while they run: a command reports what it has used when it has ended."""

Judge = Callable[[Context, Task, bytes], tuple[Any, list[Diagnostic]]]
"""(context, task, bytes of the output) -> (value, diagnostics); the value is None when it cannot be read."""
Prove = Callable[[Context, Task, Any, list[Diagnostic]], Verdict]
"""(context, task, value, what was found so far) -> the verdict on a value that passed its contract."""


@dataclass(frozen=True, slots=True)
class Assignment:
    """``role`` is ``stage`` or ``escalate``; ``given`` is the content of an input other than the accepted artifact.

    ``beside`` are more files that its folder begins with, by name. ``prove`` takes the place of a stage's own proof.
    ``model`` is the name of the manifest, reference unresolved. ``profiles`` names those that its prompt has; None
    means all that hold for a device of the host.
    """

    stage: str
    harness: HarnessSpec
    model: str | None
    budget: Budget
    role: str = "stage"
    given: bytes | None = None
    judge: Judge = judge
    prove: Prove | None = None
    beside: Mapping[str, bytes] = field(default_factory=dict)
    profiles: tuple[str, ...] | None = None

    def input(self, context: Context, workdir: Path) -> Path | None:
        """The one artifact that the agent may read."""
        return workdir / "input.json" if self.given is not None else predecessor(context, self.stage)

    def model_name(self, context: Context) -> str | None:
        """The model with its references replaced; for the agent's arguments alone, never for a file."""
        return None if self.model is None else resolve(self.model, context.environ)

    def price(self, context: Context) -> Price | None:
        """The price of its model; None without a model or when it is unknown."""
        name = self.model_name(context)
        if name is None or self.harness.name in MODEL_FREE:
            return None
        listed = context.manifest.prices.get(self.model or "")
        known = {name: Price(listed.input, listed.cached, listed.output, OWNERS)} if listed is not None else {}
        return price_of(name, known)


def unaffordable(context: Context, assignment: Assignment, left: float | None) -> Diagnostic | None:
    """Why the next attempt may not start for want of money or of a price; None when it may.

    A limit that cannot be measured is no limit, so a model without a known price is not started under one.
    """
    if left is None or assignment.harness.name in MODEL_FREE:
        return None
    if left <= 0:
        return error(
            "APPLY-COST-LIMIT",
            f"the budget in dollars is spent before {assignment.stage} has an accepted output",
            hint="raise budget.usd in octopus.yaml, or look at `octoform attempts` to see what cost so much",
        )
    if assignment.harness.name not in UNMEASURED and assignment.price(context) is None:
        return error(
            "APPLY-PRICE-UNKNOWN",
            f"budget.usd is set, and no one knows what {assignment.model} costs",
            hint=f"add it to octopus.yaml: prices: {{{assignment.model}: {{input: ..., output: ...}}}}",
        )
    return None


def of_stage(context: Context, stage: str) -> Assignment:
    """The assignment of a stage as the manifest gives it."""
    manifest = context.manifest
    harness, budget = manifest.harness_for(stage), manifest.budget_for(stage)
    # Who writes or corrects a server reads what it stands on; the embedded agent knows it.
    writes = stage in ("serve", "heal") or stage.startswith(STEP)
    beside = runtime_files() if writes and harness.name not in MODEL_FREE else {}
    own = {"interface": judge_interface}
    if harness.name not in MODEL_FREE:  # the embedded agent's PROBE is the host's own scan
        own |= {"probe": judge_scan, "serve": judge_server}
    judged = own.get(stage, judge)
    return Assignment(stage, harness, manifest.model_for(stage), budget, judge=judged, beside=beside)


# Models without a known price under a limit in dollars, found before anything is started; and prices that grew old.
#
# A limit that cannot be measured is no limit. Anyone who validates or plans must hear of it, and not only the first
# attempt.


def unpriced(manifest: Manifest, environ: Mapping[str, str], plan: Plan | None = None) -> list[Diagnostic]:
    """An error for each model whose price no table knows, a warning for each whose price is old.

    With ``plan`` only for agents that it starts, and for those of the daemon, which no plan names.
    """
    working = None if plan is None else calling(plan)
    working = working if working is None else working | set(manifest.keepers)
    models = dict.fromkeys(model for stage, model in _counted(manifest) if working is None or stage in working)
    found = []
    for model in models:
        price = _price(manifest, model, environ)
        if price is None:
            summary = f"budget.usd is set, and no one knows what {model} costs"
            hint = f"add it to octopus.yaml: prices: {{{model}: {{input: ..., output: ...}}}}, or take `usd` out"
            found.append(error("APPLY-PRICE-UNKNOWN", summary, hint=hint, **_where(manifest, model)))
            continue
        days = age_days(price, datetime.now(UTC).date())
        if days is not None and days > OLD_DAYS:
            summary = f"the price of {model} is {days} days old ({price.source}), and budget.usd counts with it"
            found.append(
                warning("PLAN-PRICE-OLD", summary, hint=f"look it up: prices: {{{model}: ...}} in octopus.yaml")
            )
    return found


def _where(manifest: Manifest, model: str) -> dict[str, object]:
    """The place in the manifest that names the model; none where a variable does."""
    try:
        lines = files.read(manifest.path).decode().splitlines()
    except (OSError, ValueError):  # it was read a moment ago, and may be another by now
        return {}
    for number, line in enumerate(lines, 1):
        before, found, _ = line.partition(model)
        if found and before.rstrip(" \"'").endswith("model:"):
            column = len(before) + 1
            return {
                "path": str(manifest.path),
                "span": Span(number, column, column + len(model)),
                "source": line,
            }
    return {"path": str(manifest.path)}


def calling(plan: Plan) -> set[str]:
    """The stages and steps of a plan that start an agent."""
    return {item.node for item in plan.work if item.calls_agent}


def _counted(manifest: Manifest) -> Iterator[tuple[str, str]]:
    """Node and model of every agent whose dollars are counted while it works; models as the manifest names them."""
    settings = [*manifest.stages.items(), *manifest.keepers.items()]
    if manifest.step is not None:
        settings += [(f"{STEP}{each.name}", manifest.step) for each in manifest.privileged_steps]
    for name, each in settings:
        agents: list[tuple[HarnessSpec, str | None]] = [(each.harness, each.model)]
        agents += [(each.escalate.harness, each.escalate.model)] if each.escalate is not None else []
        for harness, model in agents:
            limited = each.budget.usd is not None or manifest.run_usd is not None
            if limited and model is not None and harness.name not in UNMEASURED:
                yield name, model


def _price(manifest: Manifest, model: str, environ: Mapping[str, str]) -> Price | None:
    name, listed = resolve(model, environ), manifest.prices.get(model)
    known = {name: Price(listed.input, listed.cached, listed.output, OWNERS)} if listed is not None else {}
    return price_of(name, known)
