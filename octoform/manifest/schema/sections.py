"""The policy as a manifest writes it: the tables that are checked against and that the JSON Schema is made of.

(Heavy: pydantic.)
"""

import re
from functools import partial
from ipaddress import ip_address
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, create_model, model_validator

from octoform.manifest import model_url
from octoform.manifest.model import EVERY_INTERFACE, FIRST_PORT, TUNNEL_COMMAND, TUNNEL_URL
from octoform.manifest.schema.fields import (
    UNIQUE,
    Argument,
    Attempts,
    Dollars,
    Duration,
    Interval,
    Table,
    added,
    distinct,
    problem,
)
from octoform.patterns import regex
from octoform.policy import DURATION, Form, Setting
from octoform.policy.kinds import BOUNDS, PACES, RANGE, SETTINGS
from octoform.policy.resolve import RESULT_BYTES, TIMEOUT

GLOB_PATTERN = r"^[A-Za-z0-9_.*?-]{1,128}$"


def _glob(value: str) -> str:
    if re.fullmatch(GLOB_PATTERN[1:-1], value):
        return value
    raise problem(
        "no tool can have such a name",
        "a tool's name has letters, digits, _, . and -, at most 128; * matches any of them, ? matches one",
    )


Glob = Annotated[str, AfterValidator(_glob), Field(json_schema_extra={"pattern": GLOB_PATTERN})]
Decision = Literal["allow", "confirm", "deny"]
Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class Rule(Table):
    """A decision for some tools."""

    tools: Annotated[
        list[Glob], AfterValidator(distinct), Field(min_length=1, max_length=100, json_schema_extra=UNIQUE)
    ]
    """Names of tools; * stands for any characters, ? for one."""
    decision: Decision
    """Let a call pass, ask a person first, or refuse it."""


class Target(Table):
    """The calls that a limit is about."""

    tool: Glob
    """Which tools: a name; * stands for any characters, ? for one."""
    parameter: Annotated[str, Field(min_length=1, max_length=64)] | None = None
    """The parameter whose value is limited; without one the calls are, whatever their arguments."""


def _value(setting: Setting) -> Any:
    """The type of a setting's value."""
    form = setting.form
    if form is DURATION:
        return Duration
    if not form.pattern:
        return Positive if form.is_positive else Number
    return Annotated[str, BeforeValidator(partial(_text, form)), Field(json_schema_extra={"pattern": form.pattern})]


def _text(form: Form, value: object) -> object:
    wrong = form.problem(value)
    if wrong is not None:
        raise problem(f"{'these' if wrong[0].startswith('are') else 'this'} {wrong[0]}", wrong[1])
    return value


def _field(setting: Setting) -> Any:
    default = None if setting.first else added(None)
    return Annotated[_value(setting) | None, Field(description=setting.about)], default


if TYPE_CHECKING:
    _Settings = Target
else:
    _Settings = create_model(
        "_Settings",
        __base__=Target,
        __module__=__name__,
        **{name: _field(setting) for name, setting in SETTINGS.items()},
    )


class Limit(_Settings):
    """The rules for every call, of any caller."""

    units: Annotated[
        list[Annotated[str, Field(min_length=1, max_length=64)]],
        AfterValidator(distinct),
        Field(max_length=100, json_schema_extra=UNIQUE),
    ] = Field(default=[])
    """Units of the device (joints, axes) that minimum and maximum are of, whichever tool moves them; none: of all."""

    @model_validator(mode="after")
    def _limits_something(self) -> "Limit":
        given = [name for name in SETTINGS if getattr(self, name) is not None]
        bounds = [name for name in given if name in BOUNDS]
        if not given:
            raise problem("this limit limits nothing", f"add one of {', '.join((*BOUNDS, *PACES))}")
        if bounds and self.parameter is None:
            what = f"this limit names no parameter: `{bounds[0]}` is"
            raise problem(what, "add `parameter`", bounds[0])
        if self.parameter is not None and not bounds:
            what = "no limit here is for a parameter: these limits count calls, whatever their arguments"
            raise problem(what, f"remove it, or add one of {', '.join(BOUNDS)}", "parameter")
        if set(RANGE) <= set(bounds) and getattr(self, RANGE[0]) > getattr(self, RANGE[1]):
            raise problem("the minimum is above the maximum", "no value would pass; exchange the two", "minimum")
        if self.units and (not bounds or not set(bounds) <= set(RANGE)):
            what = "`units` narrows minimum and maximum, and nothing else"
            raise problem(what, "write the other limits in a separate entry", "units")
        return self


