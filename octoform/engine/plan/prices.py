"""Models without a known price under a limit in dollars, found before anything is started; and prices that grew old.

A limit that cannot be measured is no limit. Anyone who validates or plans must hear of it, and not only the first
attempt.
"""

from collections.abc import Iterator, Mapping
from datetime import UTC, datetime

from octoform.apply.stage.assignment import UNMEASURED
from octoform.base import files
from octoform.diagnostics import Diagnostic, Span, error, warning
from octoform.harness.llm.token_prices import OLD_DAYS, OWNERS, age_days, price_of
from octoform.harness.port import Price
from octoform.manifest.model import STEP, HarnessSpec, Manifest
from octoform.manifest.references import resolve
from octoform.plan.model import Plan


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
