"""Rules for WATCH: health is claimed only where everything reports, and a problem only where something shows it."""

import re
from collections.abc import Iterator
from typing import Any

from octoform.base.escaping import display, listed
from octoform.base.health_status import Status
from octoform.base.shape import pointer
from octoform.conditions import holds
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.report_context import FRAME, KERNEL, LOG, PROCESS, SENSOR, DutyFacts, place_of
from octoform.contracts.rules import report_rules, text_rules
from octoform.contracts.rules.report_rules import Found, Target, about, citations, facts_of
from octoform.diagnostics import error
from octoform.patterns import regex

_GRAVE = (Status.ERROR, Status.DOWN)
_CALLED = (LOG, SENSOR)


_TOOL = regex(
    r"\btool [`'\"]?([a-z]+(?:_[a-z0-9]+)+)|\b([a-z]+(?:_[a-z0-9]+)+)[`'\"]? (?:(?:also )?fail(?:s|ed)|tool)\b"
)
"""A name with an underscore that a sentence calls a tool."""


def unknown_name(value: JsonObject, artifacts: Artifacts) -> Found:
    """Tools, devices and units exist, also those that are named in a sentence."""
    text, tools = facts_of(artifacts).text, report_rules.known_tools(artifacts)
    found = report_rules.unknown_name("WATCH-UNKNOWN-NAME")(value, artifacts)
    for where, words in report_rules.prose_of(value, "") if text else ():
        # What fails in the words of an error may be a function of a library.
        named = [one or two for one, two in _TOOL.findall(words) if one or where == "/summary"]
        for name in dict.fromkeys(named):
            if name not in tools and name not in text:
                hint = f"its tools are {listed(tools)}"
                summary = f"there is no tool {display(name)}"
                found.append(error("WATCH-UNKNOWN-NAME", summary, pointer=where, hint=hint))
    return found


_FIGURE = regex(
    r"(?<![\w.:-])(\d+(?:\.\d+)?)(?:\s?(?:°\s?[CF]\b|V\b)|[\s-](?:degrees?|celsius|volts?|amperes?|amps?|rpm|times)\b)"
)
"""A measured amount, or how often something happened, in a sentence."""
_PLAIN_NUMBER = regex(r"(?<![\w.])-?\d+(?:\.\d+)?")


def unknown_reading(value: JsonObject, artifacts: Artifacts) -> Found:
    """Whatever is cited was given, and so was each amount that a sentence states, perhaps rounded."""
    facts = facts_of(artifacts)
    found = report_rules.unknown_reading("WATCH-UNKNOWN-READING")(value, artifacts)
    # What a picture shows (`seen`) is in no reading.
    prose = [each for each in report_rules.prose_of(value, "") if facts.text and not each[0].endswith("/seen")]
    figures = [(where, figure) for where, words in prose for figure in _FIGURE.finditer(words)]
    known = _amounts(value, facts) if figures else set()
    for where, figure in figures:
        number, digits = float(figure[1]), len(figure[1].partition(".")[2])
        if all(abs(each - number) > 0.5 * 10**-digits + 1e-9 for each in known):
            hint = "state the amounts that the readings and failures of input.json have"
            summary = f"no reading and no failure has {display(figure[0])}"
            found.append(error("WATCH-UNKNOWN-READING", summary, pointer=where, hint=hint))
    return found


def _amounts(value: JsonObject, facts: DutyFacts) -> set[float]:
    """All numbers of the input and of the report's conditions, how far a signal has moved, and how often all failed."""
    text = f"{facts.text} {[each['condition'] for each in value['claims']]}"
    rows = [(place_of(row), row["value"]) for row in facts.readings if type(row["value"]) in (int, float)]
    moved = {abs(one - two) for place, one in rows for other, two in rows if place == other}
    failed = sum(int(row.get("count") or 0) for row in facts.failures)
    return {abs(float(each)) for each in _PLAIN_NUMBER.findall(text)} | moved | {float(failed)}


