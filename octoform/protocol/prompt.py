"""Prompts: rendered from a spec, its schema, paths and fenced data, and bounded in bytes however long a run lasts.

Nothing of a device enters a prompt: the preceding artifact is named by its path. What does enter from outside (the
tail of a failed attempt's log, the contract's diagnostics, profiles, a person's answers) is bounded, escaped and fenced
as data.
"""

import os
import re
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from octoform.base.escaping import escaped
from octoform.base.files import stream
from octoform.diagnostics import Diagnostic, Severity
from octoform.patterns import regex
from octoform.protocol.model import DUTIES, STEP, Spec
from octoform.records import dataclass, field

if TYPE_CHECKING:
    from jinja2 import Environment

# Foreign text in a prompt: bounded, made visible, and inside a fence that its content cannot close.

_KEPT = "\n\t"


def fenced(label: str, text: str) -> str:
    """A code fence longer than any run of backquotes inside, labelled as data that gives no orders."""
    body = escaped(text, _KEPT)
    longest = max((len(run) for run in re.findall(r"`+", body)), default=0)
    fence = "`" * max(3, longest + 1)
    return f"{fence}text data={label}\n{body.rstrip()}\n{fence}"


def tail(path: Path, lines: int, size: int) -> str:
    """The last ``lines`` lines of a log, at most ``size`` bytes once escaped, whatever it holds.

    Empty when there is none, or when it is not a plain file: an agent may put a link in its place.
    """
    try:
        with stream(path, follow=False) as log:
            log.seek(max(0, os.fstat(log.fileno()).st_size - size))
            data = log.read(size)
    except OSError:
        return ""  # no log is no reason to stop: the diagnostics say why the attempt failed
    text = escaped(data.decode("utf-8", "replace").replace("\r\n", "\n"), _KEPT).rstrip("\n")
    return cut("\n".join(text.split("\n")[-lines:]), size)


def cut(text: str, size: int) -> str:
    """The end of a string, at most ``size`` bytes in UTF-8; a character that is cut through is omitted."""
    data = text.encode("utf-8", "replace")
    return data[max(0, len(data) - size) :].decode("utf-8", "ignore")


MAX_PROMPT_BYTES = 48 * 1024
MAX_TAIL_LINES = 100
MAX_TAIL_BYTES = 8 * 1024
MAX_DIAGNOSTICS = 20
MAX_DIAGNOSTIC_CHARACTERS = 600
_MORE = " ..."
# Between two lines that no sign of their own joins.
_LINE_END = regex(r"(?<=[^\s:;,.])\s*\n\s*")
TEMPLATES = Path(__file__).parent / "templates"


class PromptTooLarge(ValueError):
    """The fixed parts of a prompt (spec, schema, profiles) alone are over the bound."""


@dataclass(frozen=True, slots=True)
class Prompt:
    """The parts of a prompt.

    ``own_spec`` is the attempt's copy of the spec, which a retry may correct if ``editable``; ``profiles`` are whole
    texts, ``answers`` a person's answers about devices, by id, ``offered`` the profiles that match a device and
    that the owner has not chosen. ``diagnostics`` and ``failed_log`` are those of the attempt before, and one of them
    makes it a retry; ``summary`` is in the place of a log's end. ``former`` is a copy of the output that is to be
    corrected, ``of_former`` what else is wrong with it, ``right`` one sentence on what is not; ``standing`` is what a
    later stage found when it tried an accepted one. ``changed`` is what has changed in the input since ``former`` was
    accepted, a line for each.
    """

    spec: Spec
    output: Path
    input: Path | None
    workdir: Path
    own_spec: Path
    tools: int
    wall_seconds: float
    profiles: tuple[str, ...] = ()
    answers: Mapping[str, str] = field(default_factory=dict)
    offered: Mapping[str, str] = field(default_factory=dict)
    editable: bool = True
    failed_log: Path | None = None
    summary: str = ""
    former: Path | None = None
    diagnostics: tuple[Diagnostic, ...] = ()
    of_former: tuple[Diagnostic, ...] = ()
    right: str = ""
    standing: tuple[Diagnostic, ...] = ()
    changed: tuple[str, ...] = ()

    @property
    def is_retry(self) -> bool:
        """True when an attempt before this one failed."""
        return bool(self.diagnostics or self.failed_log or self.standing)


