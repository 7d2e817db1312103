"""The identity of one host: distinguished from the kinds, and hidden before anything reaches git.

Serial numbers, hardware addresses and host names stay on the machine. The committed PROBE artifact holds stable
pseudonyms in their place, so two commits can still be compared: the same serial number gives the same pseudonym. And
each unit keeps its id from one PROBE to the next.
"""

import hashlib
import hmac
import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from octoform.base import serials
from octoform.base.files import parse
from octoform.contracts.model import JsonObject
from octoform.patterns import regex

UNKNOWN = "unknown"
"""The name of a host that shows none: nothing that has to be hidden."""
MINIMUM_IN_TEXT = 6
SHORTEST_NAME = 3
"""A host's name of fewer characters is hidden in its own member alone."""
_PSEUDONYM = regex(r"redacted-[0-9a-f]{10}")
ADDRESS = regex(r"(?<![0-9A-Fa-f:])(?:[0-9A-Fa-f]{2}:){5,19}[0-9A-Fa-f]{2}(?![0-9A-Fa-f:])")
_IDENTIFYING = regex(r"serial|address|\bmac\b|uuid|guid|wwid|wwn|ssid|imei|eui|host", re.IGNORECASE)
# What the system puts into a serial's place where a device has none: the numbers of maker and product (0424_9514).
_KIND_NUMBERS = regex(r"[0-9A-Fa-f]{4}[_:][0-9A-Fa-f]{4}")
# Members that name a kind; a serial number that leaked into one is refused by a rule, not rewritten.
_KIND_MEMBERS = frozenset({"id", "interface", "classes", "drivers", "vid", "pid", "class", "strength", "port"})


def instances(probe: JsonObject) -> dict[str, JsonObject]:
    """Device id to its instance object, for the devices that have one, with the real values."""
    return {device["id"]: device["instance"] for device in probe["devices"] if isinstance(device.get("instance"), dict)}


def pseudonymise(probe: JsonObject, key: bytes) -> JsonObject:
    """The committed form of a PROBE artifact; a copy.

    Every serial number, hardware address and host name becomes ``redacted-`` and ten hex digits of its HMAC-SHA256
    under ``key``: in its own member always, elsewhere in the document where it is at least six characters long (a
    host name three, as a word of its own, unless an attached device is called so).
    Any text in the form of a hardware address is hidden too. A second pass changes nothing.
    """
    replace = hider(probe, key)
    out: JsonObject = {}
    for name, value in probe.items():
        if name == "hostname":
            out[name] = value if value == UNKNOWN else _whole(value, key)
        elif name == "devices":
            out[name] = [_device(device, key, replace) for device in value]
        else:
            out[name] = value if name == "platform" else _rewrite(value, replace)
    return out


def pseudonym(secret: str, key: bytes) -> str:
    """The stable stand-in for one secret; letter case and surrounding blanks do not matter."""
    mac = hmac.new(key, secret.strip().casefold().encode("utf-8", "surrogatepass"), hashlib.sha256)
    return "redacted-" + mac.hexdigest()[:10]


def secrets_of(instance: JsonObject) -> Iterator[tuple[str, str]]:
    """(member, value) of what identifies one unit: not blank, not yet hidden, and not the numbers of its kind."""
    for name, value in instance.items():
        if not isinstance(value, str) or not identifies(name):
            continue
        if value.strip() and not hidden(value) and not _KIND_NUMBERS.fullmatch(value.strip()):
            yield name, value.strip()


def identifies(member: str) -> bool:
    """True for the name of a member that distinguishes one unit from another."""
    return _IDENTIFYING.search(member) is not None


def _device(device: JsonObject, key: bytes, replace: Callable[[str], str]) -> JsonObject:
    out = dict(_members(device, replace))
    instance = device.get("instance")
    if isinstance(instance, dict):
        shown = dict(_members(instance, replace))
        shown.update({name: pseudonym(value, key) for name, value in secrets_of(instance)})
        out["instance"] = shown
    return out


def _members(value: JsonObject, replace: Callable[[str], str]) -> Iterator[tuple[str, Any]]:
    for name, item in value.items():
        yield name, item if name in _KIND_MEMBERS else _rewrite(item, replace)


def _rewrite(value: Any, replace: Callable[[str], str]) -> Any:
    if isinstance(value, str):
        return replace(value)
    if isinstance(value, list):
        return [_rewrite(item, replace) for item in value]
    if isinstance(value, dict):
        return dict(_members(value, replace))
    return value


