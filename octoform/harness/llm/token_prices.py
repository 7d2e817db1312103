"""Prices of tokens: the manifest's own prices, then litellm's table if it is there, then the dated one shipped here.

A price that no one knows stays unknown: a run is never reported as free because its model is not in a table.
"""

from collections.abc import Mapping
from datetime import date
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from octoform.base.files import read_json
from octoform.harness.port import Price, Usage

TABLE = "model_prices_and_context_window_backup.json"
MILLION = 1_000_000
SHIPPED = Path(__file__).with_name("prices.json")
OWNERS = "manifest"
"""The source of a price that the owner has given."""
OLD_DAYS = 180
"""Days after which the shipped prices are warned about: makers change theirs a few times a year."""


def cost_of(usage: Usage, price: Price) -> float | None:
    """US dollars of a usage at a price; None when a count is unknown."""
    if usage.input_tokens is None or usage.output_tokens is None:
        return None
    cached = min(usage.cached_tokens or 0, usage.input_tokens)
    dollars = (usage.input_tokens - cached) * price.input + cached * price.cached + usage.output_tokens * price.output
    return dollars / MILLION


def price_of(model: str, prices: Mapping[str, Price]) -> Price | None:
    """The price of a model by the name that the manifest gives it; None when no table knows it."""
    return prices.get(model) or _listed(model) or _shipped(model)


def age_days(price: Price, today: date) -> int | None:
    """Days since a price of the shipped table was looked up; None for one of another table."""
    return (today - date.fromisoformat(_prices()["date"])).days if price.source == _source() else None


def _shipped(model: str) -> Price | None:
    models = _prices()["models"]
    for name in _names(model):
        if name in models:
            into, cached, out = models[name]
            return Price(into, cached, out, _source())
    return None


def _source() -> str:
    return f"octoform's prices of {_prices()['date']}"


@cache
def _prices() -> Mapping[str, Any]:
    document: Mapping[str, Any] = read_json(SHIPPED)
    return document


def _names(model: str) -> list[str]:
    """Names with and without the provider are listed; a shorter name is the same model sold by its maker."""
    parts = model.split("/")
    return ["/".join(parts[start:]) for start in range(len(parts))]


def _listed(model: str) -> Price | None:
    table = _table()
    for name in _names(model):
        entry = table.get(name)
        price = _price(entry) if isinstance(entry, dict) else None
        if price is not None:
            return price
    return None


def _price(entry: Mapping[str, Any]) -> Price | None:
    into, out = entry.get("input_cost_per_token"), entry.get("output_cost_per_token")
    cached = entry.get("cache_read_input_token_cost", into)
    if not all(isinstance(value, int | float) and value >= 0 for value in (into, out, cached)) or not (into or out):
        return None  # a zero in that table means that no price was entered
    return Price(float(into or 0) * MILLION, float(cached or 0) * MILLION, float(out or 0) * MILLION, "litellm")


@cache
def _table() -> Mapping[str, Any]:
    """The price table as a file: importing the package itself would cost seconds."""
    from importlib.metadata import PackageNotFoundError, version  # heavy: it brings the library's `email`

    try:
        version("litellm")
    except PackageNotFoundError:
        return {}
    spec = find_spec("litellm")
    folders = spec.submodule_search_locations if spec is not None else None
    path = Path(next(iter(folders or []), "")) / TABLE
    if not path.is_file():
        return {}
    table: Mapping[str, Any] = read_json(path)
    return table
