"""What tokens cost: the manifest's table, litellm's, and nothing for what no table knows."""

from dataclasses import astuple

import pytest

from octoform.harness.llm.token_prices import cost_of, price_of
from octoform.harness.port import Price, Usage

OWN = Price(1.0, 0.1, 2.0, "manifest")


@pytest.mark.parametrize(
    ("usage", "dollars"),
    [
        (Usage(1_000_000, 0, 0), 1.0),
        (Usage(1_000_000, 400_000, 500_000), 0.6 + 0.04 + 1.0),
        (Usage(1_000_000, None, 500_000), 2.0),
        (Usage(100, 200, 0), 0.1 * 100 / 1_000_000),
        (Usage(0, 0, 0), 0.0),
        (Usage(None, 0, 10), None),
        (Usage(10, 0, None), None),
        (Usage(), None),
    ],
)
def test_what_a_usage_costs(usage: Usage, dollars: float | None) -> None:
    cost = cost_of(usage, OWN)
    assert cost == (dollars if dollars is None else pytest.approx(dollars))


def test_the_manifest_stands_above_every_table() -> None:
    assert price_of("openai/gpt-4o-mini", {"openai/gpt-4o-mini": OWN}) == OWN
    assert price_of("nobody/knows-this", {"nobody/knows-this": OWN}) == OWN


def test_a_listed_model() -> None:
    price = price_of("openai/gpt-4o-mini", {})
    assert price is not None
    assert astuple(price) == (pytest.approx(0.15), pytest.approx(0.075), pytest.approx(0.6), "litellm")


def test_a_cache_without_a_price_of_its_own_costs_what_fresh_input_does() -> None:
    price = price_of("openai/gpt-4", {})
    assert price is not None
    assert price.cached == price.input > 0


def test_a_model_that_somebody_else_sells_is_priced_by_its_makers_name() -> None:
    assert price_of("openrouter/openai/gpt-4o-mini", {}) is not None
    sold, own = (price_of(name, {}) for name in ("openrouter/anthropic/claude-sonnet-4-5", "claude-sonnet-4-5"))
    assert sold == own is not None


@pytest.mark.parametrize("model", ["openai/scripted", "nobody/knows-this", "", "/", "sample_spec"])
def test_what_no_table_knows_has_no_price(model: str) -> None:
    assert price_of(model, {}) is None
