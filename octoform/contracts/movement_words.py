"""Whether a string speaks of changing or moving something, wherever in it, and whether a parameter carries a quantity.

Judgements over words, for devices of which no one knows more than that there is a line to them. They are blunt on
purpose: refused text can be reworded, or the device's owner explains what it is.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from typing import Any

from octoform.patterns import regex

_SURE = """
    move rotate actuate nudge jog teleoperate telemanipulate replay mimic energize energise retract swivel grasp clamp
    squeeze relax disengage toggle activate deactivate enable disable modify alter overwrite erase recalibrate
    reconfigure dispense ignite inject teach unlock accelerate decelerate steer maneuver manoeuvre reposition bring
    imitate drag unclamp ungrip loosen tighten extend unwind bewegen fahren drehen mover
"""
"""Verbs that say so in every form."""
_UNSURE = """
    drive set switch command home open close hold stop lock park start track sync synchronize
    synchronise press guide wave grip release go turn lift push pull tilt spin bend swing brake tare zero trigger reset
    calibrate configure adjust change write store save program apply execute perform fire launch heat cool dim blink
    flash beep play print feed pump spray cut step clear travel approach visit mirror demonstrate pose control
    actuate halt lower raise shift slide power engage carry send wish demand
"""
"""Verbs that are nouns or adjectives as well: only where they stand as a verb does."""
_GOALS = frozenset({"wished", "desired", "commanded", "teleoperation", "teleop"})
_NEGATING = frozenset({"nothing", "never", "not", "no", "without", "cannot", "neither", "nor", "nobody"})
_TURNING = frozenset({"but", "only", "except", "until", "unless", "besides", "other", "just", "more"})
_BEFORE_VERB = frozenset(
    {"to", "and", "then", "or", "will", "can", "must", "shall", "should", "would", "may", "it", "also", "first", "lets"}
    | {"let", "makes", "make", "that", "which", "who", "immediately", "slowly", "briefly", "please", "could", "they"}
)
_BEFORE_NOUN = frozenset(
    {"the", "of", "a", "an", "all", "its", "their", "both", "each", "every", "in", "with", "these", "those", "between"}
    | {"on", "at", "per", "from", "number", "for", "this", "any", "last", "present", "current", "by"}
)
_BEFORE_ING = frozenset(
    {"by", "while", "after", "before", "when", "and", "for", "then", "is", "are", "starts", "keeps"}
)
_BEING = frozenset({"is", "are", "be", "being", "get", "gets", "becomes", "been", "was", "were", "comes"})
_ASKING = frozenset({"whether", "if", "when", "since", "what", "which", "how", "where", "nobody", "that"})
_NOW = frozenset({"whether", "if", "while", "as", "when", "since", "what", "which", "how"})
_THINGS = frozenset({"the", "a", "an", "it", "its", "each", "one", "all", "to", "there", "every", "them", "him"})
_PHRASES = regex(
    r"\bgo(?:es|ing)?\s+(?:there|to|home|back|into)\b|\btorque\b[^.;]{0,24}\b(?:off|on|releas|enabl|disabl|switch|cut)"
    r"|\b(?:releas|switch|turn|enabl|disabl|cut)\w*\b[^.;]{0,20}\btorque\b|\bmak\w+\s+(?:\w+\s+){0,3}(?:move|go|turn)\b"
    r"|\bfollow(?:s|ing)?\s+(?:\w+\s+){0,3}(?:joint|arm|leader|hand|path|person|angle|trajectory|movement|motion)s?\b"
    r"|\b(?:hand|limp|free)ed?\s+(?:guid|mov)\w+|\btakes?\s+(?:the|a|up)\s+(?:\w+\s+){0,2}(?:pose|place)\b"
    r"|\b(?:joints?|axis|axes|arms?|grippers?|motors?|servos?|valves?|relays?|pumps?|wheels?)\s+"
    r"(?:opens?|closes?|follows?|turns?|drives?|starts?|stops?|goes|go|travels?|lifts?|lowers?|swings?|spins?|homes?)\b"
)
_READING_VERBS_WORDS = """
    read get list measure listen receive check query identify watch monitor count scan sense capture log report
    show tell ask fetch detect decode poll observe sample record wait describe find look inspect view probe
    examine acquire take hear collect grab estimate compute display dump discover locate weigh note summarize
    summarise inquire obtain retrieve return stream snapshot gather is has lesen lese miss messen hole zeige leer
    lire lecture mesurer medir read_only status info determine diagnose verify test parse
