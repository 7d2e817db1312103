"""What is computed of a server without running it: right numbers, no end of nothing, and what is unknown stays so."""

import ast
import contextlib
from pathlib import Path
from typing import Any

import pytest
from bench_host import desk, smallest_first, watched
from cases import for_each

from octoform.contracts.contract_check import RULES
from octoform.contracts.rules.serve import computed_calls
from octoform.contracts.server_code.computed_values import UNKNOWN, Failed, Spent, Unsure, World
from octoform.contracts.server_code.failing_evaluator import FailingEvaluator
from octoform.contracts.server_code.flow import flow_of
from octoform.contracts.server_code.sending_evaluator import SendingEvaluator
from octoform.contracts.server_code.server_evaluator import Evaluator
from octoform.contracts.server_code.server_source import needed_source

BOUNDLESS = {
    "a tower": "return 9 ** 9 ** 9",
    "a long text": "return 'a' * 10 ** 9",
    "a long list": "return [0] * 10 ** 9",
    "a range": "return sum(range(10 ** 12))",
    "a padded number": "return f'{1:999999999}'",
    "a padded text": "return 'a'.ljust(10 ** 9)",
    "a padded number, by percent": "return '%999999999d' % 1",
    "a padded number, by a star": "return '%*d' % (10 ** 9, 1)",
    "a padded number, by format": "return '{:999999999}'.format(1)",
    "a shift": "return 1 << 10 ** 9",
    "a rounded number": "return round(1, -10 ** 9)",
    "a loop": "while True:\n        pass",
    "a loop of what is unknown": "while strange():\n        pass",
    "a recursion": "return tool()",
    "a text that doubles": "text = 'a'\n    for _ in range(99):\n        text = text + text\n    return text",
    "a number that is squared": "number = 3\n    for _ in range(99):\n"
    "        number = number * number\n    return number",
    "lists of lists": "rows = list(range(999))\n    for _ in range(9):\n"
    "        rows = [rows for _ in range(999)]\n    return rows == rows",
    "a method that is not there": "return 'a'.append(1)",
    "no number": "path = runtime.device('x').path('y') / 'z'\n    path.write_text('nan')\n"
    "    return runtime.read_integer(path)",
    "a list in itself": "rows = []\n    rows.append(rows)\n    return sorted(rows) == rows",
}
VALUES: dict[str, tuple[str, Any]] = {
    "a sum": ("return 2 + 3 * 4", 14),
    "a text": ("return f'{3.14159:.2f} ' + str(7)", "3.14 7"),
    "a record": ("return {'a': [each * 2 for each in (1, 2) if each > 1]}", {"a": [4]}),
    "a word that is called like a parameter": ("return '{function}'.format(function='a')", "a"),
    "a loop with another end": (
        "at = 0\n    while at < 3:\n        at += 1\n    else:\n        at = 9\n    return at",
        9,
    ),
    "a loop": (
        "total = 0\n    for each in range(5):\n        if each == 3:\n            break\n        total += each\n"
        "    return total",
        3,
    ),
    "letters": ("first, second = (2 * int(each) for each in '12')\n    return first + second", 6),
    "an object": ("counter = Counter(4)\n    counter.more(3)\n    return counter.number", 7),
    "a method without its object": ("return Counter.more(1, 2)", UNKNOWN),
    "a function of the file": ("return twice(4)", 8),
    "a constant of the file": ("return SCALE * 2", 20),
    "an attribute": ("return runtime.read_number(runtime.device('x').path('hwmon') / 'temp1_max', 0.5)", 50.0),
    "what is unknown": ("return strange(1)", UNKNOWN),
}


FILE = """
import runtime

SCALE = 10


class Counter:
    def __init__(self, number):
        self.number = number

    def more(self, step):
        self.number = self.number + step


def twice(number):
    return 2 * number


def tool():
    {}
"""


def evaluated(body: str) -> Any:
    source = needed_source(FILE.replace("{}", body))
    world = World(lambda name: 100.0, [50_000])
    [function] = [each for each in source.functions if each.name == "tool"]
    return Evaluator(source, world, [], lambda call, name, changed: True).call(function, {})


@for_each("case", VALUES)
def test_a_value_is_computed(case: str) -> None:
    body, wanted = VALUES[case]
    assert evaluated(body) == wanted


@for_each("case", BOUNDLESS)
def test_what_would_take_long_has_no_outcome(case: str) -> None:
    try:
        found = evaluated(BOUNDLESS[case])
    except (Failed, Spent, Unsure):
        return
    assert found is UNKNOWN


MISTAKES = {
    "a number added to a list": "found = []\n    found += 1\n    return found",
    "a place added to a list": "found = []\n    found += runtime.device('x').path('hwmon')\n    return found",
    "nothing appended": "found = []\n    found.append()\n    return found",
    "a name that is a number": "return dict(**{1: 2})",
    "a method with a name that is a number": "return {}.get(**{1: 2})",
    "two values for one": "first, second = 1\n    return first",
    "a loop over a number": "for each in 3:\n        pass\n    return each",
    "a name that is not there": "return found + 1",
    "a method that is not there": "return [].push(1)",
    "a key that is not there": "return {}['a']",
    "a key that is a list": "return {[1]: 2}",
}


@for_each("case", MISTAKES)
def test_a_mistake_of_the_server_ends_its_call_alone(case: str) -> None:
    source = needed_source(FILE.replace("{}", MISTAKES[case]))
    [function] = [each for each in source.functions if each.name == "tool"]
    world = World(lambda name: 100.0, [50_000])
    for call in (
        Evaluator(source, world, [], lambda call, name, changed: True),
        FailingEvaluator(source, world, [], flow_of(source, frozenset({function})), ("OSError", 0)),
        SendingEvaluator(source, world),
    ):
        with contextlib.suppress(Failed, Spent, Unsure):
            call.call(function, {})


def test_a_call_that_may_act_ends_what_is_known() -> None:
    source = needed_source("def tool():\n    port.send(1)\n")
    world = World(lambda name: 0.0, [1000])
    seen: list[str] = []

    def harmless(call: ast.Call, name: str, changed: bool) -> bool:
        seen.append(name)
        return False

    with pytest.raises(Unsure):
        Evaluator(source, world, [], harmless).call(source.functions[0], {})
    assert seen == ["port.send"]


def test_a_rule_that_has_used_up_its_budget_reports_what_it_has_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(computed_calls, "_BUDGET", 1)
    served = [
        known for known in smallest_first([watched(tmp_path / "host"), desk(tmp_path / "desk")], 30) if known.serve
    ]
    assert served
    for known in served:
        assert [rule.code for rule in RULES["serve"] if rule.check(known.serve, known) != []] == []