def hider(probe: JsonObject, key: bytes) -> Callable[[str], str]:
    """A function that hides every secret of the document inside one string, in a single pass."""
    patterns = {spelt(secret): secret for secret in secrets_in_text(probe)}
    longest = sorted(patterns, key=lambda item: (-len(patterns[item]), item))
    found = re.compile("|".join(longest), re.IGNORECASE) if longest else None
    spellings = {_bare(secret): secret for secret in patterns.values()}

    def replace(text: str) -> str:
        if found is not None:
            text = found.sub(lambda hit: pseudonym(spellings.get(_bare(hit.group()), hit.group()), key), text)
        return ADDRESS.sub(lambda hit: pseudonym(hit.group(), key), text)

    return replace


def secrets_in_text(probe: JsonObject) -> list[str]:
    """The values of this PROBE artifact that are hidden wherever they occur, since no other text is spelt so."""
    out = []
    for instance in instances(probe).values():
        # A "serial number" without a digit is a product name that the maker put in the wrong place.
        out += [value for _, value in secrets_of(instance) if any(item.isdigit() for item in value)]
    return list(dict.fromkeys([*_host_name(probe), *(secret for secret in out if len(secret) >= MINIMUM_IN_TEXT)]))


def _host_name(probe: JsonObject) -> list[str]:
    """The host's name, unless it is a word that is stated of its devices."""
    given = probe.get("hostname")
    name = given.strip() if isinstance(given, str) and given != UNKNOWN and not hidden(given) else ""
    if len(name) < SHORTEST_NAME or _names_a_kind(name, probe):
        return []
    return [name] if len(name) >= MINIMUM_IN_TEXT or not _is_device_word(name, probe) else []


def _is_device_word(word: str, probe: JsonObject) -> bool:
    """True when an attached device is called so, or states the word of itself: a short one is most likely that word."""
    attached = (device for device in probe["devices"] if device.get("context") is not True)
    lines = (str(device.get(member, "")) for device in attached for member in ("name", "raw_descriptor"))
    return any(re.search(spelt(word), text, re.IGNORECASE) for text in lines)


def _names_a_kind(word: str, probe: JsonObject) -> bool:
    """True when a host is called as its system, a driver or a maker is: hiding it would hide the kind."""
    known = {str(value).casefold() for value in probe.get("platform", {}).values()}
    for device in probe["devices"]:
        known.update(str(item).casefold() for item in (*device.get("drivers", ()), *device.get("classes", ())))
        known.update(re.split(r"[^0-9a-z]+", device["id"].casefold()))
    return word.casefold() in known


def spelt(secret: str) -> str:
    """A case-insensitive pattern for a secret in running text; a hardware address in any of its three spellings."""
    if ADDRESS.fullmatch(secret):
        return "[:_-]?".join(re.escape(pair) for pair in secret.split(":"))
    escaped = re.escape(secret)
    if len(secret) < MINIMUM_IN_TEXT or len(set(secret)) < 3 or not any(item.isdigit() for item in secret):
        # Zeros occur in every modalias, and a host name may be part of a longer word.
        return rf"(?<![0-9A-Za-z_-]){escaped}(?![0-9A-Za-z_-]|,[0-9A-Za-z])"
    return escaped


def _bare(text: str) -> str:
    return re.sub(r"[:_-]", "", text).casefold()


def _whole(value: Any, key: bytes) -> Any:
    return pseudonym(value, key) if isinstance(value, str) and value.strip() and not hidden(value) else value


def hidden(value: str) -> bool:
    """True for what is a pseudonym already."""
    return _PSEUDONYM.fullmatch(value.strip()) is not None


# Stand-ins for what is of one host only, in outputs that were refused.
#
# An accepted output is hidden behind pseudonyms. A refused one cannot be: whether it is refused may depend on what a
# serial number looks like and where it stands, and it need not even be JSON. So each letter and digit of such a value
# is exchanged for another one, the same way wherever it is spelt, and the output is refused for the same reasons as
# before.

_PAIR = regex(r'"((?:[^"\\]|\\.)*)"(\s*:\s*)"((?:[^"\\]|\\.)*)"')
_MARK = regex("\ue0a7([0-9]{1,9})\ue0a8")


