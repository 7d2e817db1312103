"""The kinds of values that a manifest has, each with its rule and its words, for the models of `document`.

(Heavy: pydantic.)
"""

import re
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticCustomError

from octoform.base.durations import HINT, MAX_SECONDS, PATTERN, seconds
from octoform.base.escaping import is_hidden
from octoform.manifest import model_url
from octoform.manifest.references import NAME


def problem(summary: str, hint: str | None = None, index: int | str | None = None) -> PydanticCustomError:
    """A validation error whose words are ours; ``index`` points into the list or table that is checked."""
    return PydanticCustomError("manifest", "{summary}", {"summary": summary, "hint": hint, "index": index})


def added(default: object) -> Any:
    """The default of a setting that came after manifests were in use: it counts in their digest where it differs.

    So a manifest that does not know of the setting keeps the digest that it had.
    """
    return Field(default=default, exclude_if=lambda value: value == default)


def _host(value: str) -> str:
    if model_url.is_legal_host(value):
        return value
    fitting = model_url.nearest_host(value)
    raise problem(
        "a host name has lower-case letters, digits and inner hyphens, at most 63",
        f"did you mean `{fitting}`?" if fitting else "it becomes the name of a folder: state/<host>",
    )


def _version(value: object) -> object:
    """True and 1.0 equal 1 in Python, and are no version."""
    if isinstance(value, bool | float | str) or value != 1:
        raise problem(
            "this octoform reads version 1 of the manifest",
            "write `version: 1`; a higher version needs a newer octoform",
        )
    return value


def _duration(value: object) -> object:
    if isinstance(value, int | float) and not isinstance(value, bool):
        raise problem("a duration needs a unit", f"write `{value}s` for seconds, or use m and h: `1.5m`, `1h30m`")
    length = seconds(value) if isinstance(value, str) else None
    if length is None:
        raise problem("this is no duration", HINT)
    if not 1 <= length <= MAX_SECONDS:
        raise problem("this is out of range", "a duration is between 1s and 24h")
    return value


def _interval(value: str) -> str:
    if (seconds(value) or 0) < SHORTEST_INTERVAL:
        raise problem("this is out of range", f"an interval is between {SHORTEST_INTERVAL}s and 24h")
    return value


def _base_url(value: str) -> str:
    complaint = model_url.url_complaint_as_written(value)
    if complaint is not None:
        raise problem(*complaint)
    return value


def distinct(values: list[str]) -> list[str]:
    """The list, if it has no duplicates."""
    for index, value in enumerate(values):
        if value in values[:index]:
            raise problem("this occurs twice in the list", "keep one of the two", index)
    return values


def _device_id(value: str) -> str:
    if re.fullmatch(DEVICE_ID, value) is None or len(value) > MAX_ID:
        raise problem("this is no id of a device", "write it as `octoform plan` does, such as usb-0000-0000-2")
    return value


def _step_name(value: str) -> str:
    if re.fullmatch(STEP_NAME, value) is None or len(value) > MAX_STEP:
        raise problem("this is no name of a step", "write it as its file is called, without the .md, such as arm")
    return value


def _answer(value: str) -> str:
    if len(value) > MAX_ANSWER or len(re.findall(r"\w", value)) < 2:
        raise problem(f"an answer has words, in 2 to {MAX_ANSWER} characters", "write in a sentence what the device is")
    if any(is_hidden(character) and character not in "\n\t" for character in value):
        raise problem("the answer holds a character that does not show", "write it again, as plain text")
    return value


def _profile(value: str) -> str:
    """A path, or the text of a profile: that one begins with its front matter, as its file would."""
    if not value:
        raise problem("this is empty", "give the path of a markdown file")
    longest = MAX_PROFILE if is_typed(value) else 400
    if len(value) > longest:
        raise problem(f"this has more than {longest} characters", "keep what an agent needs to know")
    return value


def is_typed(profile: str) -> bool:
    """True for an entry of ``profiles`` that is the profile itself and no path of one."""
    return profile.startswith("---")


UNIQUE = {"uniqueItems": True}
CLOSED = {"additionalProperties": False}
MAX_DOLLARS = 1_000_000
MAX_ANSWERS = 200
MAX_ID = 100
SHORTEST_INTERVAL = 5
"""Seconds: a picture takes a few, and other clients want the camera too."""
MAX_ANSWER = 1000
MAX_PROFILE = 12 * 1024
MAX_STEPS = 20
MAX_STEP = 32
STEP_NAME = "[a-z][a-z0-9]*(?:-[a-z0-9]+)*"
DEVICE_ID = "[a-z0-9]+(?:[-_.][a-z0-9]+)*"

Version = Annotated[Literal[1], BeforeValidator(_version)]
Host = Annotated[str, AfterValidator(_host), Field(json_schema_extra={"pattern": model_url.HOST_PATTERN})]
Duration = Annotated[str, BeforeValidator(_duration), Field(json_schema_extra={"pattern": PATTERN})]
Interval = Annotated[Duration, AfterValidator(_interval)]
Model = Annotated[str, Field(pattern=r"^\S+$", max_length=200)]
Argument = Annotated[str, Field(max_length=4000)]
VariableName = Annotated[str, Field(pattern=f"^{NAME.pattern}$", max_length=100)]
# Upper case only: a literal key that is taken for a name would be shown.
KeyName = Annotated[str, Field(pattern="^[A-Z_][A-Z0-9_]*$", max_length=100)]
Variables = Annotated[list[VariableName], AfterValidator(distinct), Field(json_schema_extra=UNIQUE)]
BaseUrl = Annotated[
    str, AfterValidator(_base_url), Field(max_length=400, json_schema_extra={"pattern": model_url.URL_PATTERN})
]
ProfilePath = Annotated[str, Field(min_length=1, max_length=400)]
DeviceId = Annotated[
    str,
    AfterValidator(_device_id),
    Field(json_schema_extra={"pattern": f"^{DEVICE_ID}$", "maxLength": MAX_ID}),
]
StepName = Annotated[
    str,
    AfterValidator(_step_name),
    Field(json_schema_extra={"pattern": f"^{STEP_NAME}$", "maxLength": MAX_STEP}),
]
Answer = Annotated[
    str,
    AfterValidator(_answer),
    Field(json_schema_extra={"maxLength": MAX_ANSWER, "pattern": r"\w[\s\S]*\w"}),
]
ProfileSource = Annotated[
    str,
    AfterValidator(_profile),
    Field(
        json_schema_extra={"anyOf": [{"minLength": 1, "maxLength": 400}, {"pattern": "^---", "maxLength": MAX_PROFILE}]}
    ),
]
Attempts = Annotated[int, Field(ge=1, le=20)]
Turns = Annotated[int, Field(ge=1, le=10_000)]
Dollars = Annotated[float, Field(gt=0, le=MAX_DOLLARS, allow_inf_nan=False)]
Rate = Annotated[float, Field(ge=0, le=MAX_DOLLARS, allow_inf_nan=False)]


class Table(BaseModel):
    """Base of all tables: nothing unknown, nothing converted.

    pydantic compiles a table when a value of it is first validated, and with it the tables within. So only the whole
    document is ever compiled, as long as a default table is made by ``model_construct``, which validates nothing.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, defer_build=True)
