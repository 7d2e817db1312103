"""INTERFACE and DEPLOY artifacts by the dozen, and what a reading may send over an unknown line."""

import copy
import json
from dataclasses import replace
from typing import Any

import pytest
import wrong_deploys
import wrong_interfaces
from bench_host import desk
from cases import for_each
from server_edits import WHOLE, adds, all_of, line
from unit.contracts.contract_samples import SCHEMAS

from octoform.base.id_databases import IdDatabases
from octoform.builtin.identify import identify
from octoform.builtin.interface import declare
from octoform.builtin.probe import probe_root
from octoform.builtin.serve.stage import render
from octoform.contracts import ProfileFacts
from octoform.contracts.contract_check import check
from octoform.contracts.model import Artifacts

SENSOR = "hwmon-benchtemp"
WARNED = ("DEPLOY-VERSION-EARLY", "DEPLOY-FAILED-UNKNOWN")
MILD = ("a lamp that destroys",)
"""What cannot be proved wrong is reported and accepted."""


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> Artifacts:
    """PROBE, IDENTIFY and INTERFACE of the desk, and the server that the embedded agent writes for it."""
    host = desk(tmp_path_factory.mktemp("desk") / "host")
    probe = probe_root(host)
    found = identify(probe, IdDatabases(host))
    interface = declare(found, 30)
    return Artifacts(probe=probe, identify=found, interface=interface, serve=render(interface))


def severities(stage: str, value: Any, artifacts: Artifacts) -> dict[str, str]:
    return {item.code: item.severity.value for item in check(stage, value, artifacts, SCHEMAS)}


@for_each("case", wrong_interfaces.WRONG, every=3, kind=lambda case: wrong_interfaces.WRONG[case][1])
def test_a_wrong_interface_is_told_what_is_wrong(case: str, known: Artifacts) -> None:
    change, code = wrong_interfaces.WRONG[case]
    value = copy.deepcopy(known.interface)
    change(value)
    found = severities("interface", value, known)
    mild = code in WARNED or case in MILD
    assert found.get(code) == ("warning" if mild else "error"), found


def test_a_right_interface_in_unusual_words_gives_no_finding(known: Artifacts) -> None:
    assert known.interface is not None
    value = copy.deepcopy(known.interface)
    wrong_interfaces.RIGHT(value)
    assert severities("interface", value, known) == {}


@for_each("case", wrong_deploys.WRONG)
def test_a_wrong_set_of_packages_is_told_what_is_wrong(case: str) -> None:
    change, code = wrong_deploys.WRONG[case]
    value = copy.deepcopy(wrong_deploys.GOOD)
    change(value)
    found = severities("deploy", value, Artifacts(serve=wrong_deploys.SERVER, python="3.11.7"))
    assert found.get(code) == ("warning" if code in WARNED else "error"), found


def test_a_right_set_of_packages_gives_no_finding() -> None:
    value = copy.deepcopy(wrong_deploys.GOOD)
    assert severities("deploy", value, Artifacts(serve=wrong_deploys.SERVER, python="3.11.7")) == {}
    wrong_deploys.RIGHT(value)
    assert severities("deploy", value, Artifacts(serve=wrong_deploys.SERVER, python="3.11.7")) == {}


def test_what_the_header_of_the_server_states_needs_no_purpose_and_what_it_does_not_needs_one() -> None:
    value = copy.deepcopy(wrong_deploys.GOOD)
    value["requirements"].append({"name": "pillow", "version": "11.0.0", "why": "encoder"})
    stated = wrong_deploys.SERVER.replace('"pyserial~=3.5"', '"pyserial~=3.5", "pillow>=11"')
    assert severities("deploy", value, Artifacts(serve=stated, python="3.11.7")) == {}
    without = severities("deploy", value, Artifacts(serve=wrong_deploys.SERVER, python="3.11.7"))
    assert [*without] == ["DEPLOY-REQUIREMENT-UNUSED"]