def status_contradicts(value: JsonObject, artifacts: Artifacts) -> Found:
    """The status is borne out by what the report itself lists."""
    status, errors = value["status"], value["errors"]
    held = [*errors, *value["claims"], *value["declarations"]]
    classes = {item["class"] for item in errors}
    fatal = any(item["severity"] == "fatal" for item in errors)
    problem = None
    if status == Status.HEALTHY and held:
        problem = (
            "the status is healthy, and the report lists a problem",
            "write degraded or error, or remove the problem",
        )
    elif status in _GRAVE and not errors:
        problem = f"the status is {status}, and the report lists no error", "write the error with what shows it"
    elif status == Status.DEGRADED and not held and not facts_of(artifacts).claims:
        problem = "the status is degraded, and the report lists nothing", "write what is wrong, with what shows it"
    elif status == Status.DEGRADED and fatal:
        problem = "the status is degraded, and an error is fatal", "write error, or down where the server is"
    elif status == Status.DOWN and "dead_process" not in classes:
        problem = "the status is down, and no error is of the class dead_process", "write error: the server answers"
    elif status in (Status.DEGRADED, Status.ERROR) and "dead_process" in classes:
        problem = f"the status is {status}, and the server does not run or answer", "write down"
    if problem is None:
        return []
    return [error("WATCH-STATUS-CONTRADICTS", problem[0], pointer="/status", hint=problem[1])]


def health_uncovered(value: JsonObject, artifacts: Artifacts) -> Found:
    """No one is healthy who does not report."""
    if value["status"] != Status.HEALTHY:
        return []
    return [
        error("WATCH-HEALTH-UNCOVERED", f"the status is healthy, and {why}", pointer="/status", hint=hint)
        for why, hint in _uncovered(facts_of(artifacts))
    ]


def _uncovered(facts: DutyFacts) -> Iterator[tuple[str, str]]:
    if not facts.newest():
        yield "there is no reading at all", "write unknown: absence of a report is no report"
    silent = [" ".join(place) for place in facts.unreadable()]
    if silent:
        yield f"{listed(silent)} could not be read", "write unknown, or degraded with the error that shows it"
    lasting = [str(row["id"]) for row in facts.lasting()]
    if lasting:
        yield f"nothing shows that {listed(lasting)} is over", "a tool that failed is well after a later success"
    for claim in facts.claims:
        condition, signal = claim.get("condition"), claim.get("signal")
        if not isinstance(condition, dict) or not isinstance(signal, dict):
            continue
        read = facts.newest_value(place_of(signal))
        if holds(str(condition.get("op")), condition.get("value"), read) is not False:
            summary = f"no reading refutes the claim {display(claim.get('id', ''))}"
            yield summary, "write degraded: it is still in force"


def class_unproved(value: JsonObject, artifacts: Artifacts) -> Found:
    """The class is one that the evidence allows: each of them starts a repair of its own."""
    found = []
    for index, item in enumerate(value["errors"]):
        problem = _unproved(item, facts_of(artifacts))
        if problem is not None:
            where = pointer("errors", index, "class")
            found.append(error("WATCH-CLASS-UNPROVED", problem[0], pointer=where, hint=problem[1]))
    for index, claim in enumerate(value["claims"]):
        channels = _CHANNELS.get(claim["fault"], ())
        if channels and claim["signal"]["channel"] not in channels:
            summary = f"a signal of the channel {claim['signal']['channel']} does not show the fault {claim['fault']}"
            hint = f"write none; {claim['fault']} is shown by {' or '.join(channels)}"
            found.append(error("WATCH-CLASS-UNPROVED", summary, pointer=pointer("claims", index, "fault"), hint=hint))
    return found


_CHANNELS = {
    "dead_process": (PROCESS,),
    "corrupted_file": (LOG, PROCESS),
    "dependency": (LOG, PROCESS),
    "device_moved": (LOG, KERNEL),
}
"""The channels of which a signal can show a fault of each class."""
_OF_CODE = frozenset({"AttributeError", "NameError", "TypeError", "KeyError", "IndexError", "ZeroDivisionError"})
"""Exceptions of code that could be read, with its device found."""


