"""Runs are compared by device and capability: a disagreement is reported, another name for the same is a rename."""

from typing import Any

from covered import declared, identified, known, left

from octoform.engine.coverage_runs import Disagreement, Renamed, Run, Stability, compare, run_of


def run(devices: list[dict[str, Any]], *out: dict[str, Any], agent: str = "pi", **names: Any) -> Run:
    identify = identified(devices, out)
    return run_of(agent, identify, declared(identify, **names))


def camera(*able: str, **more: Any) -> dict[str, Any]:
    return {**known("camera", "sensor", *(able or ("capture_image",))), **more}


def agreed(*runs: Run) -> Stability:
    return compare(runs)


def test_equal_runs_agree_on_all() -> None:
    report = agreed(*[run([camera()], left("hub", "bus_infrastructure"))] * 3)
    assert (report.runs, report.compared, report.same, report.disagreements) == (3, 2, 2, ())
    assert [tuple(item) for item in report.core] == [("camera", "capture_image")]
    assert report.agents == (("pi", 3),)


def test_of_three_runs_the_one_that_differs_is_told() -> None:
    other = run([camera(identified_as="a lamp", category="actuator")])
    report = agreed(run([camera()]), other, run([camera()]))
    assert (report.compared, report.same) == (1, 0)
    assert report.disagreements == (
        Disagreement("camera", "identity", (("the camera", 2), ("a lamp", 1))),
        Disagreement("camera", "category", (("sensor", 2), ("actuator", 1))),
    )


def test_a_capability_that_one_run_lacks_is_no_part_of_the_core() -> None:
    report = agreed(run([camera("capture_image", "list_formats")]), run([camera("capture_image")]))
    assert report.disagreements == (
        Disagreement("camera", "capability", (("read", 1), ("missing", 1)), "list_formats"),
    )
    assert (len(report.core), report.abilities) == (1, 2)


def test_another_effect_of_a_capability_is_a_disagreement() -> None:
    graver = camera()
    graver["capabilities"][0]["effect"] = "actuate"
    (found,) = agreed(run([camera()]), run([graver])).disagreements
    assert (found.what, found.said) == ("capture_image", (("read", 1), ("actuate", 1)))


def test_a_device_that_one_run_left_out_is_told_once() -> None:
    report = agreed(run([camera()]), run([], left("camera", "no_function")))
    assert report.disagreements == (Disagreement("camera", "identified", (("identified", 1), ("skipped", 1))),)


def test_reasons_for_leaving_out_may_differ() -> None:
    report = agreed(run([], left("hub", "virtual")), run([], left("hub", "bus_infrastructure")))
    assert report.same == report.compared == 1


def test_a_device_of_one_run_alone_has_nothing_to_be_compared_with() -> None:
    report = agreed(run([camera()]), run([camera(), known("new")]))
    assert (report.compared, report.same) == (1, 1)


def test_a_tool_with_another_name_for_the_same_capability_is_a_rename() -> None:
    report = agreed(run([camera()]), run([camera()], capture_image="take_picture"))
    assert report.disagreements == ()
    assert (report.same, report.names) == (1, 2)
    assert report.renamed == (Renamed("capture_image", ("capture_image", "take_picture")),)


def test_a_capability_with_another_name_and_the_same_way_is_a_rename_too() -> None:
    other = camera("take_picture")
    other["capabilities"][0]["via"] = "way of capture_image"
    report = agreed(run([camera()]), run([other]), run([camera()]))
    assert (report.disagreements, report.same, len(report.core)) == ((), 1, 1)
    assert report.renamed == (Renamed("capture_image", ("capture_image", "take_picture")),)


def test_two_capabilities_of_one_way_are_not_taken_for_each_other() -> None:
    one, other = camera("read_left", "read_right"), camera("read_left", "read_middle")
    for device in (one, other):
        for item in device["capabilities"]:
            item["via"] = "the same"
    report = agreed(run([one]), run([other]))
    assert {item.what for item in report.disagreements} == {"read_right", "read_middle"}
    assert report.renamed == ()


def test_one_run_has_nothing_to_compare() -> None:
    report = agreed(run([camera()]))
    assert (report.runs, report.compared, report.disagreements) == (1, 0, ())
