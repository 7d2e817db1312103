"""The rule that a name rests on its evidence: what a device is called must be said somewhere that a reader can look up.

A quote that stands verbatim in PROBE proves little when the name beside it has nothing to do with it ("driver: usbhid"
under the name of a robot). So a name that claims to be known needs a word in common with what is cited. Which text may
give the word depends on how the device was identified: strings must be in the quotes themselves; a database, a page or
a class of the kernel may be told in `says`, because it stands outside PROBE.
"""

import re

from octoform.contracts.model import Artifacts, JsonObject
from octoform.contracts.naming import says_nothing, tokens
from octoform.contracts.text import pointer, shown
from octoform.diagnostics import Diagnostic, error

# From here on a name is claimed to be known; below, the kind of thing is all that is said.
CLAIMED = 0.5
_FROM_STRINGS = "descriptor_strings"
_LOOKED_UP = ("id_database", "web_search")
# The owner's own words stand in the manifest or in a profile; octoform checks them by rules of their own.
_OWNERS = ("user_answer", "profile")
_KEY = re.compile(r"(?m)^[\w.\[\]-]+(?: \w+)?: ")
_CODE = "IDENTIFY-NAME-WITHOUT-EVIDENCE"


def name_without_evidence(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """Each name that is claimed to be known shares a word with the evidence for it."""
    return [
        error(
            _CODE,
            f"nothing that is cited for {shown(device['id'])} says {shown(device['identified_as'])}",
            pointer=pointer("devices", index, "identified_as"),
            hint=_hint(device["method"]),
        )
        for index, device in enumerate(value["devices"])
        if device["confidence"] >= CLAIMED and device["method"] not in _OWNERS and not _supported(device)
    ]


def _supported(device: JsonObject) -> bool:
    quotes = " ".join(_KEY.sub("", evidence["quote"]) for evidence in device["evidence"])
    said = " ".join(evidence.get("says", "") for evidence in device["evidence"])
    if device["method"] in _LOOKED_UP:
        return bool(said.strip())
    cited = _run_together(quotes if device["method"] == _FROM_STRINGS else f"{quotes} {said}")
    telling = [word for word in tokens(device["identified_as"]) if not says_nothing(word)]
    # A name of class words alone claims no product; nor can one without Latin letters be compared word by word.
    return not telling or any(word in cited for word in telling)


def _run_together(text: str) -> str:
    """Letters and digits alone, so that 'Quick Cam' bears out 'QuickCam'."""
    return "".join(sign for sign in text.casefold() if sign.isalnum())


def _hint(method: str) -> str:
    if method in _LOOKED_UP:
        return "write into `says` which entry or page names it, and what it says"
    if method == _FROM_STRINGS:
        return "quote the string that holds the name; without one, lower the confidence below 0.5"
    return "quote the line that leads to the name and write into `says` what follows, or lower the confidence"
