"""The match rule of a profile: a small, total language over what PROBE recorded of one device.

octoform evaluates it, never the agent, so a profile cannot make hardware appear that is not there. A rule is data:
``any``, ``all`` and ``not`` over the tests ``vid_pid``, ``text``, ``class``, ``driver`` and ``interface``. There are no
variables, no patterns and no recursion, so each rule ends, and evaluating one twice gives the same answer.
"""

import re
from collections.abc import Iterator, Mapping
from typing import Any

from octoform.patterns import regex
from octoform.records import dataclass

MAX_DEPTH = 8
MAX_TESTS = 100
TESTS = ("vid_pid", "text", "class", "driver", "interface")
COMBINATIONS = ("any", "all", "not")
_CLAUSE = regex(r"[,;!?\n]|\.(?=\s|$)|\bbut\b", re.IGNORECASE)
_DENIAL = regex(r"\b(?:not|no|never|neither|nor|without|instead of|unlike)\b|n['\u2019]t\b", re.IGNORECASE)
_VID_PID = regex(r"[0-9a-f]{4}:[0-9a-f]{4}")

Place = tuple[str | int, ...]
Problem = tuple[Place, str, str | None]


@dataclass(frozen=True, slots=True)
class Rule:
    """``kind`` is a combination with ``rules``, or a test with ``words`` of which one must be met."""

    kind: str
    rules: tuple["Rule", ...] = ()
    words: tuple[str, ...] = ()


def read(value: object, place: Place) -> tuple[Rule | None, list[Problem]]:
    """The rule that a front-matter value states, or every problem of it as (place, summary, hint)."""
    problems: list[Problem] = []
    rule = _rule(value, place, problems, 1)
    if rule is not None and sum(1 for _ in _tests(rule)) > MAX_TESTS:
        problems.append((place, f"the rule has more than {MAX_TESTS} tests", None))
    return (None if problems else rule), problems


def holds(rule: Rule, device: Mapping[str, Any], answer: str = "") -> bool:
    """Whether the rule holds for one PROBE device; never raises, whatever the device's members are.

    ``answer`` is a person's answer about the device; it counts as text of it and as nothing else, and a clause of it
    that denies something counts for nothing: what a device is not names no product.
    """
    if rule.kind == "any":
        return any(holds(item, device, answer) for item in rule.rules)
    if rule.kind == "all":
        return all(holds(item, device, answer) for item in rule.rules)
    if rule.kind == "not":
        return not holds(rule.rules[0], device, answer)
    if rule.kind == "text":
        message = "\n".join(clause for clause in _CLAUSE.split(answer) if not _DENIAL.search(clause))
        text = f"{_text(device, 'name')}\n{_text(device, 'raw_descriptor')}\n{message}".casefold()
        return any(_has_word(text, word) for word in rule.words)
    return not set(rule.words).isdisjoint(_values(rule.kind, device))


@dataclass(frozen=True, slots=True)
class Judged:
    """A rule, whether it holds for one device, and why: ``parts`` of a combination, or the ``words`` that a test met.

    ``wanted`` are the words of a test, ``seen`` what the device has in the place where it looks (nothing for texts).
    Words that only a person's answer holds are ``answered`` as well.
    """

    kind: str
    holds: bool
    parts: tuple["Judged", ...] = ()
    wanted: tuple[str, ...] = ()
    words: tuple[str, ...] = ()
    seen: tuple[str, ...] = ()
    answered: tuple[str, ...] = ()

    def tests(self) -> Iterator["Judged"]:
        """The tests in it."""
        if self.kind in TESTS:
            yield self
        for part in self.parts:
            yield from part.tests()


def judge(rule: Rule, device: Mapping[str, Any], answer: str = "") -> Judged:
    """The same as `holds`, with the whole tree of reasons."""
    verdict = holds(rule, device, answer)
    if rule.kind not in TESTS:
        return Judged(rule.kind, verdict, tuple(judge(item, device, answer) for item in rule.rules))
    single = {word: Rule(rule.kind, words=(word,)) for word in rule.words}
    met = tuple(word for word, test in single.items() if holds(test, device, answer))
    answered = tuple(word for word in met if not holds(single[word], device))
    seen = () if rule.kind == "text" else tuple(sorted(_values(rule.kind, device) - {"", ":"}))
    return Judged(rule.kind, verdict, wanted=rule.words, words=met, seen=seen, answered=answered)


_TOLD = {"vid_pid": "the number", "text": "text with", "class": "the class", "driver": "the driver"}


def describe(rule: Judged) -> str:
    """The condition of the rule, as a phrase."""
    if rule.kind in TESTS:
        return f"{_TOLD.get(rule.kind, 'the interface')} {' or '.join(rule.wanted)}"
    if rule.kind == "not":
        return f"not ({describe(rule.parts[0])})"
    parts = [f"({describe(item)})" if item.kind in ("any", "all") else describe(item) for item in rule.parts]
    return (" or " if rule.kind == "any" else " and ").join(parts)


def met(rule: Judged) -> Iterator[Judged]:
    """The tests that a device meets; what it only does not have, as ``not`` asks, is no likeness."""
    if rule.kind in TESTS and rule.holds:
        yield rule
    for part in rule.parts if rule.kind != "not" else ():
        yield from met(part)


def lacking(rule: Judged) -> Iterator[Judged]:
    """The parts of the rule that keep it from holding: no other alternative of an ``any`` that holds."""
    if rule.holds:
        return
    if rule.kind in ("any", "all"):
        for part in rule.parts:
            yield from lacking(part)
    else:
        yield rule


def nearness(judged: Judged) -> tuple[int, int, int]:
    """How near a device comes to the rule: by numbers, then by words, then by classes, drivers and interfaces."""
    kinds = [test.kind for test in met(judged)]
    numbers, words = kinds.count("vid_pid"), kinds.count("text")
    return numbers, words, len(kinds) - numbers - words


def words_wanting(rule: Rule, device: Mapping[str, Any]) -> tuple[str, ...]:
    """The words of which one in an answer would make the rule match: where its number is met and no more lacks."""
    tests = tuple(_tests(rule))
    if holds(rule, device) or not any(test.kind == "vid_pid" and holds(test, device) for test in tests):
        return ()
    words = (word for test in tests if test.kind == "text" for word in test.words)
    return tuple(word for word in words if holds(rule, device, word))


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
    """Whole words only: ``arm`` is not in ``alarm``."""
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
    if depth > MAX_DEPTH:
        problems.append((place, f"the rule is nested more than {MAX_DEPTH} deep", "write it flatter"))
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
        problems.append((place, f"{kind!r} needs a string or a list of strings", "put numbers in quotes"))
        return None
    if kind == "vid_pid":
        words = [word.casefold() for word in words]
        wrong = next((word for word in words if not _VID_PID.fullmatch(word)), None)
        if wrong is not None:
            hint = "write four hexadecimal digits, a colon, four more, in quotes"
            problems.append((place, f"{wrong!r} is no vendor and product number", hint))
            return None
    return Rule(kind, words=tuple(words))
