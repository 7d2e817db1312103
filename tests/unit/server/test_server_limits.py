"""The limits: nothing over a bound gets through, nothing within is refused, and a restart forgets nothing."""

import itertools
import json
import os
import subprocess
import sys
import threading
from collections.abc import Mapping
from datetime import datetime, timedelta
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from octoform.policy import exact, published
from octoform.policy.enforce import Ledger

RANGE = {
    "kind": "range",
    "parameter": "position",
    "minimum": 0,
    "maximum": 4095,
    "unit": "raw",
    "source": "profile arm",
}
STEP = {"kind": "step", "parameter": "position", "most": 500, "unit": "raw", "source": "policy.limits[0]"}
SUM = {"kind": "cumulative", "parameter": "steps", "most": 10000, "source": "policy.limits[1]"}
RATE = {"kind": "rate", "calls": 3, "seconds": 60.0, "source": "policy.limits[2]"}
COOLDOWN = {"kind": "cooldown", "seconds": 2.0, "source": "policy.limits[3]"}
QUIET = {"kind": "quiet_hours", "from": "22:00", "to": "07:00", "source": "policy.limits[4]"}
NO_NUMBERS = [float("nan"), float("inf"), -float("inf"), True, False, "10", "", None, [1], {"value": 1}, 10**400]
HEADER = b'{"format": 1}\n'
LINE = (
    HEADER + b'{"tool":"move","boot":"","wall":0,"clock":0,"sums":{"steps":"3"},"last":{},"calls":[],"damaged":false}\n'
)
DAMAGED = {
    "empty": b"",
    "zeros": bytes(200),
    "no header": LINE.removeprefix(HEADER),
    "another format": LINE.replace(b"1}", b"2}"),
    "cut off": LINE[:-1],
    "cut off within": LINE[:-9],
    "no text": LINE + b"\xff\xfe\n",
    "no number": LINE.replace(b'"3"', b'"x"'),
    "a key is missing": LINE.replace(b'"last":{},', b""),
    "a list": LINE + b"[]\n",
    "too deep": LINE + b"[" * 100_000 + b"\n",
}


class Time:
    """A clock and a wall clock that a test moves."""

    def __init__(self) -> None:
        self.clock = 1000.0
        self.wall = datetime(2026, 5, 4, 12, 0)

    def on(self, seconds: float) -> None:
        self.clock += seconds
        self.wall += timedelta(seconds=seconds)


def policy_of(
    *limits: Mapping[str, Any], units: Mapping[str, Any] | None = None, **more: list[Mapping[str, Any]]
) -> published.Policy:
    return published.parse(
        {
            "format": 1,
            "mode": "enforce",
            "tools": {
                name: {
                    "effect": "actuate",
                    "decision": "allow",
                    "source": "default for actuate tools",
                    "timeout": 30,
                    "result_bytes": 1000,
                    "limits": list(of),
                    **({"units": units} if units is not None else {}),
                }
                for name, of in {"move": list(limits), **more}.items()
            },
        }
    )


def ledger(folder: Path, time: Time, *limits: Mapping[str, Any], **more: list[Mapping[str, Any]]) -> Ledger:
    return Ledger(policy_of(*limits, units=None, **more), folder / "limits.json", lambda: time.clock, lambda: time.wall)


def refused(found: Ledger, **arguments: Any) -> str:
    refusal = found.reserve("move", arguments)
    return "" if refusal is None else f"{refusal.code}: {refusal.text}"


@pytest.fixture
def time() -> Time:
    return Time()


def test_range(tmp_path: Path, time: Time) -> None:
    found = ledger(tmp_path, time, RANGE)
    assert [refused(found, position=value) for value in (0, 4095, 0.0, 4095.0, 17.5)] == [""] * 5
    assert refused(found, position=5000) == (
        "range: position 5000 raw is above the most that is allowed, 4095 raw (profile arm). Allowed: 0 to 4095 raw."
    )
    assert "below the least that is allowed, 0 raw" in refused(found, position=-0.5)
    assert not (tmp_path / "limits.json").exists()  # nothing was counted


