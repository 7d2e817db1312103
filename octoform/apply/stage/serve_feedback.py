"""Feedback between attempts at a stage, and from a later stage to an earlier one.

An attempt begins with the last output that could be read, however the attempt that wrote it ended, and with all that is
wrong with it. What the test at DEPLOY finds wrong with the server goes back to SERVE, in the same run: some faults of
generated code show only when its tools are called. No set of packages fixes them, so DEPLOY is not tried
again; the agent of SERVE gets the findings and the server that it was accepted with, and then DEPLOY runs once more.
In the same way INTERFACE's agent can say what only IDENTIFY can fix, and SERVE's what only INTERFACE can, each once in
a run. Only what was made in this very
run is sent back: a run never remakes what its plan did not list, and both stages stay within the budgets of one run.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from octoform.apply.context import Context, accepted
from octoform.apply.stage.acceptance import Verdict, digest_of, read_output
from octoform.apply.stage.assignment import Assignment
from octoform.apply.stage.attempt import Failed
from octoform.apply.stage.secret_scan import leaked, masked, without_secrets
from octoform.contracts.artifact_parser import parse
from octoform.diagnostics import Diagnostic, has_errors
from octoform.graph.compile import RETURNS
from octoform.graph.model import input_of, moved_parts
from octoform.harness.port import ExitReason, Outcome, Task
from octoform.records import dataclass, replace
from octoform.state.accepted import file_digest
from octoform.state.artifact_cache import generations
from octoform.state.files import read_regular
from octoform.state.layout import STAGES

SHOWN = frozenset(
    {"ENDPOINT-TOOL-BROKEN", "ENDPOINT-TOOLS-DIFFER", "ENDPOINT-CALL-NOT-LOGGED", "ENDPOINT-OUTPUT-INVALID"}
    | {"ENDPOINT-RESULT-IMPLAUSIBLE", "ENDPOINT-RESULT-OTHER-DEVICE", "ENDPOINT-RESULT-CONSTANT"}
    | {"ENDPOINT-DEVICE-ABSENT", "ENDPOINT-PROGRAM-MISSING", "ENDPOINT-NETWORK-FAILED", "ENDPOINT-NOTHING-ANSWERS"}
)
"""Faults of the server itself, seen when it was started and called."""
TOLD = frozenset({"DEPLOY-STATUS-ERROR"})
"""DEPLOY's agent reports that no set of packages works; it may be wrong, so it is asked again first."""

BLAMED = frozenset({"INTERFACE-IDENTIFY-WRONG"})
"""INTERFACE's agent reports what only IDENTIFY can fix."""
UNSERVABLE = frozenset({"SERVE-INTERFACE-WRONG"})
"""SERVE's agent reports what only INTERFACE can fix."""


@dataclass(frozen=True, slots=True)
class Blame:
    """When a failed stage sends the run back along its edge of the graph (`Node.returns`), and how often in one run.

    ``at_once``: the codes against which another attempt of the stage itself cannot help.
    """

    codes: frozenset[str]
    at_once: frozenset[str]
    most: int
    fault: str


BLAMES = {
    "serve": Blame(SHOWN | TOLD, SHOWN, 2, "the server is at fault"),
    "interface": Blame(UNSERVABLE, UNSERVABLE, 1, "the interface is at fault"),
    "identify": Blame(BLAMED, BLAMED, 1, "what was identified is at fault"),
}
"""By the stage that is at fault."""

NOT_OF_OUTPUT = frozenset({"APPLY-OUTSIDE-WRITE", "ARTIFACT-MISSING"})
"""Why an attempt is refused whatever its output is like."""
UNREADABLE = "It could not be read as a whole, so nothing else in it was looked at."
CLEAN = "Nothing is wrong with it, as far as that shows without running it; the attempt itself did not end well."


def remembered(
    context: Context, assignment: Assignment, task: Task, ended: tuple[Outcome, Verdict], failed: Failed
) -> Failed:
    """The feedback of a rejected attempt to the next one; ``failed`` is its own feedback, if any.

    An output that no one has judged, since its agent did not end well, is judged here: it is not accepted.
    """
    outcome, verdict = ended
    try:
        data, problems = read_output(task)
    except OSError:
        return failed  # the agent has made away with it
    if has_errors(problems) or not data or leaked(task, data):
        return failed
    value, judged = assignment.judge(context, task, masked(task, data)[0])
    found = [item for item in without_secrets(task, judged) if has_errors([item])]
    if outcome.reason is ExitReason.FINISHED:
        of_output = [item for item in verdict.diagnostics if has_errors([item]) and item.code not in NOT_OF_OUTPUT]
        found = [*of_output, *(item for item in found if item not in of_output)]
    right = UNREADABLE if value is None else _right(value, found) if found else CLEAN
    return replace(failed, former=masked(task, data)[0], found=tuple(found), right=right, changed=())


