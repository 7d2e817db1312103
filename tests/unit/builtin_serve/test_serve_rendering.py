"""The text of the server: complete, readable, the same every time, and with nothing of classes that are not there."""

import ast
import asyncio
import importlib.util
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from ruff import find_ruff_bin
from unit.builtin_serve.invented_host import DEVICES, interface

from octoform.base.source_lines import counted
from octoform.builtin.interface import KINDS
from octoform.builtin.serve import stage
from octoform.builtin.serve.stage import MAX_LINES, SECTIONS, render
from octoform.builtin.task import Task, TaskRefused

ALL = tuple(KINDS)
RARE = ("counters", "position", "outputs", "printer")
ONE_OF_EACH_CLASS = tuple(names[0] for section, names in SECTIONS.items() if section not in RARE)


def rendered(only: tuple[str, ...] | None, monkeypatch: pytest.MonkeyPatch) -> tuple[str, dict[str, Any]]:
    """A server of these capabilities, whatever its length."""
    monkeypatch.setattr(stage, "MAX_LINES", 5000)
    monkeypatch.setattr("octoform.builtin.interface.MAX_LINES", 5000)
    artifact = interface(only)
    return render(artifact), artifact


def loaded(text: str, folder: Path) -> Any:
    """The server as a module, its tools as a client sees them under `tools`."""
    from octoform import runtime

    (folder / "server.py").write_text(text)
    specification = importlib.util.spec_from_file_location("generated_server", folder / "server.py")
    assert specification is not None and specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    before = sys.modules.get("runtime")
    sys.modules["runtime"] = runtime
    try:
        specification.loader.exec_module(module)
    finally:
        del sys.modules["runtime"]
        if before is not None:
            sys.modules["runtime"] = before
    return module


def declared(module: Any) -> dict[str, dict[str, Any]]:
    tools = asyncio.run(module.mcp.list_tools())
    return {tool.name: tool.to_mcp_tool(name=tool.name).model_dump(mode="json", by_alias=True) for tool in tools}


def bare(schema: Any) -> Any:
    """A schema without annotations."""
    if isinstance(schema, dict):
        return {key: bare(value) for key, value in schema.items() if key != "$comment" and not _is_title(key, value)}
    return [bare(item) for item in schema] if isinstance(schema, list) else schema


def _is_title(key: str, value: Any) -> bool:
    return key == "title" and isinstance(value, str)


def test_every_tool_of_the_catalog_has_a_template() -> None:
    assert {name for names in SECTIONS.values() for name in names} == set(KINDS)
    assert {name for names in DEVICES.values() for name in names} == set(KINDS)


