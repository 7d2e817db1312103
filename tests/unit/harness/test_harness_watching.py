"""The watcher in virtual time: what ends a run, for which reason, and what it has cost by then."""

import json
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import pytest

from octoform.harness.port import (
    AgentEvent,
    Closed,
    ExitReason,
    ModelProblem,
    Output,
    Price,
    TaskLimits,
    ToolCalled,
    Totals,
    Turn,
    Usage,
)
from octoform.harness.watcher import MAX_LINE, Watcher

EVENTS: dict[bytes, AgentEvent] = {
    b"turn": Turn(Usage(1000, 400, 100)),
    b"turn of unknown use": Turn(),
    b"tool": ToolCalled("shell", "ls /sys"),
    b"said": Output("thinking"),
    b"refused": ModelProblem(ExitReason.AUTH, "401", final=True),
    b"limited": ModelProblem(ExitReason.RATE_LIMIT, "429"),
    b"totals": Totals(Usage(5000, 0, 500)),
    b"priced totals": Totals(Usage(5000, 0, 500, 0.07, "claude-code")),
    b"done": Closed(ok=True),
    b"failed": Closed(ok=False, text="it gave up"),
}
PRICE = Price(10.0, 1.0, 100.0, "manifest")


class Words:
    """One event a line."""

    def read(self, stream: str, line: bytes) -> Iterable[AgentEvent]:
        if line in EVENTS:
            yield EVENTS[line]


class Run:
    """A watcher on a clock of its own; every call happens at a time."""

    def __init__(self, price: Price | None = None, **limits: float) -> None:
        self.now = 0.0
        self.told: list[AgentEvent] = []
        given = TaskLimits(**{"wall_seconds": 600.0, "idle_seconds": 60.0, **limits})  # type: ignore[arg-type]
        self.watcher = Watcher(Words(), given, lambda event, _s, _u: self.told.append(event), price, lambda: self.now)

    def at(self, seconds: float, *lines: bytes) -> ExitReason | None:
        """Why the run has to be ended after those lines at that time; None: it goes on."""
        self.now = seconds
        for line in lines:
            self.watcher.feed("stdout", line + b"\n")
        self.watcher.tick()
        return self.watcher.reason


def test_silence_is_idle_and_every_sign_of_work_starts_it_anew() -> None:
    run = Run()
    assert run.at(59, b"said") is None
    assert run.at(118, b"tool") is None
    assert run.at(177, b"turn") is None
    assert run.at(236) is None
    assert run.at(238) is ExitReason.IDLE


def test_without_a_limit_silence_is_no_reason() -> None:
    run = Run()
    run.watcher = Watcher(Words(), TaskLimits(600.0), lambda *told: None, clock=lambda: run.now)
    assert run.at(599) is None


def test_what_is_no_event_is_no_sign_of_work() -> None:
    run = Run()
    assert run.at(59, b"noise") is None
    assert run.at(61, b"noise") is ExitReason.IDLE


def test_replies_are_counted() -> None:
    run = Run(turns=3)
    assert run.at(1, b"turn", b"tool", b"turn", b"tool", b"turn") is None
    assert run.at(2, b"turn") is ExitReason.TURN_LIMIT
    assert run.watcher.turns == 4


def test_money_is_counted_with_cached_input_at_its_own_price() -> None:
    run = Run(PRICE, usd=0.03)
    assert run.at(1, b"turn") is None
    # 600 fresh at 10, 400 cached at 1, 100 out at 100 dollars a million.
    assert run.watcher.usage.cost_usd == pytest.approx(0.0164)
    assert run.watcher.usage.cost_source == "manifest"
    assert run.at(2, b"turn") is ExitReason.BUDGET


def test_the_programs_own_sum_stands_above_what_was_added_up() -> None:
    run = Run(PRICE)
    run.at(1, b"turn", b"turn", b"totals")
    assert (run.watcher.usage.input_tokens, run.watcher.usage.output_tokens) == (5000, 500)


@pytest.mark.parametrize(("source", "cost"), [("manifest", 0.1), ("litellm", 0.07)])
def test_a_programs_own_report_of_its_cost_goes_before_a_table_and_behind_the_owner(source: str, cost: float) -> None:
    run = Run(replace(PRICE, source=source))
    run.at(1, b"turn", b"priced totals")
    assert run.watcher.usage.cost_usd == pytest.approx(cost)
    assert run.watcher.usage.cost_source == ("manifest" if source == "manifest" else "claude-code")


