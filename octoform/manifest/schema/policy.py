"""The policy as a manifest writes it: the tables that are checked against and that the JSON Schema is made of.

(Heavy: pydantic.)
"""

import re
from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from octoform.durations import HOURS_PATTERN, RATE_PATTERN, hours, rate
from octoform.manifest.policy_model import RESULT_BYTES, TIMEOUT
from octoform.manifest.schema.fields import UNIQUE, Duration, Table, distinct, problem

GLOB_PATTERN = r"^[A-Za-z0-9_.*?-]{1,128}$"
BOUNDS = ("minimum", "maximum", "step", "cumulative")
"""What a limit says of the value of a parameter."""
PACES = ("rate", "cooldown", "quiet_hours")
"""What a limit says of calls, whatever their arguments."""


def _glob(value: str) -> str:
    if re.fullmatch(GLOB_PATTERN[1:-1], value):
        return value
    raise problem(
        "no tool can have such a name",
        "a tool's name has letters, digits, _, . and -, at most 128; * stands for any of them, ? for one",
    )


def _rate(value: object) -> object:
    if isinstance(value, str) and rate(value) is not None:
        return value
    raise problem("this is no rate", "write how many calls in which time, at most 24h: `10/1m`, `1/30s`")


def _hours(value: object) -> object:
    if isinstance(value, str) and hours(value) is not None:
        return value
    raise problem("these are no hours of a day", "write two different times of 24 hours: `22:00-07:00`")


Glob = Annotated[str, AfterValidator(_glob), Field(json_schema_extra={"pattern": GLOB_PATTERN})]
Decision = Literal["allow", "confirm", "deny"]
Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
CallRate = Annotated[str, BeforeValidator(_rate), Field(json_schema_extra={"pattern": RATE_PATTERN})]
Hours = Annotated[str, BeforeValidator(_hours), Field(json_schema_extra={"pattern": HOURS_PATTERN})]


class Rule(Table):
    """A decision for some tools."""

    tools: Annotated[
        list[Glob], AfterValidator(distinct), Field(min_length=1, max_length=100, json_schema_extra=UNIQUE)
    ]
    """Names of tools; * stands for any characters, ? for one."""
    decision: Decision
    """Let a call pass, ask a person first, or refuse it."""


class Limit(Table):
    """What a call must keep to, whoever makes it."""

    tool: Glob
    """Which tools: a name; * stands for any characters, ? for one."""
    parameter: Annotated[str, Field(min_length=1, max_length=64)] | None = None
    """Which parameter minimum, maximum, step and cumulative speak of."""
    minimum: Number | None = None
    """The lowest value of the parameter."""
    maximum: Number | None = None
    """The highest value of the parameter."""
    step: Positive | None = None
    """The most that the value may differ from that of the call before."""
    cumulative: Positive | None = None
    """The most that all values may come to, positive and negative ones added up."""
    rate: CallRate | None = None
    """The most calls in a time: 10/1m."""
    cooldown: Duration | None = None
    """The least time between two calls."""
    quiet_hours: Hours | None = None
    """When no call passes, in the host's local time: 22:00-07:00."""
    units: Annotated[
        list[Annotated[str, Field(min_length=1, max_length=64)]],
        AfterValidator(distinct),
        Field(max_length=100, json_schema_extra=UNIQUE),
    ] = Field(default=[])
    """Units of the device (joints, axes) that minimum and maximum are of, whichever tool moves them; none: of all."""

    @model_validator(mode="after")
    def _limits_something(self) -> "Limit":
        bounds = [name for name in BOUNDS if getattr(self, name) is not None]
        if not bounds and all(getattr(self, name) is None for name in PACES):
            raise problem("this limit limits nothing", f"add one of {', '.join((*BOUNDS, *PACES))}")
        if bounds and self.parameter is None:
            what = f"this limit does not say of which parameter `{bounds[0]}` is"
            raise problem(what, "add `parameter`", bounds[0])
        if self.parameter is not None and not bounds:
            what = "nothing here speaks of a parameter: it is about calls, whatever their arguments"
            raise problem(what, f"remove it, or add one of {', '.join(BOUNDS)}", "parameter")
        if self.minimum is not None and self.maximum is not None and self.minimum > self.maximum:
            raise problem("the minimum is above the maximum", "no value would pass; exchange the two", "minimum")
        if self.units and (self.step is not None or self.cumulative is not None or not bounds):
            what = "`units` narrows minimum and maximum, and nothing else"
            raise problem(what, "write the other limits in an entry of their own", "units")
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
