"""From the checked policy to its frozen value: texts of times become numbers. (Heavy: the document.)"""

from octoform.durations import hours, rate, seconds
from octoform.manifest import policy_document as document
from octoform.manifest.policy_model import Limit, Policy, Rule


def policy(source: document.Policy) -> Policy:
    """The policy of a document without errors."""
    return Policy(
        mode=source.mode,
        read=source.read,
        actuate=source.actuate,
        irreversible=source.irreversible,
        rules=tuple(Rule(tuple(rule.tools), rule.decision) for rule in source.rules),
        limits=tuple(_limit(limit) for limit in source.limits),
        timeout=seconds(source.timeout) or 0,
        timeouts=tuple((glob, seconds(length) or 0) for glob, length in sorted(source.timeouts.items())),
        result_bytes=source.result_bytes,
    )


def _limit(source: document.Limit) -> Limit:
    return Limit(
        tool=source.tool,
        parameter=source.parameter,
        minimum=_plain(source.minimum),
        maximum=_plain(source.maximum),
        step=_plain(source.step),
        cumulative=_plain(source.cumulative),
        rate=rate(source.rate) if source.rate is not None else None,
        cooldown=seconds(source.cooldown) if source.cooldown is not None else None,
        quiet_hours=hours(source.quiet_hours) if source.quiet_hours is not None else None,
        units=tuple(source.units),
    )


def _plain(value: float | None) -> float | None:
    """A whole number as one, so that messages show it as it was written."""
    return int(value) if value is not None and value.is_integer() else value