"""
_READING_VERBS = frozenset(_READING_VERBS_WORDS.split())
"""With one of these a name begins that reads."""
_QUANTITIES_WORDS = """
    angle angles degree degrees deg radian radians rad speed velocity torque goal target setpoint position
    positions pose place value values level percent power pwm duty amplitude acceleration force command cmd text
    message bytes data payload string words word register address state output input frequency current voltage
    brightness steps ticks distance offset move movement motion direction on off enable enabled
    open closed raw
"""
_QUANTITIES = frozenset(_QUANTITIES_WORDS.split())
_SELECTING_WORDS = """
    id ids index channel channels count number samples sample repeat repeats limit lines line page unit units port
    sensor joint axis motor servo slot bank max maximum most n timeout wait seconds second secs ms milliseconds
    minutes duration period interval deadline time sentences size first last from include
"""
_SELECTING = frozenset(_SELECTING_WORDS.split())
_TIMES = frozenset({"timeout", "wait", "seconds", "secs", "second", "ms", "milliseconds", "duration", "minutes"})
_WAITS = frozenset({"timeout", "wait", "duration"})
_STEERING = frozenset(
    {"position", "torque", "speed", "velocity", "angle", "steps", "pose", "duty", "force", "current", "acceleration"}
    | {"pwm", "power", "value", "data", "payload", "level"}
)
"""Beside one of these a unit of time is part of another unit (``speed_ms``, ``angle_seconds``)."""
_PLACES = frozenset(
    {"in", "out", "output", "left", "right", "up", "down", "forward", "backward", "home", "arm", "source", "relay"}
)
"""Orders that name one of several channels, joints or sensors as well."""
_WORD = regex(r"[a-zà-ÿ0-9']+|[.!?;:,()\n\[\]]")
_ORDER = regex(r"[gmGM]\d+")
_ORDERS_WORDS = """
    move mov goto go set on off out outp output home stop start rst reset open close step run jog torque goal turn
    write wr enable disable volt curr appl apply switch relay pwm servo fwd rev forward backward left right up
    down cls sav rcl save store load erase fire trig init zero tare cal calibrate lock unlock grip release abs
    sour source arm abor
