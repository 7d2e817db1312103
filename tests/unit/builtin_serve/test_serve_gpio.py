"""Lines of GPIO controllers: driven, kept, read back, and refused where they do not lead to a header."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from unit.builtin_serve import kernel_gpio
from unit.builtin_serve.generated_endpoint import Endpoint
from unit.builtin_serve.invented_host import PINS
from unit.builtin_serve.kernel_gpio import INPUT, OUTPUT, USED, Chip, Line

SET, READ = "set_gpio_line", "read_gpio_line"


@pytest.fixture
def endpoint(tmp_path: Path) -> Endpoint:
    made = Endpoint(tmp_path, ("read_gpio_lines", READ, SET))
    made.tree.member("platform/pinctrl/gpio/gpiochip512", "gpio", {"label": "demo", "ngpio": "5"})
    (made.root / "dev/gpiochip0").touch()
    (made.root / "dev/gpiochip512").touch()
    return made


@pytest.fixture
def chip(monkeypatch: pytest.MonkeyPatch) -> Iterator[Chip]:
    found = Chip([Line(), Line(pull=1), Line(consumer="power switch", flags=OUTPUT | USED, driven=1), Line(), Line()])
    monkeypatch.setattr("fcntl.ioctl", found.ioctl)
    yield found
    for file in found.held:
        os.close(file)


def driver(endpoint: Endpoint, name: str) -> None:
    """Bind the controller to a driver of this name."""
    (endpoint.root / "sys/drivers" / name).mkdir(parents=True)
    (endpoint.root / "sys/devices/platform/pinctrl/driver").symlink_to(endpoint.root / "sys/drivers" / name)


def test_a_line_that_was_set_stays_set_and_is_set_again_through_the_same_file(endpoint: Endpoint, chip: Chip) -> None:
    driver(endpoint, "gpio-sim")
    high, seen, listed, low, let_go = endpoint.data(
        [
            (SET, {"line": 3, "state": "high"}),
            (READ, {"line": 3}),
            ("read_gpio_lines", {}),
            (SET, {"line": 3, "state": "low"}),
            (SET, {"line": 3, "state": "input"}),
        ]
    )
    assert high == {"device": PINS, "chip": 0, "line": 3, "name": "", "level": 1, "used_by": "octoform"}
    assert (seen["level"], seen["used_by"]) == (1, "")
    (one,) = listed["chips"]
    assert (one["name"], one["label"], len(one["lines"])) == ("gpiochip0", "demo", 5)
    assert one["lines"][3]["direction"] == "out" and one["lines"][3]["consumer"] == "octoform"
    assert low["level"] == 0 and chip.lines[3].driven == 0
    assert let_go["level"] == 0 and chip.lines[3].flags == INPUT | USED
    assert chip.requests == 1 and list(chip.held.values()) == [3]


def test_reading_changes_no_direction_and_keeps_no_line(endpoint: Endpoint, chip: Chip) -> None:
    chip.lines[0].flags, chip.lines[0].driven = OUTPUT, 1
    out, pulled, taken = endpoint.data([(READ, {"line": 0}), (READ, {"line": 1}), (READ, {"line": 2})])
    chip.sweep()
    assert (out["level"], pulled["level"]) == (1, 1) and not chip.held
    assert (taken["level"], taken["used_by"]) == (None, "power switch")
    assert chip.lines[1].flags == INPUT and chip.requests == 2


def test_a_line_in_use_and_a_line_that_is_not_there_are_refused(endpoint: Endpoint, chip: Chip) -> None:
    driver(endpoint, "pca953x")
    used, beyond, other = endpoint.said(
        (SET, {"line": 2, "state": "low"}),
        (SET, {"line": 5, "state": "low"}),
        (SET, {"line": 0, "state": "low", "chip": 1}),
    )
    assert used == "line 2 is in use by power switch"
    assert "has 5 lines" in beyond and "has 1 GPIO chips" in other
    assert chip.lines[2].driven == 1 and not chip.requests


def test_a_processors_own_pins_are_refused_but_those_of_a_header(endpoint: Endpoint, chip: Chip) -> None:
    driver(endpoint, "pinctrl-soc9")
    assert endpoint.said((SET, {"line": 3, "state": "high"})) == [
        "line 3 (without a name) is not known to lead to a header"
    ]
    chip.lines[1].name, chip.lines[3].name = "GPIO17", "WL_RESET"
    refused, header, unnamed = endpoint.calls(
        [(SET, {"line": line, "state": "high"}) for line in (3, 1, 4)],
    )
    assert refused.content[0].text == "line 3 (WL_RESET) is not known to lead to a header"
    assert unnamed.is_error and header.structured_content["name"] == "GPIO17"
    assert [line.driven for line in chip.lines] == [0, 1, 1, 0, 0]  # the third by its own user


def test_names_on_an_expander_say_which_of_its_lines_lead_out(endpoint: Endpoint, chip: Chip) -> None:
    driver(endpoint, "mcp230xx")
    chip.lines[0].name, chip.lines[1].name = "PIN_7", "CAM_POWER"
    free, board = endpoint.calls([(SET, {"line": 0, "state": "high"}), (SET, {"line": 1, "state": "high"})])
    assert not free.is_error and board.is_error and chip.lines[1].driven == 0


def test_a_chip_that_was_away_is_asked_again(endpoint: Endpoint, chip: Chip, monkeypatch: pytest.MonkeyPatch) -> None:
    driver(endpoint, "cp2112")
    plain = kernel_gpio.Chip.ioctl

    def replugged(self: Chip, file: object, request: int, argument: bytes) -> bytes:
        if request == kernel_gpio.SET_CONFIG and chip.requests == 1:
            chip.replug()
        return plain(self, file, request, argument)

    monkeypatch.setattr("fcntl.ioctl", replugged.__get__(chip))
    first, again = endpoint.data([(SET, {"line": 0, "state": "high"}), (SET, {"line": 0, "state": "high"})])
    assert first["level"] == again["level"] == 1 and chip.requests == 2
    chip.sweep()
    assert list(chip.held.values()) == [0]
