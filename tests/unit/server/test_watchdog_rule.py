"""Whom the watchdog interrupts, determined from the stack: generated code and what it called, never the server."""

import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import FrameType

import pytest

from octoform.server.execution import watchdog as module
from octoform.server.execution.watchdog import Blocked, Fault, Interrupted, Watchdog

PLACES = {
    "ours": str(Path(module.__file__).parent / "any.py"),
    "call": str(Path(module.__file__).parents[1] / "gate" / "gate.py"),
    "generated": "/project/state/bench/serve/server.py",
    "runtime": "/project/state/bench/serve/runtime/devices.py",
    "library": "/env/lib/python3/site-packages/driver.py",
}
Step = Callable[..., object]


class Call:
    """A call that has all the time in the world."""

    deadline = float("inf")
    tool = "move"
    blocked = False


def step(place: str) -> Step:
    """A function that lies there and calls what it is given."""
    space: dict[str, Step] = {}
    exec(compile("def run(inner, work):\n    return inner()", PLACES[place], "exec"), space)
    return space["run"]


def judged(stack: str, known: bool = True) -> Fault | None:
    """What is said of a stack, the outermost place first."""
    dog, work = Watchdog(), Call()
    dog.cover(Path("/project/state/bench/serve"))
    steps = [step(place) for place in stack.split()]
    dog._frames = frozenset(each.__code__ for each, place in zip(steps, stack.split(), strict=True) if place == "call")
    if known:
        dog.watch(work)

    def look() -> Fault | None:
        return dog._fault(below(sys._getframe(), look.__code__))

    inner: Step = look
    for each in reversed(steps):
        inner = partial(each, inner, work)  # which has no frame
    found = inner()
    assert found is None or isinstance(found, Fault)
    return found


def below(frame: FrameType, code: object) -> FrameType:
    """The frame that called the test's own."""
    while frame.f_code is not code:
        assert frame.f_back is not None
        frame = frame.f_back
    assert frame.f_back is not None
    return frame.f_back


@pytest.mark.parametrize("stack", ["generated", "generated library", "generated runtime", "library generated library"])
def test_generated_code_and_what_it_called_is_interrupted(stack: str) -> None:
    fault = judged(stack)
    assert fault is not None and fault.raised is Interrupted and fault.call is None
    assert "/project/state/bench/serve" in fault.where


@pytest.mark.parametrize("stack", ["ours", "library", "ours library", "generated ours", "generated ours library"])
def test_our_own_code_and_what_it_called_is_left_alone(stack: str) -> None:
    assert judged(stack) is None


@pytest.mark.parametrize("stack", ["ours generated", "ours library generated library", "generated ours generated"])
def test_what_our_own_code_called_fails_as_it_might_by_itself(stack: str) -> None:
    fault = judged(stack)
    assert fault is not None and fault.raised is Blocked


@pytest.mark.parametrize(
    "stack", ["call generated", "call library", "call ours generated", "ours library call generated"]
)
def test_a_call_is_known_by_its_frame(stack: str) -> None:
    fault = judged(stack)
    assert fault is not None and fault.raised is Interrupted and fault.call.tool == "move"


@pytest.mark.parametrize("stack", ["call", "call ours", "call generated ours"])
def test_a_call_in_our_own_code_is_left_alone(stack: str) -> None:
    assert judged(stack) is None


def test_a_call_that_is_over_is_left_alone() -> None:
    assert judged("call generated", known=False) is None


def test_another_call_than_the_one_that_was_found_is_never_hit() -> None:
    dog = Watchdog()
    dog.cover(Path("/project/state/bench/serve"))
    dog._blocked, dog._suspect = True, object()
    step("generated")(lambda: dog._handle(0, sys._getframe(1)), None)
    assert not dog._done