def test_an_open_range_has_one_end(tmp_path: Path, time: Time) -> None:
    found = ledger(tmp_path, time, {"kind": "range", "parameter": "x", "minimum": None, "maximum": 3, "source": "p"})
    assert refused(found, x=-(10**9)) == ""
    assert refused(found, x=3.1).endswith("Allowed: 3 or less.")


def test_step_counts_from_the_last_accepted_value(tmp_path: Path, time: Time) -> None:
    found = ledger(tmp_path, time, RANGE, STEP)
    assert refused(found, position=2000) == ""
    assert refused(found, position=3000) == (
        "step: position 3000 raw is 1000 raw away from the last one, 2000 raw; one call may change it by 500 raw at "
        "most (policy.limits[0]). Allowed now: 1500 to 2500 raw."
    )
    assert refused(found, position=2500) == ""
    assert refused(found, position=3000) == ""
    assert refused(found, position=2499).startswith("step:")


def test_sums_of_both_directions(tmp_path: Path, time: Time) -> None:
    found = ledger(tmp_path, time, SUM)
    assert refused(found, steps=9000) == ""
    assert refused(found, steps=1001) == (
        "cumulative: steps 1001 would bring the sum over all calls to 10001; it may be 10000 at most in either "
        "direction (policy.limits[1]). Allowed now: -19000 to 1000. "
        "A person sets the sum to zero with: octoform limits -reset move"
    )
    assert refused(found, steps=-19000) == ""
    assert refused(found, steps=-1).startswith("cumulative:")
    found.reset("move")
    assert refused(found, steps=-10000) == ""


def test_numbers_count_as_they_are_written(tmp_path: Path, time: Time) -> None:
    found = ledger(tmp_path, time, {**SUM, "most": 1.0}, {**STEP, "parameter": "steps", "most": 0.2})
    assert [refused(found, steps=0.1) for _ in range(10)] == [""] * 10
    assert refused(found, steps=0.1).startswith("cumulative: steps 0.1 would bring the sum over all calls to 1.1;")
    found.reset(None)
    assert refused(found, steps=0.1) == refused(found, steps=0.3) == ""


@pytest.mark.parametrize("limit", [RANGE, STEP, {**SUM, "parameter": "position"}], ids=lambda item: str(item["kind"]))
@pytest.mark.parametrize("value", NO_NUMBERS, ids=lambda value: repr(value)[:20])
def test_what_is_no_finite_number_is_refused(tmp_path: Path, time: Time, limit: dict[str, Any], value: Any) -> None:
    found = ledger(tmp_path, time, limit)
    assert refused(found, position=value).startswith("no_number: position is ")
    assert not (tmp_path / "limits.json").exists()


def test_an_absent_parameter_counts_as_its_default_where_that_is_known(tmp_path: Path, time: Time) -> None:
    found = ledger(tmp_path, time, {**RANGE, "default": 9000}, {**SUM, "default": 6000}, other=[RANGE])
    assert "9000 raw is above" in refused(found)
    assert refused(found, position=1) == ""
    assert refused(found, position=1).startswith("cumulative: steps 6000 would bring the sum over all calls to 12000")
    assert found.reserve("other", {}) is None


def test_rate_is_a_sliding_window(tmp_path: Path, time: Time) -> None:
    found = ledger(tmp_path, time, RATE)
    for _ in range(3):
        assert refused(found) == ""
        time.on(10)
    assert refused(found) == (
        "rate: move was called 3 times in the last 60 s; 3 are allowed (policy.limits[2]). "
        "The next call is allowed in 30 s."
    )
    time.on(29.9)
    assert refused(found).startswith("rate:")
    time.on(0.1)
    assert refused(found) == ""
    assert refused(found).startswith("rate:")


def test_cooldown(tmp_path: Path, time: Time) -> None:
    found = ledger(tmp_path, time, COOLDOWN)
    assert refused(found) == ""
    time.on(0.5)
    assert refused(found) == (
        "cooldown: move was called 0.5 s ago; 2 s have to lie between two calls (policy.limits[3]). "
        "The next call is allowed in 1.5 s."
    )
    time.on(1.5)
    assert refused(found) == ""