def render_prompt(prompt: Prompt) -> str:
    """The prompt's text, at most `MAX_PROMPT_BYTES` in UTF-8; PromptTooLarge when its fixed parts are larger.

    A retry's log gives way first: it is cut from its beginning as far as the bound asks.
    """
    log = prompt.summary
    if not log and prompt.failed_log is not None:
        log = tail(prompt.failed_log, MAX_TAIL_LINES, MAX_TAIL_BYTES)
    while True:
        text = _render(prompt, log)
        excess = len(text.encode()) - MAX_PROMPT_BYTES
        if excess <= 0:
            return text
        if not log:
            raise PromptTooLarge(
                f"the prompt of {prompt.spec.stage} would have {MAX_PROMPT_BYTES + excess} bytes; "
                f"at most {MAX_PROMPT_BYTES} are sent"
            )
        log = cut(log, max(0, len(log.encode()) - excess))


@cache
def _environment() -> "Environment":
    """The templates, compiled once per process."""
    # Imported here: a plan names this module and renders nothing, and the library costs a tenth of a second.
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    return Environment(
        loader=FileSystemLoader(TEMPLATES),
        undefined=StrictUndefined,
        autoescape=False,
        keep_trailing_newline=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def _render(prompt: Prompt, log: str) -> str:
    return (
        _environment()
        .get_template("retry.md.j2" if prompt.is_retry else "first.md.j2")
        .render(
            stage=prompt.spec.stage.removeprefix(STEP).upper(),
            kind=_kind(prompt.spec.stage),
            body=prompt.spec.body.rstrip(),
            own_spec=_seen_from(prompt.workdir, prompt.own_spec),
            editable=prompt.editable,
            schema_path=_seen_from(prompt.workdir, prompt.spec.schema),
            input=_seen_from(prompt.workdir, prompt.input),
            output=_seen_from(prompt.workdir, prompt.output),
            tools=prompt.tools,
            seconds=round(prompt.wall_seconds),
            profiles=[fenced("profile", text) for text in prompt.profiles],
            answers=fenced("answers", _answers(prompt.answers)) if prompt.answers else "",
            offered=fenced("offered", _answers(prompt.offered)) if prompt.offered else "",
            findings=fenced("findings", findings(prompt.diagnostics)) if prompt.diagnostics else "",
            of_former=fenced("findings", findings(prompt.of_former)) if prompt.of_former else "",
            right=prompt.right,
            standing=fenced("findings", findings(prompt.standing)) if prompt.standing else "",
            log=fenced("log", log) if log.strip() else "",
            condensed=bool(prompt.summary),
            changed=fenced("changed", "\n".join(prompt.changed)) if prompt.changed else "",
            former=_seen_from(prompt.workdir, prompt.former),
        )
    )


def _kind(stage: str) -> str:
    """The name of the work in the prompt: a stage, a privileged step, or a background task."""
    if stage.startswith(STEP):
        return "step"
    return "background task" if stage in DUTIES else "stage"


def _seen_from(workdir: Path, path: Path | None) -> str | None:
    """A path as the agent can use it; an absolute one would reveal the name of the user or the company."""
    return None if path is None else os.path.relpath(path, workdir)


def _answers(given: Mapping[str, str]) -> str:
    return "\n".join(f"{device}: {' '.join(sentence.split())}" for device, sentence in given.items())


def findings(items: Sequence[Diagnostic]) -> str:
    """The diagnostics of a contract, a line each and bounded; the errors alone where there are some."""
    # What did not refuse the attempt is no reason for anything, and would read like one.
    items = [item for item in items if item.severity is Severity.ERROR] or items
    lines = []
    for item in items[:MAX_DIAGNOSTICS]:
        where = item.pointer or (f"line {item.span.line}" if item.span else item.path or "")
        text = f"{item.code}{' at ' + where if where else ''}: {item.summary}"
        text += f" ({item.hint})" if item.hint else ""
        if item.detail:  # output of a tool or a program, or a list of items; last, for it may be long
            text += ": " + _LINE_END.sub("; ", item.detail.strip())
        lines.append("- " + _cut(escaped(" ".join(text.split())), MAX_DIAGNOSTIC_CHARACTERS))
    if len(items) > MAX_DIAGNOSTICS:
        lines.append(f"- and {len(items) - MAX_DIAGNOSTICS} more")
    return "\n".join(lines)


def _cut(text: str, limit: int) -> str:
    """At most ``limit`` characters of a line; what is cut ends after an item or a word, so that no path is half."""
    if len(text) <= limit:
        return text
    head = text[: limit - len(_MORE)]
    ends = (head.rfind("; "), head.rfind(" "))
    end = next((at for at in ends if at > limit // 2), len(head))
    return head[:end].rstrip(" ;,") + _MORE
