"""A device that a person spoke of: it is what the sentence says, and does no more than the kernel's classes show.

An answer supplies a name where the evidence gives none. It is no proof of an interface, so nothing becomes possible by
it; and where the device names itself the sentence only joins the evidence. It is data: it is shortened and compared.
"""

import re
from typing import Any

from octoform.builtin.identify import naming
from octoform.builtin.identify.classes import words
from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.identity import CLASS_ONLY, FULL
from octoform.builtin.identify.leftover import leave_first
from octoform.builtin.identify.verdict import ACTUATOR, BIDIRECTIONAL, INFRASTRUCTURE, UNKNOWN, Evidence, Leave

METHOD = "user_answer"
MOST_EVIDENCE = 6
_LEAD = re.compile(r"^(?:(?:this|it|that)(?: is|'s)\s+)?(?:(?:the|a|an|my|our)\s+)?", re.IGNORECASE)
_END = re.compile(r"[.;!?](?:\s|$)|\n")
_BESIDE = re.compile(r"\s(?:of|for|with|via|through|behind|over|using|on)\s|[(,;:]", re.IGNORECASE)
# What the wire is; a sentence that names only the wire tells of no product behind it.
_WIRES = frozenset(
    ("serial", "uart", "usart", "rs232", "rs422", "rs485", "ttl", "bridge", "i2c", "smbus", "spi", "jtag", "vcp")
)
_PLUGS = frozenset(("adapter", "adaptor", "converter", "bridge", "cable", "dongle", "chip"))

# What moves is told by the last word of its name: a camera's rail is a rail, whatever it carries.
_MOVERS = frozenset(
    (
        "arm",
        "rail",
        "slider",
        "gimbal",
        "gantry",
        "gripper",
        "robot",
        "turntable",
        "motor",
        "stepper",
        "servo",
        "actuator",
    )
)


def told(device: Device, judged: dict[str, Any] | Leave, sentence: str) -> dict[str, Any] | Leave:
    """What the class modules judged of the device, completed by a person's sentence about it; "" changes nothing."""
    if not sentence or leave_first(device) is not None:
        return judged
    known = {} if isinstance(judged, Leave) else judged
    said = {**known, "id": device.id, "evidence": _evidence(device, known, sentence)}
    if known and known["category"] != UNKNOWN:
        return said if known["confidence"] > CLASS_ONLY else said | _name(device, sentence)
    kind, category = _kind(sentence, str(known.get("class", "device")))
    capabilities = list(known.get("capabilities", ()))
    said |= {**_name(device, sentence), "class": kind, "category": category, "capabilities": capabilities}
    return {name: value for name, value in said.items() if name != "missing"}


def _name(device: Device, sentence: str) -> dict[str, Any]:
    return {"identified_as": short(sentence, device.id), "method": METHOD, "confidence": FULL}


def short(sentence: str, device: str = "") -> str:
    """The name in a sentence: its first clause without the words that only lead to it."""
    text = sentence.strip().removeprefix(f"{device}:").strip()
    text = _END.split(text, maxsplit=1)[0]
    return naming.tidy(_LEAD.sub("", text)) or naming.tidy(sentence) or sentence.strip()[: naming.LONGEST_NAME]


def _kind(sentence: str, known: str) -> tuple[str, str]:
    """(class, category) by the general words of the sentence; what only names a wire carries others."""
    head = naming.words(_BESIDE.split(short(sentence), maxsplit=1)[0])
    if head and head[-1] in _MOVERS:
        return ACTUATOR, ACTUATOR
    entry = words.spoken_of(sentence)
    is_wire = not _WIRES.isdisjoint(head) and (entry is None or head[-1] in _PLUGS)
    if is_wire:
        return known, INFRASTRUCTURE
    return (entry[0], entry[1]) if entry is not None else (known, BIDIRECTIONAL)


def _evidence(device: Device, known: dict[str, Any], sentence: str) -> list[dict[str, str]]:
    shown = known.get("evidence") or [device.cite_self("what the host shows of it").as_json()]
    quoted = len(re.findall(r"\w", sentence[:500])) > 1
    answer = [Evidence(sentence, "the owner's answer").as_json()] if quoted else []
    return [*answer, *shown][:MOST_EVIDENCE]
