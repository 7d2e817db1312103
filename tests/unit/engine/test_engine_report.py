"""Every device once, with what became of it; and figures that count what they say they count."""

from typing import Any

from covered import declared, identified, known, left, seen

from octoform.engine.coverage import Counted, Coverage, Ground, Share, Standing, coverage

NAMES = ("camera", "relay", "disk", "radio", "mystery", "hub", "chip", "login", "neighbour")
IDENTIFY = identified(
    [
        known("camera", "sensor", "capture_image", profile="cameras"),
        known("relay", "actuator"),
        known("disk", "infrastructure", "read_storage"),
        known("radio", "infrastructure"),
        known("mystery", "unknown", confidence=0.0, missing="What is it?"),
    ],
    [
        left("hub", "bus_infrastructure"),
        left("chip", "no_standard_interface", "nothing drives it"),
        left("login", "no_credentials"),
        left("neighbour", "network_neighbour"),
    ],
)


def artifacts(**more: Any) -> dict[str, Any]:
    probe = {"platform": {"os": "linux", "arch": "x86_64"}, "devices": [seen(name) for name in NAMES]}
    return {"probe": probe, "identify": IDENTIFY, "interface": declared(IDENTIFY), **more}


def found(**ground: Any) -> Coverage:
    return coverage(Ground(artifacts(), **ground))


def test_each_device_stands_once_with_what_became_of_it() -> None:
    fields = {item.id: item.standing.value for item in found().devices}
    assert list(fields) == list(NAMES)
    assert fields == {
        "camera": "usable",
        "relay": "named",
        "disk": "usable",
        "radio": "named",
        "mystery": "unknown",
        **dict.fromkeys(("hub", "chip", "login", "neighbour"), "left_out"),
    }


def test_the_funnel_narrows_from_devices_to_tools() -> None:
    funnel = found().funnel
    assert (funnel.enumerated, funnel.annotated, funnel.with_tools, funnel.tools) == (9, 5, 2, 2)


def test_what_could_be_used_counts_and_what_carries_or_is_elsewhere_does_not() -> None:
    report = found()
    counted = {item.id: item.counted for item in report.devices}
    assert [name for name, where in counted.items() if where is Counted.ONBOARDABLE] == [
        *("camera", "relay", "mystery", "chip", "login")
    ]
    assert [name for name, where in counted.items() if where is Counted.INFRASTRUCTURE] == ["disk", "radio"]
    assert report.onboardable == Share(1, 5)
    assert report.with_infrastructure == Share(2, 7)


def test_nothing_to_share_in_has_no_percentage() -> None:
    assert Share(0, 0).percent is None
    assert Share(1, 4).percent == 25


def test_a_device_tells_how_it_was_known_and_by_what() -> None:
    camera = found(tiers={"camera": 2}, answers={"camera": "my camera"}).devices[0]
    assert (camera.confidence, camera.method, camera.profile) == (0.8, "kernel_class", "cameras")
    assert (camera.tier, camera.answered, camera.tools) == (2, True, ("capture_image",))


def test_an_unknown_device_asks_its_question_once() -> None:
    interface = declared(IDENTIFY, [left("mystery", "unknown_meaning", "What is it?")])
    report = coverage(Ground(artifacts(interface=interface)))
    mystery = next(item for item in report.devices if item.id == "mystery")
    assert (mystery.question, mystery.reason, mystery.detail) == ("What is it?", "unknown_meaning", "")


def test_interface_says_why_a_named_device_has_no_tool() -> None:
    interface = {"format": 1, "tools": [], "left_out": [left("camera", "tool_budget", "30 tools are the most")]}
    camera = coverage(Ground(artifacts(interface=interface))).devices[0]
    assert (camera.standing, camera.reason, camera.detail) == (Standing.NAMED, "tool_budget", "30 tools are the most")


def test_what_is_not_there_yet_is_unknown_and_not_zero() -> None:
    probe = artifacts()["probe"]
    only = coverage(Ground({"probe": probe}))
    assert (only.funnel.annotated, only.funnel.with_tools, only.funnel.tools) == (None, None, None)
    assert (only.onboardable, only.with_infrastructure) == (None, None)
    assert {item.standing for item in only.devices} == {Standing.WAITING}
    named = coverage(Ground({"probe": probe, "identify": IDENTIFY}))
    assert (named.funnel.annotated, named.funnel.with_tools, named.onboardable) == (5, None, None)
    assert named.devices[0].standing is Standing.NAMED


def test_groups_count_a_shared_tool_once() -> None:
    identify = identified([known("one", "sensor", "read_it"), known("two", "sensor", "read_it"), known("three")])
    probe = {"platform": {}, "devices": [seen(name) for name in ("one", "two", "three")]}
    report = coverage(Ground({"probe": probe, "identify": identify, "interface": declared(identify)}))
    (group,) = report.categories
    assert (group.name, group.annotated, group.usable, group.tools) == ("sensor", 3, 2, 1)
    assert report.funnel.tools == 1


def test_left_out_stands_by_reason_the_most_frequent_first() -> None:
    identify = identified([], [left("one", "virtual"), left("two", "no_function"), left("three", "no_function")])
    probe = {"platform": {}, "devices": [seen(name) for name in ("one", "two", "three")]}
    report = coverage(Ground({"probe": probe, "identify": identify, "interface": declared(identify)}))
    assert {reason: [item.id for item in items] for reason, items in report.left_out().items()} == {
        "no_function": ["two", "three"],
        "virtual": ["one"],
    }


def test_tools_that_the_policy_denies_are_named() -> None:
    assert found(denied=frozenset({"capture_image", "gone"})).denied == ("capture_image",)
