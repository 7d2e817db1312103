"""Attempts for a person and for a program: a list with one line each, and everything about one."""

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from octoform.engine.inspect.attempts import ACCEPTED, INTERRUPTED, REUSE, RUNNING, Attempt, Detail
from octoform.engine.recording import Recorded
from octoform.harness.port import Closed
from octoform.views.format.console import Console
from octoform.views.format.output import document
from octoform.views.format.problems import near, render
from octoform.views.format.table import Column, lines
from octoform.views.format.values import escape, money, one_line, tokens, used

LATEST = 20
MAX_CALLS = 200
MAX_FAILURES = 20
WIDTH = 160
STYLES = {"+": "green", "-": "red", "@": "cyan"}
COLUMNS = (
    Column("no", right=True, most=48),
    Column("stage", most=48),
    Column("try", right=True, most=48),
    Column("agent", goes=5, most=48),
    Column("ended", most=48),
    Column("time", right=True, goes=4, most=48),
    Column("turns", right=True, goes=1, most=48),
    Column("tokens in/out", right=True, goes=2, most=48),
    Column("cost", right=True, goes=6, most=48),
    Column("when", goes=3, most=48),
)
"""On a terminal that is too narrow the least useful columns are omitted; -json and `attempts show` have all."""
UNKNOWN = "-"
FILES = {"prompt.md": "prompt", "agent.log": "log", "transcript.jsonl": "transcript"}
"""The kept files of an attempt, shown as far as they are there: a reuse has none."""


def listing(console: Console, attempts: Sequence[Attempt], *, everything: bool, as_json: bool) -> int:
    """The attempts, newest last; the latest only, unless everything is asked for."""
    chosen = attempts if everything else attempts[-LATEST:]
    if as_json:
        items = [_document(item) for item in chosen]
        return document(console, {"format": 1, "attempts": items, "older": len(attempts) - len(chosen)})
    if not attempts:
        console.line("No agent has been started yet. Next:  octoform apply")
        return 0
    rows = [_row(item) for item in chosen]
    head, *found = lines(COLUMNS, rows, console.width)
    console.line(console.paint(head, "dim"))
    painted = map(partial(_painted, console), chosen, found)
    for line in painted if len(found) == len(chosen) else found:
        console.line(line)
    older = len(attempts) - len(chosen)
    if older:
        console.line(console.paint(f"{older} older; -all shows them", "dim"))
    return 0


def one(console: Console, detail: Detail, *, as_json: bool) -> int:
    """Everything about one attempt."""
    if as_json:
        return document(console, {"format": 1, **_document(detail.attempt), **_more(detail)})
    for line in _describe(console, detail):
        console.raw(line) if line.startswith("    ") else console.line(line)
    return 0


def recorded(console: Console, made: Recorded, *, as_json: bool) -> int:
    """A recording was written."""
    if as_json:
        counts = {"stages": dict(made.stages), "files": made.files, "bytes": made.size}
        return document(console, {"format": 1, "recording": str(made.folder), **counts})
    stages = ", ".join(f"{stage} ({_counted(count, 'attempt')})" for stage, count in made.stages.items())
    console.line(f"Recorded {stages}: {_counted(made.files, 'file')}, {made.size} bytes in {_near(made.folder)}.")
    console.line("To play it, copy it beside an octopus.yaml with:")
    console.line(f"  harness: {{name: replay, recording: {one_line(made.folder.name, WIDTH)}}}")
    return 0


def _row(item: Attempt) -> tuple[str, ...]:
    found, usage = item.facts, item.facts.usage
    stage = item.stage if found.role == "stage" else f"{item.stage} ({found.role})"
    turns = UNKNOWN if found.turns is None else str(found.turns)
    cost = UNKNOWN if usage.cost_usd is None else money(usage.cost_usd)
    figures = (f"{found.seconds:.1f}s", turns, _tokens(usage.input_tokens, usage.output_tokens), cost)
    cells = (str(item.number), stage, str(item.attempt), _agent(item), _ended(item), *figures, _when(item))
    return tuple(one_line(cell, 48) for cell in cells)


def _painted(console: Console, item: Attempt, line: str) -> str:
    style = {ACCEPTED: "green", RUNNING: "cyan", INTERRUPTED: "yellow"}.get(item.state, "red")
    word = _ended(item)
    return line.replace(f"  {word}", f"  {console.paint(word, style)}", 1) if console.colour else line


def _agent(item: Attempt) -> str:
    found = item.facts
    return f"{found.harness}, {found.model}" if found.model else found.harness or UNKNOWN


def _ended(item: Attempt) -> str:
    """``accepted``, ``refused PROBE-DUPLICATE-ID (+2)``, ``timeout``, ``running``."""
    codes = item.codes if item.state not in (ACCEPTED, RUNNING, INTERRUPTED) else []
    shown = [code for code in codes if item.state == "refused"]
    more = f" (+{len(shown) - 1})" if len(shown) > 1 else ""
    return one_line(f"{item.state} {shown[0]}{more}" if shown else item.state, 48)


def _when(item: Attempt) -> str:
    return item.began.replace("T", " ")


def _tokens(given: int | None, made: int | None) -> str:
    if given is None and made is None:
        return UNKNOWN
    return "/".join(UNKNOWN if count is None else tokens(count) for count in (given, made))