def test_schemas_and_annotations_are_those_of_the_artifact(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text, artifact = rendered(None, monkeypatch)
    served = declared(loaded(text, tmp_path))
    assert served.keys() == {tool["name"] for tool in artifact["tools"]} == set(KINDS)
    for tool in artifact["tools"]:
        found = served[tool["name"]]
        assert bare(found["inputSchema"]) == bare(tool["input_schema"]), tool["name"]
        assert bare(found["outputSchema"]) == bare(tool["output_schema"]), tool["name"]
        assert found["annotations"].items() >= tool["annotations"].items()
        assert " ".join(found["description"].split()) == tool["description"]


def test_narrower_ranges_and_other_names_of_an_artifact_are_served(tmp_path: Path) -> None:
    artifact = interface(("set_brightness",))
    tool = artifact["tools"][0]
    tool["name"] = "panel.set-brightness"
    tool["description"] = 'Says "how bright"\\n and\nmore'
    tool["input_schema"]["properties"]["percent"] |= {"minimum": 10, "maximum": 55.5}
    found = declared(loaded(render(artifact), tmp_path))["panel.set-brightness"]
    assert found["inputSchema"]["properties"]["percent"]["maximum"] == 55.5
    assert found["description"] == tool["description"]


def test_tools_for_different_devices_have_different_choices(tmp_path: Path) -> None:
    artifact = interface(("read_led", "set_led", "read_brightness"))
    tools = {tool["name"]: tool for tool in artifact["tools"]}
    for name, devices in {"read_led": ["b", "c"], "set_led": ["a", "b"], "read_brightness": ["3d-lamp"]}.items():
        choice = {"const": "3d-lamp", "default": "3d-lamp"} if len(devices) == 1 else {"enum": devices}
        schema = tools[name]["input_schema"]
        tools[name]["devices"] = devices
        schema["properties"]["device"] = {"type": "string", "description": "device id", **choice}
        schema["required"] = [one for one in schema["properties"] if one != "device" or len(devices) > 1]
    served = declared(loaded(render(artifact), tmp_path))
    for name, tool in tools.items():
        assert bare(served[name]["inputSchema"])["properties"] == tool["input_schema"]["properties"], name


def test_the_same_artifact_gives_the_same_bytes() -> None:
    assert render(interface()) == render(interface())


@pytest.mark.parametrize("only", [None, *((name,) for name in ALL), ONE_OF_EACH_CLASS], ids=str)
def test_formatted_and_without_a_finding(
    only: tuple[str, ...] | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text, _ = rendered(only, monkeypatch)
    ast.parse(text, feature_version=(3, 10))
    (tmp_path / "server.py").write_text(text)
    (tmp_path / "runtime").mkdir()
    options = ["--isolated", "--no-cache", "--line-length=120", "--target-version=py310"]
    rules = ["--select=E,F,W,I,B,C90,RET,SIM,ERA,UP", "--ignore=UP013"]
    for command in (["format", "--diff"], ["check", "--output-format=concise", *rules]):
        arguments = [find_ruff_bin(), command[0], *options, *command[1:], "server.py"]
        done = subprocess.run(arguments, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr


def test_never_longer_than_the_protocol_allows() -> None:
    assert len(counted(render(interface()))) <= MAX_LINES
    assert len(counted(render(interface(ONE_OF_EACH_CLASS)))) <= MAX_LINES


def test_one_tool_of_every_class_of_an_ordinary_computer_fits() -> None:
    assert [tool["name"] for tool in interface(ONE_OF_EACH_CLASS)["tools"]] == sorted(
        ONE_OF_EACH_CLASS, key=list(KINDS).index
    )


def test_a_class_that_is_not_there_leaves_no_trace() -> None:
    text = render(interface(("read_clock",)))
    for word in ("cv2", "opencv", "ToolError", "fcntl", "hwmon", "iio", "video", "alsa", "Reading", "gpio", "drm"):
        assert word not in text, word
    assert text.count("mcp.tool(") == 1


def test_only_the_kernel_interfaces_that_were_found_are_read() -> None:
    artifact = interface(("read_temperature",))
    artifact["tools"][0]["output_schema"] = {**artifact["tools"][0]["output_schema"], "$comment": "sources: thermal"}
    text = render(artifact)
    assert re.findall(r"runtime\.channels\.([a-z]+)\(", text) == ["thermal"]


def test_an_empty_interface_gives_an_empty_server(tmp_path: Path) -> None:
    text = render({"format": 1, "tools": [], "left_out": []})
    assert declared(loaded(text, tmp_path)) == {}


def test_a_device_that_names_itself_badly_stays_data(tmp_path: Path) -> None:
    artifact = interface(("read_clock",))
    artifact["tools"][0]["input_schema"]["properties"]["device"]["description"] = 'x"); import os #\n\\'
    artifact["tools"][0]["description"] = 'ends with quotes """ and a backslash \\'
    found = declared(loaded(render(artifact), tmp_path))["read_clock"]
    assert found["inputSchema"]["properties"]["device"]["description"] == 'x"); import os #\n\\'
    assert found["description"] == 'ends with quotes """ and a backslash \\'


def test_a_capability_without_a_template_is_refused() -> None:
    artifact = interface(("read_clock",))
    artifact["tools"][0]["capability"] = "fly_away"
    with pytest.raises(TaskRefused, match="no template implements fly_away"):
        render(artifact)


def test_a_server_that_would_be_too_long_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    artifact = interface(("read_clock",))
    monkeypatch.setattr(stage, "MAX_LINES", 20)
    with pytest.raises(TaskRefused, match="more than 20"):
        render(artifact)


def test_an_artifact_that_is_none_is_refused() -> None:
    with pytest.raises(TaskRefused, match="cannot be rendered"):
        render({"tools": [{"name": "x"}]})


def test_the_stage_writes_its_output(tmp_path: Path) -> None:
    import json

    source, output = tmp_path / "interface.json", tmp_path / "server.py"
    source.write_text(json.dumps(interface(("read_clock",))))
    summary = stage.run(Task("serve", source, None, output, 30, Path("/")))
    assert summary.startswith("server.py: 1 tool")
    assert output.read_text().endswith("mcp.run(show_banner=False)\n")
