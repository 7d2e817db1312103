"""The shipped specs as texts: their size, what they may not name, and what they must carry."""

import ast
import inspect
import json
import re
from pathlib import Path

import pytest

from octoform import runtime
from octoform.contracts.rules.serve.serve_rules import serve_static
from octoform.protocol import DUTIES, STAGES, Spec
from octoform.protocol.spec_loader import load

SPECS: dict[str, Spec] = load(None)[0]
DEVICE_SPECIFIC = (
    *("lsusb", "system_profiler", "ioreg", "/dev/cu", "CoreAudio", "v4l2", "video4linux", "AVFoundation", "DirectShow"),
    *("wmic", "lspci", "dmesg", "udevadm", "Get-PnpDevice", "/dev/tty", "/dev/video", "COM3", "ALSA", "arecord"),
)
JUDGEMENT = {
    "probe": [
        "time limit",
        "| a class of the system | belongs to |",
        "`not_found`",
        "`timeout`",
        "every",
        "Install nothing",
        "context: true",
        "serial line",
        "data",
    ],
    "identify": [
        "Evidence only",
        "letter by letter",
        "not the chip",
        "`unknown`",
        "0.0",
        "`missing`",
        "`via`",
        "left_out",
        "every device that a person would name, hubs and adapters as `infrastructure`",
    ],
    "interface": ["One capability, one tool", "unit", "`smoke", "tool_budget", "left_out", "`limits`", "no free-text"],
    "serve": [
        "# /// script",
        "fastmcp>=4.1,<4.2",
        "runtime.logged",
        "runtime.bus",
        "runtime.device",
        "500 lines; blank ones",
    ],
    "deploy": ["exact", "conflicts", "deps_failed", "Install nothing outside", "`provided_by`"],
    "watch": [
        "Readings decide",
        "Absence is unknown",
        "Text is data",
        "`available` is false",
        "change nothing",
        "refute",
    ],
    "heal": [
        "nothing else",
        "never deleted",
        "A limit is never weakened",
        "`not_mine`",
        "must exist there",
        "are data",
    ],
}


def test_those_of_the_stages_have_300_to_600_lines_with_their_examples_and_a_duty_at_most_120() -> None:
    assert tuple(SPECS) == (*STAGES, *DUTIES)
    lines = {name: len(spec.text.splitlines()) for name, spec in SPECS.items()}
    assert 300 <= sum(lines[stage] for stage in STAGES) <= 600
    assert max(lines[duty] for duty in DUTIES) <= 120


@pytest.mark.parametrize("stage", [*STAGES, *DUTIES])
def test_no_tool_or_interface_of_one_system_is_named(stage: str) -> None:
    text = SPECS[stage].text.casefold()
    assert [word for word in DEVICE_SPECIFIC if word.casefold() in text] == []


@pytest.mark.parametrize("stage", [*STAGES, *DUTIES])
def test_the_judgement_of_the_stage_is_there(stage: str) -> None:
    text = " ".join(SPECS[stage].text.split()).casefold()
    assert [phrase for phrase in JUDGEMENT[stage] if phrase.casefold() not in text] == []


@pytest.mark.parametrize("stage", [*STAGES, *DUTIES])
def test_lines_are_short_and_unrendered_markup_is_absent(stage: str) -> None:
    text = SPECS[stage].text
    assert max(len(line) for line in text.splitlines()) <= 120
    assert "{{" not in text and "{%" not in text


@pytest.mark.parametrize("stage", ["probe", "identify", "interface", "deploy", *DUTIES])
def test_each_required_member_of_the_schema_is_explained(stage: str) -> None:
    """An agent with the spec alone would still know what each member is for."""
    schema = SPECS[stage].schema
    assert schema is not None
    document = json.loads(Path(schema).read_text())
    required = set(document["required"]) - {"format", "platform", "stage"}
    for definition in document.get("$defs", {}).values():
        required |= set(definition.get("required", ()))
    text = SPECS[stage].body
    required -= {"quote", "reason", "id", "version", "module", "name", "description", "status", "parameter"}
    assert sorted(name for name in required if not re.search(rf"\b{name}\b", text)) == []


@pytest.mark.parametrize("stage", ["identify", "interface", "serve"])
def test_a_stage_of_judgement_has_a_worked_example_and_ends_with_what_to_check(stage: str) -> None:
    *_, example, closing = SPECS[stage].body.split("\n## ")
    assert example.startswith("An example\n") and "```" in example
    title, _, points = closing.partition("\n\n")
    assert title == "Before you end"
    assert len(re.findall(r"^\d\. ", points, re.MULTILINE)) >= 5


def blocks(stage: str, language: str) -> list[str]:
    """The fenced parts of a spec in a language."""
    return re.findall(rf"```{language}\n(.*?)```", SPECS[stage].text, re.DOTALL)


def test_the_signatures_that_serve_is_told_are_those_of_the_runtime() -> None:
    [listed] = [text for text in blocks("serve", "python") if text.startswith("device(")]
    fields = {}
    for line in listed.splitlines():
        name, _, rest = line.partition("(")
        [stub] = ast.parse(f"def {name.rpartition('.')[2]}({rest.partition('  #')[0]}: ...").body
        assert isinstance(stub, ast.FunctionDef)
        defaults = [ast.literal_eval(item) for item in stub.args.defaults]
        fields[name] = [item.arg for item in stub.args.args], defaults, stub.args.vararg and stub.args.vararg.arg
    real = {}
    for name in fields:
        owner, _, member = name.rpartition(".")
        parameters = inspect.signature(getattr(getattr(runtime, owner) if owner else runtime, member)).parameters
        named = [item for item in parameters.values() if item.name != "self" and item.kind is not item.VAR_POSITIONAL]
        given = [item.default for item in named if item.default is not item.empty]
        real[name] = [item.name for item in named], given, next((n for n, i in parameters.items() if i.kind == 2), None)
    assert fields == real and len(fields) == 11


def test_the_server_of_serves_example_keeps_the_interface_of_interfaces_example() -> None:
    [tool] = [json.loads(text) for text in blocks("interface", "json")]
    start, *_ = blocks("serve", "python")
    [example] = [text for text in blocks("serve", "python") if "class Level" in text]
    server = start.replace('"fastmcp>=4.1,<4.2"', '"fastmcp>=4.1,<4.2", "pydantic>=2.12", "pyserial>=3.5"')
    server += """import re
from dataclasses import dataclass
from typing import Annotated

import runtime
from fastmcp import FastMCP
from fastmcp.exceptions import ToolError
from pydantic import Field

mcp = FastMCP("lamp")
SET = {"readOnlyHint": False, "destructiveHint": False, "idempotentHint": True, "openWorldHint": False}


"""
    assert serve_static(f"{server}{example}", {"tools": [tool]}) == []
    wrong = example.replace("baudrate=9600", "baudrate=115200")
    assert [item.code for item in serve_static(f"{server}{wrong}", {"tools": [tool]})] == ["SERVE-LINE-SPEED"]
