"""What a wrong word is taken for: a slip or a beginning, and never another thing."""

import pytest

from octoform.diagnostics import did_you_mean


@pytest.mark.parametrize(
    ("word", "candidates", "meant"),
    [
        ("plna", ["apply", "plan"], "plan"),
        ("aply", ["apply", "plan"], "apply"),
        ("Model", ["model"], "model"),
        ("harnass", ["harness", "host"], "harness"),
        ("read_temprature", ["read_temperature", "read_voltage"], "read_temperature"),
        ("max", ["minimum", "maximum"], "maximum"),
        ("mi", ["minimum"], None),
        ("read", ["read_voltage", "read_current"], None),
        ("set_led", ["read_led"], None),
        ("usb-1f00-0002", ["usb-1f00-0001"], None),
        ("usb-1f00-1023", ["usb-1f00-1032"], "usb-1f00-1032"),
        ("usb-1f0-0001", ["usb-1f00-0001"], "usb-1f00-0001"),
        ("camera", ["thermometer"], None),
        ("", ["plan"], None),
    ],
)
def test_a_near_word_is_offered_and_no_other(word: str, candidates: list[str], meant: str | None) -> None:
    assert did_you_mean(word, candidates) == meant