def error_twice(value: JsonObject, _: Artifacts) -> Found:
    """One problem is one error: no two are about the same tool and device and rest on the same failure."""
    found, first = [], dict[tuple[Any, ...], int]()
    for index, item in enumerate(value["errors"]):
        for identity in item["cites"]:
            before = first.setdefault((item["tool"], item["device"], identity), index)
            if before != index:
                summary = f"this error is about the same as errors[{before}], and rests on {display(identity)} too"
                hint = "write one error, of the first class that the evidence supports"
                where = pointer("errors", index)
                found.append(error("WATCH-ERROR-TWICE", summary, pointer=where, hint=hint))
                break
    return found


def _unproved(item: JsonObject, facts: DutyFacts) -> tuple[str, str] | None:
    kind, device = item["class"], item["device"]
    there = facts.newest_value((KERNEL, device, "/there")) if device is not None else None
    if kind == "dead_process" and not _dead(item, facts):
        return "no newest reading of the process shows that it is dead", "cite that reading, or take another class"
    shown = {str(row.get("error")) for row in facts.failures if row["id"] in item["cites"]}
    if kind in ("corrupted_file", "device_moved") and shown and shown <= _OF_CODE:
        return f"{listed(sorted(shown))} shows that the code ran and was wrong", "write broken_tool, dependency or none"
    if kind == "device_moved" and device is None:
        return "no device is named that moved", "name it, or take another class"
    if kind == "device_moved" and there is False:
        return f"{display(device)} is not attached, so it did not move", "write none: only a person can plug it in"
    if kind == "broken_tool" and item["tool"] is None and device is None:
        return "no tool or device is named whose code is wrong", "name the tool, or the device whose tools share it"
    if kind == "broken_tool" and there is False:
        return f"{display(device)} is not attached, so its tool's code is not shown to be wrong", "write none"
    if kind == "broken_tool" and not any(row["id"] in item["cites"] for row in _of_tool(item, facts)):
        return "nothing that is cited came from a tool", "cite a failure or a reading of the tool whose code is wrong"
    return None


def _dead(item: JsonObject, facts: DutyFacts) -> bool:
    newest = facts.newest()
    return any(
        row["channel"] == PROCESS and row["value"] is False and row["id"] in item["cites"] for row in newest.values()
    )


def _of_tool(item: JsonObject, facts: DutyFacts) -> Iterator[Any]:
    """The readings of an error's tool or, where only its device is named, of any tool."""
    tool = item["tool"]
    yield from (row for row in facts.readings if row["channel"] in _CALLED and tool in (None, row["source"]))
    yield from (row for row in facts.failures if tool in (None, row["tool"]))


def failure_passed_over(value: JsonObject, artifacts: Artifacts) -> Found:
    """No failure is passed over in silence unless something shows that it is over."""
    cited = {identity for item in value["errors"] for identity in item["cites"]}
    named = {item["tool"] for item in value["errors"]}
    return [
        error(
            "WATCH-FAILURE-PASSED-OVER",
            f"no error cites {display(row['id'])}, a failure of {display(row['tool'])} that nothing shows to be over",
            pointer="/errors",
            hint="cite it in an error; where no one knows why it failed, the class is none",
        )
        for row in facts_of(artifacts).lasting()
        if row["id"] not in cited and not (row["tool"] in named and _cited_alike(row, cited, artifacts))
    ]


def _cited_alike(failure: Any, cited: set[str], artifacts: Artifacts) -> bool:
    """Another failure of the same tool and kind is cited: a message that changes in a number is the same problem."""
    return any(
        row["id"] in cited and row["tool"] == failure["tool"] and row.get("error") == failure.get("error")
        for row in facts_of(artifacts).failures
    )


