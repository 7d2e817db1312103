"""The agent's tools as the model sees them, and the way from a call that it wrote to what really happens.

A call can be wrong in every way: no such tool, arguments that are no JSON, missing or of another type. All of that is
an answer to the model, which then does better or ends by the bound on such calls.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

from octoform.base.files import parse
from octoform.harness.asking.client import Call
from octoform.harness.react.conversation import ARGUMENT_BYTES, parsed
from octoform.harness.react.files import patch, read_file, write_file
from octoform.harness.react.shell import Said, Shell
from octoform.redaction import redacted

DECLARED = Path(__file__).with_name("tools.json")
TYPES: Mapping[str, type] = {"string": str, "integer": int, "array": list, "object": dict}
QUOTED = 200


@cache
def declared() -> tuple[dict[str, Any], ...]:
    """The tools in the form in which a model is told of them."""
    return tuple(parse(DECLARED.read_text(encoding="utf-8")))


@dataclass(frozen=True, slots=True)
class Ready:
    """A call that can be made; ``text`` says for what, in one argument of it."""

    tool: str
    arguments: Mapping[str, Any]

    @property
    def text(self) -> str:
        """What the call is about."""
        return str(self.arguments.get("command") or self.arguments.get("path") or "")


def checked(call: Call) -> Ready | str:
    """The call, or what is wrong with it, for the model."""
    schema = {item["function"]["name"]: item["function"]["parameters"] for item in declared()}.get(call.name)
    if schema is None:
        names = ", ".join(item["function"]["name"] for item in declared())
        return f"there is no tool {call.name[:QUOTED]!r}; the tools are {names}"
    if len(call.arguments.encode("utf-8", "replace")) > ARGUMENT_BYTES:
        return f"the arguments have more than {ARGUMENT_BYTES} bytes; do it in smaller parts"
    arguments = parsed(call.arguments)
    if arguments is None:
        return f"the arguments are no JSON object: {call.arguments[:QUOTED]!r}"
    problem = _mismatch(schema, arguments, "")
    return (
        f"{problem}; {call.name} takes {json.dumps(schema['properties'])}" if problem else Ready(call.name, arguments)
    )


def _mismatch(schema: Mapping[str, Any], value: Any, at: str) -> str | None:
    """What does not fit the schema (of the few forms that stand in tools.json), or None."""
    if not isinstance(value, TYPES[schema["type"]]) or isinstance(value, bool):
        return f"{at or 'the value'} is no {schema['type']}"
    if isinstance(value, list):
        found = (_mismatch(schema["items"], item, f"{at}[{place}]") for place, item in enumerate(value))
        return next((item for item in found if item), None)
    if not isinstance(value, dict):
        return None
    for name in schema["required"]:
        if value.get(name) is None:
            return f"{at + '.' if at else ''}{name} is missing"
    known = ((name, value[name]) for name in schema["properties"] if value.get(name) is not None)
    found = (_mismatch(schema["properties"][name], item, f"{at + '.' if at else ''}{name}") for name, item in known)
    return next((item for item in found if item), None)


@dataclass(frozen=True, slots=True)
class Toolbox:
    """The tools at work in one attempt's folder; ``secrets`` are values, by name, that reach no model."""

    workdir: Path
    shell: Shell
    secrets: Mapping[str, str]

    def use(self, ready: Ready) -> Said:
        """Make a call that was checked."""
        known = next(item for item in declared() if item["function"]["name"] == ready.tool)["function"]["parameters"]
        arguments = {
            name: value for name, value in ready.arguments.items() if name in known["properties"] and value is not None
        }
        runs: Mapping[str, Callable[..., Said]] = {
            "shell": self.shell.run,
            "read_file": partial(read_file, self.workdir),
            "write_file": partial(write_file, self.workdir),
            "patch": partial(patch, self.workdir),
        }
        said = runs[ready.tool](**arguments)
        return Said(redacted(said.text, self.secrets), said.failed)
