"""Money and time: what a run and its stages have cost so far, and what is left of their budgets."""

from dataclasses import dataclass, field

from octoform.harness.port import Usage

LEAST_SECONDS = 0.1


@dataclass(slots=True)
class Purse:
    """What was spent in this run: US dollars by stage, attempts and seconds by stage and role.

    A stage that a later one sends back goes on with what its budget has left: it is one stage of one run. ``until`` is
    when the stage at work has to be over, trials included, on the run's clock; None where nothing has.
    """

    spent: dict[str, float] = field(default_factory=dict)
    used: dict[tuple[str, str], tuple[int, float]] = field(default_factory=dict)
    until: float | None = None

    def time(self, now: float, most: float) -> float:
        """Seconds that something may take which takes ``most`` where no stage is at work; never none at all."""
        return most if self.until is None else max(LEAST_SECONDS, min(most, self.until - now))

    def pay(self, stage: str, usage: Usage) -> None:
        """Add what an attempt has cost; an unknown cost adds nothing."""
        self.spent[stage] = self.spent.get(stage, 0.0) + (usage.cost_usd or 0.0)

    def left(self, stage: str, stage_usd: float | None, run_usd: float | None) -> float | None:
        """What the next attempt of a stage may cost; None without a limit."""
        limits = []
        if stage_usd is not None:
            limits.append(stage_usd - self.spent.get(stage, 0.0))
        if run_usd is not None:
            limits.append(run_usd - sum(self.spent.values()))
        return min(limits) if limits else None