def _describe(console: Console, detail: Detail) -> Iterator[str]:
    item, record, found = detail.attempt, detail.attempt.record, detail.attempt.facts
    reuse = record is not None and record.role == REUSE
    head = f"attempt {item.number}  {item.stage}, {'reuse' if reuse else f'try {item.attempt}'}  {_ended(item)}"
    yield console.paint(one_line(head, WIDTH), "bold")
    yield f"  began      {one_line(_when(item), WIDTH)}"
    if reuse:
        yield f"  reused     {one_line(found.detail, WIDTH)}; no agent ran"
    else:
        yield f"  agent      {one_line(_agent(item), WIDTH)}{_program(found.program)}"
        yield f"  run        {one_line(_run(item), WIDTH)}"
        if found.detail:
            yield f"             {one_line(found.detail, WIDTH)}"
        yield f"  used       {_used(item)}"
    for name, size in detail.sizes.items():
        if size is not None:
            yield f"  {FILES.get(name, name):<10} {_near(item.folder / name)}, {size} bytes"
    yield from _calls(detail)
    yield from _problem_lines(detail)
    yield from _spec(console, detail)
    if record is not None and record.files:
        yield "  files it left"
        yield from (f"    {one_line(name, WIDTH)}" for name in record.files)
    for problem in item.diagnostics:
        yield ""
        yield render(near(problem), colour=console.colour, width=console.width)


def _run(item: Attempt) -> str:
    found = item.facts
    turns = "" if found.turns is None else f", {_counted(found.turns, 'turn')}"
    status = "" if found.exit_status is None else f", exit status {found.exit_status}"
    return f"{found.reason} {'for' if item.state == RUNNING else 'after'} {found.seconds:.1f} s{status}{turns}"


def _used(item: Attempt) -> str:
    usage = item.facts.usage
    source = usage.cost_source or ""
    cost = used(usage.input_tokens, usage.cached_tokens, usage.output_tokens, usage.cost_usd, source)
    return one_line(cost, WIDTH) or "unknown"


def _program(program: str | None) -> str:
    return f" ({one_line(program, WIDTH)})" if program else ""


def _near(path: Path) -> str:
    shown = path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path
    return escape(" ".join(str(shown).split("\n")))


def _calls(detail: Detail) -> Iterator[str]:
    calls = detail.calls
    if not calls:
        return
    failed = f", {detail.calls_failed} failed" if detail.calls_failed else ""
    yield f"  {_counted(len(calls), 'tool call')}{failed}"
    for at, call in calls[:MAX_CALLS]:
        yield f"    {at:7.1f}s  {one_line(call.tool, 24)}  {one_line(call.text, WIDTH)}".rstrip()
    if len(calls) > MAX_CALLS:
        yield f"    and {len(calls) - MAX_CALLS} more, in the transcript"


def _problem_lines(detail: Detail) -> Iterator[str]:
    troubles = detail.problems
    if not troubles:
        return
    yield "  problems"
    for at, trouble in troubles[:MAX_FAILURES]:
        kind = "closed" if isinstance(trouble, Closed) else trouble.reason.value
        yield f"    {at:7.1f}s  {kind}  {one_line(trouble.text, WIDTH)}".rstrip()
    if len(troubles) > MAX_FAILURES:
        yield f"    and {len(troubles) - MAX_FAILURES} more, in the transcript"


def _spec(console: Console, detail: Detail) -> Iterator[str]:
    edit = detail.spec
    if edit is None:
        return
    asked = "" if edit.permitted else ", though it was not asked to"
    yield f"  spec       edited: {_counted(edit.added, 'line')} added, {edit.removed} removed{asked}"
    if not edit.certain:
        yield console.paint("    against the spec of today; the one it was given is no more", "yellow")
    for line in edit.lines[2:]:
        style = STYLES.get(line[:1])
        yield "    " + (console.paint(escape(line), style) if style else escape(line))


def _document(item: Attempt) -> dict[str, Any]:
    fields = item.facts.model_dump(mode="json")
    known = {"number": item.number, "stage": item.stage, "attempt": item.attempt, "state": item.state}
    return {**fields, **known, "started_at": item.began, "folder": str(item.folder)}


def _more(detail: Detail) -> dict[str, Any]:
    edit, calls, troubles = detail.spec, detail.calls, detail.problems
    lines = None
    if edit is not None:
        counts = {"added": edit.added, "removed": edit.removed, "permitted": edit.permitted}
        lines = {**counts, "certain": edit.certain, "diff": list(edit.lines)}
    return {
        "prompt": _file(detail, "prompt.md"),
        "log": _file(detail, "agent.log"),
        "spec": lines,
        "tool_calls": [{"at": at, "tool": call.tool, "text": call.text} for at, call in calls[:MAX_CALLS]],
        "tool_calls_in_all": len(calls),
        "tool_calls_failed": detail.calls_failed,
        "troubles": [
            {"at": at, "reason": None if isinstance(item, Closed) else item.reason.value, "text": item.text}
            for at, item in troubles[:MAX_FAILURES]
        ],
        "troubles_in_all": len(troubles),
    }


def _file(detail: Detail, name: str) -> dict[str, Any] | None:
    size = detail.sizes.get(name)
    return None if size is None else {"path": str(detail.attempt.folder / name), "bytes": size}


def _counted(count: int, word: str) -> str:
    return f"{count} {word}" if count == 1 else f"{count} {word}s"