def placeholder(secret: str, key: bytes) -> str:
    """Another value of the same form: digits for digits, hexadecimal letters for such, all else but letters kept.

    The same letters and digits give the same stand-in, whatever is between them and in whatever case.
    """
    signs = [sign for sign in secret if sign.isalnum()]
    stream = hashlib.shake_256(hmac.digest(key, "".join(signs).casefold().encode("utf-8", "replace"), "sha256"))
    drawn = iter(stream.digest(len(signs)))
    return "".join(_exchanged(sign, next(drawn)) if sign.isalnum() else sign for sign in secret)


def members(text: str) -> list[str]:
    """The values of members that name one unit (``serial``, ``hostname``), in JSON or in what should have been."""
    found = [_value(pair[3]) for pair in _PAIR.finditer(text) if identifies(pair[1])]
    return [value.strip() for value in found if value.strip() and not hidden(value)]


def with_placeholders(text: str, secrets: Iterable[str], key: bytes, *, in_members: bool) -> str:
    """The text with a stand-in for each of the secrets, for every hardware address and, if asked, for `members`."""
    known = set(secrets)
    stands = _Placeholders(key)
    if in_members:
        known |= {value for value in members(text) if len(value) >= MINIMUM_IN_TEXT and any(map(str.isdigit, value))}
        text = _PAIR.sub(stands.member, text)
    patterns = sorted((spelt(secret) for secret in known), key=lambda item: (-len(item), item))
    if patterns:
        text = re.sub("|".join(patterns), stands.hit, text, flags=re.IGNORECASE)
    return stands.put(ADDRESS.sub(stands.hit, text))


class _Placeholders:
    """Holds each stand-in behind a mark until the end: it has the form of a secret, and must not be exchanged again."""

    def __init__(self, key: bytes) -> None:
        self._key = key
        self._held: list[str] = []

    def hit(self, found: "re.Match[str]") -> str:
        return self._mark(placeholder(found[0], self._key))

    def member(self, pair: "re.Match[str]") -> str:
        value = _value(pair[3])
        if not identifies(pair[1]) or not value.strip() or hidden(value):
            return pair[0]
        exchanged = json.dumps(placeholder(value, self._key), ensure_ascii=False)
        return f'"{pair[1]}"{pair[2]}{self._mark(exchanged)}'

    def put(self, text: str) -> str:
        return _MARK.sub(lambda mark: self._held[int(mark[1])] if int(mark[1]) < len(self._held) else mark[0], text)

    def _mark(self, value: str) -> str:
        self._held.append(value)
        return f"\ue0a7{len(self._held) - 1}\ue0a8"


def _value(raw: str) -> str:
    try:
        value = parse(f'"{raw}"')
    except ValueError:
        return raw
    return value if isinstance(value, str) else raw


def _exchanged(sign: str, drawn: int) -> str:
    if sign.isdigit():
        return str(drawn % 10)
    letter = "abcdef"[drawn % 6] if sign.casefold() in "abcdef" else "ghijklmnopqrstuvwxyz"[drawn % 20]
    return letter.upper() if sign.isupper() else letter


# Keeps the id of each unit when PROBE runs again, so that no two equal devices change their names unseen.
#
# Ordinals are counted by place: without this, a second PROBE after a re-plug, or after the first of two twins went,
# would give one the other's id, and with it its tools and a person's answers about it. Pure: values only.

_ORDINAL = regex(r"(.+)-([2-9]|[1-9]\d+)")
_CONTENT = ("name", "interface", "raw_descriptor", "vid", "pid")


@dataclass(slots=True)
class Kept:
    """The artifact with its ids as they were, and a sentence for each kind whose units could not be distinguished."""

    probe: JsonObject
    notices: list[str] = field(default_factory=list)


def judged(probe: JsonObject) -> JsonObject:
    """The artifact with no identity called strong for a serial number that its unit shares with its twins.

    Which agent wrote it does not matter: a default number in a ledger would lead an actuator to the wrong twin.
    """
    devices = probe["devices"]
    known = {device["id"] for device in devices}
    numbers: dict[str, list[str]] = {}
    for device in devices:
        numbers.setdefault(_kind(device, known), []).append(str(_instance(device).get("serial") or ""))
    out = []
    for device in devices:
        instance = _instance(device)
        own, others = str(instance.get("serial") or ""), list(numbers[_kind(device, known)])
        others.remove(own)
        lines = [device["name"], f"{device.get('vid', '')}{device.get('pid', '')}"]
        if (
            instance.get("strength") == "strong"
            and own
            and not serials.is_distinctive(own, filter(None, others), lines)
        ):
            place = "positional" if instance.get("port") else "weak"
            device = {**device, "instance": {**instance, "strength": place}}
        out.append(device)
    return {**probe, "devices": out}


