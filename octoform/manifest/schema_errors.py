"""The schema's errors in a document, as diagnostics with places and hints. (Heavy: pydantic.)"""

import re
from collections.abc import Callable, Mapping
from typing import Any

from pydantic import BaseModel, ValidationError

from octoform.diagnostics import Span, did_you_mean
from octoform.manifest import model_url, yaml_tree
from octoform.manifest.problem_list import ProblemList
from octoform.manifest.schema.document import (
    Budget,
    Document,
    Escalation,
    Git,
    Housekeeping,
    IdentifyStage,
    Lifecycle,
    Perception,
    Price,
    Stage,
    StageBudget,
    Stages,
)
from octoform.manifest.schema.harness import NAMES, TAGS, CommandHarness, Confinement, ProgramHarness, table_of
from octoform.manifest.schema.sections import Daemon, Limit, Network, Notify, Policy, Rule, Tunnel
from octoform.manifest.yaml_tree import Items, Loc, Scalar, Table
from octoform.patterns import regex
from octoform.policy.kinds import SETTINGS

# The words of the manifest's messages, apart from the rules: a message can be improved without reading the logic.

TYPES = {
    "string_type": "a string",
    "int_type": "an integer",
    "int_from_float": "an integer",
    "bool_type": "true or false",
    "list_type": "a list",
    "model_type": "a mapping",
    "model_attributes_type": "a mapping",
    "dict_type": "a mapping",
    "float_type": "a number",
    "union_tag_not_found": "a name or a mapping",
}
FORMS = {
    "a string": "one word or quoted text",
    "a name": "one word",
    "a number": "a number without quotes, such as 2.5",
    "auto, true, false or a mapping": "`sandbox: auto`, `sandbox: true`, or `sandbox: {network: false}`",
    "an integer": "a number without quotes and point, such as 3",
    "true or false": "`true` or `false`, without quotes",
    "a list": "a list: [first, second]",
    "a mapping": "a mapping: {key: value}",
    "a name or a mapping": "`harness: builtin`, or `harness: {name: command, command: [...]}`",
}
RECORDING_HINT = "name the folder of a recording, such as recordings/bench"
COMMAND_HINT = "write `command: [my-agent, '{task}']`"
KEY_HINT = "write the name of a variable in capitals, such as MY_API_KEY; its value stays in the environment"
VARIABLE_HINT = "list names only, such as MY_API_KEY; values stay in the environment"
MODEL_HINT = "write it as the agent expects it, such as vendor/model-name"
RANGES = {
    "attempts": "allowed: 1 to 20",
    "tools": "allowed: 1 to 200",
    "command": COMMAND_HINT,
    "profiles": "allowed: up to 100 profiles",
    "answers": "allowed: up to 200 answers",
    "privileged_steps": "allowed: up to 20 steps",
    "model": MODEL_HINT,
    "key": KEY_HINT,
    "turns": "allowed: 1 to 10000",
    "usd": "write US dollars, such as 2.50",
    **dict.fromkeys(("input", "cached", "output"), "write US dollars for a million tokens, such as 0.5"),
    "max_tokens": "allowed: 64 to 8000",
    "base_url": model_url.URL_HINT,
    "recording": RECORDING_HINT,
    "rules": "allowed: up to 100 rules",
    "rules.tools": "name the tools that it is for, such as [move_rail]; allowed: 1 to 100",
    "limits": "allowed: up to 200 limits",
    "parameter": "name one parameter of the tools, such as percent",
    **{name: setting.form.hint for name, setting in SETTINGS.items() if not setting.form.pattern},
    "result_bytes": "allowed: 1000 to 1000000000",
    "port": "allowed: 1 to 65535",
    "hosts": "allowed: up to 100 names",
    "origins": "allowed: up to 100 origins",
    "heal_attempts": "allowed: 1 to 20",
    "calls_per_hour": "allowed: 0 to 1000; 0 asks no agent",
    "usd_per_hour": "write US dollars, such as 2.50",
    "webhook": "write https://alerts.example.org/hook, or keep it in a variable: ${ALERT_URL}",
    "metrics": "write a path that ends in .prom, such as /var/lib/node_exporter/octoform.prom",
    "notify.command": "write a list: [./notify-me, --problem]",
    "tunnel.command": 'write for example [cloudflared, tunnel, --url, "{url}"]',
}
# What people look for at the top, and why it is not there.
NO_KEYS = {"devices": "devices are found, not listed; what cannot be seen of them belongs in a profile"}
MAX_WORD = 80
# Words for true and false that YAML 1.2 takes as text, as it takes a quoted true.
SWITCHES = {"yes": "true", "on": "true", "true": "true", "no": "false", "off": "false", "false": "false"}


