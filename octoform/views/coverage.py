"""Coverage for a person at a terminal, as a page and for a program: the funnel, the figures, then every device."""

import textwrap
from collections.abc import Callable, Iterator
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from octoform.engine.coverage import OFFERED, Counted, Coverage, CoverageReport, Device, Share, Standing
from octoform.engine.coverage_runs import Disagreement, Pass, Stability
from octoform.views import coverage_text as words
from octoform.views.format import table
from octoform.views.format.console import Console
from octoform.views.format.output import document
from octoform.views.format.table import Column
from octoform.views.format.values import one_line
from octoform.views.plan_text import INPUTS, counted

if TYPE_CHECKING:
    from jinja2 import Template

LATEST = 10
WIDEST = 140
WIDE = 110
"""From here on the usable devices are a table; below, each has lines of its own."""
BAR = 40
USABLE = (
    Column("device", most=28),
    Column("is", most=44),
    Column("class", goes=2, most=16),
    Column("input"),
    Column("confidence", right=True, goes=4),
    Column("by", goes=1, most=28),
    Column("tools", most=400),
)
ALONE = "nothing to compare yet; each `octoform apply -target interface -replace identify` is one run more"
Paint = Callable[..., str]
TEMPLATES = Path(__file__).parent / "templates"
MAX_LENGTH = 500


def show(console: Console, report: CoverageReport, *, everything: bool, as_json: bool) -> int:
    """The report; exit code 0, also for one that is not complete yet."""
    if as_json:
        return document(console, as_document(report))
    blocks = "█" if _can_show(console, "█") else "#"
    for line in lines(report, min(console.width, WIDEST), console.paint, everything=everything, block=blocks):
        console.line(line)
    return 0


def written(console: Console, path: Path, *, as_json: bool) -> int:
    """A page was written."""
    if as_json:
        return document(console, {"format": 1, "written": str(path)})
    console.line(f"Wrote {one_line(str(path), WIDEST)}.")
    return 0


def as_document(report: CoverageReport) -> dict[str, object]:
    """The report as JSON has it."""
    found = report.coverage
    document: dict[str, object] = {
        "format": 1,
        "platform": dict(report.platform),
        "endpoint": report.endpoint,
        "notes": list(report.notes),
        "funnel": asdict(found.funnel),
        "coverage": {
            "onboardable": _share(found.onboardable),
            "with_infrastructure": _share(found.with_infrastructure),
        },
        "definitions": words.DEFINITIONS,
        "categories": [asdict(group) for group in found.categories],
        "classes": [asdict(group) for group in found.kinds],
        "left_out": {code: len(devices) for code, devices in found.left_out().items()},
        "denied_tools": list(found.denied),
        "devices": [_device(item) for item in found.devices],
        "stability": _stability(report.stability),
        "stages": [{**asdict(item), "retries": max(0, item.attempts - 1)} for item in report.stages],
        "runs": [asdict(item) for item in report.passes],
    }
    return document


def _share(share: Share | None) -> dict[str, object] | None:
    return None if share is None else {"usable": share.usable, "of": share.of, "percent": share.percent}


def _device(item: Device) -> dict[str, object]:
    fields = asdict(item)
    fields["class"] = fields.pop("kind")
    return {name: None if value == "" else value for name, value in fields.items()}


def _stability(found: Stability | None) -> dict[str, object] | None:
    if found is None:
        return None
    fields = asdict(found)
    fields["agents"] = [{"agent": name, "runs": count} for name, count in found.agents]
    fields["core"] = [item._asdict() for item in found.core]
    for item, source in zip(fields["disagreements"], found.disagreements, strict=True):
        item["said"] = [{"text": text, "runs": count} for text, count in source.said]
    return fields


def _can_show(console: Console, text: str) -> bool:
    try:
        text.encode(console.out.encoding or "utf-8")
    except (UnicodeEncodeError, LookupError):
        return False
    return True


