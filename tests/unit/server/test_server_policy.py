"""The policy is read whole or refused with the place that is wrong; the stop actions are read whatever else is."""

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from octoform.policy.kinds import Cumulative, QuietHours, Range, Rate
from octoform.policy.published import PolicyInvalid, StopAction, parse, read, stop_actions

DOCUMENT: dict[str, Any] = {
    "format": 1,
    "mode": "enforce",
    "tools": {
        "move": {
            "effect": "actuate",
            "decision": "confirm",
            "source": "policy.rules[0]",
            "timeout": 30,
            "result_bytes": 10_000_000,
            "buses": ["usb-2", "usb-1", "usb-2"],
            "limits": [
                {"kind": "range", "parameter": "x", "minimum": None, "maximum": 3.5, "unit": "mm", "source": "p"},
                {"kind": "rate", "calls": 10, "seconds": 60, "source": "p"},
                {"kind": "quiet_hours", "from": "22:00", "to": "24:00", "source": "p"},
                {"kind": "cumulative", "parameter": "x", "most": 0, "default": 2, "source": "p"},
            ],
        }
    },
    "stop": [{"device": "usb-1", "class": "tty", "baud": 1000000, "write": "fffe", "source": "profile arm"}],
}


def test_everything_is_read() -> None:
    policy = parse(DOCUMENT)
    tool = policy.tools["move"]
    assert (policy.mode, tool.effect, tool.decision, tool.timeout) == ("enforce", "actuate", "confirm", 30)
    assert tool.buses == ("usb-1", "usb-2")
    assert tool.limits == (
        Range("p", parameter="x", maximum=3.5, unit="mm"),
        Rate("p", calls=10, seconds=60),
        QuietHours("p", begin=22 * 60, end=0),
        Cumulative("p", parameter="x", sum="x", most=0, default=2),
    )
    assert policy.stop == (StopAction("usb-1", "tty", 1000000, b"\xff\xfe", "profile arm"),)


def limit(**changes: Any) -> Callable[[dict[str, Any]], None]:
    return lambda document: document["tools"]["move"]["limits"].__setitem__(
        0, {"kind": "range", "parameter": "x", "minimum": 0, "maximum": 1, "source": "p", **changes}
    )


def tool(**changes: Any) -> Callable[[dict[str, Any]], None]:
    return lambda document: document["tools"]["move"].update(changes)


BROKEN: list[tuple[Callable[[dict[str, Any]], None], str]] = [
    (lambda document: document.update(format=2), "it has format 2, and this octoform reads 1"),
    (lambda document: document.update(mode="off"), "mode is 'off'"),
    (lambda document: document.pop("tools"), "tools is no object"),
    (tool(effect="harmless"), "tools.move.effect is 'harmless'"),
    (tool(decision=["allow"]), "tools.move.decision is"),
    (tool(timeout=0), "tools.move.timeout is 0"),
    (tool(timeout=True), "no finite number"),
    (tool(result_bytes=1.5), "no integer"),
    (tool(buses="usb-1"), "tools.move.buses is no array"),
    (tool(limits=[1]), "tools.move.limits[0] is no object"),
    (limit(kind="size"), "limits[0].kind is 'size'"),
    (limit(minimum="0"), "limits[0].minimum is '0'"),
    (limit(maximum=float("nan")), "NaN is no finite number"),
    (limit(minimum=None, maximum=None), "needs minimum or maximum"),
    (limit(parameter=""), "limits[0].parameter is empty"),
    (limit(kind="step", most=-1), "limits[0].most is -1"),
    (limit(kind="step"), "limits[0].most is None"),
    (limit(kind="cooldown"), "limits[0].seconds is None"),
    (limit(kind="rate", calls=0, seconds=1), "limits[0].calls is 0"),
    (limit(kind="quiet_hours", **{"from": "22:60", "to": "07:00"}), "no time of day"),
    (limit(kind="quiet_hours", **{"from": "24:01", "to": "07:00"}), "no time of day"),
    (limit(kind="quiet_hours", **{"from": "²:00", "to": "07:00"}), "no time of day"),
    (lambda document: document["stop"][0].update(write="xy"), "stop[0].write is not hexadecimal"),
    (lambda document: document["stop"][0].update(baud="9600"), "stop[0].baud is '9600'"),
]


@pytest.mark.parametrize(("change", "text"), BROKEN, ids=[text for _, text in BROKEN])
def test_what_is_not_foreseen_is_refused_with_its_place(
    tmp_path: Path, change: Callable[[dict[str, Any]], None], text: str
) -> None:
    document = copy.deepcopy(DOCUMENT)
    change(document)
    (tmp_path / "policy.json").write_text(json.dumps(document))
    with pytest.raises(PolicyInvalid) as refused:
        read(tmp_path / "policy.json")
    assert text in str(refused.value)
    assert str(tmp_path / "policy.json") in str(refused.value)


@pytest.mark.parametrize("data", [b"", b"{", b"[" * 100_000, b"\xff"], ids=["empty", "cut", "deep", "no text"])
def test_a_file_that_is_no_json_is_refused(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "policy.json").write_bytes(data)
    with pytest.raises(PolicyInvalid):
        read(tmp_path / "policy.json")
    assert stop_actions(tmp_path / "policy.json")[0] == ()


def test_stop_actions_are_read_from_a_policy_that_is_otherwise_wrong(tmp_path: Path) -> None:
    document = {"format": 99, "tools": 3, "stop": [{"device": "x"}, *DOCUMENT["stop"]]}
    (tmp_path / "policy.json").write_text(json.dumps(document))
    found, problems = stop_actions(tmp_path / "policy.json")
    assert [action.device for action in found] == ["usb-1"]
    assert len(problems) == 1 and "stop[0]." in problems[0]
