"""How much a person had to say before a device could be told: nothing, its name, or a description of how it works.

Tier 1: the host shows enough. Tier 2: a name, and the rest is public knowledge. Tier 3: a description, because nothing
public tells how it is used; such a description is the grammar of a line protocol. A grammar of registers behind a
public library describes nothing that is not public: the name of the product was enough.
"""

from collections.abc import Collection, Mapping
from typing import Any

from octoform.contracts.answer_rules import METHOD

NOTHING, NAME, DESCRIPTION = 1, 2, 3
WORDS = {NOTHING: "nothing said", NAME: "a name", DESCRIPTION: "a description"}


def tier(annotation: Mapping[str, Any], answers: Collection[str], descriptions: Collection[str]) -> int:
    """The tier of an annotated device, by the devices spoken of and the profiles that describe a grammar of lines."""
    profile = annotation.get("profile")
    if profile in descriptions:
        return DESCRIPTION
    spoken = annotation["id"] in answers or annotation["method"] == METHOD
    return NAME if spoken or profile is not None else NOTHING


def wanted(annotation: Mapping[str, Any]) -> int | None:
    """The tier of what a person would have to say next, or None where nothing is asked."""
    return NAME if annotation["category"] == "unknown" else None