class Policy(Table):
    """What the endpoint's tools may do, for every client."""

    mode: Literal["enforce", "shadow", "dry_run"] = "enforce"
    """Enforce the policy, only log what it would refuse, or answer what would be done and do nothing."""
    read: Decision = "allow"
    """For tools that only read."""
    actuate: Decision = "confirm"
    """For tools that move or switch something."""
    irreversible: Decision = "confirm"
    """For tools whose effect cannot be taken back."""
    rules: Annotated[list[Rule], Field(max_length=100)] = Field(default=[])
    """Decisions for single tools; the first rule that matches decides."""
    limits: Annotated[list[Limit], Field(max_length=200)] = Field(default=[])
    """Limits beside those of the profiles; of two the tighter one wins."""
    timeout: Duration = TIMEOUT
    """How long one call may take."""
    timeouts: dict[Glob, Duration] = Field(default={})
    """How long a call of single tools may take, by name; * stands for any characters, ? for one."""
    result_bytes: Annotated[int, Field(ge=1_000, le=1_000_000_000)] = RESULT_BYTES
    """The most bytes that the answer of one call may have."""


# How clients elsewhere reach the endpoint, as a manifest writes it. (Heavy: pydantic.)

_ADDRESS = r"[0-9A-Fa-f:.]*:[0-9A-Fa-f:.]*"
INTERFACE_PATTERN = rf"^([A-Za-z0-9_][A-Za-z0-9_.-]{{0,14}}|{_ADDRESS})$"
_LABEL = r"[A-Za-z0-9]([A-Za-z0-9-]{0,61}[A-Za-z0-9])?"
_NAME = rf"{_LABEL}(\.{_LABEL})*"
HOST_PATTERN = rf"^({_NAME}|{_ADDRESS})$"
ORIGIN_PATTERN = rf"^https?://({_NAME}|\[[0-9A-Fa-f:.]+\])(:[0-9]{{1,5}})?$"
_MAX_HOST = 253
_PLACEHOLDER = regex(r"(?<![{$])\{([A-Za-z_][A-Za-z0-9_]*)\}(?!\})")


def _interface(value: str) -> str:
    hint = "name one, such as eth0 (`ip -brief address` lists them), or write `all`"
    if _is_address(value):
        address = ip_address(value)
        if address.is_unspecified:
            raise problem("this address means every interface", "write `all`")
        if address.is_multicast:
            raise problem("this is no address of one host", hint)
    elif ":" in value or re.fullmatch(INTERFACE_PATTERN[1:-1], value) is None:
        raise problem("this is no network interface", hint)
    return value


def _host(value: str) -> str:
    if "://" in value or "/" in value:
        raise problem("this is a URL, and a host name is needed", "write the name alone, such as bench.example.org")
    if "*" in value:
        raise problem("a host is named in full", "list each name that clients use")
    if _is_address(value):
        return value
    if ":" in value:
        raise problem("a host is written here without a port", "write the name alone, such as bench.example.org")
    if not re.fullmatch(_NAME, value) or len(value) > _MAX_HOST:
        raise problem("this is no host name", "write it as clients do, such as bench.example.org")
    return value


def _is_address(value: str) -> bool:
    try:
        ip_address(value)
    except ValueError:
        return False
    return True


def _origin(value: str) -> str:
    found = re.fullmatch(ORIGIN_PATTERN[1:-1], value)
    if found is None or not _is_port(found.groups()[-1]) or not _is_bracketed(value):
        hint = (
            "write it as a browser sends it: https://app.example.org, with a port if it is not the usual one, no path"
        )
        raise problem("this is no origin", hint)
    return value


def _is_port(text: str | None) -> bool:
    return text is None or 1 <= int(text[1:]) <= 65535


def _is_bracketed(value: str) -> bool:
    """True unless brackets hold what is no address."""
    found = re.search(r"\[(.*)\]", value)
    return found is None or _is_address(found.group(1))


def _command(values: list[str]) -> list[str]:
    if not values[0].strip():
        raise problem("the first item of a command is a program", "name the program", 0)
    for index, value in enumerate(values):
        other = next((name for name in _PLACEHOLDER.findall(value) if name != "url"), None)
        if other is not None:
            raise problem(f"{{{other[:40]}}} is no placeholder", f"the only one is {TUNNEL_URL}", index)
    if not any(TUNNEL_URL in value for value in values):
        raise problem(
            f"the program does not get the address of the endpoint: {TUNNEL_URL} is missing",
            f'write for example [cloudflared, tunnel, --url, "{TUNNEL_URL}"]',
        )
    return values