def lines(
    report: CoverageReport, width: int, paint: Paint, *, everything: bool = False, block: str = "█"
) -> Iterator[str]:
    """The report for a person, at most ``width`` wide but for what is to be copied."""
    head = ", ".join(word for word in (words.platform(report), words.ENDPOINT[report.endpoint]) if word)
    yield paint("Coverage of this host", "bold") + f"  {one_line(head, width - 23)}"
    for note in report.notes:
        yield from (paint(line, "yellow") for line in _wrapped(note, width))
    yield ""
    found = report.coverage
    yield from _funnel(found, width, paint, block)
    yield from _groups(found, width)
    yield from _figures(found, width, paint)
    yield from _usable(found, width, paint)
    yield from _unknown(found, width, paint)
    yield from _without(found, width, paint)
    yield from _left_out(found, width, paint, everything)
    yield from _waiting(found, width, paint)
    yield from _stable(report.stability, width, paint, everything)
    yield from _made(report, width, paint)
    yield from _passes(report.passes, width, paint, everything)


def _wrapped(text: str, width: int, indent: str = "  ") -> list[str]:
    flat = one_line(text, 2000)
    return textwrap.wrap(flat, width, initial_indent=indent, subsequent_indent=indent, break_on_hyphens=False)


def _funnel(found: Coverage, width: int, paint: Paint, block: str) -> Iterator[str]:
    funnel = found.funnel
    steps = (("discovered", funnel.enumerated), ("identified", funnel.identified), ("with tools", funnel.with_tools))
    room = min(BAR, width - 22)
    for name, count in steps:
        if count is None:
            yield f"  {name:<10}  {paint('not known yet', 'dim')}"
            continue
        length = max(1, round(room * count / funnel.enumerated)) if count else 0
        yield f"  {name:<10}  {count:>5}  {paint(block * length, 'cyan')}".rstrip()
    if funnel.tools is not None:
        yield f"  {'tools':<10}  {funnel.tools:>5}"
    denied = f"{counted(len(found.denied), 'tool')} denied to everybody by the policy: {', '.join(found.denied)}"
    yield from _wrapped(denied, width) if found.denied else ()


def _groups(found: Coverage, width: int) -> Iterator[str]:
    """How many of each category and class have tools; a class of which all have is shown by its number alone."""
    for name, groups in (("by category", found.categories), ("by class", found.kinds)):
        if groups and found.funnel.with_tools is not None:
            text = ", ".join(f"{group.name} {words.part(group)}" for group in groups)
            first, *rest = textwrap.wrap(one_line(text, 2000), width - 15, break_on_hyphens=False)
            yield f"  {name:<11}  {first}"
            yield from (" " * 15 + line for line in rest)


def _figures(found: Coverage, width: int, paint: Paint) -> Iterator[str]:
    if found.onboardable is None or found.with_infrastructure is None:
        return
    yield ""
    for text, share in words.figures(found.onboardable, found.with_infrastructure):
        yield f"  {paint(words.percent(share).rjust(6), 'bold')}  {text}"
    yield ""
    for text in (words.ONBOARDABLE, f"{words.WITH_INFRASTRUCTURE} {words.BESIDE}"):
        yield from (paint(line, "dim") for line in _wrapped(text, min(width, 100)))


def _head(text: str, paint: Paint) -> Iterator[str]:
    yield ""
    yield paint(text, "bold")


def _indented(columns: tuple[Column, ...], rows: list[tuple[str, ...]], width: int, paint: Paint) -> Iterator[str]:
    head, *rest = table.lines(columns, rows, width - 2)
    yield "  " + paint(head, "dim")
    yield from (f"  {line}" for line in rest)


def _usable(found: Coverage, width: int, paint: Paint) -> Iterator[str]:
    devices = found.of(Standing.USABLE)
    if not devices:
        return
    yield from _head(f"usable ({len(devices)})", paint)
    if width >= WIDE:
        rows = [(*_named(item), ", ".join(item.tools)) for item in devices]
        yield from _indented(USABLE, rows, width, paint)
        yield from _offers(devices, width)
        return
    for item in devices:
        yield from _brief(item, width, lambda text: paint(text, "green"))
        yield from _wrapped(", ".join(item.tools), width, "    ")
    yield from _offers(devices, width)


def _offers(devices: tuple[Device, ...], width: int) -> Iterator[str]:
    """The offers for devices that are not listed one by one with a reason."""
    for item in devices:
        if item.offer:
            yield from _wrapped(f"{item.id}: {words.reason(OFFERED)} ({item.offer})", width)


def _named(item: Device) -> tuple[str, ...]:
    tier = "" if item.tier is None else INPUTS[item.tier]
    return (item.id, item.identified_as, item.kind, tier, f"{item.confidence:.2g}", _by(item))


