"""The manifest as it is written: the pydantic models that are checked against and that the JSON Schema is made of.

One source for both, so an editor and octoform agree. Only settings with an effect are here. (Heavy: pydantic.)
"""

import ast
import inspect
import json
from collections import ChainMap
from collections.abc import Iterator
from itertools import pairwise
from textwrap import dedent
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema

from octoform.manifest import model_url
from octoform.manifest.schema.fields import (
    CLOSED,
    MAX_ANSWERS,
    MAX_STEPS,
    UNIQUE,
    Answer,
    Attempts,
    BaseUrl,
    DeviceId,
    Dollars,
    Duration,
    Host,
    Interval,
    KeyName,
    Model,
    ProfileSource,
    Rate,
    StepName,
    Table,
    Turns,
    Version,
    added,
    distinct,
)
from octoform.manifest.schema.harness import Agent, Harness
from octoform.manifest.schema.sections import Daemon, Network, Policy, Tunnel


class StageBudget(Table):
    """The budget of one stage, where it differs from the general one."""

    attempts: Attempts | None = None
    """How often the agent may try."""
    attempt_timeout: Duration | None = None
    """Wall time of one attempt."""
    stage_timeout: Duration | None = None
    """Wall time of all attempts together."""
    idle_timeout: Duration | None = added(None)
    """Time without a sign of progress after which an attempt is ended."""
    turns: Turns | None = added(None)
    """The most replies of the model in one attempt."""
    usd: Dollars | None = added(None)
    """US dollars for all attempts of this stage."""


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
    idle_timeout: Duration | None = added(None)
    """Time without a sign of progress after which an attempt is ended; 120s for agents whose output shows it."""
    turns: Turns = added(100)
    """The most replies of the model in one attempt."""
    usd: Dollars | None = added(None)
    """US dollars for the whole run, all stages together."""
    edit_specs: bool = added(True)
    """Let an agent that tries again correct its own copy of the spec."""


class Stage(Table):
    """What one stage does differently."""

    harness: Harness | None = None
    """Which agent runs this stage."""
    model: Model | None = None
    """Which model that agent uses."""
    budget: StageBudget = StageBudget.model_construct()
    """What this stage may use."""


class Escalation(Table):
    """Another agent for the devices that the stage's own agent could not identify."""

    harness: Agent
    """Which agent: any but the embedded one."""
    model: Model | None = None
    """Which model that agent uses; without it the general one."""


class IdentifyStage(Stage):
    """What IDENTIFY does differently."""

    escalate: Escalation | None = added(None)
    """The agent for what the embedded agent leaves unknown."""


class Stages(Table):
    """Settings of single stages."""

    probe: Stage = Stage.model_construct()
    """What the operating system sees."""
    identify: IdentifyStage = IdentifyStage.model_construct()
    """What each device is."""
    interface: Stage = Stage.model_construct()
    """Which tools the devices give."""
    serve: Stage = Stage.model_construct()
    """The server that implements the tools."""
    deploy: Stage = Stage.model_construct()
    """What the server needs to run."""
    watch: Stage = added(Stage.model_construct())
    """What is wrong, where the daemon's own rules cannot decide it."""
    heal: Stage = added(Stage.model_construct())
    """The repair of what is wrong, as a candidate that is proved before it is taken."""


class Price(Table):
    """What a model costs, in US dollars for a million tokens."""

    input: Rate
    """A million tokens of fresh input."""
    cached: Rate | None = None
    """A million tokens of input from the provider's cache; without it as much as fresh ones."""
    output: Rate
    """A million tokens of output."""


class Housekeeping(Table):
    """A small model that condenses long logs for the next attempt."""

    model: Model
    """Which model; ${NAME} stands for an environment variable."""
    max_tokens: Annotated[int, Field(ge=64, le=8000)] = 800
    """The most tokens that it may answer with."""
    key: KeyName | None = None
    """The name of the variable with the API key; without it the one that the model's provider documents."""
    base_url: BaseUrl | None = None
    """Where the model's API is, if not at its provider's; ${NAME} stands for an environment variable."""


class Lifecycle(Table):
    """What may happen to things that exist."""

    prevent_destroy: bool = False
    """Refuse `octoform destroy`."""
    ignore: Annotated[list[Literal["model", "harness"]], AfterValidator(distinct), Field(json_schema_extra=UNIQUE)] = (
        Field(default=[])
    )
    """What may change without making accepted artifacts again."""


class Git(Table):
    """How octoform works with the repository."""

    commit: bool = False
    """Let apply commit what it changed."""


class Perception(Table):
    """Whether and how octoform looks through a camera of the host."""

    enabled: bool = False
    """Let octoform look by itself, at every interval."""
    camera: DeviceId | None = None
    """The camera to look through, by the device's id; without it the best one is chosen."""
    interval: Interval = "300s"
    """The time from one look to the next: 30s, 5m; at least 5s."""


