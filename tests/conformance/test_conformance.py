"""What programs that are not ours say of an endpoint: the conformance suites of both eras, and the Inspector's linter.

Judged are a server with what the suites ask for by name, and one that the embedded agent wrote for an invented host;
both run behind octoform's own launcher. A suite can send no token, so a small proxy adds it.
"""

import asyncio
import importlib.util
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from bearer_proxy import bearer_proxy
from hosts.plant import plant
from launched import LOOPBACK, Launched, launched, tool
from suites import HANDSHAKE, INSPECTOR, LATER, judge, missing, run

from octoform.builtin.identify.iddb import IdDatabases
from octoform.builtin.identify.stage import identify
from octoform.builtin.interface.stage import declare
from octoform.builtin.probe.stage import probe_root
from octoform.builtin.serve.stage import render

HERE = Path(__file__).parent
FIXTURES = HERE / "fixture_server.py"
BASELINE = HERE / "baseline-2026-07-28.yml"
SENSOR = {"id": "hwmon-k10temp", "name": "AMD K10 temperature sensor", "category": "sensor"}
DEVICES_OF = {"read_thermometer": [SENSOR["id"]]}
FOR_ANY_SERVER = {
    "server-initialize",
    "logging-set-level",
    "ping",
    "tools-list",
    "server-sse-multiple-streams",
    "resources-list",
    "resources-subscribe",
    "resources-unsubscribe",
    "prompts-list",
    "dns-rebinding-protection",
}
"""Scenarios of the released suite that need nothing of a server but that it is one."""
FOR_ANY_SERVER_LATER = {
    "server-stateless",
    "tools-list",
    "resources-list",
    "prompts-list",
    "caching",
    "http-header-validation",
    "sep-2164-resource-not-found",
    "server-sse-multiple-streams",
    "dns-rebinding-protection",
}
NEEDS_A_FIXTURE = {
    "sep-2575-server-rejects-undeclared-capability",
    "sep-2575-missing-capability-http-400",
    "sep-2575-no-independent-requests-on-stream",
    "sep-2575-server-no-log-without-loglevel",
}
"""Checks of server-stateless that call a tool which only a server made for the suite has."""


pytestmark = pytest.mark.skipif(bool(missing()), reason=f"`make programs` installs {', '.join(missing())}")


def thermometer(root: Path) -> Path:
    """A host with one thermometer, which the fixture server unplugs and plugs in again."""
    device, members = root / "sys/devices/hwmon/hwmon0", root / "sys/class/hwmon"
    for folder in (device, members):
        folder.mkdir(parents=True)
    (device / "name").write_text("k10temp\n")
    (device / "subsystem").symlink_to(members)
    (members / "hwmon0").symlink_to(device)
    return root


def names_of(server: Path) -> list[str]:
    """The tools of a server's file."""
    found = importlib.util.spec_from_file_location("fixture_server", server)
    assert found is not None and found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return [each.name for each in asyncio.run(module.mcp.list_tools())]


@pytest.fixture(scope="module")
def fixtures(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launched]:
    """The server that was made for the suites, behind the launcher."""
    folder = tmp_path_factory.mktemp("fixtures")
    environ = {"OCTOFORM_SYSROOT": str(thermometer(folder / "root"))}
    tools = [tool(name, "read", *DEVICES_OF.get(name, ())) for name in names_of(FIXTURES)]
    source = FIXTURES.read_text()
    with launched(folder, source, tools, network=LOOPBACK, devices=[SENSOR], environ=environ) as endpoint:
        yield endpoint


@pytest.fixture(scope="module")
def generated(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Launched]:
    """What the embedded agent wrote for the laptop of tests/hosts, behind the launcher."""
    folder = tmp_path_factory.mktemp("generated")
    root = plant("laptop", folder / "laptop")
    annotated = identify(json.loads(json.dumps(probe_root(root))), IdDatabases(root))
    interface = declare(annotated, 30)
    devices = [
        {"id": each["id"], "name": each["identified_as"], "category": each["category"]} for each in annotated["devices"]
    ]
    environ = {"OCTOFORM_SYSROOT": str(root)}
    with launched(
        folder, render(interface), interface["tools"], network=LOOPBACK, devices=devices, environ=environ
    ) as endpoint:
        yield endpoint


def test_a_server_with_all_fixtures_passes_all_scenarios(fixtures: Launched, tmp_path: Path) -> None:
    with bearer_proxy(fixtures.url, fixtures.token()) as url:
        report = judge(HANDSHAKE, url, tmp_path, "--suite", "all")

    assert report.failures == ()
    assert len(report.passed()) == 32
    assert report.status == 0, report.printed


def test_it_passes_what_the_later_revision_requires(fixtures: Launched, tmp_path: Path) -> None:
    with bearer_proxy(fixtures.url, fixtures.token()) as url:
        report = judge(LATER, url, tmp_path, "--requirements", "2026-07-28", "--expected-failures", str(BASELINE))

    listed = [line.split()[1] for line in BASELINE.read_text().splitlines() if line.startswith("  - ")]
    assert report.failed() == listed, report.failures
    assert len(report.passed()) == 41
    assert report.status == 0, report.printed


def test_a_generated_server_passes_what_applies_to_any_server(generated: Launched, tmp_path: Path) -> None:
    with bearer_proxy(generated.url, generated.token()) as url:
        report = judge(HANDSHAKE, url, tmp_path, "--suite", "all")

    assert sorted(FOR_ANY_SERVER - set(report.passed())) == [], report.failures


def test_a_generated_server_passes_what_the_later_revision_asks_of_any(generated: Launched, tmp_path: Path) -> None:
    with bearer_proxy(generated.url, generated.token()) as url:
        report = judge(LATER, url, tmp_path, "--requirements", "2026-07-28")

    failures = [failure for failure in report.failures if failure.split(": ")[0] in FOR_ANY_SERVER_LATER]
    assert {failure.split(": ")[1] for failure in failures} <= NEEDS_A_FIXTURE, failures
    assert sorted(FOR_ANY_SERVER_LATER - set(report.scenarios)) == []


def listed(*arguments: str) -> Any:
    """What the Inspector lists, with its linter for schemas; fails unless it ends with status 0."""
    done = run(INSPECTOR, "--cli", *arguments, "--method", "tools/list", "--strict", "--format", "json")
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads(done.stdout)["result"]


@pytest.mark.parametrize("which", ["fixtures", "generated"])
def test_the_inspector_has_nothing_against_the_schemas(which: str, request: pytest.FixtureRequest) -> None:
    endpoint: Launched = request.getfixturevalue(which)

    over_http = listed(
        *(endpoint.url, "--transport", "http", "--header", f"Authorization: Bearer {endpoint.token()}"),
        *("--protocol-era", "modern"),
    )
    over_pipe = listed(*endpoint.command)

    assert [each["name"] for each in over_http["tools"]] == [each["name"] for each in over_pipe["tools"]]
    assert all(each["_meta"]["octoform/effect"] for each in over_pipe["tools"])
