"""What an agent of the daemon is given, how its end is reported, and the way back that is kept for each repair."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from octoform.apply import heal
from octoform.apply.context import HEALED
from octoform.apply.duty import (
    camera_frames,
    claims_of,
    failures_of,
    readings_of,
    since_of,
    summary_of,
)
from octoform.apply.heal import Healed, no_worse
from octoform.apply.repair_outcome import Cost, RepairOutcome
from octoform.base import digest
from octoform.base.digest import of_bytes
from octoform.diagnostics import error
from octoform.endpoint.client.check import CheckReport, SampleCallResult
from octoform.harness.port import Usage
from octoform.manifest.model import Perception
from octoform.perception.frames import RECORD
from octoform.state.layout import Layout

AT = "2026-11-22T10:00:00Z"


def reading(number: int, path: str = "/heat", **more: Any) -> dict[str, Any]:
    row = {"id": f"r{number}", "at": AT, "channel": "sensor", "source": "arm_status", "path": path, "value": number}
    return {**row, "why": "", **more}


def test_readings_come_flat_or_with_their_signal_and_what_is_none_is_left_out() -> None:
    flat = reading(1)
    nested = {"id": "r2", "at": AT, "signal": {"channel": "log", "source": "t", "path": "/ok"}, "value": False}
    wrong: list[Any] = [None, {}, reading(3, id=""), reading(4, channel="rumour"), "r5"]
    rows = readings_of({"readings": [flat, nested, *wrong, reading(6, value={"deep": 1})]})
    assert rows[0] == flat and rows[1]["channel"] == "log" and rows[1]["value"] is False
    assert [row["id"] for row in rows] == ["r1", "r2", "r6"] and rows[2]["value"] is None
    assert readings_of({}) == readings_of({"readings": "none"}) == []


def test_of_too_many_readings_the_newest_of_each_signal_stays() -> None:
    rare = reading(0, "/rare")
    rows = readings_of({"readings": [rare, *(reading(number) for number in range(1, 2000))]})
    assert rows[0] == rare and rows[-1]["id"] == "r1999" and len(rows) < 400
    assert len(json.dumps(rows).encode()) < 40_000
    assert [int(row["id"][1:]) for row in rows] == sorted(int(row["id"][1:]) for row in rows)


def test_foreign_words_are_bounded_and_hide_nothing() -> None:
    failure = {"id": "f1", "tool": "t", "error": "E", "message": "\x1b[2J" + "x" * 9000, "count": 2}
    (row,) = failures_of({"failures": [failure, {"id": "f2"}]})
    assert row["message"].startswith("\\x1b[2J") and len(row["message"]) == 300 and row["last"] == ""
    (claim,) = claims_of({"claims": [{"statement": "a\u202eb", "restrictions": [{"tool": "t\x00"}]}]})
    assert claim == {"statement": "a\\u202eb", "restrictions": [{"tool": "t\\x00"}]}
    assert summary_of({"summary": "y" * 2000}) == "y" * 600 and summary_of({"summary": " "}) is None
    assert since_of({"since": "1970-01-01T00:01:00Z"}) == 60.0 and since_of({"since": "yesterday"}) == 0.0


def test_a_refusal_says_whether_another_try_makes_sense() -> None:
    refusal = RepairOutcome.of_diagnostics
    assert refusal([error("APPLY-TIMEOUT", "it took too long")]).again
    for code in ("APPLY-AUTH", "HARNESS-UNKNOWN", "DUTY-NOT-APPLIED"):
        assert not refusal([error(code, "no")]).again
    found = RepairOutcome.done("a.b", "\x1b" + "d" * 5000, cost=Cost.of(1, Usage(5, 0, 7))).to_json()
    assert found["cost"] == {"calls": 1, "input_tokens": 5, "output_tokens": 7, "usd": None}
    assert len(found["detail"]) == 1500 and found["detail"].startswith("\\x1b") and "report" not in found
    assert RepairOutcome.done("a.b").to_json()["cost"]["usd"] == 0.0


def call(tool: str, *, ok: bool = True, kind: str | None = None, **more: Any) -> SampleCallResult:
    given: dict[str, Any] = {"error_class": kind, "message": None if ok else "m", "logged": True, "ended_well": ok}
    return SampleCallResult(tool, ok=ok, **(given | more))


def report(*calls: SampleCallResult, answered: bool = True) -> CheckReport:
    tools = tuple({"name": item.tool} for item in calls)
    return CheckReport(answered, None if answered else "gone", None, None, tools, calls, 0.0)


def judged(before: CheckReport, after: CheckReport) -> set[str]:
    interface: Mapping[str, Any] = {"tools": [{"name": item.tool} for item in after.calls]}
    return {item.code for item in no_worse(before, frozenset({"mended"}))(after, interface) if item.severity == "error"}


def test_a_candidate_is_compared_with_what_was_there() -> None:
    bad = call("mended", ok=False, kind="AttributeError")
    other = call("other", ok=False, kind="KeyError")
    assert judged(report(bad, call("other")), report(call("mended"), call("other"))) == set()
    assert judged(report(bad, other), report(call("mended"), other)) == set(), "it was broken before"
    assert "HEAL-NOT-HELPED" in judged(report(bad), report(call("mended", ok=False, kind="OSError")))
    gone = call("other", ok=False, kind="OSError")
    assert judged(report(bad, call("other")), report(call("mended"), gone)) == {"HEAL-WORSE"}
    assert "ENDPOINT-NO-ANSWER" in judged(report(bad), report(answered=False))
    assert judged(report(bad), report(call("mended", skipped="no harmless arguments are known"))) == set()


def healed(episode: str, base: str, after: str) -> Healed:
    return Healed(episode, AT, "t", of_bytes(base.encode()), of_bytes(after.encode()), base)


def test_the_way_back_of_an_episode_is_to_where_it_began(tmp_path: Path) -> None:
    layout = Layout(tmp_path, "bench")
    assert heal.read(layout, "e/../1") is None
    assert heal.keep(layout, healed("e/../1", "one", "two")) is None
    assert heal.keep(layout, healed("e/../1", "two", "three")) is None
    found = heal.read(layout, "e/../1")
    assert found is not None and (found.source, found.digest) == ("one", of_bytes(b"three"))
    assert heal.keep(layout, healed("e/../1", "four", "five")) is None
    found = heal.read(layout, "e/../1")
    assert found is not None and found.source == "four", "the server was made again between the two"
    for number in range(20):
        assert heal.keep(layout, healed(f"n{number}", "a", "b")) is None
    folder = layout.local / HEALED
    assert len(list(folder.iterdir())) == heal.KEEP
    assert {path.stat().st_mode & 0o777 for path in folder.iterdir()} == {0o600}


@pytest.mark.parametrize("damage", [b"", b"{}", b'{"format": 2}', b"[1", b"\xff"])
def test_a_damaged_way_back_is_set_aside_and_never_used(tmp_path: Path, damage: bytes) -> None:
    layout = Layout(tmp_path, "bench")
    heal.keep(layout, healed("e1", "one", "two"))
    (path,) = (layout.local / HEALED).iterdir()
    path.write_bytes(damage)
    assert heal.read(layout, "e1") is None
    assert [item.suffix for item in path.parent.iterdir()] == [".damaged"]


def test_a_way_back_whose_text_is_not_that_of_its_digest_is_none(tmp_path: Path) -> None:
    layout = Layout(tmp_path, "bench")
    heal.keep(layout, healed("e1", "one", "two"))
    (path,) = (layout.local / HEALED).iterdir()
    path.write_text(path.read_text().replace('"source": "one"', '"source": "evil"'))
    assert heal.read(layout, "e1") is None


def frame(layout: Layout, name: str, data: bytes, **more: object) -> dict[str, object]:
    layout.frames.mkdir(parents=True, exist_ok=True)
    (layout.frames / name).write_bytes(data)
    camera = {"device": "cam", "tool": "camera_capture", "arguments": {}}
    figures = {"width": 4, "height": 3, "mean": 90.0, "spread": 40.0, "difference": None, "thumb": ""}
    row = {"file": name, "digest": digest.of_bytes(data), "at": AT, "camera": camera, "mime": "image/jpeg", "size": 1}
    return {**row, **figures, "complaint": None, "frozen": None, **more}


def looked(layout: Layout, **record: object) -> None:
    layout.frames.mkdir(parents=True, exist_ok=True)
    document = {"format": 1, "summary": {"since": AT}, **record}
    (layout.frames / RECORD).write_text(json.dumps(document))


def seen(number: int, source: str = "cam") -> dict[str, Any]:
    return {"id": f"v{number}", "at": AT, "channel": "frame", "source": source, "path": "/trouble", "value": None}


def test_two_pictures_at_most_each_with_the_reading_that_vouches_for_it(tmp_path: Path) -> None:
    layout, on = Layout(tmp_path, "bench"), Perception(enabled=True)
    looked(layout, current=frame(layout, "current.jpg", b"c"), previous=frame(layout, "previous.jpg", b"p"))
    found = camera_frames(layout, on, [seen(1), seen(2), seen(3)])
    assert [dict(item) for item in found.frames] == [
        {"reading": "v3", "file": "current.jpg"},
        {"reading": "v2", "file": "previous.jpg"},
    ]
    assert found.files == {"current.jpg": b"c", "previous.jpg": b"p"} and found.perception["available"] is True
    assert found.perception["summary"].startswith(f"0 looks since {AT}")
    (layout.frames / "previous.jpg").write_bytes(b"of another look")
    assert len(camera_frames(layout, on, [seen(1), seen(2)]).frames) == 1


@pytest.mark.parametrize("case", ["off", "never", "absent", "black", "unread", "other camera", "no record"])
def test_without_a_picture_the_reason_is_told_and_nothing_breaks(tmp_path: Path, case: str) -> None:
    layout, on = Layout(tmp_path, "bench"), Perception(enabled=case != "off")
    readings = [] if case == "unread" else [seen(1, "another" if case == "other camera" else "cam")]
    if case == "absent":
        looked(layout, absent={"since": AT, "last": AT, "code": "X", "reason": "the capture helper is missing"})
    elif case == "no record":
        looked(layout, format=9)
    elif case != "never":
        looked(layout, current=frame(layout, "current.jpg", b"c", complaint="black" if case == "black" else None))
    found = camera_frames(layout, on, readings)
    assert found.frames == () and not found.files and found.perception["available"] is False and found.reason
    assert (found.perception["summary"] is None) == (case in ("off", "never", "no record"))


def test_of_too_many_readings_those_of_both_pictures_stay() -> None:
    looks = [seen(1), seen(2), seen(3)]
    rows = readings_of({"readings": [*looks, *(reading(number) for number in range(2000))]})
    assert [row["id"] for row in rows if row["channel"] == "frame"] == ["v2", "v3"]