class Document(Table):
    """What octoform shall make of this host: which agent, with which budget. Devices are found, not listed."""

    version: Version
    """The version of this format."""
    host: Host = model_url.DEFAULT_HOST
    """The name of this host; it names the folder state/<host>."""
    harness: Harness = "builtin"
    """The agent: a name, or a table with its settings."""
    model: Model | None = None
    """The model that the agents use; ${NAME} stands for an environment variable."""
    scope: Literal["local", "intranet", "internet"] = "local"
    """Who can reach the endpoint: local opens no network socket, the others ask for a token."""
    network: Network | None = added(None)
    """Where the endpoint listens in the scopes intranet and internet."""
    tunnel: Tunnel | None = added(None)
    """How the endpoint gets its address in the scope internet."""
    policy: Policy = added(Policy.model_construct())
    """What the endpoint's tools may do, for every client."""
    privileged_steps: Annotated[
        list[StepName], AfterValidator(distinct), Field(max_length=MAX_STEPS, json_schema_extra=UNIQUE)
    ] = Field(default=[])
    """Steps after the stages that move hardware to prove that its tools work, such as arm; none unless named here."""
    profiles: Annotated[
        list[ProfileSource], AfterValidator(distinct), Field(max_length=100, json_schema_extra=UNIQUE)
    ] = Field(default=[])
    """Knowledge about hardware: markdown files relative to this one, or the text of such a file, beginning with ---."""
    answers: Annotated[dict[DeviceId, Answer], Field(max_length=MAX_ANSWERS, json_schema_extra=CLOSED)] = added({})
    """What a person answers about a device that evidence cannot settle, by the device's id."""
    perception: Perception = added(Perception.model_construct())
    """Looking through a camera of the host."""
    daemon: Daemon = added(Daemon.model_construct())
    """How the deployment is kept alive."""
    stages: Stages = Stages.model_construct()
    """Another harness, model or budget for single stages."""
    budget: Budget = Budget.model_construct()
    """What each stage may use."""
    prices: dict[Model, Price] = added({})
    """What models cost, by their name as under `model`; for those that no price list knows."""
    housekeeping: Housekeeping | None = added(None)
    """A small model that condenses long logs."""
    lifecycle: Lifecycle = Lifecycle.model_construct()
    """What may happen to things that exist."""
    git: Git = Git.model_construct()
    """How octoform works with the repository."""


# The JSON Schema of the manifest, for editors and for ``octoform schema``. (Heavy: pydantic.)
#
# Made of the models that `loading` checks against, so it can never promise a setting that octoform refuses.

DIALECT = "https://json-schema.org/draft/2020-12/schema"


class _Generator(GenerateJsonSchema):
    def nullable_schema(self, schema: core_schema.NullableSchema) -> JsonSchemaValue:
        """A key is given or omitted; an empty one is refused, so null is no value of any setting."""
        return self.generate_inner(schema["schema"])

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> JsonSchemaValue:
        """Defaults are shown where they mean something: not null, and not a table of defaults."""
        inner: JsonSchemaValue = self.generate_inner(schema["schema"])
        default = schema.get("default")
        if default is None or not isinstance(default, str | int | list):
            return inner
        return {"allOf": [inner], "default": default} if "$ref" in inner else {**inner, "default": default}


def _tables(cls: type[Table]) -> Iterator[type[Table]]:
    for below in cls.__subclasses__():
        yield below
        yield from _tables(below)


def _descriptions(table: type[Table]) -> dict[str, str]:
    """The string below each setting of a table. Only the schema shows them, so nothing else reads the source for it."""
    inherited = [_descriptions(cls) for cls in table.__bases__ if issubclass(cls, Table)]
    if all(field.description for name, field in table.model_fields.items() if name in inspect.get_annotations(table)):
        return dict(ChainMap(*inherited))  # the fields have them already: it is made of data, and has no source
    (node,) = ast.parse(dedent(inspect.getsource(table))).body
    assert isinstance(node, ast.ClassDef)
    return dict(ChainMap(*inherited)) | {
        setting.target.id: inspect.cleandoc(text.value.value)
        for setting, text in pairwise(node.body)
        if isinstance(setting, ast.AnnAssign) and isinstance(setting.target, ast.Name)
        if isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant) and isinstance(text.value.value, str)
    }


def json_schema() -> dict[str, Any]:
    """The schema as JSON data, in the dialect that `DIALECT` names."""
    body = Document.model_json_schema(schema_generator=_Generator)
    tables = {cls.__name__: cls for cls in _tables(Table)}
    for name, table in ((Document.__name__, body), *body["$defs"].items()):
        descriptions = _descriptions(tables[name]) if name in tables else {}
        for key, setting in table.get("properties", {}).items():
            setting.pop("title", None)  # it would only repeat the key
            fields = {**setting, "description": descriptions[key]} if key in descriptions else setting
            table["properties"][key] = dict(sorted(fields.items()))
    head = {"$schema": DIALECT, "title": "octopus.yaml"}
    return {**head, **{key: value for key, value in body.items() if key != "title"}}


def text() -> str:
    """The schema as it is printed and kept beside the other schemas."""
    return json.dumps(json_schema(), indent=2, ensure_ascii=False) + "\n"
