"""Units on a bus, before simulated servos that take their time, heat up and fail. No real time passes."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from unit.runtime.servo_bench import ARM, Bench

from octoform.runtime import DeviceFault

ELBOW, LIFT, WRIST = "elbow_flex", "shoulder_lift", "wrist_flex"


@pytest.fixture
def bench() -> Bench:
    return Bench()


def fails(bench: Bench, do: str, *words: object, **named: object) -> str:
    with pytest.raises(DeviceFault) as problem:
        getattr(bench.units(), do)(*words, **named)
    assert problem.value.device == bench.device and not bench.held
    assert len(str(problem.value)) < 1200
    return str(problem.value)


def test_fields_are_read_with_scale_and_sign(bench: Bench) -> None:
    bench.joint(ELBOW).moment = 0.0
    found = bench.units().read(ELBOW, ("position", "voltage", "load", "temperature"))
    assert (found["device"], found["joint"], found["id"], found["skipped"]) == (bench.device, ELBOW, 3, None)
    assert (found["position"], found["voltage"], found["temperature"]) == (3080, pytest.approx(12.0, abs=0.2), 25)
    assert found["calibrated"] is None and isinstance(found["position"], int)


@pytest.mark.parametrize(("raw", "value"), [(0, 0), (1000, 100.0), (1024, 0), (1024 + 305, -30.5), (2047, -102.3)])
def test_the_sign_bit_is_not_a_part_of_the_size(raw: int, value: float) -> None:
    assert ARM.fields["load"].value(raw) == value


def test_a_movement_is_written_in_its_order_and_waited_for(bench: Bench) -> None:
    done = bench.units().move(ELBOW, 2080, 500)
    assert done == {
        "device": bench.device, "joint": ELBOW, "from": 3080, "goal": 2080, "position": 2080, "moved": True,
        "skipped": None,
    }  # fmt: skip
    assert bench.writes[-4:] == [(3, 40, 1), (3, 41, 20), (3, 46, 500), (3, 42, 2080)]
    assert 2.0 < bench.now < 3.2 and bench.joint(ELBOW).position == pytest.approx(2080)


@pytest.mark.parametrize(("goal", "told"), [(3101, "890 to 3100"), (889, "890 to 3100"), (-1, "890"), (4096, "3100")])
def test_a_goal_outside_of_the_units_own_limits_writes_nothing(bench: Bench, goal: int, told: str) -> None:
    text = fails(bench, "move", ELBOW, goal, 400)
    assert "outside of the limits of elbow_flex" in text and told in text and bench.writes == []


def test_of_several_goals_one_outside_of_the_limits_refuses_all(bench: Bench) -> None:
    text = fails(bench, "move_many", {LIFT: 1500, ELBOW: 4000, WRIST: 100}, 400)
    assert "elbow_flex, 890 to 3100" in text and "wrist_flex, 860 to 3220" in text and bench.writes == []


@pytest.mark.parametrize("speed", [49, 1501, None])
def test_a_speed_outside_of_its_limits_is_refused(bench: Bench, speed: int | None) -> None:
    assert "outside of its limits, 50 to 1500" in fails(bench, "move", ELBOW, 2080, speed) and bench.writes == []


def test_unusable_limits_of_a_unit_are_no_reason_to_move_it_anywhere(bench: Bench) -> None:
    bench.joint(ELBOW)._memory.put("highest", 0)
    assert "limits that leave it no way" in fails(bench, "move", ELBOW, 2080, 400) and bench.writes == []


def test_an_acknowledged_movement_that_did_not_happen_is_an_error(bench: Bench) -> None:
    bench.joint(ELBOW).fault = "stuck"
    text = fails(bench, "move", ELBOW, 2080, 400)
    assert text.endswith("elbow_flex acknowledged the goal 2080 and did not move: from 3080 to 3080")


def test_who_made_it_limp_meanwhile_is_said(bench: Bench) -> None:
    bench.joint(WRIST).fault = "stuck"
    bench.events.append((0.1, lambda: bench.bus.feed(bytes.fromhex("FFFFFE04032800D2"))))
    text = fails(bench, "move", WRIST, 1600, 400)
    assert "did not move: from 2600 to 2600; its torque is 0, so something made it limp meanwhile" in text


def test_a_unit_that_let_go_on_its_way_is_not_said_to_have_come_well(bench: Bench) -> None:
    bench.events.append((1.0, lambda: bench.bus.feed(bytes.fromhex("FFFFFE04032800D2"))))
    text = fails(bench, "move", WRIST, 1600, 400)
    assert "on its way to 1600: its torque is 0, so something made it limp meanwhile" in text


def test_a_bus_that_is_gone_is_not_waited_for_once_for_each_unit(bench: Bench) -> None:
    bench.broken = 100
    text = fails(bench, "stop")
    assert "not everything is known to have stopped: shoulder_pan: the device did not answer" in text
    assert bench.opened == 2 and bench.units().known.stops == 1


def test_torque_that_stays_off_is_seen_before_the_goal_is_written(bench: Bench) -> None:
    bench.joint(ELBOW).fault = "deaf_torque"
    text = fails(bench, "move", ELBOW, 2080, 400)
    assert "is not switched on: its torque is 0 after 1 was written; it was not moved" in text
    assert (3, 42, 2080) not in bench.writes
    assert "was set to torque = 1, and its torque is 0" in fails(bench, "torque", ELBOW, True)


def test_a_short_way_is_judged_by_its_own_length(bench: Bench) -> None:
    assert bench.units().move(ELBOW, 3080, 400)["moved"] is False
    assert bench.units().move(ELBOW, 3040, 400)["moved"] is True


def test_a_movement_that_takes_too_long_is_stopped_and_tells_how_far_it_came(bench: Bench) -> None:
    text = fails(bench, "move", ELBOW, 1080, 100)
    place = bench.joint(ELBOW).position
    assert f"elbow_flex was stopped at {place:.0f} on its way to 1080: 4 s were over" in text
    assert 2600 < place < 2750 and 3.9 < bench.now < 4.4
    bench.sleep(5.0)
    assert bench.joint(ELBOW).position == pytest.approx(place, abs=2)


@pytest.mark.parametrize("fault", ["mute", "corrupt", "half"])
def test_a_unit_without_a_sound_answer_is_named_with_what_is_unknown(bench: Bench, fault: str) -> None:
    bench.joint(ELBOW).fault = fault
    assert "elbow_flex gave no sound reply, twice" in fails(bench, "read", ELBOW, ("position",))
    text = fails(bench, "move", ELBOW, 2080, 400)
    assert "not known: its temperature, whether it may be moved; nothing was" in text and bench.writes == []


@pytest.mark.parametrize("lost", [1, 2, 5])
def test_one_lost_answer_is_asked_for_again(bench: Bench, lost: int) -> None:
    """Wherever in the call it is lost."""
    units, found = bench.units(), 0
    plain = bench.read, bench.write

    def drop(way: int) -> object:
        def ask(*words: int) -> int:
            nonlocal found
            found += 1
            if found % (lost + 3) == 0:
                bench.bus.drop(transactions=1)
            return plain[way](*words)

        return ask

    bench.read, bench.write = drop(0), drop(1)  # type: ignore[assignment, method-assign]
    assert units.move(ELBOW, 2080, 500)["position"] == 2080
    assert found > lost


def test_a_line_that_breaks_once_is_opened_anew(bench: Bench) -> None:
    bench.broken = 1
    assert bench.units().read(ELBOW, ("position",))["position"] == 3080 and bench.opened == 2
    bench.broken = 2
    assert "the device did not answer; not known: its values" in fails(bench, "read", ELBOW, ("position",))


def test_a_bus_that_stays_silent_says_so_once_for_all(bench: Bench) -> None:
    bench.bus.drop()
    assert "no joint answers; is its own power supply on?" in fails(bench, "read_all", ("position",))


def test_a_silent_unit_does_not_hide_the_others(bench: Bench) -> None:
    bench.joint(LIFT).fault = "mute"
    found = bench.units().read_all(("position", "load"))
    lift, elbow = found["joints"][1:3]
    assert lift["position"] is None and "gave no sound reply" in lift["skipped"] and "device" not in lift
    assert elbow["position"] == 3080 and elbow["skipped"] is None and found["calibration"] is None
    done = bench.units().move_many({LIFT: 1500, ELBOW: 2500}, 800)["joints"]
    assert "gave no sound reply" in done[0]["skipped"] and done[0]["moved"] is False and done[0]["position"] is None
    assert done[1]["position"] == 2500 and done[1]["moved"] is True


def test_several_move_at_once_and_a_stuck_one_fails_after_the_others(bench: Bench) -> None:
    bench.joint(ELBOW).fault = "stuck"
    text = fails(bench, "move_many", {LIFT: 1500, ELBOW: 2500, WRIST: 2000}, 800)
    assert "elbow_flex acknowledged the goal 2500 and did not move" in text
    assert "shoulder_lift is at 1500; wrist_flex is at 2000" in text and bench.now < 2.5


def test_a_disabled_unit_is_never_written_to(bench: Bench) -> None:
    bench.map = ARM._replace(disabled={ELBOW: "motor is broken"})
    units = bench.units()
    assert units.read(ELBOW, ("position",))["skipped"] == "motor is broken"
    assert units.move(ELBOW, 2080, 400)["skipped"] == "motor is broken"
    assert units.torque(ELBOW, True) == {
        "device": bench.device, "joint": ELBOW, "id": 3, "skipped": "motor is broken", "on": None
    }  # fmt: skip
    pose = units.pose({ELBOW: 2000, WRIST: 2000}, 800, release=True)["joints"]
    assert [record["skipped"] for record in pose] == ["motor is broken", None]
    assert [record["released"] for record in pose] == [False, True]
    units.stop()
    assert {write[0] for write in bench.writes} == {1, 2, 4, 5, 6}
    assert units.read_all(("position",))["joints"][2]["skipped"] == "motor is broken"


def test_protection_refuses_stays_and_relaxes_by_itself(bench: Bench) -> None:
    servo = bench.joint(ELBOW)
    servo.temperature = 65.0
    text = fails(bench, "move", ELBOW, 2080, 400)
    assert "elbow_flex is too hot to be moved: its temperature is 65 Cel" in text and "again below 55" in text
    assert "too hot" in fails(bench, "torque", ELBOW, True) and bench.writes == []
    servo.temperature = 55.0  # below the first limit, and not below the second
    assert "too hot" in fails(bench, "move", ELBOW, 2080, 400)
    servo.temperature = 54.0
    assert bench.units().move(ELBOW, 2080, 500)["moved"] is True
    servo.temperature = 60.0  # never was at the first limit since
    assert bench.units().move(ELBOW, 3080, 500)["moved"] is True


def test_a_reading_by_any_tool_sets_and_clears_the_protection(bench: Bench) -> None:
    bench.joint(ELBOW).temperature = 66.0
    bench.units().read_all(("temperature",))
    bench.joint(ELBOW).temperature = 60.0
    assert "too hot" in fails(bench, "move", ELBOW, 2080, 400)
    bench.joint(ELBOW).temperature = 50.0
    bench.units().read(ELBOW, ("temperature",))
    bench.joint(ELBOW).temperature = 60.0
    assert bench.units().move(ELBOW, 2080, 500)["moved"] is True


def test_a_hot_unit_is_skipped_among_others_and_may_be_made_limp(bench: Bench) -> None:
    bench.units().torque(ELBOW, True)
    bench.joint(ELBOW).temperature = 66.0
    done = bench.units().move_many({ELBOW: 2080, WRIST: 2000}, 800)["joints"]
    assert "too hot" in done[0]["skipped"] and done[1]["moved"] is True
    assert bench.units().torque(ELBOW, False)["on"] is False and not bench.joint(ELBOW).torque


def test_a_unit_that_gets_too_hot_on_its_way_is_stopped(bench: Bench) -> None:
    bench.events.append((1.0, lambda: setattr(bench.joint(ELBOW), "temperature", 66.0)))
    text = fails(bench, "move", ELBOW, 2080, 400)
    assert "elbow_flex was stopped at" in text and "on its way to 2080: its temperature is 66 Cel" in text
    bench.now += 5
    assert 2600 < bench.joint(ELBOW).position < 2800


def test_a_unit_that_falls_silent_on_its_way_is_not_called_stopped(bench: Bench) -> None:
    bench.events.append((1.0, lambda: setattr(bench.joint(ELBOW), "fault", "mute")))
    text = fails(bench, "move", ELBOW, 2080, 400)
    assert "gave no sound reply, twice (no answer); not known: its position, whether it moves" in text


def test_a_stop_ends_a_movement_of_another_thread_and_holds(bench: Bench) -> None:
    lines: list[dict[str, Any]] = []
    bench.events.append((1.0, lambda: lines.append(bench.units().stop())))
    text = fails(bench, "move_many", {ELBOW: 2080, WRIST: 1600}, 400)
    assert text == f"{bench.device}: stopped: the movement was ended, and its units hold their places"
    assert bench.now < 1.3
    where = bench.joint(ELBOW).position
    bench.now += 5
    assert bench.joint(ELBOW).position == pytest.approx(where, abs=60) and where > 2600
    assert bench.joint(ELBOW).torque and [record["joint"] for record in lines[0]["joints"]] == list(ARM.units)
    assert bench.units().move(ELBOW, 2500, 800)["position"] == 2500  # a stop is over when it is done


def test_a_stop_before_the_first_write_of_a_movement_leaves_it_unwritten(bench: Bench) -> None:
    bench.joint(LIFT).fault = "mute"  # asking it again takes a moment, in which the stop comes
    bench.signals.append((0.05, bench.units().known.stop))
    text = fails(bench, "move_many", {LIFT: 1500, ELBOW: 2080}, 400)
    assert "stopped" in text and bench.writes == []


def test_a_stop_in_the_middle_of_the_first_writes_leaves_the_goal_unwritten(bench: Bench) -> None:
    plain = bench.write

    def write(unit_id: int, address: int, size: int, value: int) -> int:
        if address == 46:  # the answer is lost, and while it is asked for again the stop comes
            bench.bus.drop(transactions=1)
            bench.signals.append((bench.now + 0.05, bench.units().known.stop))
            bench.write = plain  # type: ignore[method-assign]
        return plain(unit_id, address, size, value)

    bench.write = write  # type: ignore[method-assign]
    assert "stopped" in fails(bench, "move", ELBOW, 2080, 400)
    assert bench.writes[-2:] == [(3, 46, 400), (3, 46, 400)] and bench.joint(ELBOW).position == 3080


def test_a_limp_unit_gets_its_own_place_as_a_goal_before_it_is_switched_on(bench: Bench) -> None:
    bench.units().move(ELBOW, 2980, 800)
    bench.units().move(ELBOW, 3080, 800)
    goals = [value for unit, address, value in bench.writes if (unit, address) == (3, 42)]
    assert goals == [3080, 2980, 3080] and bench.writes[0] == (3, 42, 3080)


def test_a_stop_names_what_may_go_on(bench: Bench) -> None:
    bench.joint(LIFT).fault = "mute"
    text = fails(bench, "stop")
    assert "not everything is known to have stopped: shoulder_lift gave no sound reply" in text
    assert {write[0] for write in bench.writes} == {1, 3, 4, 5, 6}


def test_rest_makes_limp_what_came_there_and_nothing_else(bench: Bench) -> None:
    text = fails(bench, "pose", {ELBOW: 1000, WRIST: 2500}, 400, True)
    assert "elbow_flex was stopped at" in text and "wrist_flex is at 2500" in text
    assert bench.joint(ELBOW).torque and bench.joint(WRIST).torque  # an arm of which a part is elsewhere stays up
    done = bench.units().pose({ELBOW: 1000, WRIST: 2500}, 400, release=True)["joints"]
    assert [record["released"] for record in done] == [True, True]
    assert not bench.joint(ELBOW).torque and not bench.joint(WRIST).torque


def test_torque_holds_where_the_unit_is_and_not_where_it_once_should_go(bench: Bench) -> None:
    bench.joint(WRIST).position = 1700
    assert bench.units().torque(WRIST, True)["on"] is True
    bench.now += 3
    assert bench.joint(WRIST).position == pytest.approx(1700, abs=1)
    assert [write[:2] for write in bench.writes] == [(4, 42), (4, 40), (4, 42)]


def test_a_unit_may_be_named_by_its_id(bench: Bench) -> None:
    bench.map = ARM._replace(units={**ARM.units, "wrist_flex": 5, "wrist_roll": 4})
    found = bench.units().read("5", ("position",))
    assert (found["joint"], found["id"], found["position"]) == (WRIST, 5, 2048)
    assert bench.units().move("3", 2500, 800)["joint"] == ELBOW and bench.joint(ELBOW).position == 2500
    assert bench.units().torque("3", False)["joint"] == ELBOW


def test_a_name_that_is_no_unit_is_refused(bench: Bench) -> None:
    assert "'fl\\x1b[2Jap' is no joint; there are shoulder_pan" in fails(bench, "move", "fl\x1b[2Jap", 1, 400)


@pytest.fixture
def calibrated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    monkeypatch.setenv("HOME", str(tmp_path))
    return Bench(ARM._replace(calibration=("~/cal/*.json",)))


def calibration(bench: Bench, home: Path, name: str = "arm.json", **changed: dict[str, object]) -> Path:
    entries: dict[str, dict[str, object]] = {
        joint: {"id": number, "drive_mode": 0, "homing_offset": -7, "range_min": 1000, "range_max": 3000}
        for joint, number in bench.map.units.items()
    }
    for joint, members in changed.items():
        entries[joint] = {**entries[joint], **members}
    (home / "cal").mkdir(exist_ok=True)
    (home / "cal" / name).write_text(json.dumps(entries))
    return home / "cal" / name


def test_the_calibrated_range_narrows_and_scales(calibrated: Bench, tmp_path: Path) -> None:
    calibration(calibrated, tmp_path, wrist_flex={"drive_mode": 1, "range_max": 2700})
    units = calibrated.units()
    assert units.read(WRIST, ("position",))["calibrated"] == -88.2 and units.read_all(("load",))["calibration"] is None
    assert units.move_percent(WRIST, -50, 800)["position"] == pytest.approx(2275, abs=1)
    assert units.move_percent(WRIST, 100, 1500)["goal"] == 1000
    assert units.move_percent(ELBOW, -25, 1500)["goal"] == 1750
    assert "999 is outside of the limits of wrist_flex, 1000 to 2700" in fails(calibrated, "move", WRIST, 999, 400)
    assert "3050 is outside of the limits of elbow_flex, 1000 to 3000" in fails(calibrated, "move", ELBOW, 3050, 400)
    assert "is no percentage" in fails(calibrated, "move_percent", ELBOW, 100.1, 400)


def test_without_a_file_the_raw_units_are_left_and_the_calibrated_tool_says_where_it_looked(calibrated: Bench) -> None:
    text = "there is no calibration file; looked for ~/cal/*.json"
    assert text in fails(calibrated, "move_percent", ELBOW, 0, 400)
    assert calibrated.units().read_all(("position",))["calibration"] == text
    assert calibrated.units().read(ELBOW, ("position",))["calibrated"] is None
    assert calibrated.units().move(ELBOW, 2500, 800)["moved"] is True


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("{", "is no calibration file that can be used (JSONDecodeError"),
        ("[]", "that can be used"),
        ("{}", "none of the units is in it"),
        ('{"elbow_flex": {"id": 3}}', "that can be used"),
        ('{"elbow_flex": {"id": 3, "drive_mode": 0, "range_min": 9, "range_max": 9}}', "no range of counts"),
        ('{"elbow_flex": {"id": 3, "drive_mode": 0, "range_min": 9, "range_max": true}}', "no range of counts"),
        ("x" * 70000, "more than 65536 bytes"),
    ],
)
def test_a_file_that_is_no_calibration_is_said_to_be_none(
    calibrated: Bench, tmp_path: Path, text: str, told: str
) -> None:
    calibration(calibrated, tmp_path).write_text(text)
    found = fails(calibrated, "move_percent", ELBOW, 0, 400)
    assert told in found and "~/cal/arm.json" in found and str(tmp_path) not in found
    assert calibrated.units().move(ELBOW, 2500, 800)["moved"] is True


def test_two_files_are_one_too_many(calibrated: Bench, tmp_path: Path) -> None:
    calibration(calibrated, tmp_path)
    calibration(calibrated, tmp_path, "other.json")
    text = "there are 2 calibration files and nothing shows which is meant: ~/cal/arm.json, ~/cal/other.json"
    assert text in fails(calibrated, "move_percent", ELBOW, 0, 400)


def test_a_file_with_other_ids_moves_nothing(calibrated: Bench, tmp_path: Path) -> None:
    calibration(calibrated, tmp_path, wrist_flex={"id": 5}, wrist_roll={"id": 4})
    for do, words in (("move", (ELBOW, 2500, 400)), ("move_many", ({ELBOW: 2500}, 400))):
        text = fails(calibrated, do, *words)
        assert "gives wrist_flex the id 5 (the profile has 4), wrist_roll the id 4 (the profile has 5)" in text
    assert calibrated.writes == [] and "the id 5" in calibrated.units().read_all(("load",))["calibration"]
    swapped = ARM._replace(units={**ARM.units, "wrist_flex": 5, "wrist_roll": 4}, calibration=("~/cal/*.json",))
    assert replace(calibrated, map=swapped).units().move_percent(ELBOW, 50, 800)["goal"] == 2500
