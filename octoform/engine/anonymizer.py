"""Removes from a recording all traces of this host, of its folders and of secrets. (Heavy.)

Accepted artifacts hold kinds only; all else that an attempt leaves (what its agent wrote, its commands, its edit of the
spec, an output that was refused) was written where serial numbers, folders and names are in plain sight.
"""

import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from octoform.apply.stage.artifact_writer import pseudonym_key
from octoform.base import files
from octoform.contracts.artifact_parser import parse
from octoform.contracts.host_identity import hidden, hider, members, secrets_in_text, spelt, with_placeholders
from octoform.harness.event_parser import TEXT_LIMIT, json_object
from octoform.records import dataclass, replace
from octoform.redaction import Redactor, redacted, spellings
from octoform.state.artifact_cache import read_instances
from octoform.state.files import read_regular
from octoform.state.layout import Layout

SHORTEST_NAME = 3
SHORTEST_REMNANT = 4
SHORTEST_SECRET = 8
_COMMON_NAMES = frozenset({"localhost", "host", "linux"})


@dataclass(frozen=True, slots=True)
class Anonymizer:
    """Hides one host in texts.

    ``instances`` are what identifies its devices and the host, ``places`` its folders, ``secrets`` variables' values.
    """

    key: bytes
    hides: tuple[Callable[[str], str], ...]
    secrets: Mapping[str, str]
    instances: tuple[str, ...]
    names: tuple[str, ...]
    places: tuple[tuple[str, str], ...]

    def within(self, workdir: str) -> "Anonymizer":
        """The same for the texts of one attempt."""
        places = ((workdir, "{workdir}"), *self.places)
        return replace(self, places=places)

    def text(self, text: str) -> str:
        """A string with placeholders for folders and pseudonyms, those of the artifacts, for what is of this host."""
        return self._hidden(self._placed(redacted(self._whole(text), self.secrets)))

    def talk(self, text: str) -> str:
        """The same for messages and commands: there a short name of the host is hidden too."""
        text = self.text(text)
        for name in self.names:
            text = re.sub(rf"(?<![\w-]){re.escape(name)}(?![\w-])", "{host}", text, flags=re.IGNORECASE)
        return text

    def refused(self, text: str, *, probe: bool) -> str:
        """A refused output, which has to be refused again: with stand-ins of the same form."""
        return with_placeholders(self._placed(text), self.instances, self.key, in_members=probe)

    def shows(self, data: bytes) -> bool:
        """True when something of this host can still be read in a file, however its JSON spells it."""
        texts = [data.decode("utf-8", "replace"), *_strings(_values(data))]
        patterns = [rf"(?<![0-9A-Za-z])(?:{spelt(value)})(?![0-9A-Za-z])" for value in self.instances]
        patterns += [rf"{re.escape(place)}(?![\w-])" for place, _ in self.places]
        return any(re.search(pattern, text, re.IGNORECASE) for pattern in patterns for text in texts)

    def _whole(self, text: str) -> str:
        """Without a remnant at the end of a string that was cut there: no pattern would find it."""
        if len(text) < TEXT_LIMIT:
            return text
        folded = text.casefold()
        for known in (*self.instances, *(place for place, _ in self.places)):
            for size in range(len(known) - 1, SHORTEST_REMNANT - 1, -1):
                if folded.endswith(known[:size].casefold()):
                    return text[:-size]
        return text

    def _placed(self, text: str) -> str:
        for place, shown in self.places:
            # A backslash in the replacement would be an escape, and there is none in a placeholder.
            text = re.sub(rf"(?<![\w.-]){re.escape(place)}(?![\w-])", shown, text)
        return text

    def _hidden(self, text: str) -> str:
        for hide in self.hides:
            text = hide(text)
        return text


