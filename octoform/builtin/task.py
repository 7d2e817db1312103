"""The embedded agent's side of a task: what it was asked, what it may read (its profiles too), where it writes.

Kept apart from the stages so that each of them sees only a `Task` and cannot learn anything else about the run. The
output appears whole or not at all (temporary file, flush, rename), because a half-written file would otherwise be
one more failure to diagnose.

The protocol definition of a profile is a closed list of typed lines, so it is enough to make tools from: this is all
that the embedded agent ever knows of a product, and it knows it only from the owner's own text.
"""

import json
import os
from collections.abc import Iterable, Mapping
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from octoform.base.files import read_json, replace
from octoform.patterns import regex
from octoform.records import dataclass, field

STAGES = ("probe", "scan", "identify", "interface", "serve", "deploy", "watch", "heal")
"""The tasks of this agent; ``scan`` beside another agent's PROBE, the last two once a deployment runs."""
STEP = "step."
"""How the name of a privileged step begins; all of them are done by one stage of this agent."""
FORMER = "former-output.json"
"""Where the output of the attempt before lies when it was refused."""
_OF_DEVICE = regex(r"/devices/(\d+)(?:/.*)?")
DEFAULT_TOOLS = 30
SYSROOT_VARIABLE = "OCTOFORM_SYSROOT"


class TaskRefused(Exception):
    """A clear failure of the task itself; its text is the one line that the orchestrator's log gets."""


@dataclass(frozen=True, slots=True)
class Task:
    """One attempt at one stage, or at one privileged step (``step.arm``).

    ``input`` is the preceding stage's artifact (None for PROBE), ``schema`` the JSON Schema of the output where it
    has one, ``tools_budget`` the most tools that INTERFACE may declare, ``sysroot`` the folder whose sys, proc, dev
    and run are the host (``/`` unless the environment names a recorded one). ``profiles`` are the owner's knowledge of
    products, each with the devices that it ``holds`` for, and ``answers`` a person's answers about devices, by id.
    ``refused`` are the entries of ``devices`` in the output of the attempt before that were refused, as they were.
    """

    stage: str
    input: Path | None
    schema: Path | None
    output: Path
    tools_budget: int
    sysroot: Path
    profiles: tuple[Mapping[str, Any], ...] = ()
    answers: Mapping[str, str] = field(default_factory=dict)
    refused: tuple[Mapping[str, Any], ...] = ()

    def read_input(self) -> dict[str, Any]:
        """The preceding artifact as a JSON object; TaskRefused when there is none or it is no such thing."""
        if self.input is None:
            raise TaskRefused(f"stage {self.stage} needs the preceding stage's artifact and the task names none")
        return read_object(self.input)

    def write(self, value: Mapping[str, Any] | str) -> None:
        """Write the output atomically: text as it is, an object as indented JSON.

        TaskRefused when the disk refuses it.
        """
        text = value if isinstance(value, str) else json.dumps(value, indent=1, ensure_ascii=False) + "\n"
        try:
            replace(self.output, text.encode("utf-8"), 0o644)
        except OSError as problem:
            raise TaskRefused(f"cannot write {self.output}: {problem.strerror}") from problem


def read_task(path: Path, environ: Mapping[str, str] | None = None) -> Task:
    """Read ``task.json``; TaskRefused names what is missing or wrong in it."""
    variables = os.environ if environ is None else environ
    document = read_object(path)
    stage = document.get("stage")
    if stage not in STAGES and not (isinstance(stage, str) and stage.startswith(STEP)):
        raise TaskRefused(f"{path.name}: stage {stage!r} is none of {', '.join(STAGES)}")
    output = _path(document, "output")
    if output is None:
        raise TaskRefused(f"{path.name}: 'output' is missing")
    return Task(
        stage=stage,
        input=_path(document, "input"),
        schema=_path(document, "schema"),
        output=output,
        tools_budget=_tools(document),
        sysroot=Path(variables.get(SYSROOT_VARIABLE) or "/"),
        profiles=_profiles(document),
        answers=_answers(document),
        refused=_refused(document, output.with_name(FORMER)),
    )


