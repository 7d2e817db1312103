"""Rules for a privileged step: what is tried is the matched device, with its own tools, and all of it.

An agent reports what shall move, octoform moves it. So before anything moves, the movement must belong to the device
that the step is for; and a unit that is omitted without a reason would be taken for one that works.
"""

import re
from collections.abc import Iterator, Mapping
from typing import Any

from octoform.base.escaping import display, listed
from octoform.base.shape import pointer
from octoform.contracts.model import Artifacts, JsonObject, Rule, StepFacts
from octoform.contracts.name_clues import same_action
from octoform.diagnostics import Diagnostic, did_you_mean, error

# The tools of a device as a privileged step may use them: which moves it, which reads it, which units they name.

_CAPTURE = same_action("capture_image")
_DEVICE = "device"
_NUMBERS = ("number", "integer")
_SWITCH = ("boolean",)


def tool(artifacts: Artifacts, name: str) -> JsonObject | None:
    """The tool of INTERFACE with that name."""
    return next((item for item in _tools(artifacts) if item["name"] == name), None)


def tools_of(artifacts: Artifacts, device: str | None) -> list[JsonObject]:
    """The tools that serve a device."""
    return [item for item in _tools(artifacts) if device in item["devices"]]


def _tools(artifacts: Artifacts) -> list[JsonObject]:
    return list(artifacts.interface["tools"]) if artifacts.interface is not None else []


def takes_pictures(item: JsonObject) -> bool:
    """True for a tool that reads what a camera sees."""
    names = (str(item["capability"]), str(item["name"]))
    return item["effect"] == "read" and any(same_action(name) >= _CAPTURE for name in names)


def properties(item: JsonObject) -> Mapping[str, Any]:
    """The parameters of a tool with their schemas."""
    found = item["input_schema"].get("properties")
    return found if isinstance(found, dict) else {}


def is_numeric(item: JsonObject, parameter: str) -> bool:
    """True for a parameter of a tool that takes numbers and nothing else."""
    return _is_of(item, parameter, _NUMBERS)


def is_switch(item: JsonObject, parameter: str) -> bool:
    """True for a parameter of a tool that takes true and false and nothing else."""
    return _is_of(item, parameter, _SWITCH)


def _is_of(item: JsonObject, parameter: str, allowed: tuple[str, ...]) -> bool:
    schema = properties(item).get(parameter)
    kinds = schema.get("type") if isinstance(schema, dict) else None
    return all(kind in allowed for kind in kinds) and bool(kinds) if isinstance(kinds, list) else kinds in allowed


def units(artifacts: Artifacts, device: str | None) -> dict[str, tuple[str, ...]]:
    """Parameters that name a unit of the device, with the names: a moving and a reading tool offer the same choice."""
    served = tools_of(artifacts, device)
    moved = dict(choice for item in served if item["effect"] == "actuate" for choice in _choices(item))
    read = [choice for item in served if item["effect"] == "read" for choice in _choices(item)]
    return {name: names for name, names in read if moved.get(name) == names}


def _choices(item: JsonObject) -> Iterator[tuple[str, tuple[str, ...]]]:
    for name, schema in properties(item).items():
        names = schema.get("enum") if isinstance(schema, dict) and name != _DEVICE else None
        if isinstance(names, list) and names and all(isinstance(one, str) for one in names):
            yield name, tuple(sorted(one for one in names if not one.isdigit()))  # an id is another name for a unit


_CLAIMS = ("device", "trials", "skipped", "camera")
_CALLS = ("move", "read", "view")
_VARYING = ("move", "set")


