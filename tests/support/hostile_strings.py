"""The hostile strings of ``tests/cases/hostile``, and a laptop whose devices call themselves by one of them."""

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from string import ascii_letters, digits

_PLAIN = frozenset(f"{ascii_letters}{digits}".encode())
FILE = Path(__file__).parents[1] / "cases" / "hostile" / "strings.json"


@dataclass(frozen=True)
class Hostile:
    """One string as the bytes that a device may answer with."""

    name: str
    kind: str
    data: bytes

    @property
    def text(self) -> str:
        """The same as text; bytes that are no UTF-8 as surrogates, as the system gives them."""
        return self.data.decode("utf-8", "surrogateescape")

    @cached_property
    def planted(self) -> str:
        """The same in the notation of the invented hosts, which has nothing special in letters and digits."""
        return "".join(chr(byte) if byte in _PLAIN else f"\\x{byte:02x}" for byte in self.data)


def _load() -> tuple[Hostile, ...]:
    found = []
    for item in json.loads(FILE.read_text("utf-8")):
        if "hex" in item:
            data = bytes.fromhex(item["hex"])
        else:
            data = (item["text"] if "text" in item else item["repeat"][0] * item["repeat"][1]).encode()
        found.append(Hostile(item["name"], item["kind"], data))
    return tuple(found)


STRINGS = _load()
SLOTS = (
    "  product=Kestrel HD Camera",
    "  manufacturer=Kestrel Optics",
    "  serial=KO-200417",
    "  interface=Kestrel HD Camera",
    "  name=Kestrel HD Camera: Kestrel HD C",
    "  ID_V4L_PRODUCT=Kestrel HD Camera",
    "HDA-Intel - HDA Marsh PCH",
    "MR245 Analog : MR245 Analog",
    "  product_name=Heron 14",
    "  board_name=HRN14-B",
    "  manufacturer=Reed Cells",
    "  model_name=RC-57",
    "  ID_MODEL_FROM_DATABASE=Heron Graphics",
    "  vendor_name=Marsh",
    "  chip_name=MR245",
    "  | heron",
    "02:00:5e:10:00:01     *",
)
"""Where text of a device stands in the invented laptop; the value is what follows the last of these marks."""


TOGETHER = 10
LAPTOPS = -(-len(STRINGS) // TOGETHER)


def laptop_named(*hostile: Hostile) -> dict[str, str]:
    """What to replace in the laptop's text so that everything in it carries one of the strings, in turns."""
    changed = {}
    for number, slot in enumerate(SLOTS):
        mark = next(mark for mark in ("=", " - ", " : ", "| ", "     ") if mark in slot)
        head, _, _ = slot.partition(mark)
        end = "\n" if mark in ("=", "| ") else ""
        changed[f"{slot}{end}"] = f"{head}{mark}{hostile[number % len(hostile)].planted}{end}"
    return changed


def of_laptop(number: int) -> list[Hostile]:
    """Some strings for one laptop, each of another kind where there is one; which of them comes first goes round."""
    found = list(STRINGS[number::LAPTOPS])
    turn = number % len(found)
    return found[turn:] + found[:turn]
