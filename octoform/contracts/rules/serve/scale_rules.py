"""Rules for SERVE about the steps and the scale of a reading, computed on attributes that are made up."""

import ast
import itertools

from octoform.base.escaping import display
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.rules.serve.computed_calls import Calls, arguments, results_of, with_unit
from octoform.contracts.rules.serve.value_rules import constant_reading, numbers_read
from octoform.contracts.server_code.computed_values import Spent, Unsure
from octoform.contracts.server_code.server_source import needed_source, walk
from octoform.diagnostics import Diagnostic

COARSE = "SERVE-READING-COARSE"
_TOLERANCE = 0.02
_SWEEPS = ((20_000, 137), (20_000, 600), (200, 1), (3000, 7))
"""First raw number and step of each series that a reading is computed for."""
_IN_A_SERIES = 61
_SPEAKS_OF_STEPS = ("step", "round", "nearest", "multiple", "resolution", "coarse", "tens of", "bars", "level")


def coarse_reading(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A quantity keeps the steps in which it was read: it is not rounded to tens."""
    source = needed_source(value)
    calls = Calls(source, artifacts)
    hint = "return the number as it was read; coarse steps belong into output_schema, as multipleOf"
    out: dict[ast.AST, Diagnostic] = {}
    for tool, function in calls.served.values():
        declared = str(tool.get("output_schema")).casefold()
        said = f"{tool['description']} {declared}".casefold()
        parts = (item for each in source.entered_from([function]) for item in walk(each))
        shifts = any(isinstance(item, ast.RShift | ast.BitAnd) for item in parts)  # a field of a register
        told = "multipleof" in declared or any(word in said for word in _SPEAKS_OF_STEPS)
        if tool["effect"] != "read" or shifts or told:
            continue
        try:
            found = _step_of(calls, tool)
        except (Unsure, Spent):
            continue
        if found is not None:
            name, step, unit = found
            summary = f"the {display(name)} that {display(tool['name'])} returns comes in steps of {step:g} {unit} only"
            out[function] = source.problem(COARSE, function, summary, hint)
    # A number that a test of the reading only chooses has few values as well, and that is the cause.
    return list(out.values()) if out and not constant_reading(value, artifacts) else []


def _step_of(calls: Calls, tool: JsonObject) -> tuple[str, float, str] | None:
    """(member, step, unit) of a quantity that is rounded to more than a unit of it, and more than a fiftieth."""
    units = dict(numbers_read(tool.get("output_schema") or {}))
    given = next(arguments(tool, tool["devices"][0]))
    first = next(calls.outcomes(tool["name"], given, calls.world(1000.0, 500.0, {})), None)
    for key in list(first[0].read) if first is not None else ():
        for begin, step in _SWEEPS:
            series = [f"{begin + step * at}" for at in range(_IN_A_SERIES)]
            results = results_of(calls, tool, given, ({key: raw} for raw in series))
            for name, unit in units.items() if results else ():
                found = [with_unit(each, name, unit) for each in results]
                numbers = sorted({number for each in found for number, _ in each})
                known = {each for row in found for _, each in row}
                gaps = [two - one for one, two in itertools.pairwise(numbers)]
                wide = bool(gaps) and min(gaps) > max(1.5, _TOLERANCE * max(map(abs, numbers)))
                if wide and len(numbers) * 4 <= _IN_A_SERIES and len(known) == 1 and not known & {None, "%"}:
                    return name, min(gaps), str(known.pop())
    return None


RULES = (Rule(COARSE, coarse_reading),)
