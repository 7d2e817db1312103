"""How the deployment is kept alive and who hears of it, as a manifest writes it. (Heavy: pydantic.)"""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from octoform.manifest import base_url
from octoform.manifest.schema.fields import Argument, Attempts, Dollars, Duration, Interval, Table, problem

METRICS_PATTERN = r"^[^~\x00][^\x00]*\.prom$"
MOST_CALLS = 1000
_COMMAND_HINT = "write for example [./tell-me, --trouble]; it gets the trouble as JSON on its standard input"
_WEBHOOK_HINT = "write https://alerts.example.org/hook, or keep it secret in a variable: ${ALERT_URL}"
_METRICS_HINT = "write a path that ends in .prom, such as /var/lib/node_exporter/octoform.prom"


def _webhook(value: str) -> str:
    complaint = base_url.complaint_as_written(value)
    if complaint is None:
        return value
    if "@" in value or "?" in value or "#" in value:
        what = "a URL with a user, a password, a query or a fragment may hold a secret"
        raise problem(what, "keep the whole URL in a variable: ${ALERT_URL}")
    raise problem(complaint[0], _WEBHOOK_HINT)


def _command(values: list[str]) -> list[str]:
    if not values[0].strip():
        raise problem("the first item of a command is a program", _COMMAND_HINT, 0)
    if any("\0" in value for value in values):
        raise problem("no argument of a program can hold a zero byte", _COMMAND_HINT)
    return values


def _metrics(value: str) -> str:
    """Only names that Prometheus' exporter reads: so no other file of a person can be written over by a slip."""
    if value.startswith("~"):
        raise problem("`~` is a shell's word for a home folder", "write the path in full, or relative to octopus.yaml")
    if "\0" in value or not value.endswith(".prom") or value.rsplit("/", 1)[-1] == ".prom":
        raise problem("this is no name of a file of metrics", _METRICS_HINT)
    return value


class Notify(Table):
    """Who hears of a trouble that a person should know of; none of these unless named."""

    command: Annotated[list[Argument], Field(min_length=1, max_length=200), AfterValidator(_command)] | None = None
    """A program and its arguments; it gets what happened as JSON on its standard input, and 10 seconds."""
    webhook: (
        Annotated[
            str, AfterValidator(_webhook), Field(max_length=2000, json_schema_extra={"pattern": base_url.PATTERN})
        ]
        | None
    ) = None
    """A URL that gets what happened as a POST of JSON; ${NAME} stands for an environment variable."""
    desktop: bool = False
    """Show it as a notification of the session of whoever runs the daemon, with notify-send."""


class Daemon(Table):
    """How `octoform watch` keeps the deployment alive."""

    interval: Interval = "300s"
    """The time from one look to the next while nothing happens: 60s, 5m; at least 5s. Events are noticed at once."""
    heal_attempts: Attempts = 3
    """How often one trouble is tried to be repaired before it is frozen and a person is told."""
    apply: Literal["auto", "ask"] = "auto"
    """Whether new or vanished kinds of hardware are taken up at once, or planned and asked about."""
    calls_per_hour: Annotated[int, Field(ge=0, le=MOST_CALLS)] = 30
    """How often in an hour agents may be asked; 0 is never."""
    usd_per_hour: Dollars | None = None
    """US dollars that agents may cost in an hour; without it there is no limit."""
    claim_expiry: Duration = "30m"
    """The longest that a claim about the hardware holds without new evidence."""
    notify: Notify = Notify()
    """Who hears of a trouble that a person should know of."""
    metrics: (
        Annotated[
            str,
            AfterValidator(_metrics),
            Field(min_length=1, max_length=400, json_schema_extra={"pattern": METRICS_PATTERN}),
        ]
        | None
    ) = None
    """A file for Prometheus' node exporter, such as /var/lib/node_exporter/octoform.prom; it ends in .prom."""
