"""Tokens and money as words: short enough for a line that moves, honest about what is unknown."""


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