def _kind(device: JsonObject, known: set[str]) -> str:
    return f"{device['vid']}-{device.get('pid')}" if device.get("vid") else _base(device["id"], known)


def keep_ids(probe: JsonObject, shown: JsonObject, before: JsonObject, ledger: Mapping[str, Any]) -> Kept:
    """``probe`` is new, ``shown`` its committed form; ``before`` is what was committed last, ``ledger`` its instances.

    A unit is the former one by its serial number where that is its identity, else by its path in sysfs with the
    same text. What is left gets the ids that are left, in order. Nothing changes for kinds with one unit.
    """
    former = {device["id"]: {**device, "instance": ledger.get(device["id"])} for device in before["devices"]}
    ids = [device["id"] for device in probe["devices"]]
    known = {*ids, *former}
    groups: dict[str, list[int]] = {}
    for index, each in enumerate(ids):
        groups.setdefault(_base(each, known), []).append(index)
    kept = Kept({**probe, "devices": list(probe["devices"])})
    for base, places in groups.items():
        old = {name: device for name, device in former.items() if _base(name, known) == base}
        if len(places) > 1 or len(old) > 1:
            _keep(kept, base, [(index, shown["devices"][index]) for index in places], old)
    return kept


def _keep(kept: Kept, base: str, places: list[tuple[int, JsonObject]], old: Mapping[str, JsonObject]) -> None:
    devices = kept.probe["devices"]
    found = [(index, {**text, "instance": devices[index].get("instance")}) for index, text in places]
    given: dict[int, str] = {}
    for same in (_same_number, _same_place):
        for index, device in found:
            free = [name for name, former in old.items() if name not in given.values() and same(device, former)]
            if index not in given and len(free) == 1:
                given[index] = free[0]
    rest = [(index, device) for index, device in found if index not in given]
    missing = [name for name in old if name not in given.values()]
    if len(rest) == len(missing) == 1 and _content(rest[0][1]) == _content(old[missing[0]]):
        given[rest[0][0]] = missing[0]
    elif rest and missing:
        kept.notices.append(_notice(base, missing))
    taken = {*given.values(), *({device["id"] for device in devices} - {devices[index]["id"] for index, _ in found})}
    for index, _ in found:
        if index not in given:
            own = devices[index]["id"]
            given[index] = own if own not in taken else _free(base, taken)
            taken.add(given[index])
    renamed = sorted(({**devices[index], "id": name} for index, name in given.items()), key=_order(base))
    for (index, _), device in zip(found, renamed, strict=True):
        devices[index] = device


def _order(base: str) -> Any:
    return lambda device: int(device["id"].removeprefix(base).removeprefix("-") or 1)


def _free(base: str, taken: set[str]) -> str:
    ordinal = 1
    while (name := base if ordinal == 1 else f"{base}-{ordinal}") in taken:
        ordinal += 1
    return name


def _base(name: str, known: set[str]) -> str:
    """The kind: what is before an ordinal, where that is an id too."""
    ordinal = _ORDINAL.fullmatch(name)
    return ordinal[1] if ordinal and ordinal[1] in known else name


def _same_number(device: JsonObject, former: JsonObject) -> bool:
    one, other = _instance(device), _instance(former)
    strong = one.get("strength") == other.get("strength") == "strong"
    return strong and bool(one.get("serial")) and one["serial"] == other.get("serial")


def _same_place(device: JsonObject, former: JsonObject) -> bool:
    one, other = _instance(device), _instance(former)
    here = bool(one.get("sysfs")) and one["sysfs"] == other.get("sysfs") and _content(device) == _content(former)
    return here and one.get("serial") == other.get("serial")


def _instance(device: JsonObject) -> Mapping[str, Any]:
    instance = device.get("instance")
    return instance if isinstance(instance, Mapping) else {}


def _content(device: JsonObject) -> tuple[Any, ...]:
    return tuple(device.get(name) for name in _CONTENT)


def _notice(base: str, missing: list[str]) -> str:
    return (
        f"which of the equal devices {', '.join(missing)} is which is no longer known: they have no serial number "
        f"of their own and are in other ports; the ids of {base} are counted by port again"
    )
