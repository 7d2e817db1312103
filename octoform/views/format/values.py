"""Foreign text on one line of a terminal: bounded, control characters shown.

Times as a person at the machine reads them: the clock on the wall, and how long ago.

Tokens and money as words: short enough for a line that moves, honest about what is unknown.
"""

from datetime import UTC, datetime

from octoform.base.clock import parse_stamp
from octoform.base.escaping import escaped


def spent(input_tokens: int | None, output_tokens: int | None, cost_usd: float | None) -> str:
    """``12.4k in, 830 out, $0.031``; empty when nothing is known."""
    parts = []
    if input_tokens is not None:
        parts.append(f"{tokens(input_tokens)} in")
    if output_tokens is not None:
        parts.append(f"{tokens(output_tokens)} out")
    if cost_usd is not None:
        parts.append(money(cost_usd))
    elif parts:
        parts.append("cost unknown")
    return ", ".join(parts)


def used(
    input_tokens: int | None, cached_tokens: int | None, output_tokens: int | None, cost_usd: float | None, source: str
) -> str:
    """`spent`, with who priced it and how much of the input came from a cache; empty when nothing is known."""
    priced = f", priced by {source}" if cost_usd is not None and source else ""
    cached = f", {tokens(cached_tokens)} of them cached" if cached_tokens else ""
    return spent(input_tokens, output_tokens, cost_usd) + priced + cached


def tokens(count: int) -> str:
    """A count of tokens: ``830``, ``12.4k``, ``1.2M``."""
    if count < 1000:
        return str(count)
    return f"{count / 1000:.1f}k" if count < 1_000_000 else f"{count / 1_000_000:.1f}M"


def money(dollars: float) -> str:
    """US dollars: cents from ten of them on, and three significant digits below."""
    return f"${dollars:.2f}" if dollars >= 0.1 or not dollars else f"${dollars:.3g}"


def clock(stamp: str, now: datetime | None = None) -> str:
    """The local time of an RFC 3339 stamp: ``03:12:40``, on another day with its date; the text where it is none."""
    at = parse_stamp(stamp)
    if at is None:
        return one_line(stamp, 30)
    local = at.astimezone()
    today = (now or datetime.now(UTC)).astimezone().date()
    return local.strftime("%H:%M:%S" if local.date() == today else "%Y-%m-%d %H:%M:%S")


def ago(stamp: str, now: datetime | None = None) -> str:
    """How long that is ago, ``2 h 5 min``; empty where the stamp is none or lies ahead."""
    at = parse_stamp(stamp)
    seconds = ((now or datetime.now(UTC)) - at).total_seconds() if at is not None else -1.0
    return length(seconds) if seconds >= 0 else ""


def length(seconds: float) -> str:
    """A length with its two largest units: ``0.4 s``, ``12 s``, ``2 min 5 s``, ``2 h 5 min``, ``3 d 4 h``."""
    if seconds < 10:
        return f"{seconds:.1f} s"
    whole = int(seconds)
    units = (("d", whole // 86400), ("h", whole // 3600 % 24), ("min", whole // 60 % 60), ("s", whole % 60))
    first = next(index for index, (_, count) in enumerate(units) if count)
    return " ".join(f"{count} {unit}" for unit, count in units[first : first + 2] if count)


def escape(text: str) -> str:
    """Hidden characters as backslash escapes; line feeds and tabs stay."""
    return escaped(text, "\n\t")


def one_line(text: str, width: int) -> str:
    """At most ``width`` characters of the text on one line."""
    flat = escape(" ".join(text.split()))
    return flat if len(flat) <= width else flat[: max(0, width - 1)] + "…"