def _by(item: Device) -> str:
    """The kind of evidence that decided, and the profile that contributed."""
    return one_line(f"{item.method} {item.profile}" if item.profile else item.method, 60)


def _unknown(found: Coverage, width: int, paint: Paint) -> Iterator[str]:
    devices = found.of(Standing.UNKNOWN)
    if not devices:
        return
    yield from _head(f"unknown ({len(devices)}): one question each", paint)
    for item in devices:
        yield from _brief(item, width, lambda text: paint(text, "yellow"))
        yield from _wrapped(_why(item), width, "    ") if item.reason == OFFERED else ()
        yield from _wrapped(item.question, width, "    ")
        answered = "answered, but the answer did not identify it; add to it: " if item.answered else ""
        yield f'    {answered}octoform answer {one_line(item.id, 100)} "..."'
        yield f"    to act over a line: octoform profile new {one_line(item.id, 100)}"


def _without(found: Coverage, width: int, paint: Paint) -> Iterator[str]:
    devices = found.of(Standing.NAMED)
    if not devices:
        return
    decided = found.funnel.tools is not None
    yield from _head(f"identified, {'without a tool' if decided else 'tools not decided yet'} ({len(devices)})", paint)
    for item in devices:
        yield from _brief(item, width, str)
        if item.reason:
            yield from _wrapped(_why(item), width, "    ")


def _brief(item: Device, width: int, colour: Callable[[str], str]) -> Iterator[str]:
    """Its id, what it is and its confidence: on one line where that fits, else on two or more."""
    name = one_line(item.id, 100)
    tier = f", {INPUTS[item.tier]}" if item.tier is not None else ""
    confidence = f", {item.confidence:.2g} by {_by(item)}" if item.confidence else ""
    facts = f"{item.kind or item.category}{tier}{confidence}"
    called = one_line(item.identified_as, 300)
    if len(name) + len(called) + len(facts) + 7 <= width:
        yield f"  {colour(name)}  {called} ({facts})"
        return
    beside = len(name) + len(called) + 4 <= width
    yield f"  {colour(name)}  {called}" if beside else f"  {colour(name)}"
    for text in (facts,) if beside else (called, facts):
        yield from _wrapped(text, width, "    ")


def _why(item: Device) -> str:
    found = words.reason(item.reason)
    return f"{found} ({item.detail})" if item.detail else found


def _left_out(found: Coverage, width: int, paint: Paint, everything: bool) -> Iterator[str]:
    groups = found.left_out()
    if not groups:
        return
    yield from _head(f"skipped ({sum(map(len, groups.values()))})", paint)
    for code, devices in groups.items():
        counts = "; eligible" if devices[0].counted is Counted.ONBOARDABLE else ""
        text = f"{words.reason(code)} ({one_line(code, 40)}{counts})"
        first, *rest = textwrap.wrap(text, width - 8, break_on_hyphens=False)
        yield f"  {len(devices):>4}  {first}"
        yield from (" " * 8 + line for line in rest)
        if everything or code == OFFERED:
            for item in devices:
                yield f"        {one_line(item.id, 100)}  {one_line(item.detail or item.seen_as, 200)}".rstrip()
        else:
            yield f"        {paint(_some([item.id for item in devices], width - 8), 'dim')}"


def _some(names: list[str], width: int) -> str:
    """As many names as there is room for, and how many more."""
    flat = [one_line(name, width - 16) for name in names]
    for count in range(len(flat), 0, -1):
        more = f" and {len(flat) - count} more" if count < len(flat) else ""
        text = ", ".join(flat[:count]) + more
        if len(text) <= width or count == 1:
            return text
    return ""


def _waiting(found: Coverage, width: int, paint: Paint) -> Iterator[str]:
    devices = found.of(Standing.WAITING)
    if devices:
        yield from _head(f"seen, not identified yet ({len(devices)})", paint)
        yield f"  {_some([item.id for item in devices], width - 2)}"
        yield from _offers(devices, width)


