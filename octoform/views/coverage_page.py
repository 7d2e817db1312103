"""Coverage as one page to be kept, printed or sent: no script, nothing from elsewhere, every foreign text escaped.

Imported only where a page is wanted: it brings the template engine.
"""

from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from octoform.engine.coverage import Coverage, CoverageReport, Standing
from octoform.views import coverage as coverage_view
from octoform.views import coverage_text as words
from octoform.views.format import table
from octoform.views.format.values import one_line

TEMPLATES = Path(__file__).parent / "templates"
MAX_LENGTH = 500


def page(report: CoverageReport) -> str:
    """The whole page."""
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        undefined=StrictUndefined,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["foreign"] = lambda text, longest=MAX_LENGTH: one_line(str(text), longest)
    found = report.coverage
    return environment.get_template("coverage.html.j2").render(
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
        disagreement=coverage_view.disagreement,
        skipped=coverage_view.skipped,
        tables=_tables(report),
    )


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
