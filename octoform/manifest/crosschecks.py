"""Rules the schema cannot say: timeouts that do not fit together, settings without effect, placeholders of commands.

(Heavy: the document.)
"""

import re

from octoform.diagnostics import Span, did_you_mean
from octoform.manifest import tree
from octoform.manifest.building import timeouts
from octoform.manifest.document import CommandHarness, Document, Stage
from octoform.manifest.model import PLACEHOLDERS, STAGES
from octoform.manifest.report import Report
from octoform.manifest.tree import Items, Loc, Scalar, Table

_PLACEHOLDER = re.compile(r"\{\{|\}\}|(?<!\$)\{([A-Za-z_][A-Za-z0-9_]*)\}")


def check(document: Document, root: Table, report: Report) -> None:
    """Report what does not fit together in a document that fits the schema."""
    _timeouts(document, root, report)
    _unused_models(document, root, report)


def _stage(document: Document, name: str) -> Stage:
    stage: Stage = getattr(document.stages, name)
    return stage


def _timeouts(document: Document, root: Table, report: Report) -> None:
    told: set[Span] = set()
    for name in STAGES:
        attempt, stage = timeouts(document.budget, _stage(document, name).budget)
        if attempt <= stage:
            continue
        places = [(*where, key) for where in (("stages", name, "budget"), ("budget",)) for key in _TIMEOUTS]
        span = next((node.span for node in (tree.at(root, loc) for loc in places) if node is not None), root.span)
        if span not in told:
            told.add(span)
            report.warning(
                "MANIFEST-TIMEOUTS",
                f"one attempt may take longer ({attempt:.0f} s) than its whole stage ({stage:.0f} s)",
                span,
                hint="the stage's time ends the attempt; raise stage_timeout or lower attempt_timeout",
            )


_TIMEOUTS = ("attempt_timeout", "stage_timeout")


def _unused_models(document: Document, root: Table, report: Report) -> None:
    """A model that no agent asks for would look as if it were in force."""
    users = {name: isinstance(_stage(document, name).harness or document.harness, CommandHarness) for name in STAGES}
    places: list[Loc] = [("stages", name, "model") for name in STAGES if not users[name]]
    if not any(users.values()):
        places.append(("model",))
    for loc in places:
        key = tree.key_at(root, loc)
        if key is not None:
            report.warning(
                "MANIFEST-UNUSED",
                "this model has no effect: the embedded agent uses none",
                key.span,
                hint="remove it, or choose another harness",
            )


def check_commands(root: Table, report: Report) -> None:
    """Report what is wrong in the arguments of a command; looks at the tree, so it needs no document."""
    for loc in (("harness",), *(("stages", name, "harness") for name in STAGES)):
        command = tree.at(root, (*loc, "command"))
        way = tree.at(root, (*loc, "prompt"))
        prompt = way.text if isinstance(way, Scalar) else "stdin"
        for index, item in enumerate(command.items if isinstance(command, Items) else ()):
            if isinstance(item, Scalar):
                _argument(item, index, prompt, report)


def _argument(item: Scalar, index: int, prompt: str, report: Report) -> None:
    if index == 0 and isinstance(item.value, str) and not item.text.strip():
        report.error(
            "MANIFEST-WRONG-VALUE", "the first item of a command is a program", item.span, hint="name the program"
        )
    for name in dict.fromkeys(found for found in _PLACEHOLDER.findall(item.text) if found):
        if name not in PLACEHOLDERS:
            near = did_you_mean(name[:80], PLACEHOLDERS)
            hint = f"did you mean {{{near}}}?" if near else f"known: {', '.join(PLACEHOLDERS)}; {{{{ is a plain brace"
            report.error("MANIFEST-WRONG-VALUE", f"{{{report.shown(name)}}} is no placeholder", item.span, hint=hint)
        elif name == "prompt" and prompt != "argument":
            hint = "add `prompt: argument`, or use {prompt_file}"
            report.error(
                "MANIFEST-WRONG-VALUE", "{prompt} stands here, but the prompt is no argument", item.span, hint=hint
            )
