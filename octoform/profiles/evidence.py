"""The evidence rule of a profile: a small, total language over what PROBE recorded of one device.

octoform evaluates it, never the agent, so a profile cannot make hardware appear that is not there. A rule is data:
``any``, ``all`` and ``not`` over the tests ``vid_pid``, ``text``, ``class``, ``driver`` and ``interface``. There are no
variables, no patterns and no recursion, so each rule ends, and evaluating one twice gives the same answer.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

MOST_DEPTH = 8
MOST_TESTS = 100
TESTS = ("vid_pid", "text", "class", "driver", "interface")
COMBINATIONS = ("any", "all", "not")
_VID_PID = re.compile(r"[0-9a-f]{4}:[0-9a-f]{4}")

Place = tuple[str | int, ...]
Problem = tuple[Place, str, str | None]


@dataclass(frozen=True, slots=True)
class Rule:
    """``kind`` is a combination with ``rules``, or a test with ``words`` of which one must be met."""

    kind: str
    rules: tuple["Rule", ...] = ()
    words: tuple[str, ...] = ()


def read(value: object, place: Place) -> tuple[Rule | None, list[Problem]]:
    """The rule that a front-matter value says, or every problem of it as (place, summary, hint)."""
    problems: list[Problem] = []
    rule = _rule(value, place, problems, 1)
    if rule is not None and sum(1 for _ in _tests(rule)) > MOST_TESTS:
        problems.append((place, f"the rule has more than {MOST_TESTS} tests", None))
    return (None if problems else rule), problems


def holds(rule: Rule, device: Mapping[str, Any]) -> bool:
    """Whether the rule holds for one PROBE device; never raises, whatever the device's members are."""
    if rule.kind == "any":
        return any(holds(item, device) for item in rule.rules)
    if rule.kind == "all":
        return all(holds(item, device) for item in rule.rules)
    if rule.kind == "not":
        return not holds(rule.rules[0], device)
    if rule.kind == "text":
        text = f"{_text(device, 'name')}\n{_text(device, 'raw_descriptor')}".casefold()
        return any(_has_word(text, word) for word in rule.words)
    return not set(rule.words).isdisjoint(_values(rule.kind, device))


def needs_more_than_a_number(rule: Rule) -> bool:
    """True when the rule cannot hold on a vendor and product number alone."""
    if rule.kind == "any":
        return bool(rule.rules) and all(needs_more_than_a_number(item) for item in rule.rules)
    if rule.kind == "all":
        return any(needs_more_than_a_number(item) for item in rule.rules)
    return rule.kind in ("text", "class", "driver")


def _values(kind: str, device: Mapping[str, Any]) -> set[str]:
    if kind == "vid_pid":
        return {f"{_text(device, 'vid')}:{_text(device, 'pid')}"}
    if kind == "interface":
        return {_text(device, "interface")}
    listed = device.get("classes" if kind == "class" else "drivers")
    return {item for item in listed if isinstance(item, str)} if isinstance(listed, list) else set()


def _text(device: Mapping[str, Any], name: str) -> str:
    value = device.get(name)
    return value if isinstance(value, str) else ""


def _has_word(text: str, word: str) -> bool:
    """Whole words only: ``arm`` does not stand in ``alarm``."""
    return re.search(rf"(?<!\w){re.escape(word.casefold())}(?!\w)", text) is not None


def _tests(rule: Rule) -> Iterator[Rule]:
    if rule.kind in TESTS:
        yield rule
    for item in rule.rules:
        yield from _tests(item)


def _rule(value: object, place: Place, problems: list[Problem], depth: int) -> Rule | None:
    if not isinstance(value, Mapping) or len(value) != 1:
        hint = "write for example {any: [{vid_pid: 'vvvv:pppp'}, {text: [Name]}]}"
        problems.append((place, "a rule is a mapping with exactly one member", hint))
        return None
    kind, content = next(iter(value.items()))
    if depth > MOST_DEPTH:
        problems.append((place, f"the rule is nested more than {MOST_DEPTH} deep", "write it flatter"))
        return None
    if kind in ("any", "all"):
        return _combination(kind, content, (*place, kind), problems, depth)
    if kind == "not":
        inner = _rule(content, (*place, kind), problems, depth + 1)
        return Rule(kind, (inner,)) if inner is not None else None
    if kind in TESTS:
        return _test(kind, content, (*place, kind), problems)
    problems.append((place, f"{kind!r} is no rule", f"the rules are {', '.join((*COMBINATIONS, *TESTS))}"))
    return None


def _combination(kind: str, content: object, place: Place, problems: list[Problem], depth: int) -> Rule | None:
    if not isinstance(content, list) or not content:
        problems.append((place, f"{kind!r} needs a list of at least one rule", None))
        return None
    rules = [_rule(item, (*place, index), problems, depth + 1) for index, item in enumerate(content)]
    return Rule(kind, tuple(item for item in rules if item is not None))


def _test(kind: str, content: object, place: Place, problems: list[Problem]) -> Rule | None:
    given = content if isinstance(content, list) else [content]
    words = [word for word in given if isinstance(word, str) and word.strip()]
    if not words or len(words) < len(given):
        problems.append((place, f"{kind!r} needs a text or a list of texts", "put numbers in quotes"))
        return None
    if kind == "vid_pid":
        words = [word.casefold() for word in words]
        wrong = next((word for word in words if not _VID_PID.fullmatch(word)), None)
        if wrong is not None:
            hint = "write four hexadecimal digits, a colon, four more, in quotes"
            problems.append((place, f"{wrong!r} is no vendor and product number", hint))
            return None
    return Rule(kind, words=tuple(words))
