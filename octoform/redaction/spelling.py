"""How the value of a variable looks when a program prints it."""

import base64
import json
import os
import re
from collections.abc import Iterator
from urllib.parse import quote, quote_plus

SHORTEST = 6
"""Shorter values would blank out ordinary words and protect nothing."""
SHORTEST_BASE64 = 8


def spellings(value: str) -> list[bytes]:
    """The forms in which the value of a variable is looked for, the longest first; none for one that is too short.

    In base64 it is looked for at each of the three places that a value may have among others (``user:key``), without
    the signs at its ends that depend on its neighbours.
    """
    raw = os.fsencode(value)
    if len(raw) < SHORTEST:
        return []
    found = {raw}
    for plain in (json.dumps(value), json.dumps(value, ensure_ascii=False)):
        for once in (plain[1:-1], plain[1:-1].replace("/", "\\/")):
            found |= {os.fsencode(once), os.fsencode(json.dumps(once, ensure_ascii=False)[1:-1])}
    for encoded in (quote(raw, safe=""), quote(raw), quote_plus(raw)):
        lower = re.sub("%[0-9A-F]{2}", lambda hexadecimal: hexadecimal.group().lower(), encoded)
        found |= {encoded.encode(), lower.encode()}
    found |= {core for core in _base64_cores(raw) if len(core) >= SHORTEST_BASE64}
    return sorted(found, key=lambda form: (-len(form), form))


def _base64_cores(raw: bytes) -> Iterator[bytes]:
    for shift in range(3):
        coded = base64.b64encode(b"\0" * shift + raw)
        core = coded[(0, 2, 3)[shift] : (shift + len(raw)) * 8 // 6]
        yield core
        yield core.translate(bytes.maketrans(b"+/", b"-_"))
