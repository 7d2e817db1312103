"""What is onboardable, and the bounds that decide a run: each of them can be missed."""

from pathlib import Path
from typing import Any

import pytest
from recordings import onboardable, score
from recordings.bounds import bounds, held, print_bounds
from recordings.onboarding import Onboarded, is_laptop
from recordings.truth import Item

CAMERA = Item("host", "usb f00d:0001", "Sample Eye", "sensor", (), "camera", ("capture_image",), (), "strings", True)


def item(**changes: Any) -> Item:
    return Item(**{**{name: getattr(CAMERA, name) for name in Item.__dataclass_fields__}, **changes})


def unit(classes: list[str], text: str = "bus: usb") -> dict[str, Any]:
    nodes = [{"class": "sound", "name": "card0"}]
    return {"id": "usb-f00d-0001", "classes": classes, "raw_descriptor": text, "instance": {"nodes": nodes}}


@pytest.mark.parametrize(
    ("wanted", "changes", "seen"),
    [
        ("", {}, unit(["video4linux"])),
        ("", {}, None),
        (onboardable.INFRASTRUCTURE, {"category": "infrastructure"}, unit(["video4linux"])),
        (onboardable.NOTHING_BOUND, {}, unit([])),
        (onboardable.RAW_PIPE, {"capabilities": ("zigbee_radio", "serial_io")}, unit(["tty"])),
        (onboardable.RAW_PIPE, {}, unit(["hidraw", "tty"])),
        (onboardable.NO_CLASS_SERVES, {"capabilities": ("iq_stream",)}, unit(["iio"], "iio[0].in_temp0: raw,scale")),
        (onboardable.NO_VALUE, {}, unit(["hwmon"], "hwmon[0].in0: lcrit_alarm")),
        (onboardable.NO_VALUE, {}, unit(["iio"], "iio[0].buffered: in_voltage0")),
        (onboardable.NO_VALUE, {}, unit(["sound"], "sound[0].name: Mute switch")),
        ("", {}, unit(["sound"], "sound[0].pcm0: playback")),
        ("", {}, unit(["hwmon"], "bus: i2c\nhwmon[0].temp1: max,input label=Intake")),
        ("", {}, unit(["iio"], "iio[0].out_voltage0: raw,scale")),
    ],
)
def test_an_item_is_onboardable_or_a_reason_says_why_not(
    wanted: str, changes: dict[str, Any], seen: dict[str, Any] | None
) -> None:
    assert onboardable.why_not(item(**changes), seen) == wanted


@pytest.mark.parametrize(
    ("node", "asked", "wanted"),
    [
        ("v4l-subdev0", "capture_image", onboardable.PART_OF_A_CAMERA),
        ("v4l-subdev0", "set_focus", ""),
        ("video0", "capture_image", ""),
    ],
)
def test_a_part_of_a_camera_gives_no_picture(node: str, asked: str, wanted: str) -> None:
    seen = unit(["video4linux"])
    seen["instance"]["nodes"] = [{"class": "video4linux", "name": node}]
    assert onboardable.why_not(item(capabilities=(asked,)), seen) == wanted


def marks(result: str, usable: bool | None = None, count: int = 1, **changes: Any) -> list[score.Mark]:
    return [score.Mark(item(**changes), result, "", usable)] * count


def host(probe: float = 0.1, problems: tuple[str, ...] = ()) -> Onboarded:
    return Onboarded("laptop-sample", problems=list(problems), cpu={"probe": probe}, laptop=True)


@pytest.mark.parametrize(
    ("hosts", "some", "missed"),
    [
        ([host()], marks(score.NAMED, True, 20), ""),
        ([host()], marks(score.NAMED) + marks(score.MISIDENTIFIED), "precision"),
        ([host()], marks(score.NAMED) + marks(score.MISIDENTIFIED, by_hand=False), "precision"),
        ([host()], marks(score.MISSED, identified_by="context"), "unknowns"),
        ([host()], marks(score.UNKNOWN_RIGHT, identified_by="context"), ""),
        ([host()], marks(score.NAMED, True, 18) + marks(score.NAMED, False, 2), "onboardable"),
        ([host()], marks(score.NAMED, True, 19) + marks(score.NAMED, False, 1), ""),
        ([host()], marks(score.NAMED, True, 7) + marks(score.NAMED, False, 2), ""),
        ([host(0.31)], marks(score.NAMED), "PROBE"),
        ([host(problems=("no server",))], marks(score.NAMED), "onboarded"),
    ],
)
def test_each_bound_can_be_missed(
    hosts: list[Onboarded], some: list[score.Mark], missed: str, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = bounds(hosts, some)
    print_bounds(lines)
    last = capsys.readouterr().out.strip().splitlines()[-1]
    assert held(lines) == (not missed)
    assert last == "RESULT: all bounds hold" if not missed else missed in last


def test_a_machine_that_is_half_as_fast_may_take_twice_as_long() -> None:
    assert held(bounds([host(0.59)], marks(score.NAMED), 2.0)) and not held(
        bounds([host(0.61)], marks(score.NAMED), 2.0)
    )


def test_a_laptop_is_told_by_its_firmware(tmp_path: Path) -> None:
    assert not is_laptop(tmp_path)
    chassis = tmp_path / "sys/class/dmi/id/chassis_type"
    chassis.parent.mkdir(parents=True)
    chassis.write_text("10\n")
    assert is_laptop(tmp_path)
    chassis.write_text("3\n")
    (tmp_path / "sys/bus/acpi/devices/PNP0C0A:00").mkdir(parents=True)
    assert not is_laptop(tmp_path), "a desktop's firmware may list a battery"
    (tmp_path / "sys/bus/acpi/devices/PNP0C0D:00").mkdir()
    assert is_laptop(tmp_path)
