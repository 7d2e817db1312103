"""The manifest as it is written: the pydantic models that are checked against and that the JSON Schema is made of.

One source for both, so an editor and octoform agree. Only settings that do something stand here. (Heavy: pydantic.)
"""

from typing import Annotated, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
)
from pydantic_core import PydanticCustomError

from octoform.manifest import host_name
from octoform.manifest.durations import LONGEST_SECONDS, PATTERN, seconds
from octoform.manifest.references import NAME

NAMED, BUILTIN, COMMAND = "#name", "#builtin", "#command"


def problem(summary: str, hint: str | None = None, index: int | None = None) -> PydanticCustomError:
    """A validation error whose words are ours; ``index`` points into the list that is checked."""
    return PydanticCustomError("manifest", "{summary}", {"summary": summary, "hint": hint, "index": index})


def _host(value: str) -> str:
    if host_name.is_legal(value):
        return value
    fitting = host_name.nearest(value)
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
        raise problem("a duration needs a unit", f"write `{value}s` for seconds, or use m and h: `5m`, `1h30m`")
    length = seconds(value) if isinstance(value, str) else None
    if length is None:
        raise problem("this is no duration", "write whole numbers with h, m and s, in this order: `200s`, `1h30m`")
    if not 1 <= length <= LONGEST_SECONDS:
        raise problem("this is out of range", "a duration is between 1s and 24h")
    return value


def _distinct(values: list[str]) -> list[str]:
    for index, value in enumerate(values):
        if value in values[:index]:
            raise problem("this stands twice in the list", "keep one of the two", index)
    return values


def _kind_of_harness(value: object) -> str | None:
    if isinstance(value, str):
        return NAMED
    name = value.get("name") if isinstance(value, dict) else getattr(value, "name", None)
    return {"builtin": BUILTIN, "command": COMMAND}.get(str(name))


Version = Annotated[Literal[1], BeforeValidator(_version)]
Host = Annotated[str, AfterValidator(_host), Field(json_schema_extra={"pattern": host_name.PATTERN})]
Duration = Annotated[str, BeforeValidator(_duration), Field(json_schema_extra={"pattern": PATTERN})]
Model = Annotated[str, Field(pattern=r"^\S+$", max_length=200)]
Argument = Annotated[str, Field(max_length=4000)]
VariableName = Annotated[str, Field(pattern=f"^{NAME.pattern}$", max_length=100)]
ProfilePath = Annotated[str, Field(min_length=1, max_length=400)]
Attempts = Annotated[int, Field(ge=1, le=20)]
_UNIQUE = {"uniqueItems": True}


class Table(BaseModel):
    """Base of all tables: nothing unknown, nothing converted."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, use_attribute_docstrings=True)


class BuiltinHarness(Table):
    """The embedded agent."""

    name: Literal["builtin"]
    """The embedded agent: needs no model and no network."""


class CommandHarness(Table):
    """Any program as the agent."""

    name: Literal["command"]
    """Any program that reads a task and writes one output file."""
    command: Annotated[list[Argument], Field(min_length=1, max_length=200)]
    """The program and its arguments. Placeholders such as {task} and {prompt_file} are filled in for each attempt;
    ${NAME} stands for an environment variable."""
    env: Annotated[list[VariableName], AfterValidator(_distinct), Field(json_schema_extra=_UNIQUE)] = []
    """Names of the environment variables that the program may see, for example of API keys."""
    prompt: Literal["stdin", "file", "argument"] = "stdin"
    """How the program gets the prompt."""


Harness = Annotated[
    Annotated[Literal["builtin"], Tag(NAMED)]
    | Annotated[BuiltinHarness, Tag(BUILTIN)]
    | Annotated[CommandHarness, Tag(COMMAND)],
    Discriminator(_kind_of_harness),
]


class StageBudget(Table):
    """The budget of one stage, where it differs from the general one."""

    attempts: Attempts | None = None
    """How often the agent may try."""
    attempt_timeout: Duration | None = None
    """Wall time of one attempt."""
    stage_timeout: Duration | None = None
    """Wall time of all attempts together."""


class Budget(Table):
    """What a stage may use before it has failed."""

    attempts: Attempts = 3
    """How often the agent may try a stage."""
    attempt_timeout: Duration = "200s"
    """Wall time of one attempt: 200s, 5m, 1h30m."""
    stage_timeout: Duration = "600s"
    """Wall time of all attempts of a stage together."""
    tools: Annotated[int, Field(ge=1, le=200)] = 30
    """The most tools that the endpoint may offer."""


class Stage(Table):
    """What one stage does differently."""

    harness: Harness | None = None
    """Which agent runs this stage."""
    model: Model | None = None
    """Which model that agent uses."""
    budget: StageBudget = StageBudget()
    """What this stage may use."""


class Stages(Table):
    """Settings of single stages."""

    probe: Stage = Stage()
    """What the operating system sees."""
    identify: Stage = Stage()
    """What each device is."""
    interface: Stage = Stage()
    """Which tools the devices give."""
    serve: Stage = Stage()
    """The server that implements the tools."""
    deploy: Stage = Stage()
    """What the server needs to run."""


class Lifecycle(Table):
    """What may happen to things that exist."""

    prevent_destroy: bool = False
    """Refuse `octoform destroy`."""
    ignore: Annotated[
        list[Literal["model", "harness"]], AfterValidator(_distinct), Field(json_schema_extra=_UNIQUE)
    ] = []
    """What may change without making accepted artifacts again."""


class Git(Table):
    """How octoform works with the repository."""

    commit: bool = False
    """Let apply commit what it changed."""


class Document(Table):
    """What octoform shall make of this host: which agent, with which budget. Devices are found, not listed."""

    version: Version
    """The version of this format."""
    host: Host = host_name.DEFAULT
    """The name of this host; it names the folder state/<host>."""
    harness: Harness = "builtin"
    """The agent: a name, or a table with its settings."""
    model: Model | None = None
    """The model that the agents use; ${NAME} stands for an environment variable."""
    scope: Literal["local"] = "local"
    """Who can reach the endpoint: local opens no socket."""
    privileged_steps: Annotated[list[str], Field(max_length=0)] = []
    """Steps that need a person's consent; there are none yet, so the list is empty."""
    profiles: Annotated[
        list[ProfilePath], AfterValidator(_distinct), Field(max_length=100, json_schema_extra=_UNIQUE)
    ] = []
    """Markdown files with knowledge about hardware, relative to this file."""
    stages: Stages = Stages()
    """Another harness, model or budget for single stages."""
    budget: Budget = Budget()
    """What each stage may use."""
    lifecycle: Lifecycle = Lifecycle()
    """What may happen to things that exist."""
    git: Git = Git()
    """How octoform works with the repository."""
