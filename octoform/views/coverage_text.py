"""Coverage in words: one place for what its figures mean and why a device is skipped, for terminal, page and JSON."""

from collections.abc import Sequence

from octoform.engine.coverage import OFFERED, CoverageReport, Group, Share, Stage
from octoform.engine.coverage_runs import Pass, known_sum
from octoform.views.format.table import Column
from octoform.views.format.values import money, tokens
from octoform.views.plan_text import INPUTS, counted

REASONS = {
    "bus_infrastructure": "only carries other devices",
    "no_function": "has no function that an agent could use",
    "no_standard_interface": "no library or system interface reaches it",
    OFFERED: "a profile that comes with octoform matches it",
    "no_credentials": "needs a login that is not configured",
    "network_neighbour": "is a neighbour, not part of this host",
    "duplicate_path": "is another entry of a device that is identified",
    "virtual": "has no hardware behind it",
    "unknown_meaning": "is unidentified",
    "not_permitted": "is not open to this user",
    "tool_budget": "did not fit into the tool budget",
    "server_size": "did not fit into the limit of 500 lines of a server",
    "unsafe": "could do harm when it is called",
    "out_of_scope": "is a part of the computer itself",
}
ENDPOINT = {"running": "the endpoint runs", "stopped": "the endpoint does not run", "absent": "no endpoint yet"}
ONBOARDABLE = "Eligible is what senses or acts, what is unknown, and what was skipped although an agent could use it."
WITH_INFRASTRUCTURE = "Infrastructure is what was identified as carrying others, such as disks, radios and hubs."
BESIDE = (
    "Neither counts what IDENTIFY skipped as a carrier, without function, virtual, another path of a device, "
    "a part of the computer itself, or a neighbour on the network."
)
USABLE = "Usable is a device that at least one tool serves."
STABLE = "Compared are identity, category and capabilities of each device; a tool's name is not part of them."
DEFINITIONS = {
    "usable": USABLE,
    "onboardable": ONBOARDABLE,
    "with_infrastructure": f"{WITH_INFRASTRUCTURE} {BESIDE}",
    "stable": STABLE,
    "tier": "; ".join(f"{number}: {words}" for number, words in INPUTS.items()),
}
UNKNOWN = "-"
STAGES = (
    Column("stage"),
    Column("agent", most=40),
    Column("attempts", right=True),
    Column("retries", right=True),
    Column("time", right=True),
    Column("tokens in/out", right=True, goes=2),
    Column("cost", right=True, goes=3),
    Column("accepted", goes=1),
)
PASSES = (
    Column("no", right=True),
    Column("agent", most=28, goes=6),
    Column("stages", right=True, goes=2),
    Column("retries", right=True),
    Column("agent time", right=True),
    Column("discovered", right=True),
    Column("identified", right=True),
    Column("tools", right=True),
    Column("tokens in/out", right=True, goes=3),
    Column("cost", right=True, goes=4),
    Column("ended", most=14, goes=5),
    Column("began", goes=1),
)


def reason(code: str) -> str:
    """Why a device is skipped; a code that is not known here stands for itself."""
    return REASONS.get(code, code.replace("_", " "))


def platform(report: CoverageReport) -> str:
    """``debian 12, x86_64``."""
    found = report.platform
    system = " ".join(word for word in (found.get("os_id") or found.get("os", ""), found.get("os_version", "")) if word)
    return ", ".join(word for word in (system, found.get("arch", "")) if word not in ("", "unknown"))


def percent(share: Share) -> str:
    """``92 %``; 100 only where nothing is missing."""
    if share.percent is None:
        return UNKNOWN
    return f"{int(share.percent)} %" if share.usable < share.of else "100 %"


def figures(onboardable: Share, with_infrastructure: Share) -> tuple[tuple[str, Share], ...]:
    """Both figures as sentences."""
    verb = "is" if onboardable.of == 1 else "are"
    return (
        (f"{onboardable.usable} of {counted(onboardable.of, 'eligible device')} {verb} usable", onboardable),
        (f"{with_infrastructure.usable} of {with_infrastructure.of}, counting infrastructure", with_infrastructure),
    )


def part(group: Group) -> str:
    """``3``, or ``2 of 3`` where some have no tool."""
    return str(group.annotated) if group.usable == group.annotated else f"{group.usable} of {group.annotated}"


def seconds(value: float) -> str:
    """``0.4 s``, ``268 s``."""
    return f"{value:.1f} s" if value < 100 else f"{value:.0f} s"


def stage_row(item: Stage) -> tuple[str, ...]:
    """The cells of `STAGES`."""
    spent = (_tokens(item.input_tokens, item.output_tokens), _cost(item.cost_usd))
    tries = (str(item.attempts), str(max(0, item.attempts - 1)), seconds(item.seconds))
    return (item.name, item.agent, *tries, *spent, _moment(item.accepted_at))


def all_stages(items: Sequence[Stage]) -> tuple[str, ...]:
    """The row below them: their sums."""
    given, made = (known_sum(getattr(item, name) for item in items) for name in ("input_tokens", "output_tokens"))
    spent = (_tokens(given, made), _cost(known_sum(item.cost_usd for item in items)))
    tries = (sum(item.attempts for item in items), sum(max(0, item.attempts - 1) for item in items))
    return ("all", "", *map(str, tries), seconds(sum(item.seconds for item in items)), *spent, "")


def pass_row(item: Pass) -> tuple[str, ...]:
    """The cells of `PASSES`."""
    counts = (UNKNOWN if count is None else str(count) for count in (item.enumerated, item.identified, item.tools))
    spent = (_tokens(item.input_tokens, item.output_tokens), _cost(item.cost_usd))
    tries = (str(len(item.stages)), str(item.retries), seconds(item.seconds))
    head = (str(item.number), "; ".join(item.agents))
    return (*head, *tries, *counts, *spent, item.ended, _moment(item.began))


def quoted_counts(words: Sequence[tuple[str, int]]) -> str:
    """``"a camera" in 2 runs, "a lamp" in 1``."""
    first, *rest = words
    return ", ".join([f'"{first[0]}" in {counted(first[1], "run")}', *(f'"{word}" in {count}' for word, count in rest)])


def agents(counts: Sequence[tuple[str, int]]) -> str:
    """``builtin``, or each with its number of runs where several were at work."""
    return counts[0][0] if len(counts) == 1 else ", ".join(f"{name} {count}" for name, count in counts)


def _tokens(given: int | None, made: int | None) -> str:
    if given is None and made is None:
        return UNKNOWN
    return "/".join(UNKNOWN if count is None else tokens(count) for count in (given, made))


def _cost(value: float | None) -> str:
    return UNKNOWN if value is None else money(value)


def _moment(stamp: str) -> str:
    return stamp.replace("T", " ").removesuffix("Z")[:16]