"""
_ORDERS = frozenset(_ORDERS_WORDS.split())


def speaks_of_change(text: str) -> str | None:
    """The words by which a string states that something is moved or changed, or None."""
    plain = re.sub(r"[_\-]+", " ", text).casefold()
    if found := next((each for each in _PHRASES.finditer(plain) if not _denied(plain[: each.start()])), None):
        return found[0]
    words = _WORD.findall(plain)
    return next((word for at, word in enumerate(words) if _changes(words, at)), None)


def name_moves(name: str) -> str | None:
    """The word of a snake_case name that is no reading: its verb, or another that moves something; None for none."""
    words = spoken(name)
    if words and words[0] not in _READING_VERBS:
        return words[0]
    forms = _forms()
    return next(
        (word for word in words if word in _GOALS or (forms.get(word, ("", ""))[0] == "sure") or _gerund(word)), None
    )


def carries(name: str, schema: Mapping[str, Any], devices: Iterable[str]) -> str | None:
    """Why a parameter does more than select what is read; None for an index, a count, a time or a plain choice."""
    result, values = (
        str(schema.get("description", "")),
        schema.get("enum", [schema["const"]] if "const" in schema else None),
    )
    words = set(spoken(name))
    aims = _GOALS | {"goal", "goals", "target", "setpoint"}
    if found := speaks_of_change(result) or next((word for word in (*words, *spoken(result)) if word in aims), None):
        return f"{found} shows that it carries what the device is to do"
    times = words & _WAITS or (words & _TIMES and not words & _STEERING)
    if values is not None:
        if set(map(str, values)) <= set(devices):
            return None
        orders = (each for each in values if isinstance(each, str) and commands_something(each))
        ordered = next((each for each in orders if not (words & _SELECTING and each.casefold() in _PLACES)), None)
        amount = next(iter(sorted(words & _QUANTITIES)), None)
        return f"{ordered!r} is an order" if ordered else f"{amount} is a quantity" if amount and not times else None
    kinds = schema.get("type")
    kinds = {kinds} if isinstance(kinds, str) else set(kinds or ())
    if kinds & {"string", "object"}:
        return "it takes any text"
    if "boolean" in kinds or times:
        return None if times or not words & _QUANTITIES else "it switches something"
    if amount := next(iter(sorted(words & _QUANTITIES)), None):
        return f"{amount} is a quantity"
    return None if "integer" in kinds and words & _SELECTING else "it is a number for the device"


def is_quantity(name: str) -> bool:
    """Whether a parameter by its name is an amount or a goal that a device takes, and no length of time."""
    words = set(spoken(name))
    return bool(words & (_QUANTITIES | _GOALS)) and not words & _TIMES


def is_time(name: str) -> bool:
    """Whether a parameter by its name is how long a call waits."""
    words = set(spoken(name))
    return bool(words & _WAITS or (words & _TIMES and not words & _STEERING))


def commands_something(text: str) -> bool:
    """Whether a line for a device, or a choice, orders something by its words."""
    words = spoken(text)
    first = {word for word in words[:3]}
    return not text.rstrip().endswith("?") and bool(first & _ORDERS or any(_ORDER.fullmatch(word) for word in words))


def spoken(text: str) -> list[str]:
    """The words of a name, in small letters."""
    spread = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", text)
    return [word for word in re.split(r"[^0-9a-zà-ÿ]+", spread.casefold()) if word]


def _gerund(word: str) -> bool:
    return _forms().get(word, ("", ""))[1] == "ing"


def _changes(words: list[str], at: int) -> bool:
    word = words[at]
    if word in _GOALS:
        return not _is_denied(words, at)
    kind, form = _forms().get(word, ("", ""))
    if not kind or _is_denied(words, at):
        return False
    before = words[at - 1] if at else "."
    after = words[at + 1] if at + 1 < len(words) else "."
    clause = set(_clause(words, at))
    if form == "ed":
        return before in _BEING and not clause & _ASKING
    if form == "ing":
        if before in ("is", "are") and clause & _NOW:
            return False
        return (kind == "sure" and before not in _BEFORE_NOUN - {"by", "for"} and after not in ("average", "mean")) or (
            before in _BEFORE_ING and not clause & {"whether", "if"}
        )
    if kind == "sure":
        return before not in ("of", "a")
    starts = not before.replace("'", "").isalnum() or before in _BEFORE_VERB  # what is somebody's is a noun
    if form == "s":
        return starts and before not in _BEFORE_NOUN and (before not in ("and", "or") or after in _THINGS)
    return starts and not clause & {"whether"} and not (before in ("and", "or") and not _begins(words, at))


def _begins(words: list[str], at: int) -> bool:
    """Whether the words before 'and' begin with a verb, so that one follows it: 'Open it and close it'."""
    begin = at - 1
    while begin > 0 and words[begin - 1] not in ".!?;\n":
        begin -= 1
    return words[begin] in _READING_VERBS or words[begin] in _forms()


def _clause(words: list[str], at: int) -> Iterator[str]:
    for word in reversed(words[:at]):
        if word in ".!?;\n":
            return
        yield word


def _is_denied(words: list[str], at: int) -> bool:
    """``nothing moves``, ``moves nothing``, ``never changes``, ``without moving``."""
    near = words[max(0, at - 3) : at]
    after = words[at + 1 : at + 3]
    clause = set(_clause(words, at)) | set(words[at + 1 : at + 6])
    return bool(_NEGATING.intersection(near) or {"nothing", "no"} & set(after)) and not clause & _TURNING


def _denied(before: str) -> bool:
    words = _WORD.findall(before)[-4:]
    asks = {"whether", "if"}.intersection(_clause([*_WORD.findall(before), "."], len(_WORD.findall(before))))
    return bool(asks or _NEGATING.intersection(words)) and not _TURNING.intersection(words)


@cache
def _forms() -> dict[str, tuple[str, str]]:
    """Each form of each verb, with how sure it is and which form it is."""
    found: dict[str, tuple[str, str]] = {}
    for kind, verbs in (("unsure", _UNSURE), ("sure", _SURE)):
        for verb in verbs.split():
            stem = verb.removesuffix("e")
            twice = verb + verb[-1] if re.fullmatch(r"[a-z]*[^aeiou][aeiou][bdgnpt]", verb) else stem
            found |= {verb: (kind, "base"), f"{verb}s": (kind, "s"), f"{verb}es": (kind, "s")}
            found |= {f"{each}ing": (kind, "ing") for each in (stem, twice)}
            found |= {f"{each}ed": (kind, "ed") for each in (stem, twice)}
    more = {"driven": "ed", "held": "ed", "sent": "ed", "written": "ed", "brought": "ed", "taught": "ed", "spun": "ed"}
    return {**found, **{word: ("unsure", form) for word, form in more.items()}}


# What a person's answer gives of a device on a raw line: its bounds, and how it stops.

_FIGURE = r"(?<![\w.,-])[-+\u2212\u00b1]?\d+(?:[.,]\d+)?(?![\w-])"
_NUMBER = r"(?<![\w.,-])([-+\u2212\u00b1]?\d+(?:[.,]\d+)?)"
_UNIT = r"(?:\s?(?:\u00b0|%|[a-z\u00b5]{1,12}))?"
_TO = r"\s*(?:\.\.+|\u2026|-|\u2013|\u2014|~|to|up to|bis|\u00e0|a|hasta|fino a|tot|til|till|do|\u0434\u043e)\s*"
_RANGE = regex(rf"(?i){_NUMBER}{_UNIT}{_TO}([-+\u2212]?\d+(?:[.,]\d+)?)(?![\d-])")
_BETWEEN = regex(
    rf"(?i)\b(?:between|zwischen|entre|tra)\s+{_NUMBER}{_UNIT}\s*(?:and|und|et|y|e)\s*([-+\u2212]?\d+(?:[.,]\d+)?)(?![\d-])"
)
_ENDS = regex(
    rf"(?i)\b(?:at least|min(?:imum|imal)?|no less than|mindestens)\W{{1,3}}{_NUMBER}[^.;\n\d]{{0,24}}?"
    r"\b(?:at most|max(?:imum|imal)?|no more than|h\u00f6chstens)\W{1,3}([-+\u2212]?\d+(?:[.,]\d+)?)"
)
_PAIR = regex(rf"[\[(]\s*{_NUMBER}\s*[,;]\s*([-+\u2212]?\d+(?:[.,]\d+)?)\s*[\])]")
_SPANS = (_BETWEEN, _RANGE, _ENDS, _PAIR)
"""The ways to write a range: "between 10 and 90", "0 to 4095", "at least 10, at most 90", "[0, 100]"."""
_GROUPED = regex(r"(?<![\w.,])[1-9]\d{0,2}(?:[,'\u2019\u00a0\u202f]\d{3})+(?![\d\w])")
"""A number in groups of three digits: 4,095 is no decimal fraction, as 1,5 is one."""
_LEAST = regex(r"(?i)\b(?:at least|min(?:imum|imal)?|no less than|mindestens)\W{1,3}$")
_MOST = regex(
    rf"(?i)\b(?:at most|no (?:more|further|faster|higher) than|not (?:more than|above|over|beyond)"
    r"|never (?:above|over|beyond)|exceeds?|exceeding|up to|below"
    rf"|max(?:imum|imal)?|limit(?:s|ed)?|at least|min(?:imum|imal)?|h\u00f6chstens|mindestens)\b"
    rf"\.?[^\d.;\n]{{0,20}}{_NUMBER}"
)
_MEASURED = regex(
    rf"(?i){_NUMBER}[\s-]?(?:\u00b0|%|(?:degrees?|deg|grad|percent|prozent|rad|mm|cm|m|\u00b5m|rpm|ms|s|secs?|seconds?"
    r"|minutes?|steps?|ticks?|counts?|turns?|channels?|relays?|outputs?|switch(?:es)?|valves?|lamps?|kan\u00e4le|n|nm|g|kg"
    r"|ml|l|bar|kpa|ma)\b)"
)
_ON_OFF = regex(r"(?i)\b(?:on\s*(?:/|and|or|&)\s*off|off\s*(?:/|and|or|&)\s*on|(?:ein|an)\s*(?:/|und|oder)\s*aus)\b")
_NOT_BOUNDS = regex(
    r"(?i)\busb-[0-9a-f]{4}-[0-9a-f]{4}(?:-\d+)?\b|\b[0-9a-f]{4}:[0-9a-f]{4}\b|\b\d{4}-\d\d-\d\d\b"
    r"|\d[\d .,]*\s?(?:k?baud|bd|bps|k?bit/s)\b|\b(?:baud(?: ?rate)?|speed of the line|firmware|version|revision"
    r"|rev|usb|mark|mk|port|model|release)\W{0,2}v?\d+(?:\.\d+)*|\b\d\s?(?:data|stop|start) ?bits?\b|\b[5-8][NEO][12]\b"
)
"""Numbers of an answer that bound nothing: of the line, a version, a date, a vendor and product id."""
_COUNTS = {"two": "2", "three": "3", "four": "4", "five": "5", "six": "6", "seven": "7", "eight": "8"}
_COUNTS |= {"ten": "10", "twelve": "12", "sixteen": "16"}
_COUNTED = regex(rf"(?i)\b({'|'.join(_COUNTS)})(?=[ -](?:channels?|relays?|outputs?|switches|valves?|lamps?)\b)")
_BOTH_WAYS = regex(
    r"(?i)\u00b1|\+/-|plus or minus|either (?:way|side|direction)|each (?:way|side)|both (?:ways|sides|directions)"
)
_STOPPING = regex(
    r"(?i)\b(?:stop(?:s|ped|ping)?(?!\W{0,2}bits?\b)|stopp(?:t|en)?|halt(?:s|ed|en)?|releas(?:e|es|ed|ing)(?!\W+v?\d)"
    r"|emergency|e-?stop|not-?aus|not-?halt|anhalten|(?:ab|aus)(?:ge)?schalte[nt]|abort(?:s|ed)?|brakes?|unplug(?:s|ged)?"
    r"|power(?:s|ed)? down|shut(?:s)? down|torque 0|off(?!\W(?:the\W)?shelf)|arr\u00eat\w*|parar|parada|detener"
    r"|fermare|arresto)\b"
    r"|\bein\s*(?:/|und|oder)\s*aus\b|\ban\s*(?:/|und|oder)\s*aus\b|\u505c|\u0441\u0442\u043e\u043f"
)
_NO_STOP = regex(
    r"(?i)\b(?:no|not|non|never|without|cannot|can't|doesn't|don't|won't|unknown|unclear|kein\w*|nicht|ohne)$"
)


def lacking(answer: str, translated: bool = False) -> list[str]:
    """What an answer lacks to be the source of what acts: ``limits``, ``how it stops``, in this order.

    ``translated`` is whether evidence quotes its words for stopping and names their language: its limits may then be
    in words that no list here has, and a number is enough.
    """
    text = _bounding(answer)
    limits = any(each.search(text) for each in (*_SPANS, _MOST, _MEASURED, _ON_OFF))
    limits = limits or (translated and re.search(_FIGURE, text) is not None)
    return [
        *([] if limits else ["limits"]),
        *([] if translated or says_stop(answer) else ["how it stops"]),
    ]


def says_stop(text: str) -> bool:
    """Whether a string states how something stops, and does not deny it: "there is no stop", "it does not stop"."""
    for found in _STOPPING.finditer(text):
        before = re.split(r"[.;,:!?\n()]|\bbut\b", text[: found.start()])[-1]
        near = re.findall(r"[\w']+", before)[-4:]
        if not any(_NO_STOP.search(word) for word in near):
            return True
    return False


def within_answer(number: float, answer: str) -> bool:
    """Whether a bound of an argument is a number of an answer, or lies inside of what the answer allows."""
    return any(low <= number <= high for low, high in _spans(_bounding(answer)))


def _bounding(answer: str) -> str:
    """The answer with its counts as numbers, and without the numbers that bound nothing."""
    counted = _COUNTED.sub(lambda found: _COUNTS[found[1].casefold()], answer)
    counted = _GROUPED.sub(lambda found: re.sub(r"\D", "", found[0]), counted)
    return _NOT_BOUNDS.sub(" ", counted)


def _spans(text: str) -> Iterator[tuple[float, float]]:
    """The ranges of an answer; a number alone allows what is between nothing and itself, a least number itself."""
    rest = text
    for pattern in _SPANS:
        for found in pattern.finditer(rest):
            low, high = sorted(_number(each) for each in found.groups())
            yield (low, high)
        rest = pattern.sub(" ", rest)
    for found in re.finditer(_NUMBER, rest):
        number = _number(found[1])
        if _LEAST.search(rest[: found.start()]):
            yield (number, number)
        elif "\u00b1" in found[1] or _BOTH_WAYS.search(rest):
            yield (-abs(number), abs(number))
        else:
            yield (min(0.0, number), max(0.0, number))
    if _ON_OFF.search(text):
        yield (0.0, 1.0)


def _number(text: str) -> float:
    return float(text.replace("\u2212", "-").replace("\u00b1", "").replace(",", "."))


# Units that a sentence states something is in.

_KNOWN_BY = {
    **dict.fromkeys(("celsius",), "celsius|deg_?c|°c|\\bcel\\b"),
    **dict.fromkeys(("fahrenheit",), "fahrenheit|deg_?f|°f"),
    **dict.fromkeys(("kelvin",), "kelvin|_k\\b|[\"']k[\"']"),
    **dict.fromkeys(("degrees", "radians"), "degree|\\bdeg|°|angle|radian|_rad\\b"),
    **dict.fromkeys(("lux",), "lux|_lx\\b|illuminance"),
    **dict.fromkeys(("lumens",), "lumen|_lm\\b"),
    **dict.fromkeys(("percent",), "percent|%|pct"),
    **dict.fromkeys(("kilobytes", "kb"), "kilobyte|kibibyte|_ki?b\\b"),
    **dict.fromkeys(("megabytes", "mb"), "megabyte|mebibyte|_mi?b\\b"),
    **dict.fromkeys(("gigabytes", "gb"), "gigabyte|gibibyte|_gi?b\\b"),
    **dict.fromkeys(("milliseconds",), "millisecond|_ms\\b|\\bms\\b"),
    **dict.fromkeys(("microseconds",), "microsecond|_us\\b|\\bus\\b"),
    **dict.fromkeys(("millimetres", "millimeters", "mm"), "millimet|_mm\\b|\\bmm\\b"),
    **dict.fromkeys(("centimetres", "centimeters", "cm"), "centimet|_cm\\b|\\bcm\\b"),
    **dict.fromkeys(("inches",), "inch|_in\\b"),
    **dict.fromkeys(("millivolts",), "millivolt|_mv\\b|\\bmv\\b"),
    **dict.fromkeys(("milliamperes", "milliamps"), "milliamp|_ma\\b|\\bma\\b"),
    **dict.fromkeys(("rpm",), "rpm|revolution"),
}
_IN_UNIT = regex(
    r"(?i)\b(?:in|number of|amount of)\s+(?:whole\s+|degrees\s+(?=[ckf]))?("
    + "|".join(sorted(_KNOWN_BY, key=len, reverse=True))
    + r")\b"
)
_COMPARED = regex(r"(?i)\b(?:not|no|never|nor|instead|rather|neither|or|without)\b")


def names_unit(text: str) -> bool:
    """Whether a description states that something is in a unit."""
    return _IN_UNIT.search(text) is not None


def unknown_units(text: str, known: str) -> list[str]:
    """The units in which a description has something, and that are nowhere in what is known: ``in gigabytes``."""
    found, plain = [], ""
    for each in _IN_UNIT.finditer(text):
        sentence = re.split(r"[.;\n]", text[: each.start()])[-1]
        plain = plain or known.casefold()
        if not _COMPARED.search(sentence) and not re.search(_KNOWN_BY[each[1].casefold()], plain):
            found.append(each[1])
    return found
