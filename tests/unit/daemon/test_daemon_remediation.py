"""A problem's remedy is the same command in every view."""

import io
from pathlib import Path

import pytest

from octoform.daemon import requests
from octoform.daemon.model import Kind
from octoform.daemon.notices import advice, hint
from octoform.daemon.store.backoff import Backoff
from octoform.daemon.store.instance_lock import Record
from octoform.state.store.lock import myself
from octoform.views.daemon import requests as control
from octoform.views.format.console import Console


@pytest.mark.parametrize("kind", list(Kind))
def test_every_trouble_that_is_given_up_has_a_command(kind: Kind) -> None:
    assert "octoform " in advice(kind, "endpoint")
    assert "octoform " in hint(kind, "endpoint")


def test_hardware_that_a_person_has_to_apply_is_not_told_to_be_tried_again() -> None:
    assert "-retry" not in advice(Kind.HARDWARE_CHANGED, "hardware") + hint(Kind.HARDWARE_CHANGED, "hardware")


def test_heal_tells_what_health_tells(tmp_path: Path) -> None:
    out = io.StringIO()
    screen = Console(out, io.StringIO(), colour=False, colour_err=False, interactive=False)
    frozen = (
        Backoff("k1", "hardware", "b", frozen="2 tries did not help"),
        Backoff("k2", "disk", "b", frozen="3 tries"),
    )
    fields = {"hardware": advice(Kind.HARDWARE_CHANGED, "hardware")}
    known = requests.GivenUp(frozen, ("hardware", "disk"), fields)
    control.asked(screen, Record(myself(), "2026-11-22T03:00:00Z", 1.0, "1.0"), known, (), as_json=False)
    text = out.getvalue()
    assert f"do     {fields['hardware']}" in text
    assert "do     octoform heal -retry disk" in text
    assert "-retry hardware" not in text
