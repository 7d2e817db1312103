"""The table of docs/agents.md has for each program what its adapter has."""

import re
from pathlib import Path

import pytest

from octoform.harness import adapters
from octoform.harness.adapters.program import ProgramHarness
from octoform.harness.installer import dotted
from octoform.manifest.credentials import PROVIDERS
from octoform.manifest.model import HarnessSpec

TEXT = (Path(__file__).parents[3] / "docs" / "agents.md").read_text()
ROWS = {
    cells[0].strip("`"): cells[1:]
    for cells in ([cell.strip() for cell in line.strip("|").split("|")] for line in TEXT.splitlines())
    if len(cells) == 5 and re.fullmatch(r"`[a-z-]+`", cells[0])
}


def test_every_harness_has_a_row() -> None:
    assert sorted(ROWS) == list(adapters.NAMES)


@pytest.mark.parametrize("name", adapters.NAMES)
def test_a_program_is_what_its_adapter_pins(name: str) -> None:
    harness = adapters.resolve(HarnessSpec(name, command=("agent",) if name == "command" else ()), {})
    if isinstance(harness, ProgramHarness):
        adapter = harness.adapter
        wanted = "native" if adapter.pin.node is None else f"node {dotted(adapter.pin.node).removesuffix('.0')}"
        served = [provider.name for provider in PROVIDERS.values() if set(provider.urls) & set(adapter.apis)]
        models = "all" if len(served) == len(PROVIDERS) else ", ".join(f"`{provider}`" for provider in served)
        assert ROWS[name] == [adapter.pin.binary, adapter.pin.version, wanted, models]