def declaration_unproved(value: JsonObject, artifacts: Artifacts) -> Found:
    """A permanent restriction needs a fresh reading of its own target: no old reading proves it."""
    facts, found = facts_of(artifacts), []
    now = {row["id"] for row in (*facts.newest().values(), *facts.lasting())}
    known = set(facts.ids())
    for index, item in enumerate(value["declarations"]):
        where = pointer("declarations", index, "cites")
        old = [identity for identity in item["cites"] if identity in known - now]
        if old:
            summary = f"the permanent restriction rests on {listed(old)}, and a newer reading of that signal is there"
            hint = "cite the newest readings, or remove the permanent restriction"
            found.append(error("WATCH-DECLARATION-UNPROVED", summary, pointer=where, hint=hint))
        elif not any(about(identity, Target.of(item["target"]), artifacts) for identity in item["cites"]):
            summary = f"nothing that is cited is about {display(item['target'])}"
            hint = "cite readings of the very thing that you declare"
            found.append(error("WATCH-DECLARATION-UNPROVED", summary, pointer=where, hint=hint))
    return found


def physical_state(value: JsonObject, artifacts: Artifacts) -> Found:
    """Of what is where is spoken only where a picture was given."""
    facts, state = facts_of(artifacts), value["physical_state"]
    found = []
    if state["available"] and not facts.frames:
        found.append(("it is called available, and no frame was given", "/physical_state/available", "write false"))
    if state["available"] and state["seen"] is None:
        found.append(
            ("it is available, and nothing is reported as seen", "/physical_state/seen", "describe what is seen")
        )
    if state["available"] and state["reason"] is not None:
        found.append(("it is available, and a reason is given why not", "/physical_state/reason", "write null"))
    if not state["available"] and state["seen"] is not None:
        found.append(("it is not available, and something is reported as seen", "/physical_state/seen", "write null"))
    if not state["available"] and not (state["reason"] or "").strip():
        found.append(("it is not available, and no reason is given", "/physical_state/reason", "give the reason"))
    if not state["available"]:
        found += _on_frames(value, facts)
        found += [
            (
                f"it is not available, and {display(seen[0])} is reported",
                where,
                "report what readings show, and no place",
            )
            for where, text in report_rules.prose_of(value, "")
            if not facts.frames and (seen := _SEEN.search(text))
        ]
    return [error("WATCH-PHYSICAL-STATE", summary, pointer=where, hint=hint) for summary, where, hint in found]


_SEEN = regex(
    r"\b(?:camera|picture|frame|image|photo)s? (?:now )?(?:shows?|sees?)\b(?! (?:nothing|no\b))|\b(?:is|are) visible\b"
    r"|\bcan be seen\b|\b(?:has|have) moved (?:to|towards?|left|right|up|down|away)\b",
    re.IGNORECASE,
)
"""What only a picture shows."""


def _on_frames(value: JsonObject, facts: DutyFacts) -> Iterator[tuple[str, str, str]]:
    for where, cites in citations(value):
        for identity in cites:
            row = facts.reading(identity)
            if row is not None and row["channel"] == FRAME and row["value"] is not None:
                summary = f"it is not available, and {display(identity)} is cited, which comes from a frame"
                yield summary, f"{where}/cites", "leave out what rests on frames"


RULES = (
    Rule("WATCH-UNESCAPED-TEXT", text_rules.in_values("WATCH-UNESCAPED-TEXT")),
    Rule("WATCH-UNKNOWN-READING", unknown_reading),
    Rule("WATCH-UNKNOWN-NAME", unknown_name),
    Rule("WATCH-CITES-ELSEWHERE", report_rules.cites_elsewhere("WATCH-CITES-ELSEWHERE")),
    Rule("WATCH-STATUS-CONTRADICTS", status_contradicts),
    Rule("WATCH-HEALTH-UNCOVERED", health_uncovered),
    Rule("WATCH-CLASS-UNPROVED", class_unproved),
    Rule("WATCH-ERROR-TWICE", error_twice),
    Rule("WATCH-FAILURE-PASSED-OVER", failure_passed_over),
    Rule("WATCH-PHYSICAL-STATE", physical_state),
    Rule("WATCH-DECLARATION-UNPROVED", declaration_unproved),
    Rule("WATCH-ORDERS", report_rules.orders("WATCH-ORDERS")),
    *report_rules.rules("WATCH"),
)