def anonymizer_of(
    layout: Layout, environ: Mapping[str, str], outputs: Sequence[bytes], secrets: Mapping[str, str]
) -> Anonymizer:
    """The anonymiser for a host; ``outputs`` are its PROBE outputs with the real values, the accepted one last.

    OSError when the host's own key for pseudonyms can neither be read nor made.
    """
    key = pseudonym_key(layout)
    found = (_probe(outputs[-1] if outputs else None), _from_ledger(layout), _from_members(outputs[:-1]))
    probes = [probe for probe in found if probe is not None]
    names = {os.uname().nodename, *(str(probe.get("hostname", "")) for probe in probes)} - _COMMON_NAMES
    return Anonymizer(
        key=key,
        hides=tuple(hider(probe, key) for probe in probes),
        secrets=secrets,
        instances=tuple(sorted({value for probe in probes for value in secrets_in_text(probe)})),
        names=tuple(sorted(name for name in names if len(name) >= SHORTEST_NAME and not hidden(name))),
        places=_places(layout, environ),
    )


def secret_values(names: Iterable[str], environ: Mapping[str, str]) -> dict[str, str]:
    """Variable to value, for those of the names that are set and long enough to be distinguished from a word."""
    found = {name: environ.get(name, "") for name in sorted(names)}
    return {name: value for name, value in found.items() if len(value) >= SHORTEST_SECRET}


def secrets_in(data: bytes, values: Mapping[str, str]) -> list[str]:
    """The secrets in a file, for a person: variables by their names, and what has the form of one."""
    texts = [data, *(text.encode("utf-8", "replace") for text in _strings(_values(data)))]
    found = [name for name, value in values.items() if any(form in text for form in spellings(value) for text in texts)]
    stream = Redactor()
    formed = stream.feed(data) + stream.flush() != data
    return [*(f"the value of {name}" for name in found), *(["something in the form of a secret"] if formed else [])]


def _places(layout: Layout, environ: Mapping[str, str]) -> tuple[tuple[str, str], ...]:
    """Folders of this machine and what stands for them, the longest first."""
    found = {
        str(layout.local): "{project}/.octoform/{host}",
        str(layout.committed): "{project}/state/{host}",
        str(layout.project): "{project}",
        environ.get("HOME", "").rstrip("/"): "{home}",
    }
    if sys.prefix != sys.base_prefix:
        found[sys.prefix] = "{python}"
    return tuple(sorted((pair for pair in found.items() if len(pair[0]) > 1), key=lambda pair: -len(pair[0])))


def _from_ledger(layout: Layout) -> dict[str, Any] | None:
    """The accepted PROBE artifact with the real instances that were kept on this machine."""
    data, _ = read_regular(layout.output("probe"))
    probe = _probe(data)
    ledger, _ = read_instances(layout)
    if probe is None or not ledger:
        return probe
    real = {name: item for name, item in ledger.items() if isinstance(item, dict)}
    devices = [{**device, "instance": real.get(device["id"], {})} for device in probe["devices"]]
    return {**probe, "devices": devices, "hostname": os.uname().nodename}


def _from_members(outputs: Iterable[bytes]) -> dict[str, Any]:
    """Values that rejected outputs give as serial number or name; such outputs need not have an artifact's form."""
    values = sorted({value for data in outputs for value in members(data.decode("utf-8", "replace"))})
    return {"platform": {}, "devices": [{"id": "", "instance": {"serial": value}} for value in values]}


def _probe(data: bytes | None) -> dict[str, Any] | None:
    """An accepted PROBE artifact."""
    value, _ = parse("probe", data, "output.json") if data is not None else (None, [])
    return value if isinstance(value, dict) and isinstance(value.get("devices"), list) else None


def _values(data: bytes) -> list[Any]:
    """The JSON values in a file: one, or one in each line."""
    try:
        return [files.parse(data)]
    except ValueError:
        return [value for line in data.split(b"\n") if (value := json_object(line)) is not None]


def _strings(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for name, item in value.items():
            yield name
            yield from _strings(item)
    elif isinstance(value, list):
        for item in value:
            yield from _strings(item)
