"""The stage: the step's input in, its trials out. It moves nothing: octoform carries the trials out.

The embedded agent never rewrites a server: its tools are made from the same grammar, so there is nothing that it
would write otherwise. What it cannot prove it refuses, with the reason.
"""

from collections.abc import Mapping
from typing import Any

from octoform.builtin.grammars import holding
from octoform.builtin.step.cameras import best
from octoform.builtin.step.lines import trials as of_lines
from octoform.builtin.step.registers import disabled
from octoform.builtin.step.registers import trials as of_registers
from octoform.builtin.task import Refused, Task


def run(task: Task) -> str:
    """Write the step's output; the summary line (``5 trials, 1 unit skipped``). Refused says why there can be none."""
    given = task.read_input()
    try:
        value = answer(given, task)
    except (KeyError, TypeError, AttributeError) as problem:
        raise Refused(f"the step's input cannot be used: {type(problem).__name__}: {problem}") from problem
    task.write(value)
    if value["camera"] is not None:
        return f"the camera {value['camera']['device']}"
    return f"{len(value['trials'])} trials, {len(value['skipped'])} units skipped"


def answer(given: Mapping[str, Any], task: Task) -> dict[str, Any]:
    """The output for an input; Refused where nothing that is known can prove it."""
    kind, device = given["proof"]["kind"], given["device"]
    blank = {"format": 1, "step": given["step"], "device": None, "server": None}
    if kind == "frame":
        camera = best(given["cameras"])
        chosen = {name: camera[name] for name in ("device", "tool", "arguments")}
        return {**blank, "trials": [], "skipped": [], "camera": chosen}
    if device is None:
        raise Refused("this step is for no certain device; the embedded agent moves only what a profile describes")
    profile = holding(task.profiles, device["id"])
    grammar = (profile or {}).get("grammar") or {}
    skipped: list[dict[str, str]] = []
    if kind == "reading" and "registers" in grammar:
        trials, skipped = of_registers(given, grammar), disabled(grammar)
    elif kind == "view" and "line" in grammar:
        trials = of_lines(given, grammar)
    else:
        raise Refused(f"the profile has no grammar from which a proof of the kind {kind} could be made")
    if not trials:
        raise Refused("nothing of this device can be tried: no enabled unit, or no tool that moves it to and fro")
    return {**blank, "device": device["id"], "trials": trials, "skipped": skipped, "camera": None}
