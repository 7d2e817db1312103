"""Rules for SERVE about names and times in a result: each is of the attribute that it is called after, or measured.

The calls are computed with attributes whose text is their own name, so that a result shows what each member is read of.
"""

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from octoform.base.escaping import display
from octoform.contracts.model import Artifacts, Rule
from octoform.contracts.rules.serve.computed_calls import Calls, arguments, records
from octoform.contracts.rules.serve.reading_rules import flow_of_tools
from octoform.contracts.rules.serve.tool_rules import served_tools, tool_functions
from octoform.contracts.rules.serve.value_rules import stored_members
from octoform.contracts.server_code.computed_values import CLASS, Failed, Place, Spent, Unsure, World, is_unknown
from octoform.contracts.server_code.origins import Origin
from octoform.contracts.server_code.server_evaluator import Evaluator
from octoform.contracts.server_code.server_source import Function, needed_source
from octoform.diagnostics import Diagnostic

OTHERWISE, CONSTANT = "SERVE-READING-OTHERWISE", "SERVE-CONSTANT-READING"
_BUDGET = 40_000
_SIGN = "\N{WHITE SQUARE}"
_OF_ONE = re.compile(r"(?:^|_)(?:serial|uuid|asset_tag)(?:$|_)")
_NAMES = re.compile(
    r"(?:sys|board|bios|chassis)_vendor|(?:product|board)_name|(?:product|board|bios|chassis)_version|product_family"
    r"|bios_date|manufacturer|model_name|firmware_(?:version|rev)"
)
"""Members that are named as the kernel names an attribute, whose text is a fact of the unit at hand."""
_MEASURED = re.compile(r"(?:^|_)(?:waited|elapsed|took)(?:$|_)")


@dataclass
class _Signs(World):
    """Attributes whose text is their own name."""

    def text(self, place: Place) -> Any:
        found = super().text(place)
        named = is_unknown(found) or place.key[1:2] == ("dmi",)
        return f"{_SIGN}{place.key[-1]}{_SIGN}" if named and len(place.key) > 2 else found


def read_of_another(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A member that is called like an attribute is that attribute, and no other one; a serial number is no name."""
    source = needed_source(value)
    hint = "read the attribute that the member is called after"
    out = []
    for tool, function, found in _results(value, artifacts):
        for what in dict.fromkeys(each for record in found for each in _exchanged(record)):
            out.append(source.problem(OTHERWISE, function, f"{display(tool)} returns {what}", hint))
    return out


def written_text(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A member that is called like an attribute of the kernel is read, and no text of the file."""
    source = needed_source(value)
    hint = "read the attribute of that name in the folder of the device"
    out = []
    for _, function, found in _results(value, artifacts):
        for record in found:
            for name, each in record.items():
                if isinstance(each, str) and each and _SIGN not in each and name != CLASS and _NAMES.fullmatch(name):
                    what = f"the result's {display(name)} is a string of this file, and not one that the device gave"
                    out.append(source.problem(CONSTANT, function, what, hint))
    return out


def repeated_time(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """How long a call waited was measured: it is not how long it was to wait."""
    source = needed_source(value)
    flow = flow_of_tools(source, artifacts)
    hint = "measure it: time.monotonic() after the wait less the one before"
    stored = [(node, name, each) for node, members in stored_members(source).items() for name, each in members]
    out: dict[ast.AST, Diagnostic] = {}
    for site, tool in served_tools(source, artifacts):
        used = source.entered_from(tool_functions(source, site))
        sleeps = any(source.owner(call) in used and name.endswith("sleep") for call, name in source.calls)
        for node, name, each in stored:
            if source.owner(node) in used and not sleeps and _MEASURED.search(name):
                values = (flow.plain(each) if isinstance(each, ast.Name) else []) or [each]
                if all(flow.of(item) == Origin.ARGUMENT for item in values):
                    summary = f"{display(tool['name'])} returns its argument as {display(name)}"
                    out.setdefault(each, source.problem(CONSTANT, each, summary, hint))
    return list(out.values())


RULES = (Rule(OTHERWISE, read_of_another), Rule(CONSTANT, written_text), Rule(CONSTANT, repeated_time))


def _results(value: str, artifacts: Artifacts) -> Iterator[tuple[str, Function, list[dict[Any, Any]]]]:
    """(tool, its function, the records of its result) of each read tool that returns texts, where there is one way."""
    source = needed_source(value)
    calls, left = Calls(source, artifacts), [_BUDGET]
    for tool, function in calls.served.values():
        if tool["effect"] != "read" or '"string"' not in str(tool.get("output_schema")).replace("'", '"'):
            continue
        try:
            call = Evaluator(source, _Signs(lambda _: 500.0, left), [], lambda *_: True)
            found = list(records(call.call(function, next(arguments(tool, tool["devices"][0])))))
        except (Failed, Unsure):
            continue
        except Spent:
            return
        if not call.taken:
            yield tool["name"], function, found


def _exchanged(record: dict[Any, Any]) -> Iterator[str]:
    """The members of a record that have the text of another member's attribute, or a serial number's."""
    for name, each in record.items():
        attribute = each.strip().strip(_SIGN) if isinstance(each, str) and each.strip()[:1] == _SIGN else ""
        if not attribute or name in (attribute, CLASS) or _SIGN in attribute:
            continue
        if attribute in record:
            yield f"{display(attribute)} as {display(name)}, which is another member"
        elif _OF_ONE.search(attribute) and not _OF_ONE.search(str(name)):
            yield f"{display(attribute)}, which names one unit, as {display(name)}"
