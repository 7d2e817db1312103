"""Rules the schema cannot say: timeouts that do not fit together, settings without effect, placeholders of commands.

(Heavy: the document.)
"""

import os
from pathlib import Path

from octoform.diagnostics import Span, did_you_mean
from octoform.manifest import conversion, yaml_tree
from octoform.manifest.conversion import idle, timeouts
from octoform.manifest.model import KEEPERS, PLACEHOLDERS, STAGES, NamedStep
from octoform.manifest.problem_list import ProblemList
from octoform.manifest.schema.document import Document, Stage
from octoform.manifest.schema.harness import PROGRAMS
from octoform.manifest.yaml_tree import Items, Loc, Scalar, Table
from octoform.patterns import regex

_PLACEHOLDER = regex(r"\{\{|\}\}|(?<!\$)\{([A-Za-z_][A-Za-z0-9_]*)\}")


def check(document: Document, root: Table, report: ProblemList) -> None:
    """Report what does not fit together in a document that fits the schema."""
    _timeouts(document, root, report)
    _idle_timeouts(document, root, report)
    _unused_prices(document, root, report)
    _unused_money(document, root, report)


def _stage(document: Document, name: str) -> Stage:
    stage: Stage = getattr(document.stages, name)
    return stage


def _timeouts(document: Document, root: Table, report: ProblemList) -> None:
    names: set[Span] = set()
    for name in (*STAGES, *KEEPERS):
        own = _stage(document, name).budget
        attempt, stage = timeouts(document.budget, own)
        attempts = own.attempts or document.budget.attempts
        chosen, alone = _written(root, name, ("stage_timeout",)), not _written(root, name, ("attempt_timeout",))
        if attempt > stage:
            span = _written(root, name, ("attempt_timeout", "stage_timeout")) or root.span
            summary = f"one attempt may take longer ({attempt:.0f} s) than its whole stage ({stage:.0f} s)"
            hint = "the stage's time ends the attempt; raise stage_timeout or lower attempt_timeout"
        elif chosen is not None and alone and attempt * attempts < stage:
            span = chosen
            summary = f"the stage has {stage:.0f} s, and an attempt still ends after {attempt:.0f} s"
            hint = f"set attempt_timeout as well: {stage / attempts:.0f}s gives each of {attempts} attempts its share"
        else:
            continue
        if span not in names:
            names.add(span)
            report.warning("MANIFEST-TIMEOUTS", summary, span, hint=hint)


def _written(root: Table, stage: str, names: tuple[str, ...]) -> Span | None:
    """Where one of the settings of a budget is given, the stage's own first."""
    found = (yaml_tree.at(root, (*at, name)) for at in (("stages", stage, "budget"), ("budget",)) for name in names)
    return next((node.span for node in found if node is not None), None)


def _idle_timeouts(document: Document, root: Table, report: ProblemList) -> None:
    """A silence longer than the attempt itself never ends it."""
    names: set[Span] = set()
    for name in (*STAGES, *KEEPERS):
        own = _stage(document, name).budget
        (attempt, _), silence = timeouts(document.budget, own), idle(document.budget, own)
        span = _written(root, name, ("idle_timeout",))
        if silence is not None and silence > attempt and span is not None and span not in names:
            names.add(span)
            report.warning(
                "MANIFEST-TIMEOUTS",
                f"an attempt may be silent for longer ({silence:.0f} s) than it may take ({attempt:.0f} s)",
                span,
                hint="it has no effect; lower idle_timeout or raise attempt_timeout",
            )


def _unused_prices(document: Document, root: Table, report: ProblemList) -> None:
    """A price under a name that no agent's model has is most likely a slip."""
    used = [agent.model for agent in conversion.in_force(document) if agent.takes_model and agent.model is not None]
    used += [document.housekeeping.model] if document.housekeeping is not None else []
    for name in document.prices:
        key = yaml_tree.key_at(root, ("prices", name))
        if name not in used and key is not None:
            near = did_you_mean(name, used)
            report.warning(
                "MANIFEST-UNUSED",
                "this price has no effect: no agent uses that model",
                key.span,
                hint=f"did you mean `{report.shown(near)}`?" if near else "write the name as it is under `model`",
            )


def _unused_money(document: Document, root: Table, report: ProblemList) -> None:
    """A limit in dollars where no model is paid would look as if it were in force."""
    paid = {name: conversion.of_stage(document, name).takes_model for name in (*STAGES, *KEEPERS)}
    escalation = conversion.of_escalation(document)
    paid["identify"] |= escalation is not None and escalation.takes_model
    unpaid: list[Loc] = [("stages", name, "budget", "usd") for name in paid if not paid[name]]
    if not any(paid.values()) and document.housekeeping is None:
        unpaid += [("budget", "usd"), ("daemon", "usd_per_hour")]
    for loc in unpaid:
        key = yaml_tree.key_at(root, loc)
        if key is not None:
            report.warning(
                "MANIFEST-UNUSED",
                "this limit has no effect: no agent here uses a model",
                key.span,
                hint="remove it, or choose another harness",
            )


def check_commands(root: Table, report: ProblemList) -> None:
    """Report what is wrong in the arguments of a command; looks at the tree, so it needs no document."""
    for loc in yaml_tree.HARNESSES:
        command = yaml_tree.at(root, (*loc, "command"))
        items = command.items if isinstance(command, Items) else ()
        name, way = yaml_tree.at(root, (*loc, "name")), yaml_tree.at(root, (*loc, "prompt"))
        prompt = way.text if isinstance(way, Scalar) else "stdin"
        for item in (item for item in items if isinstance(item, Scalar)):
            if item is items[0] and isinstance(item.value, str) and not item.text.strip():
                what = "the first item of a command is a program"
                report.error("MANIFEST-WRONG-VALUE", what, item.span, hint="name the program")
            if isinstance(name, Scalar) and name.text in PROGRAMS:
                _own_argument(item, name.text, report)
            else:
                _argument(item, prompt, report)


