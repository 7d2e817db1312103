"""A reply that comes in piece by piece: the run is not idle meanwhile, and a long reply is no trying again."""

from collections.abc import Iterable

from octoform.harness.port import AgentEvent, ExitReason, ModelProblem, Output, Replying, TaskLimits
from octoform.harness.watcher import Watcher


class Letters:
    """One event a line."""

    def read(self, stream: str, line: bytes) -> Iterable[AgentEvent]:
        if line == b"piece":
            yield Replying()
        elif line == b"failed":
            yield ModelProblem(ExitReason.UNREACHABLE, "failed")


class Run:
    """A watcher on a clock of its own."""

    def __init__(self) -> None:
        self.now = 0.0
        self.told: list[AgentEvent] = []
        limits = TaskLimits(600.0, idle_seconds=60.0, patience_seconds=30.0)
        self.watcher = Watcher(Letters(), limits, lambda event, _s, _u: self.told.append(event), clock=lambda: self.now)

    def at(self, seconds: float, line: bytes) -> bool:
        """True when the run has to be ended after that line at that time."""
        self.now = seconds
        self.watcher.feed("stdout", line + b"\n")
        return self.watcher.tick()


def test_a_long_reply_is_not_idle_and_tells_nothing() -> None:
    run = Run()
    assert not any(run.at(second, b"piece") for second in range(0, 300, 50))
    assert set(run.told) == {Output("")}, "only that it is silent"
    assert run.at(311, b"no event")
    assert run.watcher.reason is ExitReason.IDLE


def test_a_long_reply_after_trouble_is_no_trying_again_but_the_trouble_stands() -> None:
    run = Run()
    assert not run.at(0, b"failed")
    assert not any(run.at(second, b"piece") for second in range(20, 100, 20))
    assert not run.at(109, b"failed"), "patience counts from the last piece"
    assert run.at(111, b"no event")
    assert run.watcher.reason is ExitReason.UNREACHABLE