def _right(value: Any, found: Iterable[Diagnostic]) -> str:
    """Of each list of an output, how many members no finding is about; empty where that shows nothing."""
    places = [(item.pointer or "").split("/")[1:3] for item in found]
    if not isinstance(value, dict) or any(len(place) < 2 for place in places):
        return ""
    named = {tuple(place) for place in places}
    lines = []
    for name, members in value.items():
        wrong = sum(1 for key, _ in named if key == name)
        if isinstance(members, list) and len(members) > wrong:
            lines.append(f"{len(members) - wrong} of {len(members)} {name}")
    return f"No finding is about {', '.join(lines)}." if lines else ""


MAX_CHANGES = 40
_KEYS = {"devices": "id", "left_out": "id", "tools": "name"}


def rerun(context: Context, stage: str, parts: Mapping[str, str]) -> Failed | None:
    """The start of a stage with a changed input: its accepted output, and the changes.

    None where there is no such output as it was accepted. PROBE is none of them: it describes the host as it is now.
    """
    known = context.store.snapshot.nodes.get(stage)
    if stage == STAGES[0] or known is None or not known.file_digest or dict(known.key_parts) == dict(parts):
        return None
    former = read_regular(context.layout.output(stage))[0]
    if former is None or file_digest(context.layout, stage) != known.file_digest:
        return None
    pairs = [(name, known.key_parts.get(name), parts.get(name)) for name in moved_parts(known.key_parts, parts)]
    lines = [line for name, before, after in pairs for line in _moved(context, name, before, after)]
    more = [f"and {len(lines) - MAX_CHANGES} more"] if len(lines) > MAX_CHANGES else []
    return Failed((), None, context.specs[stage].text, former, changed=(*lines[:MAX_CHANGES], *more))


def _moved(context: Context, part: str, before: str | None, after: str | None) -> Iterator[str]:
    """The changes in one part of a stage's input, a line for each member of an artifact."""
    kind, _, name = part.partition(".")
    if not input_of(part):
        how = "is new" if before is None else "is no longer there" if after is None else "is another one"
        yield f"{kind} {name} {how}" if name else f"the {kind} {how}"
        return
    yield f"the output of {name.upper()} is another one"
    former, now = _accepted_as(context, name, before), accepted(context, name)
    if isinstance(former, dict) and isinstance(now, dict):
        for members, key in _KEYS.items():
            yield from _differences(members, *(_by(key, value.get(members, ())) for value in (former, now)))


def _accepted_as(context: Context, stage: str, wanted: str | None) -> Any:
    """The output of a stage with that digest, from the copies of what was accepted; None where none is left."""
    for files in generations(context.layout, stage):
        value = parse(stage, next(iter(files.values())), stage)[0] if len(files) == 1 else None
        if value is not None and digest_of(context, stage, value) == wanted:
            return value
    return None


def _by(key: str, members: Iterable[Mapping[str, Any]]) -> dict[str, Mapping[str, Any]]:
    return {str(each[key]): each for each in members}


def _differences(members: str, former: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[str]:
    for name in sorted({*former, *now}):
        if name not in now:
            yield f"{members}: {name} is gone"
        elif name not in former:
            yield f"{members}: {name} is new"
        elif former[name] != now[name]:
            fields = sorted(
                each for each in {*former[name], *now[name]} if former[name].get(each) != now[name].get(each)
            )
            yield f"{members}: {name} differs in {', '.join(fields)}"


def is_earlier_fault(stage: str, found: Iterable[Diagnostic]) -> bool:
    """True when another attempt at the stage cannot help, since what it stands on is at fault."""
    blame = BLAMES.get(RETURNS.get(stage, ""))
    return blame is not None and any(item.code in blame.at_once and has_errors([item]) for item in found)


def sent_back(context: Context, maker: str, found: Iterable[Diagnostic]) -> Failed | None:
    """The feedback to the earlier stage that has to fix a failure with these findings; None where it is not its."""
    blamed = tuple(item for item in found if item.code in BLAMES[maker].codes and has_errors([item]))
    if not blamed:
        return None
    former = read_regular(context.layout.output(maker))[0]
    return Failed((), None, context.specs[maker].text, former, standing=blamed)
