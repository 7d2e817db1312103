"""Hostile strings as what devices call themselves: through the embedded agent's stages, and from any other agent."""

import ast
import asyncio
import importlib.util
import json
import sys
from collections.abc import Callable, Iterator
from copy import deepcopy
from operator import attrgetter
from pathlib import Path
from typing import Any

import pytest
from cases import share
from hostile_strings import LAPTOPS, STRINGS, TOGETHER, Hostile, laptop_named, of_laptop

from octoform.base.escaping import is_hidden
from octoform.base.id_databases import IdDatabases
from octoform.builtin.identify import identify
from octoform.builtin.interface import declare
from octoform.builtin.probe import probe_root
from octoform.builtin.probe.kernel_text import visible
from octoform.builtin.serve.stage import render
from octoform.contracts.artifact_parser import parse
from octoform.contracts.contract_check import check
from octoform.contracts.model import Artifacts

SCHEMAS = Path(__file__).parents[3] / "protocol" / "schemas"
HIDING = [item for item in STRINGS if any(is_hidden(sign) and sign not in "\n\t" for sign in item.text)]
LONGEST = 4000


def texts(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for name, item in value.items():
            yield name
            yield from texts(item)
    elif isinstance(value, list):
        for item in value:
            yield from texts(item)


def shows_everything(value: Any) -> bool:
    return not any(is_hidden(sign) for sign in {*"".join(texts(value))} - {*"\n\t"})


def artifacts(root: Path) -> tuple[Any, Any, Any]:
    probed: Any = probe_root(root)
    known = identify(probed, IdDatabases(root))
    return probed, known, declare(known, 30)


def test_there_are_many_and_of_every_kind() -> None:
    assert len(STRINGS) >= 80
    assert len({item.name for item in STRINGS}) == len(STRINGS)
    assert len({item.kind for item in STRINGS}) >= 15
    assert len(HIDING) >= 25


def test_the_text_of_a_device_reaches_the_artifacts(planted: Callable[..., Path]) -> None:
    """Otherwise the tests below would prove nothing."""
    plain = next(item for item in STRINGS if item.name == "orders-english")
    probed, known, declared = artifacts(planted("laptop", laptop_named(plain)))
    shown = plain.text
    assert sum(shown in device["raw_descriptor"] for device in probed["devices"]) >= 4
    assert sum(shown in device["identified_as"] for device in known["devices"]) >= 1
    assert probed["hostname"] == shown
    assert len(declared["tools"]) > 5


def test_each_string_is_of_one_laptop() -> None:
    laptops = [of_laptop(number) for number in range(LAPTOPS)]
    assert sorted(item.name for named in laptops for item in named) == sorted(item.name for item in STRINGS)
    assert all(1 <= len(named) <= TOGETHER for named in laptops)


@pytest.mark.parametrize(
    "number", share(range(LAPTOPS), 3), ids=lambda number: "+".join(item.name for item in of_laptop(number))
)
def test_a_laptop_of_these_names_is_onboarded(number: int, planted: Callable[..., Path]) -> None:
    probed, known, declared = artifacts(planted("laptop", laptop_named(*of_laptop(number))))
    before: dict[str, Any] = {}
    for stage, value in (("probe", probed), ("identify", known), ("interface", declared)):
        data = json.dumps(value, ensure_ascii=False).encode()
        assert parse(stage, data, "output.json") == (value, [])
        assert check(stage, value, Artifacts(**before), SCHEMAS) == []
        assert shows_everything(value)
        assert max(map(len, texts(value))) <= LONGEST
        before[stage] = value
    server = render(declared)
    assert check("serve", server, Artifacts(**before), SCHEMAS) == []
    assert server.isprintable() or shows_everything(server)


def test_the_server_is_the_same_program_whatever_its_devices_are_called() -> None:
    """All strings as names of devices behind one tool each: only literals differ, and nothing of them is run."""
    shape = None
    for item in STRINGS:
        tree = ast.parse(render(declare(_known(visible(item.text)[:300]), 30)))
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                node.value = ""
        shape = shape or ast.dump(tree)
        assert ast.dump(tree) == shape, item.name


@pytest.mark.parametrize("name", ["osc-link", "tags-block", "python-docstring"])
def test_descriptions_that_a_client_sees_carry_no_control_characters(name: str, tmp_path: Path) -> None:
    raw = next(item for item in STRINGS if item.name == name).text
    (tool,) = _tools(render(declare(_known(visible(raw)[:300]), 30)), tmp_path)
    assert tool["inputSchema"]["properties"]["device"]["description"].startswith('device id ("')
    assert shows_everything(tool)


def _known(*names: str) -> dict[str, Any]:
    capability = {"name": "read_temperature", "description": "x", "via": "hwmon", "effect": "read"}
    devices = [
        {"id": f"hwmon-{number}", "identified_as": name, "category": "sensor", "capabilities": [capability]}
        for number, name in enumerate(names)
    ]
    return {"format": 1, "devices": devices, "left_out": []}


def _tools(server: str, folder: Path) -> list[dict[str, Any]]:
    from octoform import runtime

    (folder / "server.py").write_text(server, encoding="utf-8")
    found = importlib.util.spec_from_file_location("hostile_server", folder / "server.py")
    assert found is not None and found.loader is not None
    module = importlib.util.module_from_spec(found)
    before = sys.modules.get("runtime")
    sys.modules["runtime"] = runtime
    try:
        found.loader.exec_module(module)
    finally:
        del sys.modules["runtime"]
        if before is not None:
            sys.modules["runtime"] = before
    tools = asyncio.run(module.mcp.list_tools())
    return [tool.to_mcp_tool(name=tool.name).model_dump(mode="json", by_alias=True) for tool in tools]


PLACES: dict[str, Any] = {
    "probe": [("devices", 0, "name"), ("devices", 0, "raw_descriptor"), ("scan_methods", 0, "detail")],
    "identify": [("devices", 0, "identified_as"), ("devices", 0, "capabilities", 0, "description")],
    "interface": [("tools", 0, "description"), ("tools", 0, "input_schema", "properties", "device", "description")],
}


@pytest.mark.parametrize("hostile", share(HIDING, 3, attrgetter("kind")), ids=lambda item: item.name)
def test_an_agent_that_copies_it_raw_is_refused(hostile: Hostile, good: dict[str, Any]) -> None:
    before: dict[str, Any] = {}
    for stage, places in PLACES.items():
        for place in places:
            value = _with(good[stage], place, hostile.text)
            data = json.dumps(value).encode()
            parsed, found = parse(stage, data, "output.json")
            found = found or check(stage, parsed, Artifacts(**before), SCHEMAS)
            assert found, (stage, place)
            assert all(shows_everything([item.summary, item.hint or "", item.pointer or ""]) for item in found)
        before[stage] = good[stage]


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    from hosts.plant import plant

    values = artifacts(plant("laptop", tmp_path_factory.mktemp("good") / "laptop"))
    return dict(zip(("probe", "identify", "interface"), values, strict=True))


def _with(value: Any, place: tuple[str | int, ...], text: str) -> Any:
    changed = deepcopy(value)
    inner = changed
    for step in place[:-1]:
        inner = inner[step]
    inner[place[-1]] = text
    return changed
