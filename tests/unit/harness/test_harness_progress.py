"""Progress in virtual time: bursts become one line, silence becomes a sign of life."""

from octoform.harness.containment.task_log import Progress


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def test_a_burst_is_one_line_and_silence_is_told_every_ten_seconds() -> None:
    clock, found = Clock(), []
    progress = Progress(lambda text, elapsed: found.append((text, elapsed)), clock)
    progress.feed(b"one\ntwo\nthree\n")
    assert found == [("three", 0.0)]
    for _ in range(250):
        clock.now += 0.1
        progress.tick()
    assert [text for text, _ in found] == ["three", "", ""]
    assert 10.0 <= found[1][1] <= 10.3
    progress.feed(b"four\n")
    assert found[-1][0] == "four"