@pytest.mark.parametrize(
    ("hour", "minute", "quiet"),
    [(21, 59, False), (22, 0, True), (23, 59, True), (0, 0, True), (6, 59, True), (7, 0, False)],
)
def test_quiet_hours_over_midnight(tmp_path: Path, time: Time, hour: int, minute: int, quiet: bool) -> None:
    found = ledger(tmp_path, time, QUIET)
    time.wall = datetime(2026, 5, 4, hour, minute)
    assert refused(found).startswith("quiet_hours: move has quiet hours from 22:00 to 07:00") is quiet


def test_quiet_hours_of_one_day_and_of_the_whole_day(tmp_path: Path, time: Time) -> None:
    found = ledger(tmp_path, time, {**QUIET, "from": "09:00", "to": "13:00"})
    assert refused(found).endswith("and it is 12:00 on this host. It is allowed from 13:00 on.")
    time.on(3600)
    assert refused(found) == ""
    assert "all day" in refused(ledger(tmp_path, time, {**QUIET, "from": "00:00", "to": "24:00"}))


def test_a_refused_call_counts_for_nothing_and_is_told_all_that_is_wrong(tmp_path: Path, time: Time) -> None:
    found = ledger(tmp_path, time, RANGE, SUM, RATE)
    before = found.used()
    text = refused(found, position=9999, steps=10**6)
    assert "position 9999 raw is above" in text
    assert "steps 1000000 would bring" in text
    assert found.used() == before


GOAL = {"kind": "goal", "of": "elbow", "maximum": 1000, "unit": "raw", "source": "policy.limits[0]"}
MOVE = {"names": {"elbow": ["3"]}, "parameter": "joint", "goal": {"of": "position", "parameter": "position"}}


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, "does not declare in advance where it moves elbow"),
        ({"position": "up"}, "does not declare"),
        ({"position": 1001}, "1001"),
    ],
)
def test_a_move_to_a_limited_place_names_the_place(tmp_path: Path, given: dict[str, Any], words: str) -> None:
    found = Ledger(policy_of(GOAL, units=MOVE), tmp_path / "limits.json")
    refusal = found.judge("move", {"joint": "elbow", **given})
    assert refusal is not None and refusal.code == "goal" and words in refusal.text
    assert found.judge("move", {"joint": "elbow", "position": 1000}) is None


def test_an_unknown_tool_is_refused(tmp_path: Path, time: Time) -> None:
    refusal = ledger(tmp_path, time).reserve("rm\u202e\n", {})
    assert refusal is not None
    assert refusal.text == "'rm\\u202e\\n' is not in the policy of this endpoint"


def test_all_counters_survive_a_restart(tmp_path: Path, time: Time) -> None:
    limits = (RANGE, STEP, {**SUM, "most": 0.3}, {**RATE, "calls": 2}, COOLDOWN)
    assert refused(ledger(tmp_path, time, *limits), position=100, steps=0.1) == ""
    time.on(1)
    text = refused(ledger(tmp_path, time, *limits), position=700, steps=0.3)
    assert all(word in text for word in ("is 600 raw away", "sum over all calls to 0.4", "move was called 1 s ago"))
    time.on(1)
    assert refused(ledger(tmp_path, time, *limits), position=600, steps=0.2) == ""
    time.on(2)
    assert refused(ledger(tmp_path, time, *limits), position=600, steps=0).startswith("rate:")
    assert (tmp_path / "limits.json").stat().st_mode & 0o777 == 0o600


def anew(folder: Path, time: Time, gone: float) -> None:
    """The machine was started anew: its clock begins at zero, and the wall clock shows how long it was off."""
    lines = [json.loads(line) for line in (folder / "limits.json").read_text().splitlines()]
    lines = [{**line, "boot": "another"} if "boot" in line else line for line in lines]
    (folder / "limits.json").write_text("".join(json.dumps(line) + "\n" for line in lines))
    time.clock = 5.0
    time.wall += timedelta(seconds=gone)


def test_after_a_new_start_of_the_machine_the_wall_clock_counts(tmp_path: Path, time: Time) -> None:
    slow = {**COOLDOWN, "seconds": 600.0}
    assert refused(ledger(tmp_path, time, slow)) == ""
    anew(tmp_path, time, 300)
    assert "move was called 300 s ago" in refused(ledger(tmp_path, time, slow))
    time.on(300)
    assert refused(ledger(tmp_path, time, slow)) == ""


