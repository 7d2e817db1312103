"""The attempts of a host as passes through the stages, each with what it took and what it came to.

A person applies, and the stages that have work run one after the other: that is a pass. Attempts are numbered over
all of them, so a pass ends where the next attempt is of an earlier stage, or begins a stage anew.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from octoform.apply.stage.escalation import merged
from octoform.apply.stage.serve_feedback import JUDGE, MAKER
from octoform.engine.coverage.run_comparison import Run, run_of
from octoform.engine.inspect.attempts import ACCEPTED, REUSE, Attempt
from octoform.state.layout import STAGES

ESCALATE = "escalate"
Number = TypeVar("Number", int, float)
Output = Callable[[Attempt], Mapping[str, Any] | None]
"""What an accepted attempt wrote, where it can still be read."""
_MEMBER = {"probe": "devices", "identify": "devices", "interface": "tools"}


@dataclass(frozen=True, slots=True)
class Pass:
    """One pass. ``number`` is that of its first attempt, ``seconds`` are the agents' own, ``ended`` its last word.

    ``enumerated``, ``annotated`` and ``tools`` are what stood at its end; None where that is no longer known, as are
    tokens and US dollars that nobody told.
    """

    number: int
    began: str
    ended: str
    stages: tuple[str, ...]
    agents: tuple[str, ...]
    attempts: int
    retries: int
    seconds: float
    enumerated: int | None
    annotated: int | None
    tools: int | None
    input_tokens: int | None = None
    output_tokens: int | None = None
    cost_usd: float | None = None


def grouped(attempts: Sequence[Attempt]) -> list[list[Attempt]]:
    """The attempts by pass, in their order."""
    groups: list[list[Attempt]] = []
    for item in attempts:
        if not groups or _begins(item, groups[-1]):
            groups.append([])
        groups[-1].append(item)
    return groups


def _begins(item: Attempt, before: Sequence[Attempt]) -> bool:
    last = before[-1]
    if item.stage == last.stage:
        return _turn(item) <= _turn(last)
    returned = (last.stage, item.stage) == (JUDGE, MAKER) and last.state != ACCEPTED
    return STAGES.index(item.stage) < STAGES.index(last.stage) and not returned


def _turn(item: Attempt) -> tuple[int, int]:
    """The place of an attempt among those of its stage: what is taken over, the stage's agent, the one after it."""
    role = item.told.role
    return (0 if role == REUSE else 2 if role == ESCALATE else 1), item.attempt


def passes(groups: Iterable[Sequence[Attempt]], output: Output) -> tuple[Pass, ...]:
    """What each pass took and came to; a stage that did not run stands as the pass before left it."""
    counts: dict[str, int | None] = dict.fromkeys(_MEMBER)
    found = []
    for group in groups:
        for item in group:
            value = output(item) if item.stage in _MEMBER and item.state == ACCEPTED else None
            if value is not None and item.told.role != ESCALATE:
                counts[item.stage] = len(value[_MEMBER[item.stage]])
        found.append(_pass(group, counts))
    return tuple(found)


def _pass(group: Sequence[Attempt], counts: Mapping[str, int | None]) -> Pass:
    used = [item.told.usage for item in group]
    asked = [item for item in group if item.told.role != REUSE]
    return Pass(
        number=group[0].number,
        began=group[0].began,
        ended=group[-1].state,
        stages=tuple(dict.fromkeys(item.stage for item in group)),
        agents=tuple(dict.fromkeys(agent_of(item) for item in group)),
        attempts=len(asked),
        retries=len(asked) - len({(item.stage, item.told.role) for item in asked}),
        seconds=round(sum(item.told.seconds for item in group), 3),
        enumerated=counts["probe"],
        annotated=counts["identify"],
        tools=counts["interface"],
        input_tokens=known_sum(one.input_tokens for one in used),
        output_tokens=known_sum(one.output_tokens for one in used),
        cost_usd=known_sum(one.cost_usd for one in used),
    )


def known_sum(values: Iterable[Number | None]) -> Number | None:
    """The sum of what is known; None when nothing is."""
    known = [value for value in values if value is not None]
    return sum(known[1:], known[0]) if known else None


def agent_of(item: Attempt) -> str:
    """Who worked: ``pi, openai/x``, or that an output was taken over."""
    if item.told.role == REUSE:
        return "taken over"
    return f"{item.told.harness}, {item.told.model}" if item.told.model else item.told.harness


def runs(groups: Iterable[Sequence[Attempt]], output: Output) -> list[tuple[Attempt, Run]]:
    """Every accepted IDENTIFY of an agent with the INTERFACE after it, oldest first, each with its last attempt."""
    found: list[tuple[Attempt, Run]] = []
    interface: Mapping[str, Any] | None = None
    rests_on: Mapping[str, Any] | None = None
    for group in groups:
        identify, last = _identified(group, output)
        made = [output(item) for item in group if item.stage == "interface" and item.state == ACCEPTED]
        if identify is not None and identify != rests_on:
            interface, rests_on = None, identify  # tools of another answer are not this one's
        interface = made[-1] if made else interface
        if identify is not None and last is not None:
            found.append((last, run_of(agent_of(last), identify, interface)))
    return found


def _identified(group: Sequence[Attempt], output: Output) -> tuple[Mapping[str, Any] | None, Attempt | None]:
    """What a pass's own agents said of the devices, a second one's words in place of the first's."""
    said: Mapping[str, Any] | None = None
    last = None
    for item in group:
        if item.stage != "identify" or item.state != ACCEPTED or item.told.role == REUSE:
            continue
        value = output(item)
        if value is None:
            continue
        more = item.told.role == ESCALATE and said is not None
        said, last = (merged(said, value) if more and said is not None else value), item
    return said, last