def range_of(loc: Loc) -> str | None:
    """The allowed values of a setting; by its last two names where the last one alone means several things."""
    names = [part for part in loc if isinstance(part, str)]
    return RANGES.get(".".join(names[-2:]) if len(names) > 1 else "", RANGES.get(str(loc[-1]) if loc else ""))


def dotted(loc: Loc) -> str:
    """A path as a person writes it: ``stages.probe.harness.command[0]``."""
    out = ""
    for part in loc:
        out += f"[{part}]" if isinstance(part, int) else f".{part}" if out else part
    return out


_NOT_FINITE = regex(r"[-+]?(\.inf|\.Inf|\.INF)|\.nan|\.NaN|\.NAN")
"""What YAML 1.2 calls a number and no setting may be."""


def kind(node: yaml_tree.Node | None) -> str:
    """The kind of a value, in words."""
    if isinstance(node, Table):
        return "a mapping"
    if isinstance(node, Items):
        return "a list"
    value = node.value if isinstance(node, Scalar) else None
    if isinstance(node, Scalar) and node.plain and (found := _NOT_FINITE.fullmatch(node.text)):
        return "infinite" if found[1] else "not a number (NaN)"
    if isinstance(value, bool):
        return "true or false"
    if isinstance(value, float):
        return "a number with a fraction or exponent"
    return "a number" if isinstance(value, int) else "a string"


# Which keys may stand where in a manifest, for the message about a key that may not. (Heavy: the document.)

# Also where a key belongs that stands elsewhere; the first place counts.
_PLACES: tuple[tuple[Loc, type[BaseModel]], ...] = (
    ((), Document),
    (("budget",), Budget),
    (("lifecycle",), Lifecycle),
    (("git",), Git),
    (("stages",), Stages),
    (("harness",), CommandHarness),
    (("harness",), ProgramHarness),
    (("housekeeping",), Housekeeping),
    (("policy",), Policy),
    (("network",), Network),
    (("tunnel",), Tunnel),
    (("perception",), Perception),
    (("stages", "identify"), IdentifyStage),
    (yaml_tree.ESCALATION, Escalation),
    (("daemon",), Daemon),
    (("daemon", "notify"), Notify),
)
_TABLES = dict(reversed(_PLACES))
_ITEMS: dict[Loc, type[BaseModel]] = {("policy", "rules"): Rule, ("policy", "limits"): Limit}


def keys_at(root: Table, loc: Loc) -> tuple[str, ...]:
    """The keys that the table at a path may have."""
    table = _TABLES.get(loc)
    if loc[-1:] == ("harness",):
        entry = yaml_tree.at(root, (*loc, "name"))
        table = table_of(entry.text if isinstance(entry, Scalar) else "")
    elif loc[-1:] == ("sandbox",):
        table = Confinement
    elif loc[:1] == ("prices",):
        table = Price
    elif loc[:-1] in _ITEMS:
        table = _ITEMS[loc[:-1]]
    elif table is None:
        table = StageBudget if loc[-1] == "budget" else Stage
    return tuple(sorted(table.model_fields, key=lambda name: name != "name"))


def home_of(loc: Loc) -> Loc | None:
    """The table where a key belongs that is at a path where nothing has that name; None for one unknown."""
    name = str(loc[-1])
    if loc[-2:-1] == ("harness",) and name in ProgramHarness.model_fields | CommandHarness.model_fields:
        return None  # a setting of another kind of agent
    return next((place for place, table in _PLACES if name in table.model_fields), None)


def check(root: Table, report: ProblemList) -> Document | None:
    """The document, or None with every problem of it in the report."""
    _refuse_empty(root, report)
    try:
        return Document.model_validate(_filled(root))
    except ValidationError as failure:
        for item in failure.errors(include_url=False, include_input=False):
            loc = tuple(part for part in item["loc"] if part not in TAGS)
            if not report.is_settled(loc):
                _Problem(root, report, loc, item["type"], item.get("ctx", {})).report()
    return None


def _refuse_empty(root: Table, report: ProblemList) -> None:
    """Report every key that has no value."""
    found = [(loc, scalar) for loc, scalar in yaml_tree.scalars(root) if scalar.value is None]
    for loc, scalar in found:
        key = yaml_tree.key_at(root, loc)
        report.error(
            "MANIFEST-WRONG-TYPE",
            f"`{report.shown(key.text)}` has no value" if key else "this item of the list has no value",
            key.span if key else scalar.span,
            hint="give it a value, or remove it",
        )
        report.settle(loc)