def read_object(path: Path) -> dict[str, Any]:
    """A JSON object from a file; TaskRefused when it cannot be read, parsed or is no object."""
    try:
        value = read_json(path, any_text=True)
    except OSError as problem:
        raise TaskRefused(f"cannot read {path}: {problem.strerror}") from problem
    except ValueError as problem:
        raise TaskRefused(f"{path} is not JSON: {problem}") from problem
    if not isinstance(value, dict):
        raise TaskRefused(f"{path} holds no JSON object")
    return value


def _path(document: Mapping[str, Any], key: str) -> Path | None:
    value = document.get(key)
    if value is None:
        return None
    if not isinstance(value, str) or not value:
        raise TaskRefused(f"task: {key!r} is no path")
    return Path(value)


def _tools(document: Mapping[str, Any]) -> int:
    limits = document.get("limits")
    tools = limits.get("tools") if isinstance(limits, dict) else None
    return tools if isinstance(tools, int) and not isinstance(tools, bool) and tools > 0 else DEFAULT_TOOLS


def _profiles(document: Mapping[str, Any]) -> tuple[Mapping[str, Any], ...]:
    given = document.get("profiles", [])
    if not isinstance(given, list) or not all(isinstance(item, dict) for item in given):
        raise TaskRefused("task: 'profiles' is no list of profiles")
    return tuple(given)


def _answers(document: Mapping[str, Any]) -> Mapping[str, str]:
    given = document.get("answers", {})
    if not isinstance(given, dict) or not all(isinstance(item, str) for item in given.values()):
        raise TaskRefused("task: 'answers' is no object of sentences")
    return given


def _refused(document: Mapping[str, Any], former: Path) -> tuple[Mapping[str, Any], ...]:
    """The devices of the former output to which an error points; none in a first attempt."""
    lines = [item for item in document.get("diagnostics") or () if isinstance(item, dict)]
    errors = [str(item.get("pointer")) for item in lines if item.get("severity") == "error"]
    places = {int(found[1]) for pointer in errors if (found := _OF_DEVICE.fullmatch(pointer))}
    if not places or not former.is_file():
        return ()
    devices = read_object(former).get("devices")
    entries = devices if isinstance(devices, list) else []
    return tuple(
        entries[place] for place in sorted(places) if place < len(entries) and isinstance(entries[place], dict)
    )


Profiles = Iterable[Mapping[str, Any]]
"""The profiles of a task (``Task.profiles``)."""


def holding(profiles: Profiles, device: str) -> Mapping[str, Any] | None:
    """The profile that matches a device: the first with a protocol definition, else the first; mostly None."""
    found = [profile for profile in profiles if device in profile.get("holds", ())]
    return next((profile for profile in found if profile.get("grammar")), found[0] if found else None)


def commands(profiles: Profiles) -> dict[str, tuple[Mapping[str, Any], Mapping[str, Any]]]:
    """Tool name to (profile, command); the contracts of octoform keep a tool in one protocol definition alone."""
    return {
        str(command["tool"]): (profile, command)
        for profile in profiles
        for command in (profile.get("grammar") or {}).get("commands", ())
    }


def parameters(profile: Mapping[str, Any], command: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The parameters of a command, each with its bounds as far as the limits of the profile narrow them."""
    found = {name: dict(value) for name, value in command.get("parameters", {}).items()}
    for limit in profile.get("limits", ()):
        value = found.get(limit.get("parameter", ""))
        if value is None or not fnmatchcase(str(command["tool"]), limit.get("tool", "*")):
            continue
        for bound, tighter in (("minimum", max), ("maximum", min)):
            if bound in limit:
                value[bound] = tighter(value.get(bound, limit[bound]), limit[bound])
        if "unit" in limit:
            value["unit"] = limit["unit"]
    return found
