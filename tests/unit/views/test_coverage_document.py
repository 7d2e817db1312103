"""The examples of docs/coverage.md are what the command prints; ``--update`` writes them anew."""

import re
from pathlib import Path

import pytest
from covered import onboarded, report
from hosts.plant import plant

from octoform.contracts.rules.identify.answer_rules import tier, wanted
from octoform.engine.coverage import CoverageReport, Share
from octoform.views.coverage import lines
from octoform.views.coverage_text import percent

DOCUMENT = Path(__file__).parents[3] / "docs" / "coverage.md"
EXAMPLE = re.compile(r"(?<=<!-- example -->\n```text\n).*?(?=```\n)", re.DOTALL)
HOSTS = re.compile(r"(?<=\| with infrastructure \|\n\| --- \| --- \| --- \| --- \| --- \| --- \|\n)[^#]*?(?=\n## JSON)")
WIDTH = 100


@pytest.fixture(scope="module")
def reports(tmp_path_factory: pytest.TempPathFactory) -> dict[str, CoverageReport]:
    folder, found = tmp_path_factory.mktemp("hosts"), {}
    for name in ("bench", "empty-vm", "laptop", "raspberry", "server"):
        artifacts = onboarded(plant(name, folder / name))
        tiers = {item["id"]: wanted(item) or tier(item, (), ()) for item in artifacts["identify"]["devices"]}
        found[name] = report(artifacts, tiers=tiers)
    return found


def holds(pattern: re.Pattern[str], text: str, update: bool) -> None:
    document = DOCUMENT.read_text("utf-8")
    if update:
        DOCUMENT.write_text(pattern.sub(lambda _: text, document, count=1), "utf-8")
        return
    found = pattern.search(document)
    assert found is not None and found[0] == text


def test_the_example_is_what_is_printed(reports: dict[str, CoverageReport], update: bool) -> None:
    printed = lines(reports["laptop"], WIDTH, lambda text, *_: text)
    holds(EXAMPLE, "".join(f"{line}\n" for line in printed), update)


def test_the_table_is_of_the_invented_hosts(reports: dict[str, CoverageReport], update: bool) -> None:
    holds(HOSTS, "".join(row(name, made) for name, made in reports.items()), update)


def row(name: str, made: CoverageReport) -> str:
    funnel, found = made.coverage.funnel, made.coverage
    counts = (str(count) for count in (funnel.enumerated, funnel.identified, funnel.tools))
    return f"| {' | '.join((name, *counts, share(found.onboardable), share(found.with_infrastructure)))} |\n"


def share(value: Share | None) -> str:
    assert value is not None
    return f"{value.usable} of {value.of}, {percent(value)}" if value.of else "none"
