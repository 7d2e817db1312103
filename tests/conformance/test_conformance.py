"""What other people's programs say of an endpoint: the conformance suites of both eras, the Inspector's linter."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from conformance import judged
from conformance.suites import missing
from launched import Launched


@pytest.fixture(scope="module", autouse=True)
def installed() -> None:
    assert not missing(), f"`make programs` installs {', '.join(missing())}"


@pytest.fixture(scope="module")
def fixtures(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launched]:
    with judged.fixtures(tmp_path_factory.mktemp("fixtures")) as endpoint:
        yield endpoint


@pytest.fixture(scope="module")
def generated(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launched]:
    with judged.generated(tmp_path_factory.mktemp("generated")) as endpoint:
        yield endpoint


def test_a_server_with_all_fixtures_passes_all_scenarios(fixtures: Launched, tmp_path: Path) -> None:
    report = judged.released(fixtures, tmp_path)

    assert report.failures == ()
    assert len(report.passed()) == 32
    assert report.status == 0, report.printed


def test_it_passes_what_the_later_revision_requires(fixtures: Launched, tmp_path: Path) -> None:
    report = judged.later(fixtures, tmp_path, "--expected-failures", str(judged.BASELINE))

    listed = [line.split()[1] for line in judged.BASELINE.read_text().splitlines() if line.startswith("  - ")]
    assert report.failed() == listed, report.failures
    assert len(report.passed()) == 41
    assert report.status == 0, report.printed


def test_a_generated_server_passes_what_applies_to_any_server(generated: Launched, tmp_path: Path) -> None:
    report = judged.released(generated, tmp_path)

    assert sorted(judged.FOR_ANY_SERVER - set(report.passed())) == [], report.failures


def test_a_generated_server_passes_what_the_later_revision_asks_of_any(generated: Launched, tmp_path: Path) -> None:
    report = judged.later(generated, tmp_path)

    failures = [failure for failure in report.failures if failure.split(": ")[0] in judged.FOR_ANY_SERVER_LATER]
    assert {failure.split(": ")[1] for failure in failures} == judged.NEEDS_A_FIXTURE, failures
    assert sorted(judged.FOR_ANY_SERVER_LATER - set(report.scenarios)) == []


@pytest.mark.parametrize("which", ["fixtures", "generated"])
def test_the_inspector_has_nothing_against_the_schemas(which: str, request: pytest.FixtureRequest) -> None:
    endpoint: Launched = request.getfixturevalue(which)

    def listed(*arguments: str) -> list[dict[str, Any]]:
        status, printed, errors = judged.inspected(*arguments)
        assert status == 0, printed + errors
        tools: list[dict[str, Any]] = json.loads(printed)["result"]["tools"]
        return tools

    over_http, over_pipe = listed(*judged.over_http(endpoint)), listed(*endpoint.command)

    assert [each["name"] for each in over_http] == [each["name"] for each in over_pipe]
    assert all(each["_meta"]["octoform/effect"] for each in over_pipe)