def name_differs(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """The artifact is that of the step that was asked for."""
    name = _facts(artifacts).name
    if value["step"] == name:
        return []
    summary = f"the step is called {display(name)}, not {display(value['step'])}"
    return [error("STEP-NAME-DIFFERS", summary, pointer="/step", hint=f"write {name}")]


def device_differs(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A step moves only the device that it is for; a step without movement names no device."""
    facts, device = _facts(artifacts), value["device"]
    if device is None and facts.idle:
        return []
    if facts.kind == "frame":
        allowed, hint = device is None, "write null: nothing moves, and the camera is in `camera`"
    elif facts.needs_profile:
        allowed, hint = device in facts.devices, f"write {' or '.join(facts.devices) or 'nothing: there is none'}"
    else:
        known = [item["id"] for item in (artifacts.identify or {"devices": []})["devices"]]
        near = did_you_mean(str(device), known)
        allowed, hint = device in known, f"did you mean {near}?" if near else "name a device of IDENTIFY"
    if allowed:
        return []
    summary = f"the step {facts.name} is not for the device {display(device)}"
    return [error("STEP-DEVICE-DIFFERS", summary, pointer="/device", hint=hint)]


def wrong_proof(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """The tests are of the kind that proves this step, and there is at least one."""
    facts = _facts(artifacts)
    if facts.idle and not any(value[name] for name in _CLAIMS):
        return []
    frame = facts.kind == "frame"
    found = []
    if frame != bool(value["camera"]):
        summary = "the step chooses a camera" if frame else "the step chooses no camera"
        found.append((summary, "/camera", "name one of the cameras of input.json" if frame else "write null"))
    if frame and (value["trials"] or value["skipped"]):
        found.append(("nothing is moved in this step", "/trials", "write empty lists"))
    if not frame and not value["trials"]:
        found.append(("nothing is tested, so nothing is proved", "/trials", "write a hardware test for each unit"))
    for index, trial in enumerate(value["trials"] if not frame else ()):
        for name, kind in (("read", "reading"), ("view", "view")):
            if (trial[name] is not None) != (facts.kind == kind):
                summary = f"a hardware test of the kind {facts.kind} has {'a' if facts.kind == kind else 'no'} {name}"
                hint = f"describe how to {name} before and after" if facts.kind == kind else "write null"
                found.append((summary, pointer("trials", index, name), hint))
        if trial.get("restore") is not None and facts.kind != "reading":
            summary = f"the hardware test is of the kind {facts.kind}, after which nothing is restored"
            found.append((summary, pointer("trials", index, "restore"), "write null"))
    return [error("STEP-WRONG-PROOF", summary, pointer=where, hint=hint) for summary, where, hint in found]


def foreign_tool(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A test moves with an actuating and reads with a reading tool of its device, and looks with one of a camera."""
    found = []
    own = [item["name"] for item in tools_of(artifacts, value["device"])]
    for where, part, call in _calls(value):
        item = tool(artifacts, call["tool"])
        problem = _unfit(part, item, own)
        if problem is not None:
            near = did_you_mean(call["tool"], own) if item is None else None
            hint = f"did you mean {near}?" if near else problem[1]
            summary = f"the tool {display(call['tool'])} {problem[0]}"
            found.append(error("STEP-FOREIGN-TOOL", summary, pointer=f"{where}/tool", hint=hint))
        elif part != "view" and call["arguments"].get("device", mine := _mine(value, part)) != mine:
            summary = f"the call of {display(call['tool'])} is for {display(call['arguments']['device'])}"
            where = f"{where}/arguments/device"
            found.append(error("STEP-FOREIGN-TOOL", summary, pointer=where, hint=f"this is about {mine}"))
    return found


def _mine(value: JsonObject, part: str) -> Any:
    """The device that a call of this part is for."""
    return value["camera"]["device"] if part == "camera" else value["device"]


def _unfit(part: str, item: JsonObject | None, own: list[str]) -> tuple[str, str] | None:
    """The objection to a tool in its place, and what to do."""
    if item is None:
        return "is not one of INTERFACE", "use a tool of input.json"
    if part in ("view", "camera"):
        return None if takes_pictures(item) else ("takes no pictures", "use the tool of a camera of input.json")
    if item["name"] not in own:
        return "does not belong to the device of this step", "use a tool of that device: they are in input.json"
    wanted = "actuate" if part in _VARYING else "read"
    if item["effect"] != wanted:
        return f"has the effect {item['effect']}, and a {part} has {wanted}", f"choose a tool with the effect {wanted}"
    return None


def wrong_arguments(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """Every call has the arguments that its tool takes, and a number of it is varied."""
    found: list[Diagnostic] = []
    for where, part, call in _calls(value):
        item = tool(artifacts, call["tool"])
        if item is None:
            continue
        varied = [call["vary"]] if part in _VARYING else []
        if varied:
            found += _varied(item, varied[0], part, f"{where}/vary")
            found += _too_far(item, call, where) if part == "move" else ()
        found += _arguments(item, call["arguments"], varied, f"{where}/arguments")
    return found


def _varied(item: JsonObject, name: str, part: str, where: str) -> Iterator[Diagnostic]:
    """A movement goes by a number; what is set again may be a switch too."""
    fit = [one for one in properties(item) if is_numeric(item, one) or (part == "set" and is_switch(item, one))]
    if name not in fit:
        kind = "boolean or numeric" if part == "set" else "numeric"
        hint = f"its {kind} parameters are {listed(fit)}" if fit else "choose another tool"
        summary = f"{display(name)} is no {kind} parameter of {display(item['name'])}"
        yield error("STEP-WRONG-ARGUMENTS", summary, pointer=where, hint=hint)


def _arguments(item: JsonObject, given: dict[str, Any], varied: list[str], where: str) -> Iterator[Diagnostic]:
    known = list(properties(item))
    for name in (name for name in given if name not in known or name in varied):
        near = did_you_mean(name, known)
        hint = f"did you mean {near}?" if near else f"its parameters are {listed(known)}"
        summary = f"{display(item['name'])} has no parameter {display(name)}"
        if name in varied:
            summary, hint = f"{display(name)} is varied, and is among the arguments too", "take it out of them"
        yield error("STEP-WRONG-ARGUMENTS", summary, pointer=where, hint=hint)
    for name in (name for name in given if name in known and not _fits(properties(item)[name], given[name])):
        summary = f"{display(item['name'])} does not take {display(given[name])} for {display(name)}"
        yield error("STEP-WRONG-ARGUMENTS", summary, pointer=f"{where}{pointer(name)}", hint="take what its schema has")
    absent = [name for name in item["input_schema"].get("required", ()) if name not in given and name not in varied]
    if absent:
        summary = f"{display(item['name'])} needs {listed(absent)}"
        yield error("STEP-WRONG-ARGUMENTS", summary, pointer=where, hint="give every required parameter")


def _fits(schema: Any, given: Any) -> bool:
    """Whether an argument is one of the choices of its parameter, and within its bounds."""
    if not isinstance(schema, dict):
        return True
    if not isinstance(given, str | bool | int | float):
        return True
    number = isinstance(given, int | float) and not isinstance(given, bool)
    low, high = (schema.get(name) for name in ("minimum", "maximum"))
    within = not number or ((low is None or given >= low) and (high is None or given <= high))
    return within and given in schema.get("enum", [given]) and given == schema.get("const", given)


def _too_far(item: JsonObject, call: JsonObject, where: str) -> Iterator[Diagnostic]:
    """A movement has room in one direction or the other, and its way back."""
    schema, by = properties(item).get(call["vary"], {}), abs(call["by"])
    low, high = (schema.get(name) if isinstance(schema, dict) else None for name in ("minimum", "maximum"))
    if not isinstance(low, int | float) or not isinstance(high, int | float):
        return
    hint = "give a smaller `by`; `relative` is true only where the parameter is a distance and no position"
    if call["relative"] and not low <= -by <= by <= high:
        summary = f"{display(call['vary'])} of {display(item['name'])} takes {low:g} to {high:g}, and not -{by:g}"
        yield error("STEP-WRONG-ARGUMENTS", f"{summary}, which moves back", pointer=f"{where}/by", hint=hint)
    elif not call["relative"] and 2 * by > high - low:
        summary = f"{display(call['vary'])} of {display(item['name'])} has no room for {by:g} in its {high - low:g}"
        yield error("STEP-WRONG-ARGUMENTS", summary, pointer=f"{where}/by", hint=hint)


def uncovered_unit(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """Every unit of the device is tried or skipped, once."""
    where = {
        **{index: pointer("trials", index, "unit") for index in range(len(value["trials"]))},
        **{len(value["trials"]) + at: pointer("skipped", at, "unit") for at in range(len(value["skipped"]))},
    }
    named = [item["unit"] for item in (*value["trials"], *value["skipped"])]
    found = [
        (f"the unit {display(unit)} is there twice", where[index], "test each unit once")
        for index, unit in enumerate(named)
        if unit in named[:index]
    ]
    offered = units(artifacts, value["device"])
    for parameter, names in offered.items():
        absent = sorted(set(names) - set(named))
        if absent:
            summary = f"the {parameter} {listed(absent)} is neither tested nor skipped"
            found.append((summary, "/trials", "write a hardware test for it; skip only what the profile disables"))
    for index, trial in enumerate(value["trials"]):
        found += _misnamed(trial, offered, pointer("trials", index))
    return [error("STEP-UNCOVERED-UNIT", summary, pointer=place, hint=hint) for summary, place, hint in found]


def _misnamed(test: JsonObject, offered: dict[str, tuple[str, ...]], where: str) -> Iterator[tuple[str, str, str]]:
    """A test that names one unit and moves or reads another proves nothing."""
    for place, part, call in _calls_of(test):
        arguments = call["arguments"] if part != "view" else {}
        for parameter in offered:
            if parameter in arguments and arguments[parameter] != test["unit"]:
                other = display(arguments[parameter])
                summary = f"the hardware test of {display(test['unit'])} has the {parameter} {other} in its {part}"
                yield summary, f"{where}{place}/arguments/{parameter}", f"write {test['unit']}"


def wrongly_skipped(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A unit is skipped when the profile disables it, and then it is, with a reason."""
    disabled = _facts(artifacts).disabled
    found = []
    for index, item in enumerate(value["skipped"]):
        where = pointer("skipped", index)
        if item["unit"] not in disabled:
            summary = f"the unit {display(item['unit'])} is skipped, and the profile does not disable it"
            hint = "test it; its owner disables a broken one in the profile's rig"
            found.append(error("STEP-WRONGLY-SKIPPED", summary, pointer=f"{where}/unit", hint=hint))
        if not item["reason"].strip():
            summary = f"the unit {display(item['unit'])} is skipped without a reason"
            found.append(error("STEP-WRONGLY-SKIPPED", summary, pointer=f"{where}/reason", hint="give the profile's"))
        elif not _is_of_profile(item["reason"], disabled.get(item["unit"], "")):
            summary = f"the unit {display(item['unit'])} is skipped for another reason than the profile gives"
            hint = f"write {display(disabled[item['unit']])}"
            found.append(error("STEP-WRONGLY-SKIPPED", summary, pointer=f"{where}/reason", hint=hint))
    for index, trial in enumerate(value["trials"]):
        if trial["unit"] in disabled:
            summary = f"the unit {display(trial['unit'])} is tried, and the profile disables it"
            where, hint = pointer("trials", index, "unit"), "skip it with the reason that the profile gives"
            found.append(error("STEP-WRONGLY-SKIPPED", summary, pointer=where, hint=hint))
    return found


def _is_of_profile(reason: str, given: str) -> bool:
    """Whether a reason has a word of the profile's; one beyond ASCII, in another language, is not judged."""
    own = set(re.findall(r"\w{4,}", given.casefold()))
    return not own or not own.isdisjoint(re.findall(r"\w{4,}", reason.casefold())) or not reason.isascii()


def too_small(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A movement that is smaller than what proves it cannot prove it."""
    facts = _facts(artifacts)
    return [
        error(
            "STEP-TOO-SMALL",
            f"{display(trial['unit'])} is to move by {trial['move']['by']}, and the test requires {facts.minimum:g}",
            pointer=pointer("trials", index, "move", "by"),
            hint=f"move by more than {facts.minimum:g}, far enough to be distinguished from a jitter",
        )
        for index, trial in enumerate(value["trials"])
        if facts.kind == "reading" and abs(trial["move"]["by"]) < facts.minimum
    ]


def wrong_camera(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """The camera is one that is there: the manifest's, else one on a hub of its own, else a USB one."""
    facts, camera = _facts(artifacts), value["camera"]
    if camera is None or facts.kind != "frame":
        return []
    known = {item["device"]: item for item in facts.cameras}
    chosen = known.get(camera["device"])
    if chosen is None:
        summary = f"{display(camera['device'])} is no camera of this host"
        return [
            _camera(summary, "/camera/device", f"the cameras are {listed(list(known))}" if known else "there is none")
        ]
    if camera["tool"] != chosen["tool"]:
        summary = f"the camera {display(camera['device'])} has the tool {display(chosen['tool'])}"
        return [_camera(summary, "/camera/tool", f"write {chosen['tool']}")]
    best = known.get(facts.best or "")
    if best is None or _rank(chosen) <= _rank(best):
        return []
    summary = f"the camera {display(camera['device'])} {_weakness(chosen, best)}"
    return [_camera(summary, "/camera/device", f"choose {best['device']}")]


def _camera(summary: str, where: str, hint: str) -> Diagnostic:
    return error("STEP-WRONG-CAMERA", summary, pointer=where, hint=hint)


def _rank(camera: Any) -> tuple[bool, bool, bool]:
    return not camera["hint"], bool(camera["hub_shared_with"]), camera["built_in"]


def _weakness(chosen: Any, best: Any) -> str:
    """Why another camera goes before it."""
    if best["hint"] and not chosen["hint"]:
        return "is not the one that the manifest names"
    if chosen["hub_shared_with"] and not best["hub_shared_with"]:
        return f"shares its hub with {listed(list(chosen['hub_shared_with']))}, and another does not"
    return "is built into the machine, and another is not"


RULES = (
    Rule("STEP-NAME-DIFFERS", name_differs),
    Rule("STEP-DEVICE-DIFFERS", device_differs),
    Rule("STEP-WRONG-PROOF", wrong_proof),
    Rule("STEP-FOREIGN-TOOL", foreign_tool),
    Rule("STEP-WRONG-ARGUMENTS", wrong_arguments),
    Rule("STEP-UNCOVERED-UNIT", uncovered_unit),
    Rule("STEP-WRONGLY-SKIPPED", wrongly_skipped),
    Rule("STEP-TOO-SMALL", too_small),
    Rule("STEP-WRONG-CAMERA", wrong_camera),
)


def _facts(artifacts: Artifacts) -> StepFacts:
    if artifacts.step is None:
        raise ValueError("a step cannot be checked without its facts")
    return artifacts.step


def _calls(value: JsonObject) -> Iterator[tuple[str, str, JsonObject]]:
    """(pointer, part, call) of every call that the step would make."""
    for index, trial in enumerate(value["trials"]):
        for place, part, call in _calls_of(trial):
            yield pointer("trials", index) + place, part, call
    if value["camera"] is not None:
        yield "/camera", "camera", value["camera"]


def _calls_of(test: JsonObject) -> Iterator[tuple[str, str, JsonObject]]:
    """The same of one test; the pointer begins at the test."""
    for part in _CALLS:
        if test[part] is not None:
            yield pointer(part), part, test[part]
    for part, call in (test.get("restore") or {}).items():
        yield pointer("restore", part), part, call