def _filled(node: yaml_tree.Node) -> Any:
    """The plain data without the keys that have no value."""
    if isinstance(node, Table):
        return {key.text: _filled(value) for key, value in node.entries if yaml_tree.data(value) is not None}
    return [_filled(item) for item in node.items] if isinstance(node, Items) else node.value


class _Problem:
    """One validation error on its way to a diagnostic."""

    def __init__(self, root: Table, report: ProblemList, loc: Loc, kind: str, context: Mapping[str, Any]) -> None:
        self._root = root
        self._report = report
        self._loc = loc
        self._kind = kind
        self._is_key = loc[-1:] == ("[key]",)
        if self._is_key:
            self._loc = loc[:-1]
        self._context = context

    def report(self) -> None:
        """Report it."""
        telling: dict[str, Callable[[], None]] = {
            "missing": self._missing,
            "extra_forbidden": self._unknown_key,
            "literal_error": self._unknown_value,
            "manifest": self._own_words,
            "union_tag_not_found": self._no_branch,
        }
        if self._kind in telling:
            telling[self._kind]()
        elif self._kind in TYPES:
            self._wrong_type()
        else:
            self._wrong_value(self._limits())

    def _missing(self) -> None:
        name, parent = str(self._loc[-1]), yaml_tree.at(self._root, self._loc[:-1])
        if isinstance(parent, Table) and self._is_misspelt(name, parent):
            return
        inside = f" in `{dotted(self._loc[:-1])}`" if len(self._loc) > 1 else ""
        hint = {
            "version": "write `version: 1` as the first line",
            "command": COMMAND_HINT,
            "name": "write `name: command`, or the name of a coding-agent program",
            "harness": "name the agent, such as `harness: claude-code`",
            "model": "name it as the provider does, such as anthropic/claude-sonnet-4-5",
            "recording": RECORDING_HINT,
            "tool": 'name the tools that it is for, such as `tool: move_rail`, or `tool: "*"` for all',
            "tools": "name the tools that it is for, such as `tools: [move_rail]`",
            "decision": "write `decision: allow`, `confirm` or `deny`",
            "input": RANGES["input"],
            "output": RANGES["output"],
        }
        self._report.error(
            "MANIFEST-MISSING-KEY",
            f"the key `{name}` is missing{inside}",
            parent.span if parent else Span(1, 1),
            hint=hint.get(name),
        )

    def _is_misspelt(self, name: str, parent: Table) -> bool:
        """True when a key is there that is reported as a slip of this one."""
        known = keys_at(self._root, self._loc[:-1])
        keys = [key.text[:MAX_WORD] for key, _ in parent.entries if key.text not in known]
        return any(did_you_mean(key, known) == name for key in keys)

    def _unknown_key(self) -> None:
        key = yaml_tree.key_at(self._root, self._loc)
        name, span = str(self._loc[-1]), key.span if key else self._span()
        siblings = keys_at(self._root, self._loc[:-1])
        hint = NO_KEYS.get(name) if len(self._loc) == 1 else None
        self._report.error(
            "MANIFEST-UNKNOWN-KEY",
            f"unknown key `{self._report.shown(name)}`",
            span,
            hint=hint or self._where_key_belongs(name, siblings),
        )

    def _where_key_belongs(self, name: str, siblings: tuple[str, ...]) -> str:
        if siblings == ("name",):
            return "the embedded agent has no settings; write `harness: builtin`"
        near = did_you_mean(name[:MAX_WORD], siblings)
        if near:
            return f"did you mean `{near}`?"
        elsewhere = home_of(self._loc)
        if elsewhere is not None:
            return f"`{name}` belongs " + (f"under `{dotted(elsewhere)}`" if elsewhere else "at the top")
        return f"known here: {', '.join(siblings)}"

    def _unknown_value(self) -> None:
        value = yaml_tree.at(self._root, self._loc)
        if not isinstance(value, Scalar) or not isinstance(value.value, str):
            self._wrong_type("a name")
            return
        allowed = tuple(re.findall(r"'([^']*)'", str(self._context.get("expected", ""))))
        if self._loc[-1] == "harness":
            self._harness_name(value)
        else:
            self._not_one_of(value, allowed)

    def _harness_name(self, value: Scalar) -> None:
        needs = {
            "command": ("command", "{name: command, command: [my-agent, '{task}']}"),
            "replay": ("recording", "{name: replay, recording: recordings/bench}"),
        }
        if value.text in needs:
            what, form = needs[value.text]
            self._report.error(
                "MANIFEST-MISSING-KEY",
                f"the harness `{value.text}` needs its {what}",
                value.span,
                hint=f"write `harness: {form}`",
            )
        elif value.text == "builtin":
            self._report.error(
                "MANIFEST-ESCALATION",
                "the embedded agent cannot escalate to itself",
                value.span,
                hint="choose another harness, such as claude-code, or remove `escalate`",
            )
        else:
            self._not_one_of(value, self._harnesses())

    def _harnesses(self) -> tuple[str, ...]:
        """The harnesses that may be here."""
        return tuple(name for name in NAMES if name != "builtin" or "escalate" not in self._loc)

    def _not_one_of(self, value: Scalar, allowed: tuple[str, ...]) -> None:
        near = did_you_mean(value.text[:MAX_WORD], allowed)
        self._report.error(
            "MANIFEST-WRONG-VALUE",
            f"`{self._report.shown(value.text)}` is no value of `{dotted(self._loc)}`",
            value.span,
            hint=f"did you mean `{near}`?" if near else f"allowed: {', '.join(allowed)}",
        )

    def _no_branch(self) -> None:
        """A harness that is neither a name nor a table with a known name, or a sandbox that is neither."""
        node = yaml_tree.at(self._root, self._loc)
        entry = node.get("name") if isinstance(node, Table) else None
        if self._loc[-1] == "sandbox":
            self._wrong_type("auto, true, false or a mapping")
        elif not isinstance(node, Table):
            self._wrong_type()
        elif entry is None:
            self._loc = (*self._loc, "name")
            self._missing()
        elif not isinstance(entry[1], Scalar):
            self._loc = (*self._loc, "name")
            self._wrong_type("a string")
        else:
            self._loc = (*self._loc, "name")
            self._harness_name(entry[1])

    def _own_words(self) -> None:
        index = self._context.get("index")
        if index is not None:
            self._loc = (*self._loc, index)
        self._wrong_value(str(self._context["summary"]), self._context.get("hint"))

    def _wrong_type(self, expected: str | None = None) -> None:
        node = yaml_tree.at(self._root, self._loc)
        hint = self._how_to_write(node) if isinstance(node, Scalar) else None
        expected = expected or TYPES[self._kind]
        hint = hint or f"write {FORMS[expected]}"
        self._report.error(
            "MANIFEST-WRONG-TYPE",
            f"`{dotted(self._loc)}` must be {expected}, and this is {kind(node)}",
            self._span(),
            hint=hint,
        )

    def _how_to_write(self, node: Scalar) -> str | None:
        """The value in the form that was expected, where it is plain what was meant."""
        shown = self._report.shown(node.text)
        if (self._kind == "bool_type" or self._loc[-1] == "sandbox") and node.text.lower() in SWITCHES:
            return f"write `{SWITCHES[node.text.lower()]}`"
        if self._kind == "string_type":
            return f'quote it: "{shown}"'
        if self._kind == "list_type":
            return f"write a list: [{shown}]"
        if self._kind == "int_type" and re.fullmatch("[0-9]+", node.text):
            return f"remove the quotes: {shown}"
        if self._kind == "float_type" and isinstance(yaml_tree.plain_value(node.text), int | float) and not node.plain:
            return f"remove the quotes: {shown}"
        return None

    def _limits(self) -> str:
        context = self._context
        words = {
            "greater_than": f"must be more than {_shortest(context.get('gt'))}",
            "greater_than_equal": f"must be at least {_shortest(context.get('ge'))}",
            "less_than_equal": f"must be at most {_shortest(context.get('le'))}",
            "finite_number": "is too large a number",
            "too_short": f"must have at least {context.get('min_length')} item",
            "too_long": f"may have at most {context.get('max_length')} items",
            "string_too_short": "may not be empty",
            "string_too_long": f"may have at most {context.get('max_length')} characters",
        }
        return words.get(self._kind, "")

    def _wrong_value(self, summary: str, hint: str | None = None) -> None:
        if self._kind == "string_pattern_mismatch":
            hints = {"env": VARIABLE_HINT, "key": KEY_HINT}
            hint = next((hints[str(part)] for part in self._loc[-2:] if part in hints), MODEL_HINT)
            summary = "must be one word" if hint == MODEL_HINT else "is no name of an environment variable"
        elif self._kind != "manifest":
            hint = range_of(self._loc)
        lead = f"`{dotted(self._loc)}`" + (" " if self._kind != "manifest" else ": ")
        self._report.error("MANIFEST-WRONG-VALUE", lead + summary, self._span(), hint=hint)

    def _span(self) -> Span:
        key = yaml_tree.key_at(self._root, self._loc) if self._is_key else None
        node = key or yaml_tree.at(self._root, self._loc) or yaml_tree.at(self._root, self._loc[:-1]) or self._root
        return node.span


def _shortest(limit: object) -> object:
    """A limit as a person would write it: 0 and not 0.0."""
    return int(limit) if isinstance(limit, float) and limit.is_integer() else limit
