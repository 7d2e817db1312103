"""What a check of the endpoint saw, as values."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from octoform.diagnostics import Diagnostic


@dataclass(frozen=True, slots=True)
class TrialCall:
    """One trial call, and its repetitions.

    ``device`` is the one that the call was for, where it is known. ``skipped`` is the reason why there was none.
    ``error_class`` is the exception's class as the log tells it, or ``Timeout``, ``OutputSchema``, ``ResultRefused``,
    ``Protocol``, ``BadArgument``. ``logged`` means that call and result both stand in the log, ``ended_well`` is what
    that result says. ``pictures`` holds
    ``{"bytes", "mean", "spread"}`` for each picture of the answer, brightness in 0..255. ``results`` are the structured
    results of all calls that were made, ``raw`` the numbers that the tool read meanwhile, one table for each.
    """

    tool: str
    ok: bool
    skipped: str | None = None
    error_class: str | None = None
    message: str | None = None
    ms: float | None = None
    logged: bool = False
    ended_well: bool | None = None
    pictures: tuple[dict[str, Any], ...] = ()
    device: str | None = None
    results: tuple[Any, ...] = ()
    raw: tuple[Mapping[str, float], ...] = ()


@dataclass(frozen=True, slots=True)
class CheckReport:
    """What the client saw. ``tools`` are the served tools with their schemas, in the spelling of the artifacts."""

    answered: bool
    error: str | None
    protocol: str | None
    server: dict[str, Any] | None
    tools: tuple[dict[str, Any], ...]
    calls: tuple[TrialCall, ...]
    seconds: float
    survivors: int = 0
    log: str = ""
    unrecorded: Diagnostic | None = None