def test_what_nobody_told_is_unknown_and_costs_nothing_that_could_be_limited() -> None:
    run = Run(PRICE, usd=0.0001)
    assert run.at(1, b"turn of unknown use") is None
    assert (run.watcher.usage.input_tokens, run.watcher.usage.cost_usd) == (None, None)


def test_a_refused_key_ends_the_run_at_once() -> None:
    assert Run().at(1, b"refused") is ExitReason.AUTH


def test_trouble_may_last_as_long_as_patience() -> None:
    run = Run(patience_seconds=20.0)
    assert run.at(0, b"limited") is None
    assert run.at(19, b"limited") is None
    assert run.at(21, b"limited") is ExitReason.RATE_LIMIT


def test_trouble_that_passes_is_forgotten() -> None:
    run = Run(patience_seconds=20.0)
    assert run.at(0, b"limited") is None
    assert run.at(19, b"turn") is None
    assert run.at(30, b"limited") is None
    assert run.at(49) is None, "patience begins again"
    assert run.watcher.problem == EVENTS[b"limited"]


def test_trouble_is_no_sign_of_work_and_gives_silence_its_reason() -> None:
    run = Run(patience_seconds=1000.0)
    assert run.at(30, b"limited") is None
    assert run.at(61) is ExitReason.RATE_LIMIT


def test_a_program_that_is_done_and_does_not_leave_has_finished() -> None:
    run = Run(turns=1)
    assert run.at(5, b"turn", b"done") is None
    assert run.at(14) is None
    assert run.at(16) is ExitReason.FINISHED


def test_a_program_that_says_it_failed_is_waited_for_as_any_other() -> None:
    run = Run()
    assert run.at(5, b"failed") is None
    assert run.at(16) is None
    assert run.at(66) is ExitReason.IDLE


def test_lines_come_in_any_pieces_and_one_that_is_too_long_is_left_out() -> None:
    run = Run()
    for piece in (b"tu", b"rn\nto", b"ol\n", b"x" * (MAX_LINE + 1), b"turn\ntu", b"rn\n"):
        run.watcher.feed("stdout", piece)
    assert run.watcher.turns == 2
    run.watcher.feed("stdout", b"turn")
    run.watcher.finish()
    assert run.watcher.turns == 3, "the last line may lack its end"


def test_what_was_said_last_is_told_at_the_end() -> None:
    run = Run()
    run.at(1, b"turn")
    EVENTS[b"closing words"] = Output("closing words")
    run.watcher.feed("stdout", b"said\nclosing words\n")
    run.watcher.finish()
    assert run.told[-1] == Output("closing words")


def test_the_streams_are_read_apart() -> None:
    run = Run()
    run.watcher.feed("stdout", b"tu")
    run.watcher.feed("stderr", b"limited\n")
    run.watcher.feed("stdout", b"rn\n")
    assert run.watcher.turns == 1


def test_the_transcript_holds_every_event_with_its_time(tmp_path: Path) -> None:
    run = Run()
    run.watcher.recording(tmp_path / "transcript.jsonl")
    run.at(1, b"tool")
    run.at(2.5, b"turn", b"said", b"noise")
    run.watcher.finish()
    lines = [json.loads(line) for line in (tmp_path / "transcript.jsonl").read_text().splitlines()]
    assert [(line["at"], line["event"]) for line in lines] == [(1, "tool_called"), (2.5, "turn"), (2.5, "said")]
    assert lines[0]["text"] == "ls /sys"
    assert (tmp_path / "transcript.jsonl").stat().st_mode & 0o777 == 0o600


def test_a_transcript_is_never_written_through_a_link(tmp_path: Path) -> None:
    (tmp_path / "target").write_text("mine")
    (tmp_path / "transcript.jsonl").symlink_to(tmp_path / "target")
    with pytest.raises(OSError, match="symbolic links"):
        Run().watcher.recording(tmp_path / "transcript.jsonl")
    assert (tmp_path / "target").read_text() == "mine"
