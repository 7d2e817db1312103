"""A limit in dollars needs a price: validate and plan say so, and the manifest of the README needs nothing more."""

from datetime import date
from pathlib import Path

import pytest

from octoform.apply.stage.assignment import unpriced
from octoform.cli.main import main
from octoform.harness.llm import token_prices
from octoform.manifest.loader import load

README = Path(__file__).parents[3] / "README.md"


@pytest.fixture(autouse=True)
def without_litellm(monkeypatch: pytest.MonkeyPatch) -> None:
    """A plain installation has no litellm beside it."""
    monkeypatch.setattr(token_prices, "_table", dict)


def project(folder: Path, model: str, more: str = "") -> Path:
    (folder / "octopus.yaml").write_text(
        f"version: 1\nhost: bench\nharness: claude-code\nmodel: {model}\nbudget: {{usd: 3.00}}\n{more}"
    )
    return folder


def example() -> str:
    """The coding agent's manifest as the README has it."""
    blocks = README.read_text().split("```yaml\n")[1:]
    return next(block.partition("```")[0] for block in blocks if "claude-code" in block)


def test_the_manifest_of_the_readme_has_a_price(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ANTHROPIC_API_KEY", "k")
    (tmp_path / "octopus.yaml").write_text(example())
    manifest, _ = load(tmp_path / "octopus.yaml", {"ANTHROPIC_API_KEY": "k"})
    assert manifest is not None
    assert unpriced(manifest, {}) == []
    assert main([f"-chdir={tmp_path}", "validate"]) == 0
    assert main([f"-chdir={tmp_path}", "plan"]) == 0


@pytest.mark.parametrize("command", ["validate", "plan"])
def test_a_model_that_no_table_knows_is_refused_before_anything_is_started(
    tmp_path: Path, command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("ANTHROPIC_API_KEY", "k")
    project(tmp_path, "anthropic/nobody-knows-1")
    assert main([f"-chdir={tmp_path}", command]) == 1
    found = capsys.readouterr()
    assert (
        "APPLY-PRICE-UNKNOWN" in found.out + found.err and "prices: {anthropic/nobody-knows-1" in found.out + found.err
    )
    assert "octopus.yaml:4:8\n" in found.out + found.err, "the line that names the model"
    project(tmp_path, "anthropic/nobody-knows-1", "prices: {anthropic/nobody-knows-1: {input: 1, output: 2}}\n")
    assert main([f"-chdir={tmp_path}", command]) == 0


def test_an_old_price_is_used_and_warned_about(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    manifest, _ = load(project(tmp_path, "anthropic/claude-sonnet-4-5") / "octopus.yaml", {"ANTHROPIC_API_KEY": "k"})
    assert manifest is not None
    monkeypatch.setattr(
        token_prices, "_prices", lambda: {"date": "2020-01-01", "models": {"claude-sonnet-4-5": [3, 0.3, 15]}}
    )
    (old,) = unpriced(manifest, {})
    assert (old.severity, old.code) == ("warning", "PLAN-PRICE-OLD")


def test_the_table_is_whole_and_dated() -> None:
    table = token_prices._prices()
    assert date.fromisoformat(table["date"])
    for name, numbers in table["models"].items():
        into, cached, out = numbers
        assert into > 0 and 0 <= cached <= into and out > 0, name


@pytest.mark.parametrize("stage", ["heal", "watch"])
@pytest.mark.parametrize("command", ["validate", "plan"])
def test_the_agents_of_the_daemon_are_counted_too(
    tmp_path: Path, command: str, stage: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("ANTHROPIC_API_KEY", "k")
    agent = f"stages: {{{stage}: {{harness: claude-code, model: anthropic/nobody-knows-1}}}}\n"
    (tmp_path / "octopus.yaml").write_text(f"version: 1\nhost: bench\n{agent}")
    assert main([f"-chdir={tmp_path}", command]) == 0
    capsys.readouterr()
    (tmp_path / "octopus.yaml").write_text(f"version: 1\nhost: bench\nbudget: {{usd: 3}}\n{agent}")
    assert main([f"-chdir={tmp_path}", command]) == 1
    found = capsys.readouterr()
    assert "no one knows what anthropic/nobody-knows-1 costs" in found.out + found.err
