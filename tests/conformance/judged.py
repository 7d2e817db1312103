"""The two endpoints that are judged, each behind octoform's own launcher.

One serves what the suites ask for by name, the other what the embedded agent wrote for an invented host.
"""

import asyncio
import importlib.util
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from conformance.bearer_proxy import bearer_proxy
from conformance.suites import HANDSHAKE, INSPECTOR, LATER, Report, judge, run
from hosts.plant import plant
from launched import LOOPBACK, Launched, launched, tool

from octoform.base.digest import of_bytes
from octoform.base.id_databases import IdDatabases
from octoform.builtin.identify import identify
from octoform.builtin.interface import declare
from octoform.builtin.probe import probe_root
from octoform.builtin.serve.stage import render

HERE = Path(__file__).parent
FIXTURES = HERE / "fixture_server.py"
START = HERE / "serve_with_fixtures.py"
BASELINE = HERE / "baseline-2026-07-28.yml"
SENSOR = {"id": "hwmon-k10temp", "name": "AMD K10 temperature sensor", "category": "sensor"}
DEVICES_OF = {"read_thermometer": [SENSOR["id"]]}
REVISION = "2026-07-28"
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
}
"""Checks of server-stateless that call a tool which only a server made for the suite has."""


@contextmanager
def fixtures(folder: Path) -> Iterator[Launched]:
    """The server that was made for the suites, behind the launcher, which serves its resources and prompts as well."""
    environ = {"OCTOFORM_SYSROOT": str(_thermometer(folder / "root"))}
    tools = [tool(name, "read", *DEVICES_OF.get(name, ())) for name in _names_of(FIXTURES)]
    source = FIXTURES.read_text()
    with launched(folder, source, tools, network=LOOPBACK, devices=[SENSOR], environ=environ) as endpoint:
        endpoint.stop()
        _publish(endpoint.layout.endpoint, "serve.py", START.read_bytes())
        endpoint.start()
        yield endpoint


@contextmanager
def generated(folder: Path) -> Iterator[Launched]:
    """What the embedded agent wrote for the laptop of tests/hosts, behind the launcher."""
    root = plant("laptop", folder / "laptop")
    annotated = identify(json.loads(json.dumps(probe_root(root))), IdDatabases(root))
    interface = declare(annotated, 30)
    devices = [
        {"id": each["id"], "name": each["identified_as"], "category": each["category"]} for each in annotated["devices"]
    ]
    environ, source = {"OCTOFORM_SYSROOT": str(root)}, render(interface)
    with launched(folder, source, interface["tools"], network=LOOPBACK, devices=devices, environ=environ) as endpoint:
        yield endpoint


def released(endpoint: Launched, output: Path) -> Report:
    """All scenarios of the released suite (revision 2025-11-25)."""
    with bearer_proxy(endpoint.url, endpoint.token()) as url:
        return judge(HANDSHAKE, url, output, "--suite", "all")


def later(endpoint: Launched, output: Path, *options: str) -> Report:
    """What revision 2026-07-28 requires."""
    with bearer_proxy(endpoint.url, endpoint.token()) as url:
        return judge(LATER, url, output, "--requirements", REVISION, *options)


def inspected(*arguments: str) -> tuple[int, str, str]:
    """The Inspector lists the tools of a server and lints their schemas: exit status, output, errors."""
    done = run(INSPECTOR, "--cli", *arguments, "--method", "tools/list", "--strict", "--format", "json")
    return done.returncode, done.stdout, done.stderr


def over_http(endpoint: Launched) -> tuple[str, ...]:
    """How the Inspector reaches an endpoint over HTTP, in the later era."""
    header = f"Authorization: Bearer {endpoint.token()}"
    return endpoint.url, "--transport", "http", "--header", header, "--protocol-era", "modern"


def _publish(folder: Path, name: str, data: bytes) -> None:
    """Put another file in the place of one that octoform published, as if it were that."""
    manifest = json.loads((folder / "manifest.json").read_bytes())
    manifest["files"][name] = of_bytes(data)
    (folder / name).write_bytes(data)
    (folder / "manifest.json").write_text(json.dumps(manifest))


def _thermometer(root: Path) -> Path:
    """A host with one thermometer, which the fixture server unplugs and plugs in again."""
    device, members = root / "sys/devices/hwmon/hwmon0", root / "sys/class/hwmon"
    for folder in (device, members):
        folder.mkdir(parents=True)
    (device / "name").write_text("k10temp\n")
    (device / "subsystem").symlink_to(members)
    (members / "hwmon0").symlink_to(device)
    return root


def _names_of(server: Path) -> list[str]:
    """The tools of a server's file."""
    found = importlib.util.spec_from_file_location("fixture_server", server)
    assert found is not None and found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return [each.name for each in asyncio.run(module.mcp.list_tools())]