def test_a_clock_that_jumped_back_neither_frees_nor_blocks_for_ever(tmp_path: Path, time: Time) -> None:
    slow = {**COOLDOWN, "seconds": 600.0}
    assert refused(ledger(tmp_path, time, slow)) == ""
    anew(tmp_path, time, -(10**8))
    found = ledger(tmp_path, time, slow)
    assert "move was called 0 s ago" in refused(found)
    time.on(600)
    assert refused(found) == ""


def test_the_wall_clock_does_not_matter_while_the_machine_runs(tmp_path: Path, time: Time) -> None:
    assert refused(ledger(tmp_path, time, COOLDOWN)) == ""
    time.wall += timedelta(days=400)
    assert refused(ledger(tmp_path, time, COOLDOWN)).startswith("cooldown:")
    time.wall -= timedelta(days=900)
    time.on(2)
    assert refused(ledger(tmp_path, time, COOLDOWN)) == ""


@pytest.mark.parametrize("damage", DAMAGED.values(), ids=DAMAGED)
def test_a_damaged_file_never_means_nothing_counted(tmp_path: Path, time: Time, damage: bytes) -> None:
    (tmp_path / "limits.json").write_bytes(damage)
    found = ledger(tmp_path, time, SUM, other=[COOLDOWN], still=[RANGE, QUIET])
    for _ in range(2):
        text = refused(found, steps=1)
        assert text.startswith(f"counters_damaged: move is refused: {tmp_path}/limits.json cannot be read")
        assert text.endswith("octoform limits -reset move")
        assert found.reserve("still", {"position": 1}) is None
        found = ledger(tmp_path, time, SUM, other=[COOLDOWN], still=[RANGE, QUIET])
    found.reset("move")
    assert refused(found, steps=1) == ""
    assert (tmp_path / "limits.damaged").read_bytes() == damage
    again = ledger(tmp_path, time, SUM, other=[COOLDOWN])
    assert refused(again, steps=1) == ""
    other = again.reserve("other", {})
    assert other is not None and other.code == "counters_damaged"
    again.reset(None)
    assert again.reserve("other", {}) is None
    assert not any(item["damaged"] for item in again.used().values())


def test_what_cannot_be_kept_is_refused_and_not_counted(tmp_path: Path, time: Time) -> None:
    found = ledger(tmp_path, time, SUM)
    (tmp_path / "limits.json").mkdir()
    assert refused(found, steps=1).startswith("counters_unwritable: move is refused: ")
    (tmp_path / "limits.json").rmdir()
    assert refused(found, steps=10000) == ""


def test_the_file_stays_small(tmp_path: Path, time: Time) -> None:
    found = ledger(tmp_path, time, SUM)
    for number in range(4000):
        assert refused(found, steps=1 if number % 2 else -1) == ""
    assert (tmp_path / "limits.json").stat().st_size < 300_000
    assert ledger(tmp_path, time, SUM).used() == found.used()


