"""The evidence rule: truth tables, totality, and what is refused."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from octoform.profiles import Profile, briefing, devices_of, load, match_rule, near, packaging

ARM = Path(__file__).parents[3] / "profiles" / "so-arm101.md"


@pytest.fixture(scope="module")
def arm() -> Profile:
    """The shipped profile of the arm."""
    profiles, found = load([ARM])
    assert found == []
    return profiles[0]


def device(vid: str, pid: str, text: str, **more: object) -> dict[str, Any]:
    fields = {"id": "usb-x", "name": "USB Serial", "interface": "usb", "raw_descriptor": text}
    return {**fields, "vid": vid, "pid": pid, "classes": ["tty"], "drivers": ["ch341"], **more}


@pytest.mark.parametrize("chip", [("1a86", "7523"), ("1a86", "55d3")])
@pytest.mark.parametrize("word", ["Feetech", "STS3215", "LeRobot", "SO-ARM100", "SO-ARM101", "lerobot", "feetech"])
def test_the_arm_needs_a_known_chip_and_a_word(arm: Profile, chip: tuple[str, str], word: str) -> None:
    chip_and_word = {"devices": [device(*chip, f"product: {word} bus board")]}
    chip_only = {"devices": [device(*chip, "product: USB Serial")]}
    word_only = {"devices": [device("0403", "6001", f"product: {word} bus board")]}
    neither = {"devices": [device("0403", "6001", "product: USB Serial")]}
    assert devices_of(arm, chip_and_word) == {"usb-x"}
    assert devices_of(arm, chip_only) == frozenset()
    assert devices_of(arm, word_only) == frozenset()
    assert devices_of(arm, neither) == frozenset()


def test_the_word_must_be_said_of_that_very_device(arm: Profile) -> None:
    other = device("0403", "6001", "product: LeRobot camera mount", id="usb-y")
    assert devices_of(arm, {"devices": [device("1a86", "7523", ""), other]}) == frozenset()


def test_only_whole_words_count(arm: Profile) -> None:
    for text in ("SO-ARM1010", "xFeetech", "FeetechX"):
        assert devices_of(arm, {"devices": [device("1a86", "7523", text)]}) == frozenset()


def test_a_neighbour_is_never_met(arm: Profile) -> None:
    assert devices_of(arm, {"devices": [device("1a86", "7523", "LeRobot", context=True)]}) == frozenset()


def rule(value: object) -> match_rule.Rule:
    found, problems = match_rule.read(value, ())
    assert problems == []
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ({"class": "tty"}, True),
        ({"class": ["sound", "tty"]}, True),
        ({"class": "TTY"}, False),
        ({"driver": "ch341"}, True),
        ({"driver": "ftdi_sio"}, False),
        ({"interface": "usb"}, True),
        ({"interface": "pci"}, False),
        ({"vid_pid": "1A86:7523"}, True),
        ({"text": "usb serial"}, True),
        ({"not": {"text": "usb serial"}}, False),
        ({"not": {"not": {"class": "tty"}}}, True),
        ({"all": [{"class": "tty"}, {"driver": "nope"}]}, False),
        ({"any": [{"class": "nope"}, {"driver": "ch341"}]}, True),
    ],
)
def test_single_rules(value: object, expected: bool) -> None:
    assert match_rule.holds(rule(value), device("1a86", "7523", "")) is expected


@pytest.mark.parametrize(
    "value",
    [
        *(None, [], {}, "text", {"text": []}, {"text": [""]}, {"text": 7}, {"any": []}, {"any": {}}, {"all": None}),
        *(
            {"vid_pid": "1a86"},
            {"vid_pid": ["1a86:7523", "*"]},
            {"exec": "x"},
            {"not": []},
            {"text": "a", "class": "b"},
        ),
        *({"any": [{"text": "a"}, {"regex": ".*"}]}, {"any": [{"text": f"w{n}"} for n in range(101)]}),
    ],
)
def test_what_is_no_rule(value: object) -> None:
    found, problems = match_rule.read(value, ("evidence",))
    assert found is None
    assert problems and all(place[0] == "evidence" for place, _, _ in problems)


def test_depth_is_bounded() -> None:
    value: object = {"text": "a"}
    for _ in range(match_rule.MAX_DEPTH):
        value = {"not": value}
    assert match_rule.read(value, ())[0] is None


tests = st.fixed_dictionaries({"text": st.sampled_from(["a", "b"])}) | st.fixed_dictionaries({"class": st.just("tty")})
rules = st.recursive(
    tests,
    lambda inner: (
        st.fixed_dictionaries({"not": inner})
        | st.fixed_dictionaries({"any": st.lists(inner, min_size=1, max_size=3)})
        | st.fixed_dictionaries({"all": st.lists(inner, min_size=1, max_size=3)})
    ),
    max_leaves=6,
)
junk = st.recursive(st.none() | st.integers() | st.text(max_size=5), lambda x: st.lists(x, max_size=3), max_leaves=5)


@given(rules, st.dictionaries(st.sampled_from(["name", "raw_descriptor", "vid", "classes", "drivers"]), junk))
def test_every_rule_has_an_answer_for_every_device(value: object, facts: dict[str, Any]) -> None:
    found, problems = match_rule.read(value, ())
    if found is not None:
        assert match_rule.holds(found, facts) is not match_rule.holds(match_rule.Rule("not", (found,)), facts)
    else:
        assert problems


@given(junk)
def test_holds_never_raises(arm: Profile, probe: object) -> None:
    assert devices_of(arm, probe) == frozenset()
    assert devices_of(arm, {"devices": probe}) == frozenset()
    assert devices_of(arm, {"devices": [probe, {"id": probe}]}) == frozenset()


def test_the_arms_stop_switches_the_torque_of_every_servo_off(arm: Profile) -> None:
    (stop,) = arm.stop
    assert (stop.kind, stop.baud) == ("tty", 1_000_000)
    header, everyone, length, write, register, off, check = stop.write[:2], *stop.write[2:]
    assert (header, everyone, length, write, register, off) == (b"\xff\xff", 254, 4, 3, 40, 0)
    assert check == ~sum(stop.write[2:-1]) & 0xFF


@pytest.mark.parametrize(
    ("limit", "told"),
    [
        ({"parameter": "x", "maximum": 3, "unit": "V"}, ["x at most 3 V"]),
        ({"tool": "t", "parameter": "x", "minimum": 0}, ["x of t at least 0"]),
        (
            {"parameter": "x", "step": 5, "unit": "mm"},
            ["x: from call to call no further than 5 mm; the endpoint itself sees to it"],
        ),
        (
            {"tool": "t", "parameter": "x", "maximum": 9, "cumulative": 50, "cooldown": "2s"},
            [
                "x of t at most 9",
                "x of t: all values added up within 50 in both directions, at least 2s between two calls; "
                "the endpoint itself sees to it",
            ],
        ),
        ({"tool": "set_*", "rate": "10/1m"}, ["set_*: at most 10 calls in 1m; the endpoint itself sees to it"]),
        ({"tool": "t", "rate": "1/30s"}, ["t: at most 1 call in 30s; the endpoint itself sees to it"]),
        (
            {"tool": "t", "quiet_hours": "22:00-07:00"},
            ["t: no calls from 22:00 to 07:00; the endpoint itself sees to it"],
        ),
    ],
)
def test_every_limit_is_told_in_words(arm: Profile, limit: dict[str, Any], told: list[str]) -> None:
    text = briefing(replace(arm, limits=(limit,)), {"usb-x"})
    assert [line for line in text.splitlines() if line.startswith("Limit")] == [f"Limit: {words}." for words in told]


def test_a_briefing_names_devices_and_limits(arm: Profile) -> None:
    text = briefing(arm, {"usb-1a86-7523"})
    assert text.startswith("Profile so-arm101: ")
    assert "matches: usb-1a86-7523." in text
    assert "Limit: position at least 0 and at most 4095 raw." in text
    assert "shoulder_pan" in text


def test_deploy_is_told_of_packages_and_files_alone(arm: Profile) -> None:
    text = packaging(arm, {"usb-1a86-7523"})
    assert "Its library: feetech-servo-sdk, imported as scservo_sdk." in text
    assert "~/.cache/huggingface/lerobot/calibration/robots/*/*.json" in text and "matches: usb-1a86-7523." in text
    assert "arm_move_joint" not in text and '"address"' not in text and "upper arm" not in text
    assert len(text) < len(briefing(arm, {"usb-1a86-7523"})) / 3
    prose = replace(arm, grammar=None, body="It is warm.\n\n- Lift it.\n- The pip package is `arm-kit`.\n- Drop it.")
    assert packaging(prose, {"usb-x"}).splitlines()[2:] == ["", "- The pip package is `arm-kit`."]
    assert packaging(replace(prose, body="It is warm."), {"usb-x"}) == ""


def test_a_profile_is_near_where_a_word_alone_lacks_and_nobody_has_spoken(arm: Profile) -> None:
    bare, other = device("1a86", "7523", "product: USB Serial"), device("0403", "6001", "product: USB Serial")
    named = device("1a86", "7523", "product: Feetech bus board")
    assert near([arm], {"devices": [bare]}) == [("usb-x", arm.name, "SO-ARM101")], "the product's own word"
    assert near([arm], {"devices": [bare | {"context": True}, other, named]}) == []
    assert near([arm], {"devices": [bare]}, {"usb-x": "a lamp"}) == []
    more = replace(arm, evidence=match_rule.Rule("all", (arm.evidence, match_rule.Rule("class", words=("leds",)))))
    assert near([more], {"devices": [bare]}) == [], "a class lacks as well"
    assert devices_of(arm, {"devices": [bare]}, {"usb-x": "SO-ARM101"}), "the word that was told is enough"
