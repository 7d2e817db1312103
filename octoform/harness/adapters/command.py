"""Harness ``command``: any program that a person names in the manifest is the agent.

The command is a list of arguments, never a shell line. Placeholders in braces are replaced inside an argument; the
prompt comes on standard input, as a file, or as an argument. What the program needs besides is in the
environment: OCTOFORM_TASK, OCTOFORM_PROMPT and OCTOFORM_OUTPUT are paths.
"""

import re
from collections.abc import Mapping
from pathlib import Path

from octoform.base.files import read
from octoform.diagnostics import Diagnostic, did_you_mean, error
from octoform.harness.contained_attempt import Invocation, run_contained
from octoform.harness.port import Outcome, ProgressSink, Task
from octoform.manifest.model import PLACEHOLDERS, HarnessSpec, Sandbox
from octoform.manifest.references import resolve_argument
from octoform.patterns import regex
from octoform.records import dataclass

PROMPT_WAYS = ("stdin", "file", "argument")
_PLACEHOLDER = regex(r"\{\{|\}\}|\{([A-Za-z_][A-Za-z0-9_]*)\}")


@dataclass(frozen=True, slots=True)
class CommandHarness:
    """Runs ``argv`` for a task; ``env`` names the variables of the caller that it may see.

    ``prompt_via`` is ``stdin``, ``file`` (the prompt's path is where ``{prompt_file}`` does, and in
    OCTOFORM_PROMPT) or ``argument`` (the text is where ``{prompt}`` does, else it is the last argument).
    """

    argv: tuple[str, ...]
    env: tuple[str, ...] = ()
    prompt_via: str = "stdin"
    name: str = "command"
    sandbox: Sandbox | None = None

    def run(self, task: Task, progress: ProgressSink) -> Outcome:
        """See `Harness.run`."""
        stdin = task.prompt if self.prompt_via == "stdin" else None
        invocation = Invocation(self.arguments(task), stdin, self.env, sandbox=self.sandbox)
        return run_contained(task, invocation, progress)

    def arguments(self, task: Task) -> tuple[str, ...]:
        """The arguments for one task; OSError when the prompt is needed and cannot be read."""
        values = {
            "prompt_file": str(task.prompt),
            "task": str(task.document),
            "output": str(task.output),
            "workdir": str(task.workdir),
            "model": task.model or "",
            "stage": task.stage,
        }
        if self.prompt_via != "argument":
            return tuple(fill(item, values) for item in self.argv)
        values["prompt"] = read(task.prompt).decode("utf-8", "replace").replace("\0", "\ufffd")
        filled = tuple(fill(item, values) for item in self.argv)
        return filled if any("prompt" in names(item) for item in self.argv) else (*filled, values["prompt"])


def fill(template: str, values: dict[str, str]) -> str:
    """Replace ``{name}`` by its value, and ``{{`` and ``}}`` by a brace; a name without a value stays as it is."""

    def one(found: re.Match[str]) -> str:
        name = found.group(1)
        return found.group()[0] if name is None else values.get(name, found.group())

    return _PLACEHOLDER.sub(one, template)


def names(template: str) -> set[str]:
    """The placeholder names that are in an argument."""
    return {found for found in _PLACEHOLDER.findall(template) if found}


def create(spec: HarnessSpec, environ: Mapping[str, str], folder: Path | None) -> CommandHarness | Diagnostic:
    """The harness, or what is wrong with its settings; a relative program with a slash belongs to ``folder``."""
    command = [resolve_argument(item, environ) for item in spec.command]
    if not command or not command[0].strip():
        return error(
            "HARNESS-NO-COMMAND",
            "the command harness has no command",
            hint="name the program and its arguments as a list: command: [my-agent, --task, '{task}']",
        )
    if spec.prompt_via not in PROMPT_WAYS:
        return error(
            "HARNESS-PROMPT-VIA",
            f"prompt_via is {spec.prompt_via!r}, which is none of {', '.join(PROMPT_WAYS)}",
            hint="leave it out for stdin",
        )
    problem = _placeholders(command, spec.prompt_via)
    if problem is not None:
        return problem
    program = command[0]
    if folder is not None and "/" in program and not Path(program).is_absolute():
        program = str(folder / program)
    return CommandHarness((program, *command[1:]), tuple(spec.env), spec.prompt_via, sandbox=spec.sandbox)


def _placeholders(command: list[str], prompt_via: str) -> Diagnostic | None:
    for item in command:
        for name in sorted(names(item) - set(PLACEHOLDERS)):
            return _unknown(name, item)
    if prompt_via != "argument" and any("prompt" in names(item) for item in command):
        return error(
            "HARNESS-PROMPT-VIA",
            "{prompt} is in the command, but the prompt is not passed as an argument",
            hint="set prompt_via: argument, or use {prompt_file}",
        )
    return None


def _unknown(name: str, item: str) -> Diagnostic:
    near = did_you_mean(name, PLACEHOLDERS)
    return error(
        "HARNESS-PLACEHOLDER",
        f"{{{name}}} in the command is no placeholder",
        detail=f"in the argument {item!r}",
        hint=f"did you mean {{{near}}}?" if near else "write {{" + name + "}} for the plain text",
    )