def test_a_full_disk_counts_nothing_and_leaves_a_whole_file(tmp_path: Path) -> None:
    program = f"""
import resource, signal, sys
from pathlib import Path
sys.path[:0] = [{str(Path(__file__).parent)!r}, {str(Path(published.__file__).parents[3])!r}]
from test_server_limits import SUM, Time, ledger
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
found = ledger(Path({str(tmp_path)!r}), Time(), SUM)
resource.setrlimit(resource.RLIMIT_FSIZE, (2000, resource.RLIM_INFINITY))
print(sum(found.reserve("move", {{"steps": 1}}) is None for _ in range(40)))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True)
    again = ledger(tmp_path, Time(), SUM)
    assert 3 < int(done.stdout) < 40
    assert again.used()["move"]["sums"] == {"steps": int(done.stdout)}
    assert again.reserve("move", {"steps": 1}) is None


def test_a_line_that_the_disk_took_in_part_is_taken_back(
    tmp_path: Path, time: Time, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, write = ledger(tmp_path, time, SUM), os.write
    assert refused(found, steps=3) == ""
    before = (tmp_path / "limits.json").read_bytes()
    with monkeypatch.context() as full:
        full.setattr(os, "write", lambda descriptor, data: write(descriptor, data[: len(data) // 2]))
        assert refused(found, steps=4).startswith("counters_unwritable: ")
    assert (tmp_path / "limits.json").read_bytes() == before
    assert refused(found, steps=9997) == "" and refused(found, steps=1).startswith("cumulative: ")


@pytest.mark.parametrize(("digits", "shown"), [(60, "1" * 60 + " "), (61, "1" * 60 + "... ")])
def test_a_long_number_is_cut_where_it_is_told(tmp_path: Path, time: Time, digits: int, shown: str) -> None:
    assert f" {shown}" in refused(ledger(tmp_path, time, RANGE), position=int("1" * digits))


def test_a_restart_adds_to_the_file_and_rewrites_nothing(tmp_path: Path, time: Time) -> None:
    assert refused(ledger(tmp_path, time, SUM), steps=1) == ""
    before = (tmp_path / "limits.json").read_bytes()
    assert refused(ledger(tmp_path, time, SUM), steps=1) == ""
    after = (tmp_path / "limits.json").read_bytes()
    assert after.startswith(before) and after.count(b"\n") == before.count(b"\n") + 1


def test_only_what_counts_is_written(tmp_path: Path, time: Time) -> None:
    found = ledger(tmp_path, time, SUM, still=[RANGE])
    assert refused(found, steps=1) == ""
    before = (tmp_path / "limits.json").stat().st_mtime_ns
    assert refused(found, steps=10**6) != ""
    assert found.reserve("still", {"position": 3}) is None
    assert found.judge("move", {"steps": 5}) is None
    assert (tmp_path / "limits.json").stat().st_mtime_ns == before


def test_threads_cannot_share_the_last_call(tmp_path: Path, time: Time) -> None:
    found = ledger(tmp_path, time, {**SUM, "most": 50}, {**RATE, "calls": 60})
    results: list[bool] = []

    def calls() -> None:
        results.extend(found.reserve("move", {"steps": 1}) is None for _ in range(20))

    threads = [threading.Thread(target=calls) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(30)
    assert (len(results), sum(results)) == (120, 50)


numbers = st.one_of(st.integers(-40, 40), st.floats(-40, 40), st.sampled_from([0.1, -0.1, 0.3, "7", True, None]))
calls = st.lists(
    st.tuples(st.fixed_dictionaries({}, optional={"x": numbers, "y": numbers}), st.integers(0, 8)), max_size=30
)
limits_of = st.lists(
    st.one_of(
        st.builds(
            lambda low, width, name: {"kind": "range", "parameter": name, "minimum": low, "maximum": low + width},
            st.integers(-20, 10),
            st.integers(0, 40),
            st.sampled_from("xy"),
        ),
        st.builds(
            lambda kind, most, name, default: {"kind": kind, "parameter": name, "most": most, "default": default},
            st.sampled_from(["step", "cumulative"]),
            st.floats(0, 60),
            st.sampled_from("xy"),
            st.sampled_from([None, 3, 0.1]),
        ),
        st.builds(lambda count, span: {"kind": "rate", "calls": count, "seconds": span}, st.integers(1, 4), st.just(9)),
        st.builds(lambda span: {"kind": "cooldown", "seconds": span}, st.integers(1, 5)),
    ),
    min_size=1,
    max_size=5,
)


@given(limits=limits_of, sequence=calls, restart=st.integers(1, 6))
def test_no_sequence_of_accepted_calls_exceeds_a_bound(
    tmp_path_factory: pytest.TempPathFactory, limits: list[dict[str, Any]], sequence: list[Any], restart: int
) -> None:
    folder, time = tmp_path_factory.mktemp("limits"), Time()
    limits = [{**limit, "source": "test"} for limit in limits]
    found = ledger(folder, time, *limits)
    accepted: list[tuple[float, dict[str, Any]]] = []
    for number, (arguments, wait) in enumerate(sequence):
        time.on(wait)
        if number % restart == 0:
            found = ledger(folder, time, *limits)
        judged = found.judge("move", arguments)
        assert judged == found.judge("move", arguments)
        assert found.reserve("move", arguments) == judged  # looking first shows what will be
        if judged is None:
            accepted.append((time.clock, arguments))
    for limit in limits:
        assert held(limit, accepted), (limit, accepted)


def held(limit: dict[str, Any], accepted: list[tuple[float, dict[str, Any]]]) -> bool:
    """Whether a limit was kept by all accepted calls, worked out from the list alone."""
    moments = [moment for moment, _ in accepted]
    if limit["kind"] == "cooldown":
        return all(after - before >= limit["seconds"] for before, after in itertools.pairwise(moments))
    if limit["kind"] == "rate":
        return all(
            sum(begin <= each < begin + limit["seconds"] for each in moments) <= limit["calls"] for begin in moments
        )
    given_values = [arguments.get(limit["parameter"], limit.get("default")) for _, arguments in accepted]
    if any(isinstance(value, bool | str) for value in given_values):
        return False
    values = [exact(value) for value in given_values if value is not None]
    if limit["kind"] == "range":
        return all(limit["minimum"] <= value <= limit["maximum"] for value in values)
    most = exact(limit["most"])
    if limit["kind"] == "step":
        return all(abs(after - before) <= most for before, after in itertools.pairwise(values))
    return all(abs(sum(values[: end + 1], Fraction(0))) <= most for end in range(len(values)))


def test_many_calls_of_many_tools_are_kept_and_read_again(tmp_path: Path, time: Time) -> None:
    """More of them than fitted into what was read once, which then counted as damaged."""
    often = {**RATE, "calls": 10_000, "seconds": 3600.0}
    tools: dict[str, Any] = {f"tool{number}": [often] for number in range(40)}
    line: dict[str, Any] = {"boot": "another", "wall": time.wall.timestamp(), "clock": 1000.0, "sums": {}, "last": {}}
    calls = [990.0 + number * 0.0012345 for number in range(9000)]
    lines = [json.dumps({"tool": name, **line, "calls": calls, "damaged": False}) for name in tools]
    (tmp_path / "limits.json").write_text("\n".join([HEADER.decode().strip(), *lines, ""]))
    assert (tmp_path / "limits.json").stat().st_size > 4_000_000
    for round_ in range(3):
        found = ledger(tmp_path, time, **tools)
        assert [len(item["calls"]) for item in found.used().values()] == [9000 + round_] * 40
        assert all(found.reserve(name, {}) is None for name in tools)
    before = (tmp_path / "limits.json").stat().st_size
    assert found.reserve("tool0", {}) is None
    assert 0 < (tmp_path / "limits.json").stat().st_size - before < 300


@given(steps=st.lists(st.tuples(st.sampled_from("abc"), st.integers(0, 30), st.booleans()), max_size=60))
def test_what_is_kept_is_what_was_counted(
    tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch, steps: list[tuple[str, int, bool]]
) -> None:
    """Through restarts, and through the file being written anew."""
    monkeypatch.setattr("octoform.policy.enforce._COMPACT_BYTES", 900)
    folder, time = tmp_path_factory.mktemp("kept"), Time()
    tools: dict[str, Any] = {"a": [RATE], "b": [{**RATE, "calls": 20}, {**SUM, "most": 10**9}], "c": [STEP, COOLDOWN]}
    found = ledger(folder, time, **tools)
    for name, gone, again in steps:
        time.on(gone)
        found.reserve(name, {"steps": gone, "position": gone})
        if again:
            used = found.used()
            found = ledger(folder, time, **tools)
            assert found.used() == used


def test_a_file_that_lost_moments_is_damaged(tmp_path: Path, time: Time) -> None:
    found = ledger(tmp_path, time, {**RATE, "calls": 9})
    for _ in range(4):
        assert refused(found) == ""
    lines = (tmp_path / "limits.json").read_text().splitlines(keepends=True)
    (tmp_path / "limits.json").write_text("".join([*lines[:2], *lines[3:]]))
    assert refused(ledger(tmp_path, time, {**RATE, "calls": 9})).startswith("counters_damaged")