def _own_argument(item: Scalar, harness: str, report: ProblemList) -> None:
    """The command of a known program names the program; octoform adds what it needs to know."""
    for name in dict.fromkeys(found for found in _PLACEHOLDER.findall(item.text) if found in PLACEHOLDERS):
        report.error(
            "MANIFEST-WRONG-VALUE",
            f"{{{name}}} is not filled in here: `{harness}` is given its task by octoform",
            item.span,
            hint="name the program alone",
        )


def _argument(item: Scalar, prompt: str, report: ProblemList) -> None:
    for name in dict.fromkeys(found for found in _PLACEHOLDER.findall(item.text) if found):
        if name not in PLACEHOLDERS:
            near = did_you_mean(name[:80], PLACEHOLDERS)
            hint = f"did you mean {{{near}}}?" if near else f"known: {', '.join(PLACEHOLDERS)}; {{{{ is a plain brace"
            report.error("MANIFEST-WRONG-VALUE", f"{{{report.shown(name)}}} is no placeholder", item.span, hint=hint)
        elif name == "prompt" and prompt != "argument":
            hint = "add `prompt: argument`, or use {prompt_file}"
            report.error(
                "MANIFEST-WRONG-VALUE", "{prompt} is used here, but the prompt is no argument", item.span, hint=hint
            )


# Recordings as a manifest names them: folders of the project, by a path relative to the manifest.
#
# As with profiles, only what lies inside the project counts, also after links are followed: what a recording makes must
# be the same on every machine.

_COPY = "copy it beside octopus.yaml and give its relative path, such as recordings/bench"


def check_recordings(root: Table, project: Path, report: ProblemList) -> None:
    """Report what is wrong with the recordings that harnesses name."""
    for loc in yaml_tree.HARNESSES:
        item = yaml_tree.at(root, (*loc, "recording"))
        if isinstance(item, Scalar) and isinstance(item.value, str) and not report.is_settled((*loc, "recording")):
            _one(item, project, report)


def _one(item: Scalar, project: Path, report: ProblemList) -> None:
    if not item.text or "\0" in item.text:
        return
    path = Path(os.path.normpath(project / item.text))
    shown = f"the recording `{report.shown(item.text)}`"
    if Path(item.text).is_absolute() or path == project or not path.is_relative_to(project):
        _refuse(item, f"{shown} is not below the project's folder", _COPY, report)
        return
    try:
        if not path.exists():
            _refuse(
                item, f"there is no recording `{report.shown(item.text)}`", "paths are relative to octopus.yaml", report
            )
        elif not path.resolve().is_relative_to(project.resolve()):
            _refuse(item, f"{shown} is a link to a place outside the project", "copy the folder", report)
        elif not path.is_dir():
            _refuse(item, f"{shown} is no folder", "a recording is a folder; name that", report)
    except OSError as problem:
        _refuse(item, f"{shown} cannot be read: {problem.strerror or problem}", "a recording is a folder", report)


def _refuse(item: Scalar, what: str, hint: str, report: ProblemList) -> None:
    report.error("MANIFEST-BAD-RECORDING", what, item.span, hint=hint)


# Rules on scope and policy: settings of a scope that is not chosen, rules that can never decide.
#
# (Heavy: the document.)

_USED_IN = {"network": ("intranet", "internet"), "tunnel": ("internet",)}


def check_scope(document: Document, root: Table, report: ProblemList) -> None:
    """Report what does not fit together in a document that fits the schema."""
    for name, scopes in _USED_IN.items():
        key = yaml_tree.key_at(root, (name,))
        if key is not None and document.scope not in scopes:
            report.error(
                "MANIFEST-SCOPE",
                f"scope {document.scope} has no {name}",
                key.span,
                hint=f"remove it, or write {' or '.join(f'`scope: {scope}`' for scope in scopes)}",
            )
    _rules(document, root, report)


def _rules(document: Document, root: Table, report: ProblemList) -> None:
    """A name that an earlier rule has taken already; a later one's setting for it would look as if it were in force."""
    taken: dict[str, int] = {}
    for index, rule in enumerate(document.policy.rules):
        for at, glob in enumerate(rule.tools):
            loc: Loc = ("policy", "rules", index, "tools", at)
            before = taken.get("*", taken.get(glob))
            node = yaml_tree.at(root, loc)
            if before is not None and before != index and node is not None:
                report.warning(
                    "MANIFEST-UNUSED",
                    f"this has no effect: `policy.rules[{before}]` decides for these tools",
                    node.span,
                    hint="the first rule that matches decides; put the more special one first, or remove this one",
                )
            taken.setdefault(glob, index)


# The privileged steps that a manifest switches on, each with its place.
#
# Only the files of the protocol show whether a step exists, and the manifest does not know them; a caller with both
# needs the place for what there is to say.


def named_steps(root: Table, report: ProblemList) -> tuple[NamedStep, ...]:
    """The steps of a document without errors, in order."""
    node = yaml_tree.at(root, ("privileged_steps",))
    items = node.items if isinstance(node, Items) else ()
    return tuple(
        NamedStep(item.text, item.span, report.source(item.span)) for item in items if isinstance(item, Scalar)
    )
