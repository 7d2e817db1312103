"""The agents as a manifest writes them: a name, or a table with the settings that this kind of agent acts on.

Each kind has a table of its own, so that a setting without effect is an unknown key. (Heavy: pydantic.)
"""

from typing import Annotated, Literal, get_args

from pydantic import Discriminator, Field, Tag

from octoform.manifest.schema.fields import (
    Argument,
    BaseUrl,
    KeyName,
    ProfilePath,
    Table,
    Variables,
    added,
)

NAMED, BUILTIN, COMMAND, PROGRAM, LITELLM, REPLAY = "#name", "#builtin", "#command", "#program", "#litellm", "#replay"
SWITCH, SETTINGS = "#switch", "#settings"
AUTO: Literal["auto"] = "auto"
"""The sandbox where it can be had."""
TAGS = frozenset({NAMED, BUILTIN, COMMAND, PROGRAM, LITELLM, REPLAY, SWITCH, SETTINGS})
"""The names that pydantic puts into the path of a problem for its branch."""

ProgramName = Literal["claude-code", "codex", "gemini-cli", "opencode", "pi", "qwen-code"]
PROGRAMS: tuple[str, ...] = get_args(ProgramName)
_KINDS = {
    "builtin": BUILTIN,
    "command": COMMAND,
    "litellm": LITELLM,
    "replay": REPLAY,
    **dict.fromkeys(PROGRAMS, PROGRAM),
}


def _kind_of_harness(value: object) -> str | None:
    if isinstance(value, str):
        return NAMED
    name = value.get("name") if isinstance(value, dict) else getattr(value, "name", None)
    return _KINDS.get(name) if isinstance(name, str) else None


def _kind_of_agent(value: object) -> str | None:
    """As `_kind_of_harness`, where the embedded agent is none."""
    kind = _kind_of_harness(value)
    return kind if kind != BUILTIN else None


def _kind_of_sandbox(value: object) -> str | None:
    if isinstance(value, bool) or value == AUTO:
        return SWITCH
    return SETTINGS if isinstance(value, dict | Confinement) else None


class Confinement(Table):
    """An agent that writes only in its attempt's folder."""

    network: bool = True
    """Whether the agent has a network; one whose model is elsewhere needs it."""


Sandbox = Annotated[
    Annotated[bool | Literal["auto"], Tag(SWITCH)] | Annotated[Confinement, Tag(SETTINGS)],
    Discriminator(_kind_of_sandbox),
]


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
    env: Variables = Field(default=[])
    """Names of the environment variables that the program may see, for example of API keys."""
    prompt: Literal["stdin", "file", "argument"] = "stdin"
    """How the program gets the prompt."""
    sandbox: Sandbox = added(AUTO)
    """Let the program write only in its folder: auto (where that can be had), true, false or {network: false}."""


class ModelHarness(Table):
    """What all agents with a model of the manifest's choice have in common."""

    env: Variables = Field(default=[])
    """Names of more environment variables that the agent may see, for example of a proxy."""
    key: KeyName | None = None
    """The name of the variable with the API key; without it the one that the model's provider documents."""
    base_url: BaseUrl | None = None
    """Where the model's API is, if not at its provider's; ${NAME} stands for an environment variable."""
    api: Literal["openai-completions", "openai-responses", "anthropic-messages", "gemini"] | None = None
    """The API that is spoken there, where the agent and the provider know more than one."""
    web_search: bool = False
    """Let the agent search the web; all can but pi."""
    sandbox: Sandbox = added(AUTO)
    """Let the agent write only in its folder: auto (where that can be had), true, false or {network: false}."""


class ProgramHarness(ModelHarness):
    """A coding-agent program."""

    name: ProgramName
    """Which coding-agent program."""
    command: Annotated[list[Argument], Field(min_length=1, max_length=200)] | None = None
    """The program, where it is not the installed one; ${NAME} stands for an environment variable."""
    login: bool = added(False)
    """Use the login (subscription) that you have with this program on this machine instead of a key."""


class LitellmHarness(ModelHarness):
    """A plain loop of a model and a shell, made of the litellm library."""

    name: Literal["litellm"]
    """A plain loop of a model and a shell, made of the litellm library."""


class ReplayHarness(Table):
    """A recorded run instead of an agent."""

    name: Literal["replay"]
    """A recorded run instead of an agent: needs no model and no network."""
    recording: ProfilePath
    """The folder of the recording, relative to this file."""


AgentName = Literal["claude-code", "codex", "gemini-cli", "litellm", "opencode", "pi", "qwen-code"]
Harness = Annotated[
    Annotated[Literal["builtin", AgentName], Tag(NAMED)]
    | Annotated[BuiltinHarness, Tag(BUILTIN)]
    | Annotated[CommandHarness, Tag(COMMAND)]
    | Annotated[ProgramHarness, Tag(PROGRAM)]
    | Annotated[LitellmHarness, Tag(LITELLM)]
    | Annotated[ReplayHarness, Tag(REPLAY)],
    Discriminator(_kind_of_harness),
]
Agent = Annotated[
    Annotated[AgentName, Tag(NAMED)]
    | Annotated[CommandHarness, Tag(COMMAND)]
    | Annotated[ProgramHarness, Tag(PROGRAM)]
    | Annotated[LitellmHarness, Tag(LITELLM)]
    | Annotated[ReplayHarness, Tag(REPLAY)],
    Discriminator(_kind_of_agent),
]
"""Any harness but the embedded agent."""
NAMES = tuple(sorted(_KINDS))
TABLES: dict[str, type[Table]] = {
    BUILTIN: BuiltinHarness,
    COMMAND: CommandHarness,
    PROGRAM: ProgramHarness,
    LITELLM: LitellmHarness,
    REPLAY: ReplayHarness,
}


def table_of(name: str) -> type[Table]:
    """The table of a harness by its name, of the ``command`` harness for a name that is none."""
    return TABLES[_KINDS.get(name, COMMAND)]