Host = Annotated[str, AfterValidator(_host), Field(json_schema_extra={"pattern": HOST_PATTERN})]
Origin = Annotated[str, AfterValidator(_origin), Field(max_length=300, json_schema_extra={"pattern": ORIGIN_PATTERN})]


class Network(Table):
    """Where the endpoint listens, and who it answers to; for the scopes intranet and internet."""

    interface: Annotated[str, AfterValidator(_interface), Field(json_schema_extra={"pattern": INTERFACE_PATTERN})] = (
        EVERY_INTERFACE
    )
    """The network interface that it listens on, such as eth0, or one address of it; `all` for every one."""
    port: Annotated[int, Field(ge=1, le=65535)] = FIRST_PORT
    """The port; the next free one where it is taken."""
    hosts: Annotated[list[Host], AfterValidator(distinct), Field(max_length=100, json_schema_extra=UNIQUE)] = Field(
        default=[]
    )
    """More names that clients may call this host by, beside its own name and addresses."""
    origins: Annotated[list[Origin], AfterValidator(distinct), Field(max_length=100, json_schema_extra=UNIQUE)] = Field(
        default=[]
    )
    """Web pages that may call the endpoint from a browser."""


class Tunnel(Table):
    """The program that gives the endpoint an address on the internet; for the scope internet."""

    command: Annotated[list[Argument], Field(min_length=1, max_length=200), AfterValidator(_command)] = Field(
        default=list(TUNNEL_COMMAND)
    )
    """The program and its arguments; {url} stands for the endpoint's own address. It prints the address it gives."""


# How the deployment is kept alive and who hears of it, as a manifest writes it. (Heavy: pydantic.)

METRICS_PATTERN = r"^[^~\x00][^\x00]*\.prom$"
MAX_CALLS = 1000
_COMMAND_HINT = "write for example [./notify-me, --problem]; it gets the problem as JSON on its standard input"
_WEBHOOK_HINT = "write https://alerts.example.org/hook, or keep it secret in a variable: ${ALERT_URL}"
_METRICS_HINT = "write a path that ends in .prom, such as /var/lib/node_exporter/octoform.prom"


def _webhook(value: str) -> str:
    complaint = model_url.url_complaint_as_written(value)
    if complaint is None:
        return value
    if "@" in value or "?" in value or "#" in value:
        what = "a URL with a user, a password, a query or a fragment may hold a secret"
        raise problem(what, "keep the whole URL in a variable: ${ALERT_URL}")
    raise problem(complaint[0], _WEBHOOK_HINT)


def _notify_command(values: list[str]) -> list[str]:
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
    """Who is notified of a problem that a person should know of; none of these unless named."""

    command: Annotated[list[Argument], Field(min_length=1, max_length=200), AfterValidator(_notify_command)] | None = (
        None
    )
    """A program and its arguments; it gets what happened as JSON on its standard input, and 10 seconds."""
    webhook: (
        Annotated[
            str, AfterValidator(_webhook), Field(max_length=2000, json_schema_extra={"pattern": model_url.URL_PATTERN})
        ]
        | None
    ) = None
    """A URL that gets what happened as a POST of JSON; ${NAME} stands for an environment variable."""
    desktop: bool = False
    """Show it as a notification in the session of the user who runs the daemon, with notify-send."""


class Daemon(Table):
    """How `octoform watch` keeps the deployment alive."""

    interval: Interval = "300s"
    """The time from one look to the next while nothing happens: 60s, 5m; at least 5s. Events are noticed at once."""
    heal_attempts: Attempts = 3
    """How many repairs of one problem the daemon tries before it gives up and notifies a person."""
    apply: Literal["auto", "ask"] = "auto"
    """Whether new or vanished kinds of hardware are taken up at once, or planned and asked about."""
    calls_per_hour: Annotated[int, Field(ge=0, le=MAX_CALLS)] = 30
    """How often in an hour agents may be asked; 0 is never."""
    usd_per_hour: Dollars | None = None
    """US dollars that agents may cost in an hour; without it there is no limit."""
    claim_expiry: Duration = "30m"
    """The longest that a claim about the hardware holds without new evidence."""
    notify: Notify = Notify.model_construct()
    """Who is notified of a problem that a person should know of."""
    metrics: (
        Annotated[
            str,
            AfterValidator(_metrics),
            Field(min_length=1, max_length=400, json_schema_extra={"pattern": METRICS_PATTERN}),
        ]
        | None
    ) = None
    """A file for Prometheus' node exporter, such as /var/lib/node_exporter/octoform.prom; it ends in .prom."""