def _stable(found: Stability | None, width: int, paint: Paint, everything: bool) -> Iterator[str]:
    if found is None:
        return
    yield from _head(f"identity over {counted(found.runs, 'run')} ({one_line(words.agents(found.agents), 60)})", paint)
    if found.runs < 2:
        yield from _wrapped(ALONE, width)
    else:
        yield f"  {found.same} of {counted(found.compared, 'device')} had the same result in every run"
        yield f"  {len(found.core)} of {found.abilities} capabilities in every run, {counted(found.names, 'tool name')}"
    shown = found.disagreements if everything else found.disagreements[:LATEST]
    for item in shown:
        yield from (paint(line, "yellow") for line in _wrapped(f"{item.device}: {disagreement(item)}", width))
    if len(shown) < len(found.disagreements):
        yield f"  and {len(found.disagreements) - len(shown)} more; -all shows them"
    for renamed in found.renamed:
        yield from _wrapped(f"renamed, and no disagreement: {' -> '.join(renamed.names)}", width)
    if found.skipped:
        yield from _wrapped(skipped(found), width)


def disagreement(item: Disagreement) -> str:
    """In what the runs differ about a device."""
    aspect = f"capability {item.what}" if item.what else item.aspect
    return f"{aspect}: {words.quoted_counts(item.said)}"


def skipped(found: Stability) -> str:
    """Why some runs are not compared."""
    were = "run was" if found.skipped == 1 else "runs were"
    return f"{found.skipped} earlier {were} given another spec, other answers or other profiles, and not compared"


def _made(report: CoverageReport, width: int, paint: Paint) -> Iterator[str]:
    if report.stages:
        yield from _head("what the accepted outputs took", paint)
        rows = [*map(words.stage_row, report.stages), words.all_stages(report.stages)]
        yield from _indented(words.STAGES, rows, width, paint)


def _passes(passes: tuple[Pass, ...], width: int, paint: Paint, everything: bool) -> Iterator[str]:
    if not passes:
        return
    shown = passes if everything else passes[-LATEST:]
    yield from _head(f"runs ({len(passes)})", paint)
    yield from _indented(words.PASSES, [words.pass_row(item) for item in shown], width, paint)
    if len(shown) < len(passes):
        yield paint(f"  {len(passes) - len(shown)} older; -all shows them", "dim")


def page(report: CoverageReport) -> str:
    """The report as one page to be kept, printed or sent.

    It has no script, takes nothing from elsewhere and has every foreign text escaped.
    """
    found = report.coverage
    return _template().render(
        report=report,
        found=found,
        words=words,
        platform=words.platform(report),
        accepted=max((item.accepted_at for item in report.stages), default=""),
        shares=_shares(found),
        bars=_bars(found),
        usable=found.of(Standing.USABLE),
        unknown=found.of(Standing.UNKNOWN),
        named=found.of(Standing.NAMED),
        waiting=found.of(Standing.WAITING),
        left_out=found.left_out(),
        disagreement=disagreement,
        skipped=skipped,
        tables=_tables(report),
    )


@cache
def _template() -> "Template":
    """The template of the page, compiled once per process."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined  # only a page pays for it

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        undefined=StrictUndefined,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["foreign"] = lambda text, longest=MAX_LENGTH: one_line(str(text), longest)
    return environment.get_template("coverage.html.j2")


def _shares(found: Coverage) -> list[tuple[str, str, float]]:
    """Each figure with its sentence, and as a number for its bar."""
    if found.onboardable is None or found.with_infrastructure is None:
        return []
    both = words.figures(found.onboardable, found.with_infrastructure)
    return [(words.percent(share), text, share.percent or 0.0) for text, share in both]


def _bars(found: Coverage) -> list[tuple[str, int | None, float]]:
    """Each step of the funnel with its count, and its width in percent of the first."""
    funnel = found.funnel
    steps = (("discovered", funnel.enumerated), ("identified", funnel.identified), ("with tools", funnel.with_tools))
    whole = funnel.enumerated or 1
    return [(name, count, round(100 * (count or 0) / whole, 2)) for name, count in steps]


def _tables(report: CoverageReport) -> list[tuple[str, tuple[table.Column, ...], list[tuple[str, ...]]]]:
    """The tables of the making: title, columns, rows."""
    found: list[tuple[str, tuple[table.Column, ...], list[tuple[str, ...]]]] = []
    if report.stages:
        rows = [*map(words.stage_row, report.stages), words.all_stages(report.stages)]
        found.append(("What the accepted outputs took", words.STAGES, rows))
    if report.passes:
        found.append((f"Runs ({len(report.passes)})", words.PASSES, [words.pass_row(item) for item in report.passes]))
    return found