# What a reading sends, and whether it is fixed; `goal` and `channel` are parameters of the caller's.
SENT = {
    "a literal": ("port.write(b'T?')", True),
    "a choice of two": ("port.write(b'T1?' if channel == 'in' else b'T2?')", True),
    "a table": ("port.write(REQUESTS[channel])", True),
    "a table, coded": ("port.write(TEXTS.get(channel).encode('ascii'))", True),
    "a table, through a helper": ("ask(port, REQUESTS[channel])", True),
    "a formatted goal": ("port.write(f'T{goal}'.encode())", False),
    "a goal put on": ("port.write(b'T' + str(goal).encode())", False),
    "a goal by way of a name": ("text = 'T%d' % goal\nport.write(text.encode())", False),
    "a goal through a helper": ("ask(port, b'T%d' % goal)", False),
    "a goal in a list": ("port.writelines([b'T', str(goal).encode()])", False),
    "a computed frame": ("port.write(bytes(json.loads('[255, 255, 1]')))", False),
    "a coded frame": ("port.write(b85decode('s8N'))", False),
    "an answer sent back": ("port.write(port.read(4))", False),
    "a library's question": ("Meter(port).query(goal)", False),
    "a control of a driver": ("Meter(port).ioctl(goal)", False),
    "a stream that is copied": ("shutil.copyfileobj(io.BytesIO(b'T%d' % goal), port)", False),
    "a method by its name": ("operator.methodcaller('write', b'T%d' % goal)(port)", False),
    "a port's write, handed on": ("list(map(port.write, [b'T%d' % goal]))", False),
}


def steered(known: Artifacts, talk: str) -> tuple[str, Artifacts]:
    """The desk's server, whose thermometer is behind a raw line and takes a goal and a channel."""
    probe = copy.deepcopy(known.probe)
    assert probe is not None and known.serve is not None
    next(device for device in probe["devices"] if device["id"] == SENSOR)["classes"] = ["tty"]
    more = """
        REQUESTS = {"in": b"T1?", "out": b"T2?"}
        TEXTS = {"in": "T1?", "out": "T2?"}

        def ask(port, text):
            port.write(text)
        """
    edit = all_of(adds(more), line(WHOLE, f"{talk}\nvalue = float(port.readline())"))
    text = edit(known.serve).replace("def read_temperature(", "def read_temperature(goal: int, channel: str, ")
    return text, replace(known, probe=probe)


@for_each("case", SENT, every=3)
def test_what_a_reading_sends_over_an_unknown_line_is_fixed(case: str, known: Artifacts) -> None:
    talk, fixed = SENT[case]
    text, behind = steered(known, talk)
    assert severities("serve", text, behind).keys() == (set() if fixed else {"SERVE-LINE-WRITTEN"})


def test_who_knows_the_line_may_send_more(known: Artifacts) -> None:
    text, behind = steered(known, SENT["a formatted goal"][0])
    assert severities("serve", text, replace(behind, answers={SENSOR: "a heater: T and a number"})) == {}
    assert severities("serve", text, known) == {}  # no raw line
    found = copy.deepcopy(behind.identify)
    assert found is not None
    next(device for device in found["devices"] if device["id"] == SENSOR)["profile"] = "heater"
    profiles = {"heater": ProfileFacts("heater", frozenset({SENSOR}))}
    assert severities("serve", text, replace(behind, identify=found, profiles=profiles)) == {}


def test_a_reading_over_an_unknown_line_takes_no_goal(known: Artifacts) -> None:
    _, behind = steered(known, SENT["a literal"][0])
    assert known.interface is not None
    value = copy.deepcopy(known.interface)
    taken = wrong_interfaces.tool(value, "read_temperature")["input_schema"]["properties"]
    taken["channel"] = {"type": "string", "enum": ["in", "out"], "default": "in"}
    assert severities("interface", value, behind) == {}
    taken["goal_position"] = {"type": "integer", "minimum": 0, "maximum": 4095, "default": 0}
    assert severities("interface", value, behind) == {"INTERFACE-READ-MOVES": "error"}
    assert severities("interface", value, known) == {"INTERFACE-PARAMETER-FOREIGN": "error"}
    assert json.dumps(value)
